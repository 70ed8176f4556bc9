"""From the fused frames to a calibration: answer, verdict on every frame, remarks, refusals."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from siloscope import _core, sensors
from siloscope.errors import UsageError
from siloscope.fusion.history import MAX_KEPT_FACTORS, Fused, History, since_the_last_move
from siloscope.parameters import PARAMETERS
from siloscope.reasons import CALIBRATION_REFUSALS, sentence
from siloscope.types.calibration import Calibration, Evidence, FrameRecord
from siloscope.types.frame_factor import FrameFactor
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry, geometry_of

RADIUS, SLOPE = 12, 49
"""Where the state has the radius and the cone's slope, with its intercept behind it."""

COAXIAL = ("coaxial-cone", "cone-alone")
"""Models whose cone is the axis' own."""

MAX_DIRECTION_STD = 0.02
"""Largest standard deviation of the axis' direction that still is an answer, rad."""

MAX_POSITION_STD = 0.05
"""Largest standard deviation of the axis' position that still is an answer, as a fraction of the silo's radius."""

MANY_FRACTION = 0.25
"""Fraction of disagreeing frames from which on a remark is made."""


def calibration_of(history: History, rule: str, config: dict[str, Any]) -> Calibration:
    answered = [record for record in history.records if record.pose is not None]
    if not answered:
        return _refused("no-frame-answers", history, rule, config)
    if rule == "mean-of-last-10":
        return _mean_of_last(history, config)
    if not history.evidence:
        raise UsageError(
            "fusing by information needs estimates of method surface, with their details; give those, or choose the "
            "rule mean-of-last-10"
        )
    fused = since_the_last_move(history)
    if fused is None:
        return _refused("poorly-determined", history, rule, config)
    history = replace(fused.history, records=_judged(fused))
    alone = fused.history.earlier is None and fused.disagreeing > 0.5
    if alone or not _determined(fused.fusion):
        disagree = fused.fusion.excess > 1.0 or fused.disagreeing > MANY_FRACTION
        return _refused("frames-disagree" if disagree else "poorly-determined", history, rule, config)
    return _answer(history, fused, config)


def _answer(history: History, fused: Fused, config: dict[str, Any]) -> Calibration:
    fusion = fused.fusion
    values, covariance, relative = fusion.parameters, fusion.covariance, fusion.covariance_relative
    profile = sensors.from_record(config.get("sensor"))
    if profile is not None and profile.map is not None:
        covariance, relative = profile.map.widened(covariance), profile.map.widened(relative)
    radius, slope, intercept = (None if not np.isfinite(v) else float(v) for v in values[4:7])
    cone = None if slope is None or intercept is None or not fusion.hopper else (slope, intercept)
    silo, silo_std = geometry_of(radius, cone, covariance)
    return Calibration(
        "ok",
        pose=SiloPose(*(float(v) for v in values[:4])),
        covariance=covariance[:4, :4].copy(),
        silo=silo,
        silo_std=silo_std,
        parameters=values,
        parameter_covariance=covariance,
        excess=fusion.excess,
        scale_std=fusion.scale_std,
        moves=history.moves,
        frames=history.records,
        quality=_quality(history, fused),
        config=config,
        evidence=fused.kept,
        models=tuple(fusion.models),
        covariance_relative=relative[:4, :4].copy(),
    )


def _judged(fused: Fused) -> tuple[FrameRecord, ...]:
    """Records with the verdict of the fusion."""
    history, fusion = fused.history, fused.fusion
    verdict = {
        number: (weight, deviation)
        for (number, _), weight, deviation in zip(history.evidence, fusion.weights, fusion.deviations, strict=True)
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


def _quality(history: History, fused: Fused) -> tuple[str, ...]:
    fusion = fused.fusion
    agreeing = sum(weight > 0.5 for weight in fusion.weights) + (history.earlier.frames if history.earlier else 0)
    seen = np.isfinite(fusion.parameters)
    holds = {
        "camera-moved": bool(history.moves),
        "few-frames": agreeing < 3,
        "many-frames-disagree": fused.disagreeing > MANY_FRACTION,
        "frames-scatter": fusion.excess > 4.0,
        "scale-unknown": fusion.scale_std > 0.0,
        "cone-not-seen": not seen[6],
        "cylinder-not-seen": not seen[4],
        "deformed": fusion.deformed,
    }
    return tuple(code for code, true in holds.items() if true)


def _determined(fusion: _core.Fusion) -> bool:
    """Whether the frames, apart from an unknown scale, fix the pose."""
    values, variance = fusion.parameters, np.diag(fusion.covariance)
    size = values[4] if np.isfinite(values[4]) else values[6]
    scale = (np.nan_to_num(values[2:4]) * fusion.scale_std) ** 2
    direction = math.sqrt(variance[0] + variance[1])
    position = math.sqrt(max(float((variance[2:4] - scale).sum()), 0.0))
    return direction < MAX_DIRECTION_STD and position < MAX_POSITION_STD * size


def _mean_of_last(history: History, config: dict[str, Any]) -> Calibration:
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
        evidence=Evidence(history.evidence[-MAX_KEPT_FACTORS:], history.earlier),
    )


def _stamped(record: FrameRecord, status: str, weight: float) -> FrameRecord:
    return replace(record, status=status, weight=weight, deviation=None)


def _mean_geometry(evidence: list[FrameFactor]) -> SiloGeometry:
    """Mean radius and apex of the frames that show them, and the cylinder's bottom from their mean cone."""
    radius = _mean(e.state[RADIUS] for e in evidence if e.has_cylinder)
    cones = [e.state[SLOPE : SLOPE + 2] for e in evidence if e.has_cone and e.hopper and e.model in COAXIAL]
    slope, apex = _mean(cone[0] for cone in cones), _mean(cone[1] / cone[0] for cone in cones)
    bottom = None if radius is None or slope is None or apex is None else apex - radius / slope
    return SiloGeometry(radius, bottom, apex)


def _mean(values: Iterable[float]) -> float | None:
    told = [float(value) for value in values]
    return sum(told) / len(told) if told else None


def _refused(reason: str, history: History, rule: str, config: dict[str, Any]) -> Calibration:
    message = sentence(CALIBRATION_REFUSALS[reason], _commonest(history))
    evidence = Evidence(history.evidence[-MAX_KEPT_FACTORS:], history.earlier)
    return Calibration(
        "refused", rule, moves=history.moves, frames=history.records, reason=reason, message=message, config=config,
        evidence=evidence,
    )  # fmt: skip


def _commonest(history: History) -> str:
    """The commonest reason of the frames themselves, for the message."""
    reasons = Counter(record.reason for record in history.records if record.status == "refused")
    if not reasons:
        return ""
    reason, count = reasons.most_common(1)[0]
    return f" ({count} of {len(history.records)}: {reason})"
