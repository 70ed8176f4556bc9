"""Frames that a calibration has not counted yet, by the hash of their measurements."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from siloscope.fusion.located_frame import LocatedFrame
from siloscope.types.calibration import Calibration
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame, digest_of


class UncountedFrames:
    """Frames in their order without those that were counted before; iterated once.

    Parameters
    ----------
    frames : iterable
        Frames, depth arrays or estimates; an estimate has no measurements and always counts.
    before : Calibration, optional
        The calibration that is continued. A frame that it could not use may be tried again.
    """

    def __init__(self, frames: Iterable[Any], before: Calibration | None) -> None:
        self._frames = frames
        records = () if before is None else before.frames
        self._counted = {record.digest for record in records if record.status != "unreadable"} - {None}
        self._digests: list[str | None] = []
        self._repeated = 0

    def __iter__(self) -> Iterator[Any]:
        for frame in self._frames:
            digest = _digest(frame)
            if digest is not None and digest in self._counted:
                self._repeated += 1
                continue
            self._counted.add(digest)
            self._digests.append(digest)
            yield frame

    def marked(self, answers: Iterable[LocatedFrame]) -> list[LocatedFrame]:
        """The frames' answers, in their order, with their hashes."""
        return [replace(answer, digest=digest) for answer, digest in zip(list(answers), self._digests, strict=True)]

    @property
    def remarks(self) -> tuple[str, ...]:
        """Codes of `siloscope.reasons.CALIBRATION_REMARKS`, after the iteration."""
        return ("frames-counted-before",) if self._repeated else ()


def _digest(frame: Any) -> str | None:
    if isinstance(frame, Estimate):
        return None
    return frame.digest if isinstance(frame, Frame) else digest_of(np.asarray(frame))
