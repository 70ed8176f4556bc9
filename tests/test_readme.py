"""README.md and the pages of docs/ are run: Python and commands work as printed, JSON has the keys of a real answer."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from siloscope import sensors
from siloscope.cli import main
from siloscope.reporting.demo import SCENE, write_frame

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text("utf-8")
PAGES = ("README.md", "docs/index.md", "docs/your-frame.md", "docs/api.md")


def blocks(language: str, *pages: str) -> list[str]:
    text = "\n".join((ROOT / page).read_text("utf-8") for page in pages or ("README.md",))
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory as `make demo` leaves it."""
    directory = tmp_path_factory.mktemp("readme")
    (directory / "demo").mkdir()
    seen = SCENE.render()
    write_frame(seen, directory / "demo")
    write_frame(seen, directory)
    return directory


@pytest.mark.parametrize("line", [line for block in blocks("bash", *PAGES) for line in block.splitlines()])
def test_commands_work(line: str, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = shlex.split(line, comments=True)
    monkeypatch.chdir(place)
    if words[0] == "make":
        assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    elif words[0] == "siloscope":
        assert main(words[1:]) == 0
    else:
        assert words == [".", ".venv/bin/activate"]


@pytest.mark.parametrize("code", blocks("python", *PAGES))
def test_python_works(
    code: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    exec(compile(code, "README.md", "exec"), {})
    assert "None" not in capsys.readouterr().out


def test_the_sensor_profile_is_one(tmp_path: Path) -> None:
    (printed,) = blocks("toml", "docs/your-frame.md")
    file = tmp_path / "sensor.toml"
    file.write_text(printed, "utf-8")
    profile = sensors.load(file)
    assert profile.bias == (0.002, -0.004, 0.003)
    assert profile.sigma(2.0) == pytest.approx(0.0048)
    assert profile.camera(640, 480) is not None


def test_json_has_the_keys_of_a_real_answer(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    assert main(["locate", "demo/frame.png", "--camera", "demo/camera.json", "--json"]) == 0
    real = json.loads(capsys.readouterr().out)
    (printed,) = blocks("json")
    assert missing(json.loads(printed), real) == []


def missing(shown: Any, real: Any, path: str = "") -> list[str]:
    """Keys that the README shows and the answer does not have."""
    if not isinstance(shown, dict):
        return []
    gone = [f"{path}.{key}" for key in shown if key not in real]
    return gone + [name for key in shown if key in real for name in missing(shown[key], real[key], f"{path}.{key}")]


def test_pictures_and_links_are_there() -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / target).exists(), target
    for picture in (ROOT / "docs" / "images").glob("*.png"):
        assert picture.stat().st_size < 300_000
