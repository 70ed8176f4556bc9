"""What a live source gives: the bytes of a frame's file and when it was taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol


def _nothing() -> None:
    """What most sources do once a frame is safe."""


@dataclass(frozen=True)
class Capture:
    """A frame that was just taken, or found."""

    body: bytes
    """A file that `siloscope.open` reads."""
    time: int | None = None
    """When it was taken, µs; None for the moment in which it arrives."""
    name: str = "the frame"
    """What it is called where it is refused."""
    safe: Callable[[], None] = _nothing
    """Called once the service has it on its disk."""
    refused: Callable[[], None] = _nothing
    """Called once the service has refused it for good."""


class LiveSource(Protocol):
    """Where a camera's frames come from."""

    poll_s: float | None
    """How often it is looked at; None: at the camera's own interval."""

    def captures(self, wanted_s: float, stopped: Callable[[], bool]) -> Iterator[Capture]:
        """The frames that are due. `wanted_s` is the time to the next one; it ends early once `stopped`.

        Raises
        ------
        siloscope.InputError, OSError
            Where the source can't be reached or has failed.
        """

    def close(self) -> None:
        """Lets go of what it holds."""
