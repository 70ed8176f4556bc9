"""The frames of a calibration in their order, and what those since the last move of the camera say together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from siloscope.errors import UsageError
from siloscope.fusion.change_point import find_moves, may_have_moved
from siloscope.fusion.factors import FrameFactors
from siloscope.fusion.located_frame import LocatedFrame
from siloscope.fusion.relinearize import at_bias, bias_is_free, relinearized
from siloscope.fusion.solve import Fused, fuse
from siloscope.parameters import PARAMETERS
from siloscope.types.calibration import Calibration, FrameRecord
from siloscope.types.frame_factor import FrameFactor, SummedFactor
from siloscope.types.move import Move


@dataclass(frozen=True)
class History:
    """All frames so far: a record of each, and the evidence of those that can still be fused."""

    records: tuple[FrameRecord, ...] = ()
    evidence: tuple[tuple[int, FrameFactor], ...] = ()
    earlier: SummedFactor | None = None
    moves: tuple[Move, ...] = ()

    @classmethod
    def of(cls, before: Calibration | None) -> History:
        if before is None:
            return cls()
        return cls(before.frames, before.evidence.frames, before.evidence.earlier, before.moves)

    def extended(self, answers: list[LocatedFrame], lost: Iterable[str]) -> History:
        """With new frames behind the old ones."""
        first = max((record.index for record in self.records), default=-1) + 1
        numbered = list(enumerate(answers, first))
        unread = [FrameRecord(n, name, "unreadable") for n, name in enumerate(lost, first + len(answers))]
        errors = [answer.error for answer in answers if answer.error is not None]
        if errors and len(errors) == len(answers):
            raise errors[0]
        new = tuple((n, a.estimate.evidence) for n, a in numbered if a.estimate and a.estimate.evidence)
        records = (*self.records, *(_record(n, answer) for n, answer in numbered), *unread)
        return replace(self, records=records, evidence=(*self.evidence, *new))


def _record(number: int, answer: LocatedFrame) -> FrameRecord:
    plain = FrameRecord(number, answer.name, "used", timestamp=answer.timestamp, digest=answer.digest)
    if answer.estimate is None:
        return replace(plain, status="unreadable", reason=str(answer.error))
    if not answer.estimate.ok:
        return replace(plain, status="refused", reason=answer.estimate.reason)
    return replace(plain, pose=answer.estimate.pose, cone_reach=answer.cone_reach or answer.estimate.cone_reach)


def since_the_last_move(history: History) -> tuple[History, FrameFactors, Fused]:
    """The factors since the last move of the camera, and their common answer.

    If the bias is unknown, a move shows clearly only with equations at the right bias, and the bias follows only from
    frames without a move between them. So moves are searched twice if there may be one.
    """
    factors = _factors(history)
    found = _fused_since(history, factors, find_moves(factors, history.earlier))
    if bias_is_free(factors) and (found[0].moves != history.moves or may_have_moved(found[2])):
        about_bias = at_bias(factors, found[2].parameters)
        found = _fused_since(history, factors, find_moves(about_bias, history.earlier))
    return found


def _fused_since(history: History, factors: FrameFactors, moves: list[Move]) -> tuple[History, FrameFactors, Fused]:
    """The evidence since the last of these moves, fused; `factors` is that of all."""
    if moves:
        first = moves[-1].index
        told = tuple(replace(move, index=history.evidence[move.index][0]) for move in moves)
        history = replace(history, evidence=history.evidence[first:], earlier=None, moves=(*history.moves, *told))
        factors = _factors(history)
    factors = relinearized(factors, history.earlier)
    return history, factors, fuse(factors, history.earlier)


def _factors(history: History) -> FrameFactors:
    factors = FrameFactors([evidence for _, evidence in history.evidence])
    _check_common(factors)
    return factors


def _check_common(factors: FrameFactors) -> None:
    """Parameters that a frame does not estimate must have the same given value in all: one sensor profile.

    The frames' own values may differ: a bias that the diameter tells is left where it is in a frame without cylinder.
    """
    for k in range(7, len(PARAMETERS)):
        told = factors.expected[~factors.free[:, k], k]
        if len(told) and np.ptp(np.nan_to_num(told)) > 1e-12:
            raise UsageError("the estimates were made with different sensor profiles; locate all frames with one")
