"""Folders of ROS 2 bags: ``metadata.yaml`` beside one or several ``.db3`` or ``.mcap`` files that belong together."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from siloscope.errors import InputError
from siloscope.io.recordings.containers.mcap import Mcap
from siloscope.io.recordings.containers.packed import SUFFIXES, Packed
from siloscope.io.recordings.containers.sqlite_bag import SqliteBag
from siloscope.io.recordings.dialects import source
from siloscope.io.recordings.recording import Entry, Recording, Topic
from siloscope.io.recordings.wire import Wire
from siloscope.io.source import Format, FrameSource, Options

_CONTAINERS: dict[str, Callable[[Path], Recording]] = {".db3": SqliteBag, ".mcap": Mcap}


def parts_of(folder: Path) -> list[Path]:
    """The bag's files in the order in which they were recorded: ``…_9.db3`` before ``…_10.db3``."""
    files = (file for file in folder.iterdir() if _suffix(file) in _CONTAINERS and file.is_file())
    return sorted(files, key=lambda file: [int(n) if n.isdigit() else n for n in re.split(r"(\d+)", file.name)])


def _suffix(file: Path) -> str:
    """Ending of a file's name, of a packed one without the packing."""
    return Path(file.stem).suffix if file.suffix in SUFFIXES else file.suffix


def _opened(file: Path) -> Recording:
    return Packed(file) if file.suffix in SUFFIXES else _CONTAINERS[file.suffix](file)


class Joined(Recording):
    """Several files of one recording."""

    def __init__(self, path: Path, files: list[Path]) -> None:
        super().__init__(path)
        self.parts: list[Recording] = []
        try:
            for file in files:
                self._join(_opened(file))
        except BaseException:
            self.close()
            raise

    def _join(self, part: Recording) -> None:
        number = len(self.parts)
        self.parts.append(part)
        self.damage = self.damage or part.damage
        for topic in part.topics.values():
            entries = self.declare(topic.name, topic.type, topic.encoding).entries
            entries.extend(Entry(entry.time_ns, (number, entry)) for entry in topic.entries)

    def read(self, topic: Topic, entry: Entry) -> Wire:
        """One message."""
        number, inner = entry.where
        part: Recording = self.parts[number]
        return part.read(topic, inner)

    def close(self) -> None:
        """Lets go of the files."""
        for part in self.parts:
            part.close()


def _open(path: Path, options: Options) -> FrameSource:
    files = parts_of(path)
    if not files:
        raise InputError(f"{path}: the ROS 2 bag has no .db3 or .mcap file; copy the whole folder again")
    return source(path, f"ros2-bag ({_suffix(files[0])[1:]})", options, Joined(path, files))


def _is_bag(head: bytes, path: Path) -> bool:
    if not path.is_dir():
        return False
    try:
        with (path / "metadata.yaml").open("rb") as file:
            return b"rosbag2_bagfile_information" in file.read(4096)
    except OSError:
        return bool(parts_of(path))


FORMAT = Format("ros2-bag", _is_bag, _open)
