"""Every engine and number of workers writes the same bytes, and those are what `track` measures."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import siloscope
from fleet import population
from fleet.conftest import ARCHIVES, FRAMES
from fleet.outputs import answers, files, rows
from siloscope.cli import main
from siloscope.fleet.running import run

Planned = Callable[[str], str]


@pytest.fixture(scope="module")
def reference(
    store: Path, calibrations: Path, measuring: Any, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, dict[str, str]]:
    from siloscope.fleet import plan

    place = tmp_path_factory.mktemp("runs") / "one"
    plan.make(store, place, calibrations, measuring)
    run(str(place), workers=1)
    return str(place), answers(place)


def test_two_workers(reference: tuple[str, dict[str, str]], planned: Planned) -> None:
    place = planned("two")
    opened, account = run(place, workers=2)
    assert answers(place) == reference[1]
    assert bool(opened.state.measured.all())
    assert sum(account.frames.values()) == ARCHIVES * FRAMES
    assert account.peak_bytes <= 300e6


def test_indexed_workers_in_any_order(reference: tuple[str, dict[str, str]], planned: Planned) -> None:
    place = planned("indexed")
    for index in (2, 0, 1):
        assert main(["fleet", "worker", place, "--index", str(index), "--of", "3"]) == 0
    assert answers(place) == reference[1]


def test_ray(reference: tuple[str, dict[str, str]], planned: Planned) -> None:
    pytest.importorskip("ray")
    place = planned("ray")
    assert main(["fleet", "run", place, "--engine", "ray", "--workers", "2"]) == 0
    assert answers(place) == reference[1]


def test_nothing_is_done_twice(reference: tuple[str, dict[str, str]], capsys: Any) -> None:
    place = reference[0]
    before = {path: path.stat().st_mtime_ns for path in Path(place).rglob("*.parquet")}
    opened, account = run(place, workers=2)
    assert not account.tasks
    assert {path: path.stat().st_mtime_ns for path in Path(place).rglob("*.parquet")} == before
    assert main(["fleet", "status", place, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["complete"]
    assert told["frames"] == {"total": ARCHIVES * FRAMES, "done": ARCHIVES * FRAMES, "left": 0}
    assert told["silos"] == {"total": ARCHIVES, "given": 7, "to_fold": 3, "folded": 3}
    assert opened.plan.run == told["run"]


def test_results_lie_where_the_contract_says(reference: tuple[str, dict[str, str]]) -> None:
    place, written = reference
    identity = json.loads((Path(place) / "plan.json").read_text())["run"]
    shards = [name for name in written if name.startswith("results/")]
    silos = [f"silo{number:02d}" for number in range(ARCHIVES)]
    for silo in silos:
        own = sorted(name for name in shards if name.startswith(f"results/run={identity}/silo={silo}/"))
        assert own == [f"results/run={identity}/silo={silo}/{silo}.cam.{k:06d}.parquet" for k in range(len(own))]
    for name in shards:
        commit = json.loads((Path(place) / "commits" / identity / f"{Path(name).stem}.json").read_text())
        assert {row["name"]: row["sha256"] for row in commit["objects"]}[name] == written[name]


def test_the_numbers_are_those_of_track(
    reference: tuple[str, dict[str, str]], archives: list[Path], calibrations: Path
) -> None:
    silo = archives[5].stem
    settings: dict[str, Any] = {"sensor": population.SENSOR, "bottom": "cone", "product": "wheat"}
    story = siloscope.track(archives[5], calibrations / f"{silo}.json", **settings)
    own = sorted((row for row in rows(reference[0]) if row["silo"] == silo), key=lambda row: row["captured"])
    assert len(own) == len(story.readings) == FRAMES
    for row, reading in zip(own, story.readings, strict=True):
        assert row["captured"].timestamp() == reading.time
        for name, value in (("volume_m3", reading.volume), ("volume_std_m3", reading.volume_std)):
            assert row[name] == value
        assert (row["mass_kg"], row["ullage_m3"], row["status"]) == (reading.mass, reading.ullage, reading.status)


def test_a_folded_silo_is_measured_as_well_as_a_calibrated_one(
    reference: tuple[str, dict[str, str]], archives: list[Path]
) -> None:
    one = siloscope.calibrate(archives[0], sensor=population.SENSOR)
    (path,) = Path(reference[0]).glob(f"calibrations/run=*/{archives[0].stem}.cam.json")
    folded = siloscope.Calibration.load(path)
    assert folded.ok
    assert folded.counts["used"] >= one.counts["used"]
    for name in ("r_x", "r_y", "t_x", "t_y"):
        std = max(json.loads(path.read_text())["std"][name], 1e-5)
        assert abs(getattr(folded, name) - getattr(one, name)) < 4.0 * std


def test_each_file_says_what_made_it(reference: tuple[str, dict[str, str]]) -> None:
    place, _ = reference
    first = next(Path(place).glob("results/run=*/silo=silo04/*.parquet"))
    said = {key.decode(): value.decode() for key, value in pq.read_schema(first).metadata.items()}
    calibration = files(place, "plans")[f"plans/{said['siloscope.run']}/calibrations/silo04.cam.json"]
    assert said["siloscope.calibration"] == calibration
    assert said["siloscope.version"] == siloscope.__version__
    assert (said["siloscope.silo"], said["siloscope.schema"]) == ("silo04", "siloscope.results/1")
