"""Makes the release that CHANGELOG.md announces: sets the version, dates the section, commits and tags.

    make release

The topmost section is "## 0.2.0 (unreleased)"; its number is the version. The working tree must be clean. Nothing is
pushed.
"""

from __future__ import annotations

import datetime
import re
import subprocess
import sys
from pathlib import Path

CARGO, CHANGES = Path("Cargo.toml"), Path("CHANGELOG.md")
ANNOUNCED = re.compile(r"^## (\d+\.\d+\.\d+) \(unreleased\)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
VERSION = re.compile(r'^version = "(\d+\.\d+\.\d+)"$', re.MULTILINE)
KINDS = ("Added", "Changed", "Fixed", "Removed", "Deprecated", "Security")


class Refused(Exception):
    """Why there is no release, and what to do."""


def run(*command: str) -> str:
    """Output of a command."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Refused(f"{' '.join(command)}: {done.stderr.strip()}")
    return done.stdout


def announced(changes: str, present: str) -> str:
    """The version that the changelog announces; it has entries of known kinds and follows the present one."""
    section = ANNOUNCED.search(changes)
    if section is None or section.start() != changes.index("\n## ") + 1:
        raise Refused(f"{CHANGES} does not begin with a section '## X.Y.Z (unreleased)'")
    version, text = section.groups()
    kinds = re.findall(r"^### (.+)$", text, re.MULTILINE)
    if not re.search(r"^- ", text, re.MULTILINE) or not kinds or not set(kinds) <= set(KINDS):
        raise Refused(f"{version} in {CHANGES} needs entries under any of {', '.join(KINDS)}")
    if [int(part) for part in version.split(".")] <= [int(part) for part in present.split(".")]:
        raise Refused(f"{version} in {CHANGES} does not follow {present}, the version in {CARGO}")
    return str(version)


def release(today: datetime.date) -> str:
    """Sets version and date, commits and tags; gives the version."""
    if run("git", "status", "--porcelain"):
        raise Refused("the working tree has changes; commit them first")
    cargo, changes = CARGO.read_text("utf-8"), CHANGES.read_text("utf-8")
    present = VERSION.search(cargo)
    if present is None:
        raise Refused(f"{CARGO} has no version")
    version = announced(changes, present[1])
    if run("git", "tag", "--list", f"v{version}"):
        raise Refused(f"there is a tag v{version} already")
    CARGO.write_text(VERSION.sub(f'version = "{version}"', cargo, count=1), "utf-8")
    CHANGES.write_text(changes.replace(f"## {version} (unreleased)", f"## {version} - {today}", 1), "utf-8")
    run("cargo", "update", "--quiet", "--offline", "--workspace")
    run("git", "commit", "--quiet", "--all", "--message", f"release: set version {version}")
    run("git", "tag", "--annotate", f"v{version}", "--message", f"siloscope {version}")
    return version


def main() -> int:
    """Exit code."""
    try:
        version = release(datetime.datetime.now(datetime.UTC).date())
    except Refused as why:
        print(f"no release: {why}", file=sys.stderr)
        return 1
    print(f"committed and tagged v{version}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
