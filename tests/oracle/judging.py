"""Is an answer right, and does it know how right? Answers and truths are plain data; the product is not asked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .cameras import Pose

POSE = ("r_x", "r_y", "t_x", "t_y")
GEOMETRY = ("radius", "cylinder_bottom", "apex")

SURE = 4.0
"""An error of more stated deviations is sure and wrong, if it is also larger than these:"""
LEAST = {"r_x": 5e-3, "r_y": 5e-3, "t_x": 10e-3, "t_y": 10e-3, "radius": 10e-3, "cylinder_bottom": 10e-3, "apex": 10e-3}
"""rad and m."""

WALL_SEEN = 0.25
"""A refusal of a frame that shows at least this share of wall is a miss."""


@dataclass(frozen=True)
class Verdict:
    """One answer judged."""

    answered: bool
    reason: str | None = None
    missed: bool = False
    """Refused though a quarter of the readings shows wall."""
    wrong: bool = False
    """Sure and wrong in the pose; where there is no silo, answered at all."""
    geometry_wrong: bool = False
    """Sure and wrong in radius, cylinder's bottom or apex, or a bottom of another kind is named."""
    z: tuple[float, ...] = ()
    """Errors of r_x, r_y, t_x, t_y in stated deviations."""
    position_mm: float = math.nan
    rotation_mrad: float = math.nan
    std_mm: float = math.nan
    std_mrad: float = math.nan


def judge(answer: Mapping[str, Any], truth: Mapping[str, Any]) -> Verdict:
    """The verdict on a document of `locate --json` or a calibration, beside the truth of its frame."""
    silo = truth["silo"] is not None
    if answer["status"] != "ok":
        return Verdict(False, answer["reason"], missed=silo and truth["wall"] >= WALL_SEEN)
    if not silo:
        return Verdict(True, wrong=True)
    true, found = Pose(**truth["pose"]), Pose(*(answer[name] for name in POSE))
    errors = {name: getattr(found, name) - getattr(true, name) for name in POSE}
    std = answer["std"]
    return Verdict(
        True,
        wrong=any(sure_and_wrong(name, errors[name], std[name]) for name in POSE),
        geometry_wrong=_geometry_wrong(answer["silo"], truth),
        z=tuple(errors[name] / max(std[name], 1e-12) for name in POSE),
        position_mm=1e3 * math.hypot(errors["t_x"], errors["t_y"]),
        rotation_mrad=1e3 * axis_angle(true, found),
        std_mm=1e3 * math.hypot(std["t_x"], std["t_y"]),
        std_mrad=1e3 * math.hypot(std["r_x"], std["r_y"]),
    )


def sure_and_wrong(name: str, error: float, std: float | None) -> bool:
    """Whether a quantity is off by more than it says, and by more than matters."""
    return abs(error) > max(SURE * (std or 0.0), LEAST[name])


def axis_angle(a: Pose, b: Pose) -> float:
    """Angle between two axes, rad."""
    first, second = a.rotation[2], b.rotation[2]
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))


def _geometry_wrong(stated: Mapping[str, Any], truth: Mapping[str, Any]) -> bool:
    for name in GEOMETRY:
        value, true = stated[name], truth["silo"][name]
        if value is None:
            continue
        if true is None or sure_and_wrong(name, value - true, stated["std"][name]):
            return True
    kind = (stated.get("bottom") or {}).get("kind")
    return kind not in (None, "unknown", "map", *truth["bottoms"])


HEAD = (
    "answered", "refused", "missed", "wrong", "within 2, %", "worst z", "mm median", "mm max", "mrad median",
    "mrad max", "std mm", "std mrad", "geometry wrong",
)  # fmt: skip
"""Columns of a row of a table."""


def row(verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    """A population's figures under `HEAD`; medians of what was answered."""
    found = [v for v in verdicts if v.z]
    z = np.abs([v.z for v in found]).ravel()
    counts = [
        sum(v.answered for v in verdicts),
        sum(not v.answered for v in verdicts),
        sum(v.missed for v in verdicts),
        sum(v.wrong for v in verdicts),
    ]
    if not found:
        return (*map(str, counts), *("–",) * 8, "0")
    mm, mrad = np.array([v.position_mm for v in found]), np.array([v.rotation_mrad for v in found])
    std_mm, std_mrad = np.median([v.std_mm for v in found]), np.median([v.std_mrad for v in found])
    return (
        *map(str, counts),
        f"{100.0 * np.mean(z <= 2.0):.0f}",
        f"{z.max():.1f}",
        f"{np.median(mm):.2f}",
        f"{mm.max():.1f}",
        f"{np.median(mrad):.2f}",
        f"{mrad.max():.1f}",
        f"{std_mm:.2f}",
        f"{std_mrad:.2f}",
        str(sum(v.geometry_wrong for v in found)),
    )
