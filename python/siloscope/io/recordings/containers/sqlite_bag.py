"""The SQLite container (``.db3``) of ROS 2 bags and of RealSense recordings since SDK 2.59."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from urllib.parse import quote

from siloscope.errors import InputError
from siloscope.io.recordings.dialects import source
from siloscope.io.recordings.recording import MAX_CHUNK, Entry, Recording, Topic, wire
from siloscope.io.recordings.wire import Wire
from siloscope.io.source import Format, FrameSource, Options

MAGIC = b"SQLite format 3\0"
_ERRORS = (sqlite3.Error, UnicodeError)
"""What damage raises; in the text of an error the bytes need not be text."""


class SqliteBag(Recording):
    """A ``.db3`` file, with or without the folder of a ROS 2 bag around it."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.size = path.stat().st_size
        self.base = self._connect(path)
        try:
            self._index()
        except _ERRORS as error:
            self.damage = f"{self.name}: the recording is cut off or damaged ({error}); frames before are read"
        except BaseException:
            self.base.close()
            raise
        for topic in self.topics.values():
            topic.entries.sort(key=lambda entry: entry.time_ns)

    def _connect(self, path: Path) -> sqlite3.Connection:
        # Read-only still reads a write-ahead log; where the folder forbids that, the file alone has to do.
        for mode in ("mode=ro", "mode=ro&immutable=1"):
            base = sqlite3.connect(f"file:{quote(str(path.resolve()))}?{mode}", uri=True, check_same_thread=False)
            base.text_factory = _text
            try:
                tables = {name for (name,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
                break
            except _ERRORS as error:
                base.close()
                problem = str(error)
        else:
            raise InputError(f"{path}: damaged SQLite file ({problem}); record again") from None
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(1_000_000, min(self.size, MAX_CHUNK)))
        if not {"topics", "messages"} <= tables:
            base.close()
            raise InputError(f"{path}: a SQLite file, but no recording: it has no tables 'topics' and 'messages'")
        return base

    def _index(self) -> None:
        rows = self.base.execute("SELECT id, name, type, serialization_format FROM topics")
        topics = {number: self.declare(str(name), str(kind), str(form)) for number, name, kind, form in rows}
        # In the order of the file, not of its index: a cut-off file then gives what is before the cut.
        for number, topic_id, time_ns in self.base.execute("SELECT id, topic_id, timestamp FROM messages NOT INDEXED"):
            topic = topics.get(topic_id)
            if topic and isinstance(time_ns, int):
                topic.entries.append(Entry(time_ns, number))

    def read(self, topic: Topic, entry: Entry) -> Wire:
        """One message."""
        try:
            row = self.base.execute("SELECT data FROM messages WHERE id = ?", (entry.where,)).fetchone()
        except _ERRORS as error:
            raise InputError(f"the recording is cut off or damaged ({error})") from None
        data = row[0] if row else b""
        if not isinstance(data, bytes):
            raise InputError("a message is no bytes")
        return wire(topic.encoding, data)

    def close(self) -> None:
        """Lets go of the file."""
        self.base.close()


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _open(path: Path, options: Options) -> FrameSource:
    return source(path, "db3", options, SqliteBag(path))


FORMAT = Format("db3", lambda head, path: head.startswith(MAGIC), _open)
