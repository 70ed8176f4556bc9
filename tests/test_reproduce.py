"""The evaluation: jobs that are done once, tables, verdicts, and the command."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from siloscope import SiloPose, UsageError
from siloscope.cli import main
from siloscope.reproduction.challenges import SCALES, complex_feed, enlarged, eyes, feeds, large, views
from siloscope.reproduction.discharges import PRINTED, perfect, perturbed, real
from siloscope.reproduction.evaluation import published
from siloscope.reproduction.evaluation.chapter import Chapter, Picture, Verdict
from siloscope.reproduction.evaluation.page import page
from siloscope.reproduction.evaluation.plan import Plan
from siloscope.reproduction.evaluation.series import Series
from siloscope.reproduction.evaluation.tables import Table, number, shown
from siloscope.reproduction.evaluation.targets import CHAPTERS, NAMES, wanted
from siloscope.reproduction.evaluation.verdicts import judged, listed
from siloscope.reproduction.jobs import Job, key, program
from siloscope.reproduction.running import run
from siloscope.reproduction.sensor_trials import ACCELEROMETER_STD, SensorTrial, accelerometer, ideal_cloud
from siloscope.reproduction.solvers import ALL, SOLVERS
from siloscope.reproduction.store import Store
from siloscope.reproduction.trials import Observation, Trial
from siloscope.simulation import Silo, metrics
from siloscope.simulation.scenarios import scenario
from siloscope.simulation.stand_ins import FOUR_SENSORS


@dataclass(frozen=True)
class Square:
    """A job that leaves a trace of every run."""

    number: int
    trace: str
    alone: bool = False

    def settings(self) -> dict[str, Any]:
        return {"number": self.number}

    def run(self) -> dict[str, Any]:
        with open(self.trace, "a", encoding="utf-8") as file:
            file.write(f"{self.number}\n")
        if self.number < 0:
            raise UsageError("no roots here")
        return {"square": self.number**2}


def runs(trace: Path) -> list[int]:
    return sorted(int(line) for line in trace.read_text().split()) if trace.exists() else []


# Jobs and their store


def test_a_job_is_done_once(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    jobs = [Square(n, str(trace)) for n in (1, 2, 2, 3)]
    results = run(jobs, Store(tmp_path / "store"), workers=1)
    assert [results[job]["square"] for job in jobs] == [1, 4, 4, 9]
    again = run([*jobs, Square(4, str(trace))], Store(tmp_path / "store"), workers=1)
    assert again[jobs[0]] == {"square": 1}
    assert runs(trace) == [1, 2, 3, 4]


def test_processes_give_the_same_and_jobs_that_measure_time_run_in_this_one(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    jobs = [Square(n, str(trace)) for n in range(4)] + [Square(9, str(trace), alone=True)]
    results = run(jobs, Store(tmp_path / "store"), workers=2)
    assert [results[job]["square"] for job in jobs] == [0, 1, 4, 9, 81]
    assert trace.read_text().split()[-1] == "9"


def test_an_interrupted_run_goes_on(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    jobs = [Square(n, str(trace)) for n in (1, 2, -1, 3)]
    with pytest.raises(UsageError, match="no roots"):
        run(jobs, Store(tmp_path / "store"), workers=1)
    run([jobs[0], jobs[1], jobs[3]], Store(tmp_path / "store"), workers=1)
    assert runs(trace) == [-1, 1, 2, 3]


def test_a_torn_line_costs_only_its_own_job(tmp_path: Path) -> None:
    path = tmp_path / "store"
    store = Store(path)
    store.put("a", {"x": 1})
    store.put("b", {"x": 2})
    path.write_bytes(path.read_bytes()[:-5])
    torn = Store(path)
    assert "a" in torn
    assert "b" not in torn
    torn.put("c", {"x": 3})
    assert Store(path)["c"] == {"x": 3}
    assert len(Store(path)) == 2


@pytest.mark.parametrize("content", [b"", b"\x00\xff\n", b"[]\n", b'{"key": 1}\n', b'{"key": "a", "result": 3}\n'])
def test_a_store_reads_past_rubbish(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "store"
    path.write_bytes(content)
    store = Store(path)
    assert len(store) == 0
    store.put("a", {"x": math.pi})
    assert Store(path)["a"] == {"x": math.pi}


def test_keys_tell_settings_apart() -> None:
    trial = perfect()[0].trials(3)[0]
    others: list[Job] = [
        replace(trial, scene=replace(trial.scene, seed=trial.scene.seed + 1)),
        replace(trial, stride=trial.stride + 1),
        replace(trial, solvers=ALL[:1]),
        replace(trial, profile=perturbed()[0].profile),
        SensorTrial(FOUR_SENSORS[0], 0),
        SensorTrial(FOUR_SENSORS[0], 1),
    ]
    assert key(trial) == key(perfect()[0].trials(3)[0])
    assert len({key(job) for job in [trial, *others]}) == len(others) + 1


def test_the_program_counts_as_a_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    trial = perfect()[0].trials(3)[0]
    before = key(trial)
    monkeypatch.setattr("siloscope.reproduction.jobs.program", lambda: "another")
    assert key(trial) != before
    assert program().startswith("0.")


# Trials


@pytest.fixture(scope="module")
def trial() -> Trial:
    return perturbed()[0].trials(2)[-1]


@pytest.fixture(scope="module")
def observation(trial: Trial) -> Observation:
    stored = json.loads(json.dumps(trial.run()))
    return Observation.of(trial, stored)


def test_a_trial_measures_every_method(observation: Observation) -> None:
    assert list(observation.answers) == list(ALL)
    for answer in observation.answers.values():
        assert answer.pose is not None
        assert answer.distance is not None
        assert answer.distance > 0
        assert answer.seconds > 0
    assert observation.answers["surface-profile"].distance < 1e-3 < observation.answers["shape-tensor"].distance


def test_a_trials_distance_is_equation_11(trial: Trial, observation: Observation) -> None:
    answer, frame = observation.answers["surface"], trial.scene.render()
    assert answer.pose is not None
    distance = metrics.pc_average_distance(
        answer.pose, frame.pose, frame.measured, frame.camera, stride=trial.stride
    )  # fmt: skip
    assert answer.distance == distance


def test_evidence_survives_storing(trial: Trial, observation: Observation) -> None:
    fresh = SOLVERS["surface"](trial.scene.render(), trial.profile)
    kept = observation.answers["surface"].evidence
    assert fresh.evidence is not None
    assert kept == fresh.evidence


def test_one_index_for_several_poses_gives_the_same_distances() -> None:
    frame = scenario("silo3").render()
    poses = [SiloPose(0.2, -0.24, 0.61, 0.5), SiloPose(0.21, -0.24, 0.6, 0.5), frame.pose]
    arguments = (frame.pose, frame.measured, frame.camera)
    one_by_one = [metrics.pc_average_distance(pose, *arguments, stride=501) for pose in poses]
    assert metrics.pc_average_distances(poses, *arguments, stride=501) == one_by_one
    assert one_by_one[2] == 0.0
    assert metrics.pc_average_distances([], *arguments) == []


# Scenes


def test_discharges_have_the_papers_steps() -> None:
    silos = [*perfect(), *perturbed(), *real()]
    for silo in silos:
        share = PRINTED if "printed" in silo.name else 1
        assert silo.steps == published.STEPS[silo.name.split()[0]] // share
        assert len(silo.trials()) == silo.steps
        assert len(silo.trials(3)) == 3
    assert {silo.name: silo.scene.pose.r_y for silo in real()} == {
        "SiloR1": -0.16,
        "SiloR2": -0.1,
        "SiloR1 as printed": 0.16,
        "SiloR2 as printed": 0.1,
    }


def test_the_stand_ins_feed_moves() -> None:
    trials = real()[0].trials(20)
    assert len({trial.scene.feed.seed for trial in trials}) > 1
    assert len({trial.scene.seed for trial in trials}) == 20


def test_every_experiment_can_be_simulated() -> None:
    trials = [*views(2), *(complex_feed(shape)[-1] for shape in feeds(Silo(1.0, 2.0, 1.0)))]
    trials += [trial for eye in eyes().values() for scale in SCALES[::3] for trial in large(eye, scale, 1)]
    for trial in trials:
        frame = trial.scene.render()
        assert np.mean(frame.measured > 0) > 0.3


def test_enlarging_scales_depths() -> None:
    scene = replace(scenario("silo2"), feed=None)
    once, twice = scene.render(), enlarged(scene, 2.0).render()
    np.testing.assert_allclose(twice.depth, 2.0 * once.depth, rtol=1e-9)


def test_the_ideal_cloud_is_on_the_wall_and_dense() -> None:
    silo = Silo(0.78, 1.65, 1.7, top=-0.1)
    cloud = ideal_cloud(silo, 0.05)
    r, z = np.hypot(cloud[:, 0], cloud[:, 1]), cloud[:, 2]
    cylinder = z < 1.55
    np.testing.assert_allclose(r[cylinder], 0.78)
    np.testing.assert_allclose(r[~cylinder], 0.78 * (3.25 - z[~cylinder]) / 1.7, atol=1e-12)
    assert z.min() == -0.1
    area = 2 * math.pi * 0.78 * 1.65 + math.pi * 0.78 * math.hypot(0.78, 1.7)
    assert len(cloud) == pytest.approx(area / 0.05**2, rel=0.1)


def test_accelerometers_err_as_stated() -> None:
    pose = SiloPose(0.1, -0.2, 0.0, 0.0)
    readings = np.array([accelerometer(pose, device) for device in range(400)])
    off = np.arccos(readings @ pose.axis_direction)
    assert np.sqrt(np.mean(off**2) / 2) == pytest.approx(ACCELEROMETER_STD, rel=0.1)


def test_a_sensor_trial_compares_with_the_ideal_silo() -> None:
    result = SensorTrial(FOUR_SENSORS[3], 1).run()
    assert set(result["poses"]) == {"true pose", *ALL, "surface-gravity"}
    assert result["pose_distances"]["true pose"] == 0.0
    assert 1e-4 < result["distances"]["true pose"] < 0.03


# Series


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> Series:
    silo = perturbed()[0]
    jobs = silo.trials(4)
    results = run(jobs, Store(tmp_path_factory.mktemp("series") / "store"), workers=1)
    return Series.of(silo, results, 4)


def test_a_series_has_its_steps_in_order(series: Series) -> None:
    assert series.level.tolist() == pytest.approx([0.9, 0.6, 0.3, 0.0])
    assert series.pixels.shape == series.area.shape == (4, 3)
    assert np.all(np.diff(series.pixels[:, 2]) <= 0)
    assert series.error("surface").shape == series.std("surface").shape == (4, 4)


def test_the_mean_of_the_last_is_the_mean_of_the_answered(series: Series) -> None:
    poses = [answer.pose for answer in series.answered("surface")][-2:]
    mean = series.mean_of_last("surface", 2)
    assert mean is not None
    assert mean.t_x == pytest.approx(np.mean([pose.t_x for pose in poses if pose]))
    assert series.last("surface") == poses[-1]


def test_adjustments_are_in_the_papers_units(series: Series) -> None:
    off = replace(series.truth, t_x=series.truth.t_x + 0.002, r_y=series.truth.r_y + 0.003)
    none, one = series.adjustments([None, off])
    assert none is None
    assert one is not None
    assert (one.t_x, one.t_y, one.r_x, one.r_y) == pytest.approx((2.0, 0.0, 0.0, 3.0))
    assert 0.1 < one.distance < 20.0


def test_settled_is_the_level_after_the_last_far_step(series: Series) -> None:
    far: Callable[[float], float | None] = lambda limit: series.settled("surface", limit)  # noqa: E731
    assert far(1e-9) is None
    distance = series.distance("surface")
    limit = float(np.nanmax(distance)) * 1.01
    expected = series.level[np.isfinite(distance)][0]
    assert far(limit) == pytest.approx(expected)


# Tables and words


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.0, "0"),
        (1234.4, "1234"),
        (99.96, "100"),
        (12.3456, "12.35"),
        (-0.0956, "-0.10"),
        (0.0949, "0.095"),
        (0.0004, "< 0.001"),
        (-1e-9, "< 0.001"),
        (math.nan, "–"),
    ],
)
def test_numbers_have_about_three_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_a_table_is_markdown_and_csv() -> None:
    table = Table("t", "Title", ("what", "n", "x | y"), (("a, b", 3, 1 / 3), ("c", None, None)), "A note.")
    text = table.markdown().splitlines()
    assert text == [
        "**Title**",
        "",
        "| what | n | x \\| y |",
        "| --- | ---: | ---: |",
        "| a, b | 3 | 0.33 |",
        "| c | – | – |",
        "",
        "A note.",
    ]
    rows = list(csv.reader(io.StringIO(table.csv())))
    assert rows == [["what", "n", "x | y"], ["a, b", "3", repr(1 / 3)], ["c", "", ""]]
    assert shown("–") == "–"


def test_a_ragged_table_is_refused() -> None:
    with pytest.raises(ValueError, match="2 cells below 1 columns"):
        Table("t", "Title", ("a",), (("x", "y"),))


@pytest.mark.parametrize(
    ("here", "outcome"), [(1.9, "agrees"), (2.1, "worse"), (0.6, "agrees"), (0.4, "better"), (None, "no answer")]
)
def test_verdicts(here: float | None, outcome: str) -> None:
    assert judged(here, 1.0) == outcome


def test_lists_of_words() -> None:
    assert [listed(list(words)) for words in ("", "a", "ab", "abc")] == ["none", "a", "a and b", "a, b and c"]


def test_the_page_says_what_was_shortened_and_how_it_was_made() -> None:
    blocks = ("A\nb.", Table("t", "T", ("x",), ((1.0,),)), Picture("p", "A picture.", lambda: pytest.fail("drawn")))
    chapter = Chapter("One", blocks, (Verdict("claim", "1", "2", "worse", "so"),))
    text = page([chapter], Plan(7), "siloscope reproduce all --steps 7", "results")
    assert "Shortened run" in text
    assert "`siloscope reproduce all --steps 7`" in text
    assert "## One\n\nA b.\n\n**T**" in text
    assert "![A picture.](results/p.png)" in text
    assert "1 worse" in text
    assert "Shortened" not in page([chapter], Plan(), "siloscope reproduce all", "results")


# Targets and the command


def test_targets_cover_every_chapter_once() -> None:
    assert [part.module for part in wanted([])] == [part.module for part in wanted(["all"])] == list(CHAPTERS)
    items = [item for part in wanted([]) for item in part.items]
    assert len(items) == len(set(items))
    assert [part.items for part in wanted(["fig11", "table4"])] == [
        frozenset({"table4", "table4-coverage", "fig11", "fig12"})
    ]


def test_an_unknown_table_is_wrong_usage(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["reproduce", "table9", "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert all(name in error for name in ("table9", *NAMES))


def test_a_place_that_cannot_be_written_is_wrong_usage(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert main(["reproduce", "fig14", "--steps", "1", "--jobs", "1", "--out", str(blocked)]) == 2
    assert str(blocked) in capsys.readouterr().err


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("all")
    assert main(["reproduce", "--steps", "1", "--jobs", "2", "--out", str(out)]) == 0
    return out


def test_all_writes_a_page_with_every_table_and_picture(everything: Path) -> None:
    text = (everything / "results.md").read_text()
    for part in wanted([]):
        for item in part.items:
            assert (everything / "results" / f"{item}.csv").exists() or f"results/{item}.png" in text, item
    for picture in (everything / "results").glob("*.png"):
        assert f"(results/{picture.name})" in text
        assert picture.stat().st_size < 200_000
    assert "nan" not in text.lower().replace("finance", "")


def test_a_second_run_works_nothing_and_writes_the_same(
    everything: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("siloscope.reproduction.trials.Trial.run", lambda _: pytest.fail("ran again"))
    blank = io.BytesIO()
    Image.new("RGB", (4, 4)).save(blank, "PNG")
    monkeypatch.setattr("siloscope.reporting.plots.style.png", lambda *_: blank.getvalue())
    before = (everything / "results.md").read_text()
    capsys.readouterr()
    assert main(["reproduce", "--steps", "1", "--jobs", "1", "--out", str(everything), "--json"]) == 0
    told = capsys.readouterr()
    document = json.loads(told.out)
    assert "finished already" in told.err
    assert (everything / "results.md").read_text() == before
    assert document["schema"] == "siloscope.reproduction/1"
    assert document["tables"]["table3"]["head"][3] == "paper"
    assert all(Path(path).exists() for path in document["files"])
    claims = [verdict["claim"] for verdict in document["verdicts"]]
    assert len(claims) == len(set(claims))


def test_one_table_is_only_that_table(everything: Path, tmp_path: Path) -> None:
    store = "results/finished.jsonl"
    (tmp_path / "results").mkdir()
    (tmp_path / store).write_bytes((everything / store).read_bytes())
    assert main(["reproduce", "table4", "--steps", "1", "--jobs", "1", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "results.md").read_text()
    assert "Table 4" in text
    assert "Table 3:" not in text
    assert not list((tmp_path / "results").glob("*.png"))
