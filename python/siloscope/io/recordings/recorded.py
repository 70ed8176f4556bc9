"""A source of frames that lies in a recording."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from siloscope.errors import InputError
from siloscope.io.recordings.contents import listed
from siloscope.io.recordings.recording import Entry, Recording
from siloscope.io.recordings.streams import Stream, choose, described
from siloscope.io.source import FrameSource, Item, Options
from siloscope.types.frame import Frame


class RecordedSource(FrameSource):
    """Frames of one stream of a recording; where it breaks off, what came before is given and `problems` says so."""

    def __init__(
        self, path: Path, format: str, options: Options, recording: Recording, streams: Sequence[Stream]
    ) -> None:
        super().__init__(path, format, options)
        self.recording = recording
        self.streams = streams
        if not streams and recording.damage:
            raise InputError(recording.damage)
        self.stream = choose(self.name, streams, options.stream)
        self.provenance["stream"] = self.stream.name
        self.problems = self._damage()
        self.timestamps = [self._time(entry) for entry in self.stream.topic.entries]

    @abstractmethod
    def _decode(self, entry: Entry) -> Frame:
        """One frame."""

    def _time(self, entry: Entry) -> float:
        return entry.time_ns / 1e9

    def _items(self) -> Iterator[Item]:
        for number, entry in enumerate(self.stream.topic.entries):
            yield Item(f"frame {number}", partial(self._decode, entry))
        if self.recording.damage:
            raise InputError(self.recording.damage)

    def _damage(self) -> list[str]:
        return [self.recording.damage] if self.recording.damage else []

    def _count(self) -> int:
        return len(self.stream.topic.entries)

    def _streams(self) -> list[dict[str, Any]]:
        return described(self.streams, self.stream)

    def _topics(self) -> list[dict[str, Any]]:
        return listed(self.recording, self.streams, self.stream)

    def close(self) -> None:
        """Lets go of the file."""
        self.recording.close()
