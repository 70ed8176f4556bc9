"""Many frames in, the silo's calibration out."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from siloscope import sensors
from siloscope.errors import InputError, UsageError
from siloscope.estimation.surface import geometry
from siloscope.estimation.thinning import thinned
from siloscope.fusion.change_point import find_moves, may_have_moved
from siloscope.fusion.relinearize import at_bias, bias_is_free, straightened
from siloscope.fusion.solve import Fused, Stack, fuse, sums
from siloscope.io import FrameSource
from siloscope.io import open as open_frames
from siloscope.locate import locate
from siloscope.parameters import PARAMETERS
from siloscope.reasons import CALIBRATION_REFUSALS, sentence
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration, Evidence, FrameRecord
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.types.frame_factor import FrameFactor, SummedFactor
from siloscope.types.move import Move
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry

RULES = ("information", "mean-of-last-10")
"""How frames become one: weighed by their information, or the mean of the last 10 answers (section 2.4.4)."""

KEPT = 300
"""So many frames keep their own evidence in a calibration; older ones are added up."""

MAX_DIRECTION_STD = 0.02
"""Largest standard deviation of the axis' direction that still is an answer, rad."""

MAX_POSITION_STD = 0.05
"""Largest standard deviation of the axis' position that still is an answer, as a share of the silo's radius."""

MANY = 0.25
"""Share of the frames that are many when they disagree with the rest."""


SEARCHED = 16
"""Of so many frames one is searched for the wall; the others look for it first where such a frame has shown it."""

WHOLE = 16
"""So many frames are asked for all their pixels. Later ones can add little and are asked for a quarter of them."""

Pathlike = str | PathLike[str]


def calibrate(
    frames: Iterable[Frame | Estimate | ArrayLike] | FrameSource | Pathlike | Iterable[Pathlike],
    *,
    camera: Camera | None = None,
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: float | None = None,
    diameter: float | None = None,
    gravity: ArrayLike | None = None,
    continue_from: Calibration | Pathlike | None = None,
    rule: str = "information",
    jobs: int = 1,
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> Calibration:
    """Fuse the frames of one camera in one silo to the camera's pose and the silo's geometry.

    Frames count by what they show, in any order; frames that disagree with the majority don't count. Where the
    sequence shows that the camera has moved, only the frames since its last move are fused. From the 17th frame on, a
    quarter of a frame's pixels is asked, if that gives an answer: its deviations are twice as large, and stated so.

    Parameters
    ----------
    frames : files, frame source, or iterable of Frame, depth array or Estimate
        A path or several, what `siloscope.open` gives, frames, arrays, or answers of `locate` (method surface).
    camera, sensor, depth_unit, diameter, gravity
        As for `locate`. Estimates bring their own.
    continue_from : Calibration or path, optional
        An earlier calibration of the same camera and silo; its frames come before these.
    rule : str
        One of `RULES`.
    jobs : int
        Frames located at the same time.
    progress : callable, optional
        Is given the frames and gives them on, to show how far it has come.

    Returns
    -------
    Calibration
        With status ``refused`` and a reason of `CALIBRATION_REFUSALS` where no frame shows enough wall.

    Raises
    ------
    InputError
        Where no frame can be read, or the earlier calibration can't be used.
    UsageError
        For an unknown rule or sensor, a setting outside its bounds, or settings other than the earlier calibration's.
    """
    if rule not in RULES:
        raise UsageError(f"unknown rule '{rule}'; known are {', '.join(RULES)}")
    if not 1 <= jobs <= 256:
        raise UsageError(f"jobs {jobs} is not between 1 and 256; give the number of frames to locate at a time")
    start = time.perf_counter()
    before = Calibration.load(continue_from) if isinstance(continue_from, str | PathLike) else continue_from
    settings = _settings(before, sensor=sensor, diameter=diameter, gravity=gravity)
    source = _source(frames, camera, depth_unit)
    one = _locator(camera, depth_unit, settings)
    ahead = 0 if jobs == 1 else 2 * jobs
    with _Inline() if jobs == 1 else ThreadPoolExecutor(jobs) as pool:
        read = source.ahead(pool, ahead) if isinstance(source, FrameSource) else source
        answers = list(_answers(progress(read) if progress else read, one, pool, ahead))
    lost = source.problems if isinstance(source, FrameSource) else []
    located = time.perf_counter()
    told = {name: value for name, value in (("sensor", sensor), ("diameter", diameter)) if value is not None}
    brought = {} if before is not None else _brought(answers)
    config = {**settings.described(), **{k: v for k, v in brought.items() if k not in told}}
    config["camera"] = _camera(before, answers)
    found = _fused(_History.of(before).extended(answers, lost), rule, config)
    times = {"frames": 1e3 * (located - start), "fusion": 1e3 * (time.perf_counter() - located)}
    return replace(found, timing_ms=times)


@dataclass(frozen=True)
class _Settings:
    """What every frame is located with."""

    profile: SensorProfile
    diameter: float | None
    gravity: ArrayLike | None

    def described(self) -> dict[str, Any]:
        """For the result's ``config``, and to be gone on with."""
        down = None if self.gravity is None else [float(g) for g in np.ravel(np.asarray(self.gravity, float))]
        return {"sensor": self.profile.to_dict(), "diameter": self.diameter, "gravity": down}


def _settings(before: Calibration | None, **given: Any) -> _Settings:
    """The caller's settings; those of the earlier calibration where the caller says nothing."""
    profile = sensors.load(given["sensor"])
    mine = _Settings(profile, given["diameter"], given["gravity"])
    if before is None or not before.config:
        return mine
    earlier = before.config
    if given["sensor"] is None:
        mine = replace(mine, profile=_profile(earlier.get("sensor")))
    if given["diameter"] is None:
        mine = replace(mine, diameter=earlier.get("diameter"))
    if given["gravity"] is None:
        mine = replace(mine, gravity=earlier.get("gravity"))
    for name in ("sensor", "diameter"):
        if mine.described()[name] != earlier.get(name):
            raise UsageError(
                f"the calibration to continue has another {name} ({_short(earlier.get(name))}); "
                f"leave {name} out, or calibrate all frames anew"
            )
    return mine


def _short(value: Any) -> Any:
    return value.get("name", value) if isinstance(value, dict) else value


def _profile(table: Any) -> SensorProfile:
    """The sensor profile that a calibration's ``config`` describes."""
    profile = sensors.from_record(table)
    if profile is None:
        raise InputError("the calibration to continue does not tell its sensor; calibrate all frames anew")
    return profile


@dataclass(frozen=True)
class _Answer:
    """One frame's estimate, or why there is none."""

    name: str
    timestamp: float | None
    estimate: Estimate | None
    error: InputError | None = None
    camera: Camera | None = None
    made: bool = True
    """Whether it was made here; False for an estimate that the caller brought."""


def _brought(answers: list[_Answer]) -> dict[str, Any]:
    """What the caller's estimates were made with, where all agree on it."""
    configs = [answer.estimate.config for answer in answers if answer.estimate is not None and not answer.made]
    if not configs or len(configs) < len(answers):
        return {}
    common = {name: [config.get(name) for config in configs] for name in ("sensor", "diameter")}
    return {name: told[0] for name, told in common.items() if told[0] is not None and all(v == told[0] for v in told)}


def _source(frames: Any, camera: Camera | None, depth_unit: float | None) -> Iterable[Any]:
    if isinstance(frames, str | PathLike):
        return open_frames(frames, camera=camera, depth_unit=depth_unit)
    if isinstance(frames, list | tuple) and frames and all(isinstance(f, str | PathLike) for f in frames):
        return open_frames(frames, camera=camera, depth_unit=depth_unit)
    return frames  # type: ignore[no-any-return]


def _camera(before: Calibration | None, answers: list[_Answer]) -> dict[str, Any] | None:
    """The one camera of all frames, where known."""
    earlier = None if before is None else before.config.get("camera")
    known = [earlier] if earlier is not None else []
    for answer in answers:
        if answer.camera is None:
            continue
        known.append(answer.camera.to_dict())
        if known[-1] != known[0]:
            raise InputError(f"{answer.name}: it is of another camera than the frames before; calibrate it by itself")
    return known[0] if known else None


Locate = Callable[[int, Any, Estimate | None], tuple[_Answer, Estimate | None]]
"""Number, frame and where to start, to the answer, and where others may start."""


def _locator(camera: Camera | None, depth_unit: float | None, settings: _Settings) -> Locate:
    def one(number: int, frame: Any, start: Estimate | None) -> tuple[_Answer, Estimate | None]:
        if isinstance(frame, Estimate):
            return _Answer(f"estimate {number}", None, frame, made=False), None
        name = frame.source if isinstance(frame, Frame) else f"frame {number}"
        timestamp = frame.timestamp if isinstance(frame, Frame) else None
        known: dict[str, Any] = {"diameter": settings.diameter, "gravity": settings.gravity, "depth_unit": depth_unit}
        known |= {"sensor": settings.profile, "start": start, "ratios": False}
        try:
            few = _by_a_quarter(frame, camera, known) if number >= WHOLE else None
            estimate = few or locate(frame, camera, **known)
        except InputError as error:
            return _Answer(name, timestamp, None, error), None
        mine = camera or (frame.camera if isinstance(frame, Frame) else None)
        return _Answer(name, timestamp, replace(estimate, details=None), camera=mine), estimate

    return one


def _by_a_quarter(frame: Any, camera: Camera | None, known: dict[str, Any]) -> Estimate | None:
    """The answer of a quarter of a frame's pixels, where they give one."""
    few = thinned(frame, camera)
    try:
        estimate = None if few is None else locate(few, **known)
    except InputError:  # all the pixels tell better what is wrong
        return None
    return estimate if estimate is not None and estimate.ok else None


def _answers(frames: Iterable[Any], one: Locate, pool: Executor, ahead: int) -> Iterator[_Answer]:
    """The frames located in order; the next ones are read and located in `pool`, so many `ahead`.

    Which frame starts from which answer is settled by their order alone, so that the pool doesn't change any answer.
    """
    waiting: deque[Future[tuple[_Answer, Estimate | None]]] = deque()
    starts = _Starts()
    for number, frame in enumerate(frames):
        waiting.append(pool.submit(one, number, frame, starts.of(number)))
        starts.add(number, waiting[-1])
        if len(waiting) > ahead:
            yield waiting.popleft().result()[0]
    while waiting:
        yield waiting.popleft().result()[0]


class _Starts:
    """Where frames start: a searched one from nothing, the others from the last but one that was searched.

    The last one may still be at work; only the first frames that are asked whole, or for a quarter, wait for it.
    """

    def __init__(self) -> None:
        self.searched: deque[Future[tuple[_Answer, Estimate | None]]] = deque()
        self.start: Estimate | None = None

    def of(self, number: int) -> Estimate | None:
        if number % SEARCHED == 0:
            return None
        first = any(0 <= number - begin < SEARCHED for begin in (0, WHOLE))
        while len(self.searched) > (0 if first else 1):
            found = self.searched.popleft().result()[1]
            self.start = found if found is not None and found.ok else self.start
        return self.start

    def add(self, number: int, answer: Future[tuple[_Answer, Estimate | None]]) -> None:
        if number % SEARCHED == 0:
            self.searched.append(answer)


class _Inline(Executor):
    """Does the work at once, in this thread."""

    def submit(self, work: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(work(*given, **named))
        return done


@dataclass(frozen=True)
class _History:
    """All frames so far: a record of each, and the evidence of those that can still be fused."""

    records: tuple[FrameRecord, ...] = ()
    evidence: tuple[tuple[int, FrameFactor], ...] = ()
    earlier: SummedFactor | None = None
    moves: tuple[Move, ...] = ()

    @classmethod
    def of(cls, before: Calibration | None) -> _History:
        if before is None:
            return cls()
        return cls(before.frames, before.evidence.frames, before.evidence.earlier, before.moves)

    def extended(self, answers: list[_Answer], lost: Iterable[str]) -> _History:
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


def _record(number: int, answer: _Answer) -> FrameRecord:
    plain = FrameRecord(number, answer.name, "used", timestamp=answer.timestamp)
    if answer.estimate is None:
        return replace(plain, status="unreadable", reason=str(answer.error))
    if not answer.estimate.ok:
        return replace(plain, status="refused", reason=answer.estimate.reason)
    return replace(plain, pose=answer.estimate.pose)


def _fused(history: _History, rule: str, config: dict[str, Any]) -> Calibration:
    answered = [record for record in history.records if record.pose is not None]
    if not answered:
        return _refused("no-frame-answers", history, rule, config)
    if rule == "mean-of-last-10":
        return _mean_of_last(history, config)
    if not history.evidence:
        raise UsageError(
            "fusing by information needs estimates of method surface; give those, or choose the rule mean-of-last-10"
        )
    return _by_information(*_since_the_last_move(history), config)


def _since_the_last_move(history: _History) -> tuple[_History, Stack, Fused]:
    """Only the evidence since the camera last moved, and what it says.

    With an unknown bias a move is seen sharply only where the frames' equations are made about the bias. The bias is
    told by frames between which the camera has not moved; so moves are looked for twice where there may be one.
    """
    stack = _stack(history)
    found = _fused_since(history, stack, find_moves(stack, history.earlier))
    if bias_is_free(stack) and (found[0].moves != history.moves or may_have_moved(found[2])):
        about_bias = at_bias(stack, found[2].parameters)
        found = _fused_since(history, stack, find_moves(about_bias, history.earlier))
    return found


def _fused_since(history: _History, stack: Stack, moves: list[Move]) -> tuple[_History, Stack, Fused]:
    """The evidence since the last of these moves, fused; `stack` is that of all."""
    if moves:
        first = moves[-1].index
        told = tuple(replace(move, index=history.evidence[move.index][0]) for move in moves)
        history = replace(history, evidence=history.evidence[first:], earlier=None, moves=(*history.moves, *told))
        stack = _stack(history)
    stack = straightened(stack, history.earlier)
    return history, stack, fuse(stack, history.earlier)


def _stack(history: _History) -> Stack:
    stack = Stack([evidence for _, evidence in history.evidence])
    _check_common(stack)
    return stack


def _by_information(history: _History, stack: Stack, fused: Fused, config: dict[str, Any]) -> Calibration:
    history = replace(history, records=_judged(history, fused))
    if not _determined(fused):
        disagree = fused.excess > 1.0 or fused.disagreeing > MANY
        return _refused("frames-disagree" if disagree else "poorly-determined", history, "information", config)
    return _answer(history, stack, fused, config)


def _answer(history: _History, stack: Stack, fused: Fused, config: dict[str, Any]) -> Calibration:
    values = fused.parameters
    radius, slope, intercept = (None if not np.isfinite(v) else float(v) for v in values[4:7])
    cone = None if slope is None or intercept is None else (slope, intercept)
    silo, silo_std = geometry(radius, cone, fused.covariance)
    return Calibration(
        "ok",
        pose=SiloPose(*(float(v) for v in values[:4])),
        covariance=fused.covariance[:4, :4].copy(),
        silo=silo,
        silo_std=silo_std,
        parameters=values,
        parameter_covariance=fused.covariance,
        excess=fused.excess,
        scale_std=fused.scale_std,
        moves=history.moves,
        frames=history.records,
        quality=_quality(history, fused),
        config=config,
        evidence=_kept(history, stack, fused),
    )


def _check_common(stack: Stack) -> None:
    """What was told of a parameter that a frame does not estimate must be the same in all: one sensor profile.

    The frames' own values may differ: a bias that the diameter tells is left where it is in a frame without cylinder.
    """
    for k in range(7, len(PARAMETERS)):
        told = stack.expected[~stack.free[:, k], k]
        if len(told) and np.ptp(np.nan_to_num(told)) > 1e-12:
            raise UsageError("the estimates were made with different sensor profiles; locate all frames with one")


def _judged(history: _History, fused: Fused) -> tuple[FrameRecord, ...]:
    """Records with the verdict of the fusion."""
    verdict = {
        number: (float(weight), float(deviation))
        for (number, _), weight, deviation in zip(history.evidence, fused.weights, fused.deviations, strict=True)
    }
    first = history.moves[-1].index if history.moves else 0

    def judged(record: FrameRecord) -> FrameRecord:
        if record.index in verdict:
            weight, deviation = verdict[record.index]
            return replace(record, status="used" if weight > 0.0 else "rejected", weight=weight, deviation=deviation)
        if record.pose is not None and record.index < first:
            return replace(record, status="before-move", weight=0.0, deviation=None)
        return record

    return tuple(judged(record) for record in history.records)


def _quality(history: _History, fused: Fused) -> tuple[str, ...]:
    agreeing = int((fused.weights > 0.5).sum()) + (history.earlier.frames if history.earlier else 0)
    seen = np.isfinite(fused.parameters)
    holds = {
        "camera-moved": bool(history.moves),
        "few-frames": agreeing < 3,
        "many-frames-disagree": fused.disagreeing > MANY,
        "frames-scatter": fused.excess > 4.0,
        "scale-unknown": fused.scale_std > 0.0,
        "cone-not-seen": not seen[6],
        "cylinder-not-seen": not seen[4],
    }
    return tuple(code for code, true in holds.items() if true)


def _kept(history: _History, stack: Stack, fused: Fused) -> Evidence:
    """The newest frames' evidence; older frames added up with the weights they have now."""
    spare = stack.count - KEPT
    if spare <= 0:
        return Evidence(history.evidence, history.earlier)
    older = sums(stack.take(slice(0, spare)), fused.weights[:spare], fused.parameters, history.earlier)
    return Evidence(history.evidence[spare:], older)


def _determined(fused: Fused) -> bool:
    """Whether the frames, apart from an unknown scale, fix the pose."""
    values, variance = fused.parameters, np.diag(fused.covariance)
    size = values[4] if np.isfinite(values[4]) else values[6]
    scale = (np.nan_to_num(values[2:4]) * fused.scale_std) ** 2
    direction = math.sqrt(variance[0] + variance[1])
    position = math.sqrt(max(float((variance[2:4] - scale).sum()), 0.0))
    return direction < MAX_DIRECTION_STD and position < MAX_POSITION_STD * size


def _mean_of_last(history: _History, config: dict[str, Any]) -> Calibration:
    """The paper's rule: the mean of the last 10 answers; its covariance from their scatter."""
    answered = [record for record in history.records if record.pose is not None]
    last = answered[-10:]
    poses = np.array([[getattr(r.pose, name) for name in PARAMETERS[:4]] for r in last])
    chosen = {record.index for record in last}
    evidence = [e for number, e in history.evidence if number in chosen]
    covariance = np.cov(poses.T) / len(last) if len(last) > 1 else None
    status = {True: ("used", 1.0), False: ("not-averaged", 0.0)}
    records = tuple(
        record if record.pose is None else _stamped(record, *status[record.index in chosen])
        for record in history.records
    )
    return Calibration(
        "ok",
        rule="mean-of-last-10",
        pose=SiloPose(*(float(v) for v in poses.mean(axis=0))),
        covariance=covariance,
        silo=_mean_geometry(evidence),
        moves=history.moves,
        frames=records,
        quality=("few-frames",) if len(last) < 3 else (),
        config=config,
        evidence=Evidence(history.evidence[-KEPT:], history.earlier),
    )


def _stamped(record: FrameRecord, status: str, weight: float) -> FrameRecord:
    return replace(record, status=status, weight=weight, deviation=None)


def _mean_geometry(evidence: list[FrameFactor]) -> SiloGeometry:
    """Mean radius and apex of the frames that show them, and the cylinder's bottom from their mean cone."""
    if not evidence:
        return SiloGeometry()
    values = np.array([e.parameters[4:7] for e in evidence])
    values[:, 2] /= values[:, 1]  # the apex, from the cone's intercept and slope
    means = [float(column[np.isfinite(column)].mean()) if np.isfinite(column).any() else None for column in values.T]
    radius, slope, apex = means
    bottom = None if radius is None or slope is None or apex is None else apex - radius / slope
    return SiloGeometry(radius, bottom, apex)


def _refused(reason: str, history: _History, rule: str, config: dict[str, Any]) -> Calibration:
    message = sentence(CALIBRATION_REFUSALS[reason], _commonest(history))
    evidence = Evidence(history.evidence[-KEPT:], history.earlier)
    return Calibration(
        "refused", rule, moves=history.moves, frames=history.records, reason=reason, message=message, config=config,
        evidence=evidence,
    )  # fmt: skip


def _commonest(history: _History) -> str:
    """The commonest reason of the frames themselves, for the message."""
    reasons = Counter(record.reason for record in history.records if record.status == "refused")
    if not reasons:
        return ""
    reason, count = reasons.most_common(1)[0]
    return f" ({count} of {len(history.records)}: {reason})"
