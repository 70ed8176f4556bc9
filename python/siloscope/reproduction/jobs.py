"""A job is one piece of work of the evaluation whose result is plain data and can be kept."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import siloscope

TELLING = ("cli", "reporting", "io", "reproduction/evaluation")
"""Parts of the package that only read files or tell about numbers, so that no number depends on them."""


@runtime_checkable
class Job(Protocol):
    """Work that can be done in another process."""

    @property
    def alone(self) -> bool:
        """Whether nothing else may run meanwhile, because it measures time."""
        ...

    def settings(self) -> dict[str, Any]:
        """Everything the result depends on, as plain data."""
        ...

    def run(self) -> dict[str, Any]:
        """The result as plain data."""
        ...


def key(job: Job) -> str:
    """Name of a job's result: a hash of its settings and of the program."""
    content = {"kind": type(job).__name__, "settings": job.settings(), "program": program()}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


@cache
def program() -> str:
    """Version and a hash of the code that numbers come from."""
    package = Path(siloscope.__file__).parent
    digest = hashlib.sha256()
    for path in _sources(package):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return f"{siloscope.__version__}+{digest.hexdigest()[:12]}"


def _sources(package: Path) -> Iterator[Path]:
    """Python files, sensor profiles and the compiled core."""
    for path in sorted(package.rglob("*")):
        name = path.relative_to(package).as_posix()
        if path.suffix in (".py", ".toml", ".so", ".pyd") and not name.startswith(TELLING):
            yield path
