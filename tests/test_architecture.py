"""Laws of the house that import-linter can't see."""

from __future__ import annotations

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import siloscope

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


def test_the_package_and_its_help_load_no_numpy() -> None:
    program = (
        "import sys, siloscope; from siloscope.cli import main; main(['--help']); sys.exit('numpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("verb", VERBS)
def test_a_verb_is_its_function_whatever_is_imported_first(verb: str) -> None:
    for first in (
        f"import siloscope.{verb}",
        f"from siloscope.{verb} import {verb}",
        f"from siloscope import {verb}",
        "",
    ):
        program = f"{first}\nimport siloscope, sys\nsys.exit(siloscope.{verb}.__name__ != '{verb}')"
        assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_every_public_name_is_there_and_no_other() -> None:
    for name in siloscope.__all__:
        assert getattr(siloscope, name).__doc__ or name == "__version__"
    assert set(siloscope.__all__) <= set(dir(siloscope))
    assert siloscope.sensors.names()
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        getattr(siloscope, "noth" + "ing")


def imports(module: Path) -> set[str]:
    """Modules of the package that a module imports, anywhere in it."""
    names = {".".join(("siloscope", *path.with_suffix("").parts)).removesuffix(".__init__") for path in MODULES}
    found = set()
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("siloscope"):
            full = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in names else str(node.module) for name in full}
    return (found & names) - {"siloscope"}


def test_no_module_imports_itself_through_others() -> None:
    """In any number of steps, lazily or not; import-linter looks between folders only. The face is left out."""
    names = {path: ".".join(("siloscope", *path.with_suffix("").parts)).removesuffix(".__init__") for path in MODULES}
    graph = {name: imports(path) - {name} for path, name in names.items() if name != "siloscope"}
    assert len(list(TopologicalSorter(graph).static_order())) == len(graph)  # CycleError names a circle
