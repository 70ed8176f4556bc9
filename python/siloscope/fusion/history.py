"""The frames of a calibration in their order, and what those since the last move of the camera say together."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from siloscope import _core
from siloscope.errors import InputError, UsageError
from siloscope.fusion.located_frame import LocatedFrame
from siloscope.types.calibration import Calibration, Evidence, FrameRecord
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
    def of(cls, before: Calibration | None, rule: str) -> History:
        """Of the calibration to continue; raises `InputError` where that lacks what is fused."""
        if before is None:
            return cls()
        lacking = not before.evidence.frames and before.evidence.earlier is None
        if lacking and before.ok and before.rule == rule == "information":
            raise InputError(
                "the calibration to continue was written by an earlier version of siloscope, without the evidence that "
                "this one fuses; calibrate all frames anew"
            )
        return cls(before.frames, before.evidence.frames, before.evidence.earlier, before.moves)

    def extended(self, answers: list[LocatedFrame], lost: Iterable[str]) -> History:
        """With new frames behind the old ones."""
        first = max((record.index for record in self.records), default=-1) + 1
        numbered = list(enumerate(answers, first))
        unread = [FrameRecord(n, name, "unreadable") for n, name in enumerate(lost, first + len(answers))]
        errors = [answer.error for answer in answers if answer.error is not None]
        if errors and len(errors) == len(answers):
            raise errors[0]
        new = tuple((n, a.evidence) for n, a in numbered if a.evidence)
        records = (*self.records, *(_record(n, answer) for n, answer in numbered), *unread)
        return replace(self, records=records, evidence=(*self.evidence, *new))


def _record(number: int, answer: LocatedFrame) -> FrameRecord:
    plain = FrameRecord(number, answer.name, "used", timestamp=answer.timestamp, digest=answer.digest)
    if answer.estimate is None:
        return replace(plain, status="unreadable", reason=str(answer.error))
    if not answer.estimate.ok:
        return replace(plain, status="refused", reason=answer.estimate.reason)
    return replace(plain, pose=answer.estimate.pose, cone_reach=answer.cone_reach)


MAX_KEPT_FACTORS = 100
"""Number of frames that keep their own factor in a calibration; older ones are added up."""


@dataclass(frozen=True)
class Fused:
    """What the frames since the last move of the camera say together."""

    history: History
    fusion: _core.Fusion

    @property
    def disagreeing(self) -> float:
        """Fraction of the frames, 0 to 1, that count less than half."""
        weights = self.fusion.weights
        return sum(weight < 0.5 for weight in weights) / len(weights) if weights else 0.0

    @property
    def kept(self) -> Evidence:
        """The newest frames' evidence; older frames added up with the weights they have now."""
        older = self.fusion.older
        return Evidence(self.history.evidence[-MAX_KEPT_FACTORS:], None if older is None else SummedFactor.of(older))


def since_the_last_move(history: History) -> Fused | None:
    """The frames since the last move of the camera, fused; None where they tell no place.

    Raises
    ------
    UsageError
        For frames that were located with different sensor profiles.
    """
    factors = [factor for _, factor in history.evidence]
    _check_common([*factors, *([] if history.earlier is None else [history.earlier.factor])])
    fusion = _core.fuse_frames(factors, history.earlier, MAX_KEPT_FACTORS)
    if fusion is None:
        return None
    if not fusion.moves:
        return Fused(history, fusion)
    told = tuple(Move(history.evidence[m.index][0], m.turn, m.shift, m.significance) for m in fusion.moves)
    evidence = history.evidence[fusion.first :]
    return Fused(replace(history, evidence=evidence, earlier=None, moves=(*history.moves, *told)), fusion)


def _check_common(factors: list[FrameFactor]) -> None:
    """One sensor profile for all: what is expected of the depth bias, and how firmly."""
    if len({(factor.bias, factor.bias_std) for factor in factors}) > 1:
        raise UsageError("the estimates were made with different sensor profiles; locate all frames with one")
