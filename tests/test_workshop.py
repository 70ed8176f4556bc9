"""The workshop's own scripts: a release, the subject of a commit, the hooks."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
CHECKS = sorted(path for part in ("tests", "benchmarks") for path in (ROOT / part).rglob("*.py"))
MANIFEST = (
    '[workspace]\nresolver = "2"\nmembers = ["one"]\n\n[workspace.package]\nversion = "0.1.0"\nedition = "2024"\n'
)
MEMBER = '[package]\nname = "one"\nversion.workspace = true\nedition.workspace = true\n'
CHANGES = (
    "# Changes\n\n## 0.2.0 (unreleased)\n\n### Added\n\n- A thing.\n\n## 0.1.0 - 2026-01-01\n\n### Fixed\n\n- Old.\n"
)


def git(place: Path, *arguments: str) -> str:
    command = ["git", "-c", "user.name=T", "-c", "user.email=t@example.org", *arguments]
    return subprocess.run(command, cwd=place, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small workspace under version control."""
    for name, value in (("NAME", "T"), ("EMAIL", "t@example.org")):
        monkeypatch.setenv(f"GIT_AUTHOR_{name}", value)
        monkeypatch.setenv(f"GIT_COMMITTER_{name}", value)
    (tmp_path / "one" / "src").mkdir(parents=True)
    (tmp_path / "one" / "src" / "lib.rs").write_text("")
    (tmp_path / "one" / "Cargo.toml").write_text(MEMBER)
    (tmp_path / "Cargo.toml").write_text(MANIFEST)
    (tmp_path / "CHANGELOG.md").write_text(CHANGES)
    subprocess.run(["cargo", "generate-lockfile", "--offline", "-q"], cwd=tmp_path, check=True)
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-qm", "first: make all")
    return tmp_path


def release(project: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / ".ci" / "release.py")]
    return subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)


def test_a_release_sets_the_version_dates_the_changes_commits_and_tags(project: Path) -> None:
    done = release(project)
    assert done.returncode == 0, done.stderr
    assert 'version = "0.2.0"' in (project / "Cargo.toml").read_text()
    assert 'version = "0.2.0"' in (project / "Cargo.lock").read_text()
    assert re.search(r"^## 0\.2\.0 - \d{4}-\d\d-\d\d$", (project / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert git(project, "status", "--porcelain") == ""
    assert git(project, "tag", "--points-at", "HEAD").split() == ["v0.2.0"]
    assert git(project, "log", "-1", "--format=%s").strip() == "release: set version 0.2.0"
    again = release(project)
    assert again.returncode == 1
    assert "unreleased" in again.stderr


@pytest.mark.parametrize(
    ("name", "old", "new", "why"),
    [
        ("CHANGELOG.md", "- A thing.", "", "needs entries"),
        ("CHANGELOG.md", "### Added", "### Novelties", "needs entries"),
        ("CHANGELOG.md", "## 0.2.0", "## 0.1.0", "does not follow 0.1.0"),
        ("CHANGELOG.md", " (unreleased)", "", "does not begin with"),
        ("Cargo.toml", 'version = "0.1.0"', 'version = "1.0.0"', "does not follow 1.0.0"),
    ],
)
def test_what_is_no_release_is_refused_and_changes_nothing(
    project: Path, name: str, old: str, new: str, why: str
) -> None:
    text = (project / name).read_text()
    (project / name).write_text(text.replace(old, new, 1))
    git(project, "commit", "-qam", "changes: break something")
    done = release(project)
    assert (done.returncode, why in done.stderr) == (1, True), done.stderr
    assert git(project, "status", "--porcelain") == ""
    assert git(project, "tag") == ""


def test_a_release_needs_a_clean_tree_and_a_free_tag(project: Path) -> None:
    git(project, "tag", "v0.2.0")
    assert "tag v0.2.0 already" in release(project).stderr
    (project / "new").write_text("x")
    assert "has changes" in release(project).stderr


@pytest.mark.parametrize(
    ("subject", "good"),
    [
        ("io: read npy heads by NumPy", True),
        ("core, package: move modules", True),
        ("content.rs: fix it", False),
        ("Content with the last fit", False),
        ("Core: move modules", False),
        ("core: ", False),
        (f"core: {'x' * 54}", True),
        (f"core: {'x' * 55}", False),
    ],
)
def test_a_subject_names_area_verb_and_object(subject: str, good: bool, tmp_path: Path) -> None:
    message = tmp_path / "message"
    message.write_text(f"{subject}\n\nWhy.\n")
    done = subprocess.run([str(ROOT / ".ci" / "check_subject"), str(message)], capture_output=True, check=False)
    assert (done.returncode == 0) == good


def test_hooks_are_targets_of_the_makefile_and_come_from_here() -> None:
    config = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())
    assert [repository["repo"] for repository in config["repos"]] == ["local"]
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for hook in config["repos"][0]["hooks"]:
        command, *wanted = hook["entry"].split()
        assert command == "make" or (ROOT / command).exists()
        assert set(wanted) <= targets


def test_the_announced_version_is_not_behind_the_program() -> None:
    first = re.search(r"^## (\d+)\.(\d+)\.(\d+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    program = re.search(r'^version = "(\d+)\.(\d+)\.(\d+)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)
    assert first is not None
    assert program is not None
    assert [int(part) for part in first.groups()] >= [int(part) for part in program.groups()]


def private_names(source: str) -> list[str]:
    """Private names of others that a module imports, reads or patches; its own objects' (`self`, `cls`) are none."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.Attribute) and getattr(node.value, "id", "") not in ("self", "cls", "os"):
            found.append(node.attr)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("setattr", "delattr"):
            found += [str(part.value).rsplit(".", 1)[-1] for part in node.args[:2] if isinstance(part, ast.Constant)]
    return [name for name in found if name.startswith("_") and not name.startswith("__") and name != "_core"]


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("from a import _b, c", ["_b"]),
        ("a.c()._b", ["_b"]),
        ('monkeypatch.setattr(a, "_b", 1)', ["_b"]),
        ('monkeypatch.setattr("a.c._b", 1)', ["_b"]),
        ("self._b, a.__name__, os._exit(1)\nfrom siloscope import _core", []),
    ],
)
def test_private_names_are_noticed(source: str, found: list[str]) -> None:
    assert private_names(source) == found


@pytest.mark.parametrize("path", [path.relative_to(ROOT) for path in CHECKS], ids=str)
def test_no_test_reaches_into_a_private_name(path: Path) -> None:
    assert private_names((ROOT / path).read_text("utf-8")) == []
