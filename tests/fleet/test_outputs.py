"""What people get of runs: comparison, publication, metrics, progress, the documented queries, the example files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from fleet.conftest import FRAMES
from siloscope.cli import main
from siloscope.fleet import plan
from siloscope.fleet.pack import pack
from siloscope.fleet.places import open_store
from siloscope.fleet.running import run
from siloscope.fleet.settings import settings

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "fleet"


@pytest.fixture(scope="module")
def sealed(archives: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("few") / "store"
    pack(archives[3:5], place, shard_frames=16)
    return place


@pytest.fixture(scope="module")
def runs(sealed: Path, calibrations: Path, measuring: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """Two runs of one place: without and with the cylinder's height by the datasheet, and a product."""
    place = tmp_path_factory.mktemp("runs") / "runs"
    names = []
    for told in (measuring, settings(None, sensor="orbbec-astra-s", bottom="unknown")):
        made, _ = plan.make(sealed, place, calibrations, told)
        run(str(place), workers=1)
        names.append(f"{place}@{made.run}")
    return names[0], names[1]


def test_a_run_compared_with_itself_is_the_same(runs: tuple[str, str], capsys: Any) -> None:
    assert main(["fleet", "diff", runs[0], runs[0], "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["all"]["frames"] == found["all"]["same"] == 2 * FRAMES
    assert found["worst"] == []
    assert {change["turn"] for change in found["poses"].values()} == {0.0}


def test_a_comparison_tells_what_changed_and_where(runs: tuple[str, str], tmp_path: Path, capsys: Any) -> None:
    assert main(["fleet", "diff", *runs, "--out", str(tmp_path / "page.html"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["all"]["same"] < found["all"]["frames"] == 2 * FRAMES
    assert found["all"]["quality"]["+bottom-unknown"] == 2 * FRAMES
    assert set(found["silos"]) == {"silo03", "silo04"}
    page = (tmp_path / "page.html").read_text()
    assert all(word in page for word in ("What changed between two runs", "bottom-unknown", "silo03.cam"))


def test_current_is_moved_and_remembers(runs: tuple[str, str], tmp_path: Path, capsys: Any) -> None:
    to = str(tmp_path / "readings")
    for name in runs:
        assert main(["fleet", "publish", name, "--to", to]) == 0
    told = json.loads((tmp_path / "readings" / "current.json").read_text())
    ids = [name.rpartition("@")[2] for name in runs]
    assert (told["run"], told["previous"]) == (ids[1], ids[0])
    assert Path(told["results"]).is_dir()


def test_the_run_is_named_by_what_decides_its_answers(sealed: Path, calibrations: Path, tmp_path: Path) -> None:
    def identity(**told: Any) -> str:
        return plan.make(sealed, tmp_path / "run", calibrations, settings(None, **told))[0].run

    assert identity(product="wheat") == identity(product="wheat") != identity(product="barley")
    without = plan.make(sealed, tmp_path / "run", None, settings(None, product="wheat"))[0]
    assert without.run != identity(product="wheat")


def test_frames_that_come_later_go_on_with_the_run(archives: list[Path], calibrations: Path, tmp_path: Path) -> None:
    told = settings(None, sensor="orbbec-astra-s")
    made = []
    for some in (archives[3:4], archives[3:5]):
        pack(some, tmp_path / "store", shard_frames=16)
        only = tmp_path / "only"
        only.mkdir(exist_ok=True)
        (only / "silo03.json").write_bytes((calibrations / "silo03.json").read_bytes())
        made.append(plan.make(tmp_path / "store", tmp_path / "run", only, told))
    (first, few), (second, more) = made
    assert first.run == second.run
    assert few < more


def test_settings_travel_with_the_plan(sealed: Path, tmp_path: Path) -> None:
    (tmp_path / "silo.toml").write_text("diameter = 2.5\n")
    (tmp_path / "mill.toml").write_text(
        '[measure]\nproduct = "wheat"\n[silo.silo03]\nvessel = "silo.toml"\nmoisture = 14.0\n[locate]\nframes = 9\n'
    )
    command = ["fleet", "plan", str(sealed), "--out", str(tmp_path / "run"), "--config", str(tmp_path / "mill.toml")]
    assert main(command) == 0
    (tmp_path / "silo.toml").unlink()
    known = plan.load(open_store(tmp_path / "run")).settings
    assert known.of("silo03")["vessel"] == {"name": "silo.toml", "text": "diameter = 2.5\n"}
    assert (known.of("silo03")["moisture"], known.of("silo04"), known.located_frames) == (0.14, {"product": "wheat"}, 9)
    (tmp_path / "mill.toml").write_text("[measure]\nprodukt = 'wheat'\n")
    assert main(command) == 3


def test_progress_is_json_and_prometheus(
    sealed: Path, calibrations: Path, measuring: Any, tmp_path: Path, capsys: Any
) -> None:
    plan.make(sealed, tmp_path / "run", calibrations, measuring)
    metrics = tmp_path / "siloscope.prom"
    assert main(["fleet", "run", str(tmp_path / "run"), "--workers", "1", "--metrics", str(metrics), "--json"]) == 0
    shown = capsys.readouterr()
    assert json.loads(shown.out)["complete"]
    told = json.loads(shown.err.splitlines()[-1])
    assert told["frames"]["ok"] + told["frames"]["refused"] == 2 * FRAMES
    assert told["core_hours"] > 0.0
    from prometheus_client.parser import text_string_to_metric_families

    found = {family.name: family.samples[0] for family in text_string_to_metric_families(metrics.read_text())}
    assert found["siloscope_fleet_shards_done"].value == told["shards"]["total"]
    assert found["siloscope_fleet_frames_measured"].value == 2 * FRAMES
    assert set(found["siloscope_fleet_shards"].labels) == {"run"}


DOCUMENT = (ROOT / "docs" / "fleet.md").read_text("utf-8").partition("## Queries")[2]


@pytest.fixture
def filled(runs: tuple[str, str], sealed: Path) -> Callable[[str], str]:
    """Puts a run and a store in the place of the names in a documented query."""
    place, _, identity = runs[0].rpartition("@")
    return lambda text: text.replace("RUN", place).replace("run=ID", f"run={identity}").replace("STORE", str(sealed))


@pytest.mark.parametrize("query", re.findall(r"```sql\n(.*?)```", DOCUMENT, re.DOTALL))
def test_the_documented_queries_run_in_duckdb(query: str, filled: Callable[[str], str]) -> None:
    duckdb = pytest.importorskip("duckdb")
    rows = duckdb.connect().execute(filled(query)).fetchall()
    refused = "status <> 'ok'" in query
    assert refused or {row[0] for row in rows} == {"silo03", "silo04"}


@pytest.mark.parametrize("block", re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL))
def test_the_documented_python_runs(block: str, filled: Callable[[str], str]) -> None:
    names: dict[str, Any] = {}
    exec(compile(filled(block), "docs/fleet.md", "exec"), names)
    assert ("daily" in names and names["daily"].num_rows == 2) or len(names["depth"]) == 320 * 240 * 2


JOB = {
    "type": "object",
    "required": ["apiVersion", "kind", "metadata", "spec"],
    "properties": {
        "apiVersion": {"const": "batch/v1"},
        "kind": {"const": "Job"},
        "spec": {
            "type": "object",
            "additionalProperties": False,
            "required": ["completionMode", "completions", "parallelism", "template"],
            "properties": {
                "completionMode": {"const": "Indexed"},
                "completions": {"type": "integer", "minimum": 1},
                "parallelism": {"type": "integer", "minimum": 1},
                "backoffLimitPerIndex": {"type": "integer", "minimum": 0},
                "maxFailedIndexes": {"type": "integer", "minimum": 0},
                "podFailurePolicy": {
                    "type": "object",
                    "properties": {
                        "rules": {
                            "type": "array",
                            "items": {
                                "type": "object",
                                "required": ["action"],
                                "properties": {"action": {"enum": ["FailJob", "FailIndex", "Ignore", "Count"]}},
                                "oneOf": [{"required": ["onExitCodes"]}, {"required": ["onPodConditions"]}],
                            },
                        }
                    },
                },
                "template": {"$ref": "#/$defs/pod"},
            },
        },
    },
    "$defs": {
        "pod": {
            "type": "object",
            "required": ["spec"],
            "properties": {
                "spec": {
                    "type": "object",
                    "required": ["containers"],
                    "properties": {
                        "restartPolicy": {"enum": ["Never", "OnFailure"]},
                        "containers": {
                            "type": "array",
                            "minItems": 1,
                            "items": {
                                "type": "object",
                                "required": ["name", "image"],
                                "properties": {
                                    "command": {"type": "array", "items": {"type": "string"}},
                                    "args": {"type": "array", "items": {"type": "string"}},
                                },
                            },
                        },
                    },
                }
            },
        }
    },
}
"""What `batch/v1` and `ray.io/v1` demand of these files, after their public definitions."""

GROUP = {
    "type": "object",
    "required": ["rayStartParams", "template"],
    "properties": {
        "rayStartParams": {"type": "object", "additionalProperties": {"type": "string"}},
        "replicas": {"type": "integer"},
        "template": {"$ref": "#/$defs/pod"},
    },
}

RAY_JOB = {
    "type": "object",
    "required": ["apiVersion", "kind", "metadata", "spec"],
    "properties": {
        "apiVersion": {"const": "ray.io/v1"},
        "kind": {"const": "RayJob"},
        "spec": {
            "type": "object",
            "additionalProperties": False,
            "required": ["entrypoint", "rayClusterSpec"],
            "properties": {
                "entrypoint": {"type": "string"},
                "backoffLimit": {"type": "integer", "minimum": 0},
                "shutdownAfterJobFinishes": {"type": "boolean"},
                "ttlSecondsAfterFinished": {"type": "integer", "minimum": 0},
                "rayClusterSpec": {
                    "type": "object",
                    "required": ["headGroupSpec"],
                    "properties": {
                        "rayVersion": {"type": "string"},
                        "headGroupSpec": GROUP,
                        "workerGroupSpecs": {"type": "array", "items": {"allOf": [GROUP, {"required": ["groupName"]}]}},
                    },
                },
            },
        },
    },
    "$defs": JOB["$defs"],
}


@pytest.mark.parametrize(("name", "schema"), [("indexed-job.yaml", JOB), ("rayjob.yaml", RAY_JOB)])
def test_the_kubernetes_files_fit_their_schema(name: str, schema: dict[str, Any]) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator(schema).validate(yaml.safe_load((EXAMPLES / name).read_text()))


def test_the_indexed_job_counts_its_workers_once() -> None:
    spec = yaml.safe_load((EXAMPLES / "indexed-job.yaml").read_text())["spec"]
    arguments = spec["template"]["spec"]["containers"][0]["args"]
    assert arguments[:4] == ["--index", "$(JOB_COMPLETION_INDEX)", "--of", str(spec["completions"])]


def test_the_slurm_script_is_an_array_of_workers() -> None:
    import subprocess

    text = (EXAMPLES / "slurm.sh").read_text()
    assert subprocess.run(["bash", "-n", EXAMPLES / "slurm.sh"], check=False).returncode == 0
    options = dict(re.findall(r"^#SBATCH --([a-z-]+)(?:=(\S+))?$", text, re.MULTILINE))
    assert re.fullmatch(r"0-\d+", options["array"])
    assert options["cpus-per-task"] == "1"
    assert '--index "$SLURM_ARRAY_TASK_ID" --of "$SLURM_ARRAY_TASK_COUNT"' in text


def test_the_commands_of_the_examples_are_known(capsys: Any) -> None:
    for text in [(EXAMPLES / name).read_text() for name in ("slurm.sh", "indexed-job.yaml", "rayjob.yaml")]:
        (verb,) = set(re.findall(r"siloscope\W+fleet\W+(run|worker)\b", text))
        main(["fleet", verb, "--help"])
        known = capsys.readouterr().out
        used = re.findall(
            r"(--[a-z-]+)", "\n".join(line for line in text.splitlines() if "--" in line and "#" not in line)
        )
        assert used
        assert all(option in known for option in used)


def test_wrong_usage_is_told(sealed: Path, tmp_path: Path, capsys: Any) -> None:
    place = str(tmp_path / "run")
    plan.make(sealed, place, None, settings(None))
    for wrong, code in (
        (["run", str(tmp_path / "none")], 3),
        (["run", place, "--engine", "spark"], 2),
        (["run", place, "--address", "auto"], 2),
        (["worker", place, "--index", "3", "--of", "3"], 2),
        (["plan", str(tmp_path / "none"), "--out", place], 3),
        (["plan", str(sealed), "--out", place, "--calibrations", str(tmp_path / "none")], 2),
        (["publish", place], 2),
    ):
        assert main(["fleet", *wrong]) == code, wrong
        assert capsys.readouterr().err.startswith("error: ")
