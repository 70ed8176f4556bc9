"""Laws of the house that import-linter can't see."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "python" / "siloscope"
MODULES = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
VERBS = ("locate", "calibrate", "measure", "track")
ABOVE_THE_FACE = ("cli", "reporting", "reproduction")
"""Folders that may use the package as its users do."""


def tree(module: Path) -> ast.Module:
    return ast.parse((PACKAGE / module).read_text("utf-8"))


@pytest.mark.parametrize("module", MODULES, ids=str)
def test_library_code_does_not_assert(module: Path) -> None:
    assert not [node.lineno for node in ast.walk(tree(module)) if isinstance(node, ast.Assert)]


@pytest.mark.parametrize("module", MODULES, ids=str)
def test_a_file_has_one_idea(module: Path) -> None:
    assert len((PACKAGE / module).read_text("utf-8").splitlines()) <= 350


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_is_short(verb: str) -> None:
    assert len((PACKAGE / f"{verb}.py").read_text("utf-8").splitlines()) <= 150


@pytest.mark.parametrize("module", [path for path in MODULES if path.parts[0] not in ABOVE_THE_FACE], ids=str)
def test_what_the_package_is_made_of_does_not_import_its_face(module: Path) -> None:
    """import-linter takes the compiled core for the package itself, so it is told to pass these imports over."""
    if module.name == "__init__.py" and len(module.parts) == 1:
        return
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.Import):
            assert "siloscope" not in [alias.name for alias in node.names]
        if isinstance(node, ast.ImportFrom) and node.module == "siloscope":
            assert {alias.name for alias in node.names} <= {"_core", "sensors"}
