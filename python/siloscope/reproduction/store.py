"""Results of finished jobs, kept in one file so that an interrupted run goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any


class Store:
    """A file of JSON lines, one finished job a line. A torn last line, as a crash leaves it, is skipped."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._results = dict(_lines(path))

    def __contains__(self, key: str) -> bool:
        return key in self._results

    def __getitem__(self, key: str) -> dict[str, Any]:
        return self._results[key]

    def __len__(self) -> int:
        return len(self._results)

    def put(self, key: str, result: dict[str, Any]) -> None:
        """Keeps a result, on disk too before it returns."""
        line = json.dumps({"key": key, "result": result}, separators=(",", ":")) + "\n"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a+", encoding="utf-8") as file:
            file.write(line if _ends_whole(self.path) else "\n" + line)
        self._results[key] = json.loads(line)["result"]


def _ends_whole(path: Path) -> bool:
    """Whether the file ends with a whole line."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        if size == 0:
            return True
        file.seek(size - 1)
        return file.read(1) == b"\n"


def _lines(path: Path) -> list[tuple[str, dict[str, Any]]]:
    if not path.is_file():
        return []
    found = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            entry = json.loads(line)
            found.append((str(entry["key"]), dict(entry["result"])))
        except (ValueError, TypeError, KeyError):
            continue
    return found
