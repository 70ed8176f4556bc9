"""The streams of a recording, and which of them is meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.io.recordings.recording import Topic


@dataclass(frozen=True)
class Stream:
    """One sequence of frames in a recording.

    Attributes
    ----------
    name : str
        As `choose` takes it.
    kind : str
        ``depth`` or ``points``.
    topic : Topic
        Its messages.
    size : tuple of int, int, or int, or None
        Width and height in pixels, or the number of points of the first frame; None where that frame is damaged.
    dtype : str or None
        Type of a pixel or coordinate.
    """

    name: str
    kind: str
    topic: Topic
    size: tuple[int, int] | int | None = None
    dtype: str | None = None


class NoStreams(InputError):
    """A recording without depth and points."""


class SeveralStreams(InputError):
    """Several streams and nothing that says which is meant."""

    def __init__(self, message: str, streams: Sequence[Stream]) -> None:
        super().__init__(message)
        self.streams = streams


def choose(name: str, streams: Sequence[Stream], wanted: str | None) -> Stream:
    """The stream named `wanted` (or a part of a name that fits only one); without, the only depth stream.

    Raises
    ------
    InputError
        Where there is none.
    SeveralStreams
        Where there are several and nothing says which.
    UsageError
        For a name that fits none or several.
    """
    if not streams:
        raise NoStreams(f"{name}: no depth and no points in this recording")
    if wanted is not None:
        return _named(name, streams, wanted)
    candidates = [stream for stream in streams if stream.kind == "depth"] or list(streams)
    if len(candidates) > 1:
        kind, names = candidates[0].kind, _listed(candidates)
        raise SeveralStreams(f"{name}: {len(candidates)} {kind} streams; choose one with --stream: {names}", streams)
    return candidates[0]


def _named(name: str, streams: Sequence[Stream], wanted: str) -> Stream:
    fitting = [stream for stream in streams if stream.name == wanted]
    fitting = fitting or [stream for stream in streams if wanted in stream.name]
    if len(fitting) != 1:
        number = "no stream" if not fitting else f"{len(fitting)} streams"
        raise UsageError(f"{name}: {number} named '{wanted}'; there are {_listed(streams)}")
    return fitting[0]


def _listed(streams: Sequence[Stream]) -> str:
    return ", ".join(stream.name for stream in streams)


def described(streams: Sequence[Stream], chosen: Stream | None) -> list[dict[str, Any]]:
    """The streams as plain data, for `FrameSource.describe`."""
    return [
        {
            "name": stream.name,
            "kind": stream.kind,
            "size": [stream.size] if isinstance(stream.size, int) else stream.size,
            "dtype": stream.dtype,
            "frames": len(stream.topic.entries),
            "chosen": stream is chosen,
        }
        for stream in streams
    ]
