"""Installs the peers beside the project, into build/peers, and says what it could not install.

    python benchmarks/peers/install.py

Python packages come from the package index, PCL and CGAL from the system's packages (apt, where this may install
them). Nothing of it becomes a dependency of siloscope.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).parent
BUILT = HERE.parents[1] / "build" / "peers"
PACKAGES = BUILT / "packages"
"""Where Python packages are put; `import_path` adds it behind the project's own."""

LIBRARIES = {
    "pcl": ("/usr/include/pcl-*", ("libpcl-dev",)),
    "cgal": ("/usr/include/CGAL", ("libcgal-dev", "libeigen3-dev")),
}
"""Headers and Debian packages of each C++ library."""


def import_path() -> None:
    """Makes the installed Python packages importable, behind everything else."""
    if str(PACKAGES) not in sys.path:
        sys.path.append(str(PACKAGES))


def program(name: str) -> Path | None:
    """A built C++ program ("pcl" or "cgal"), or None."""
    path = BUILT / f"{name}_axis"
    return path if path.is_file() else None


def main() -> int:
    """Installs everything; the exit code is 0 even where something is missing, because the benchmark goes without."""
    failures = [*_python_packages(), *(problem for name in LIBRARIES for problem in _library(name))]
    for problem in failures:
        print(f"not installed: {problem}")
    print("all peers installed" if not failures else "the benchmark runs without these")
    return 0


def _python_packages() -> list[str]:
    """One by one, so that one that fails does not take the others along."""
    lines = [line.strip() for line in (HERE / "requirements.txt").read_text().splitlines()]
    wanted = [line for line in lines if line and not line.startswith("#")]
    return [problem for line in wanted for problem in _python_package(line)]


def _python_package(requirement: str) -> list[str]:
    name = requirement.split("==")[0]
    if _importable(name):
        return []
    pip = [sys.executable, "-m", "pip", "install", "-q", "--disable-pip-version-check", "--upgrade"]
    return _tried(requirement, [*pip, "--target", str(PACKAGES), requirement])


def _importable(name: str) -> bool:
    script = f"import sys; sys.path.append({str(PACKAGES)!r}); import {name}"
    return subprocess.run([sys.executable, "-c", script], capture_output=True).returncode == 0


def _library(name: str) -> list[str]:
    headers, debian = LIBRARIES[name]
    if not list(Path("/").glob(headers.lstrip("/"))):
        problems = _from_debian(debian)
        if problems:
            return problems
    return _built(name)


def _from_debian(packages: Sequence[str]) -> list[str]:
    wanted = " ".join(packages)
    if not shutil.which("apt-get"):
        return [f"{wanted}: no apt-get here; install them with the system's own tool"]
    if os.geteuid() != 0:
        return [f"{wanted}: needs administrator's rights; run 'sudo apt-get install {wanted}' and start this again"]
    return _tried(wanted, ["apt-get", "install", "-y", "-q", "--no-install-recommends", *packages])


def _built(name: str) -> list[str]:
    """Builds the program of a library."""
    folder = BUILT / f"cmake-{name}"
    configure = ["cmake", "-S", str(HERE), "-B", str(folder), f"-DWITH_{name.upper()}=ON"]
    problems = _tried(f"{name}_axis", configure) or _tried(f"{name}_axis", ["cmake", "--build", str(folder)])
    if not problems:
        shutil.copy2(folder / f"{name}_axis", BUILT / f"{name}_axis")
    return problems


def _tried(what: str, command: Sequence[str]) -> list[str]:
    """Runs a command; the last line it said where it failed."""
    print(f"installing {what}: {command[0]} …", flush=True)
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return [f"{what}: there is no {command[0]} here; install it"]
    if done.returncode == 0:
        return []
    said = [line for line in (done.stderr or done.stdout).splitlines() if line.strip()]
    return [f"{what}: {said[-1] if said else f'exit code {done.returncode}'}"]


if __name__ == "__main__":
    sys.exit(main())
