"""The documentation is whole: every page can be reached, every dependency is explained and pinned."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DESIGN = (ROOT / "DESIGN.md").read_text("utf-8")
PINNED = (ROOT / "requirements" / "dev.txt").read_text("utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
CARGO = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["dependencies"]
PAGES = [path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")]


def names(requirements: list[str]) -> list[str]:
    return [match[0] for line in requirements if (match := re.match(r"[A-Za-z0-9_.-]+", line))]


RUN_TIME = names(PROJECT["dependencies"])
EXTRAS = names([line for group in PROJECT["optional-dependencies"].values() for line in group])


@pytest.mark.parametrize("page", PAGES)
def test_every_page_is_in_the_navigation(page: str) -> None:
    assert f" {page}\n" in (ROOT / "mkdocs.yml").read_text("utf-8")


@pytest.mark.parametrize("page", [page for page in PAGES if page.startswith("design/")])
def test_every_decision_is_listed_in_the_design(page: str) -> None:
    assert f"(docs/{page})" in DESIGN


@pytest.mark.parametrize("name", [*RUN_TIME, *EXTRAS, *(crate for crate in CARGO if not crate.startswith("siloscope"))])
def test_every_dependency_has_its_reason(name: str) -> None:
    assert re.search(rf"^\|.*\b{re.escape(name)}\b.*\|", DESIGN, re.MULTILINE | re.IGNORECASE), name


@pytest.mark.parametrize("name", RUN_TIME)
def test_every_dependency_is_pinned_with_hashes(name: str) -> None:
    pinned = re.sub(r"[-_.]+", "-", name.lower())
    assert re.search(rf"^{re.escape(pinned)}==[^\n]*\\\n    --hash=sha256:", PINNED, re.MULTILINE), name


def test_pins_name_no_address() -> None:
    assert "://" not in PINNED
    assert "--index" not in PINNED
    assert "--find-links" not in PINNED


def test_links_between_documents_lead_somewhere() -> None:
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", path.read_text("utf-8")):
            assert (path.parent / target).exists(), f"{path.name}: {target}"
