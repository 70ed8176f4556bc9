"""`fleet diff`: what changed from one run to another, frame by frame, told by silo and in all."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.fleet import results
from siloscope.fleet.extras import arrow
from siloscope.fleet.running import Opened

SCHEMA = "siloscope.fleet-diff/1"

WORST = 30
"""Frames that are listed: those whose volumes are farthest apart in their own deviations."""

_COMPARED = (
    *("status", "reason", "volume_m3", "volume_std_m3", "ullage_m3", "ullage_std_m3", "own_std_m3", "level_m"),
    *("mass_kg", "coverage", "quality"),
)


@dataclass(eq=False)
class Change:
    """What changed of some frames."""

    frames: int = 0
    """In both runs."""
    only_before: int = 0
    only_after: int = 0
    same: int = 0
    """Frames of which every compared number is the same to the last bit."""
    gained: int = 0
    """Frames that have an answer now and had none."""
    lost: int = 0
    gaps: list[NDArray[np.float64]] = field(default_factory=list)
    """Differences of the volume (of the free space where there is none), m³."""
    deviations: list[NDArray[np.float64]] = field(default_factory=list)
    """The same in the deviations that differ from frame to frame."""
    ratios: list[NDArray[np.float64]] = field(default_factory=list)
    """Deviation after by deviation before."""
    quality: Counter[str] = field(default_factory=Counter)
    """Frames by code that appeared (``+code``) or went (``-code``)."""

    def add(self, other: Change) -> None:
        """Takes another silo's in."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        gaps, deviations, ratios = (_finite(parts) for parts in (self.gaps, self.deviations, self.ratios))
        return {
            "frames": self.frames,
            "only_before": self.only_before,
            "only_after": self.only_after,
            "same": self.same,
            "gained": self.gained,
            "lost": self.lost,
            "volume_m3": {
                "mean": float(gaps.mean()) if len(gaps) else None,
                "rms": math.sqrt(float((gaps**2).mean())) if len(gaps) else None,
                "largest": float(np.abs(gaps).max()) if len(gaps) else None,
                "largest_in_deviations": float(np.abs(deviations).max()) if len(deviations) else None,
            },
            "std_ratio": float(np.median(ratios)) if len(ratios) else None,
            "quality": dict(sorted(self.quality.items())),
        }


def diff(before: Opened, after: Opened) -> dict[str, Any]:
    """The document of ``siloscope fleet diff --json``: ``all``, ``silos``, ``poses``, and the ``worst`` frames."""
    whole, by_silo = Change(), dict[str, Any]()
    worst: list[dict[str, Any]] = []
    for silo in sorted({*results.silos(before), *results.silos(after)}):
        change, rows = _of_silo(silo, results.readings(before, silo), results.readings(after, silo))
        by_silo[silo] = change.to_dict()
        whole.add(change)
        worst = sorted([*worst, *rows], key=lambda row: -row["deviations"])[:WORST]
    return {
        "schema": SCHEMA,
        "before": {"run": before.plan.run, "version": before.plan.version},
        "after": {"run": after.plan.run, "version": after.plan.version},
        "all": whole.to_dict(),
        "silos": by_silo,
        "poses": _poses(before, after),
        "worst": worst,
    }


def _of_silo(silo: str, before: Any | None, after: Any | None) -> tuple[Change, list[dict[str, Any]]]:
    if before is None or after is None:
        lost, new = (0 if table is None else table.num_rows for table in (before, after))
        return Change(only_before=lost, only_after=new), []
    both = _joined(before, after)
    change = Change(len(both["key"]), before.num_rows - len(both["key"]), after.num_rows - len(both["key"]))
    ok = [both[f"status{side}"] == "ok" for side in ("_a", "_b")]
    change.gained, change.lost = int((~ok[0] & ok[1]).sum()), int((ok[0] & ~ok[1]).sum())
    change.same = int(np.all([_equal(both[f"{name}_a"], both[f"{name}_b"]) for name in _COMPARED], axis=0).sum())
    gap, own, ratio = _gaps(both)
    change.gaps, change.deviations, change.ratios = [gap], [gap / own], [ratio]
    changed = np.flatnonzero(both["quality_a"] != both["quality_b"])
    for row in changed:
        old, new = (set(str(both[f"quality{side}"][row]).split()) for side in ("_a", "_b"))
        change.quality.update([f"+{code}" for code in new - old] + [f"-{code}" for code in old - new])
    return change, _worst(silo, both, gap, gap / own)


def _joined(before: Any, after: Any) -> dict[str, NDArray[Any]]:
    """The compared columns of the frames that both have, by name and side (``_a``, ``_b``)."""
    one, other = _keys(before), _keys(after)
    common, first, second = np.intersect1d(one, other, assume_unique=True, return_indices=True)
    found: dict[str, NDArray[Any]] = {"key": common}
    for side, table, rows in (("_a", before, first), ("_b", after, second)):
        for name in ("camera", "seconds", "sha256", *_COMPARED):
            found[f"{name}{side}"] = _column(table, name)[rows]
    return found


def _keys(table: Any) -> NDArray[Any]:
    """What tells a frame: camera, hash, time, and its number among frames that are alike."""
    seconds = _column(table, "seconds")
    plain = [
        f"{c} {h} {t!r}" for c, h, t in zip(_column(table, "camera"), _column(table, "sha256"), seconds, strict=True)
    ]
    seen: Counter[str] = Counter()
    keys = []
    for key in plain:
        keys.append(f"{key} {seen[key]}")
        seen[key] += 1
    return np.array(keys, np.str_)


def _column(table: Any, name: str) -> NDArray[Any]:
    column = table.column(name)
    if name == "quality":
        return np.array([" ".join(codes) for codes in column.to_pylist()], object)
    if arrow().types.is_floating(column.type):
        return np.asarray(column.to_numpy(), np.float64)
    return np.array(["" if value is None else value for value in column.to_pylist()], object)


def _equal(one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.bool_]:
    if one.dtype == np.float64:
        return np.asarray((one == other) | (np.isnan(one) & np.isnan(other)))
    return np.asarray(one == other, bool)


def _gaps(both: dict[str, NDArray[Any]]) -> tuple[NDArray[np.float64], ...]:
    """Differences of volume or free space, the deviation between two readings, and the ratio of the deviations."""
    by_volume = np.isfinite(both["volume_m3_a"]) & np.isfinite(both["volume_m3_b"])
    gap = np.where(by_volume, both["volume_m3_b"] - both["volume_m3_a"], both["ullage_m3_a"] - both["ullage_m3_b"])
    std = [np.where(by_volume, both[f"volume_std_m3{s}"], both[f"ullage_std_m3{s}"]) for s in ("_a", "_b")]
    with np.errstate(divide="ignore", invalid="ignore"):
        own = np.hypot(both["own_std_m3_a"], both["own_std_m3_b"])
        return gap, np.where(own > 0.0, own, np.nan), std[1] / std[0]


def _worst(
    silo: str, both: dict[str, NDArray[Any]], gap: NDArray[np.float64], deviations: NDArray[np.float64]
) -> list[dict[str, Any]]:
    """The frames that changed most; frames that gained or lost their answer come first."""
    flipped = (both["status_a"] == "ok") != (both["status_b"] == "ok")
    size = np.where(flipped, np.inf, np.nan_to_num(np.abs(deviations), nan=0.0))
    rows = np.argsort(-size, kind="stable")[:WORST]
    return [_row(silo, both, int(k), gap, float(size[k])) for k in rows if size[k] > 0.0]


def _row(silo: str, both: dict[str, NDArray[Any]], k: int, gap: NDArray[np.float64], size: float) -> dict[str, Any]:
    def side(s: str) -> dict[str, Any]:
        names = ("status", "reason", "volume_m3", "volume_std_m3", "ullage_m3", "quality")
        return {name: _plain(both[f"{name}{s}"][k]) for name in names}

    where = {"silo": silo, "camera": both["camera_a"][k], "seconds": _plain(both["seconds_a"][k])}
    told = {**where, "sha256": both["sha256_a"][k], "gap_m3": _plain(gap[k]), "deviations": size}
    return {**told, "before": side("_a"), "after": side("_b")}


def _plain(value: Any) -> Any:
    return (float(value) if math.isfinite(value) else None) if isinstance(value, float | np.floating) else value


def _poses(before: Opened, after: Opened) -> dict[str, Any]:
    """By series, how far the axis has moved: turn in rad, shift in m, and both in the later one's deviations."""
    found = {}
    for series in sorted({*before.table.series, *after.table.series}):
        one, other = results.calibration(before, series), results.calibration(after, series)
        if one is not None and other is not None and one["status"] == other["status"] == "ok":
            found[series.name] = _pose_change(one, other)
    return found


def _pose_change(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    names = ("r_x", "r_y", "t_x", "t_y")
    step = {name: other[name] - one[name] for name in names}
    std = other.get("std", {})
    largest = max((abs(step[name]) / std[name] for name in names if std.get(name)), default=None)
    turn, shift = math.hypot(step["r_x"], step["r_y"]), math.hypot(step["t_x"], step["t_y"])
    return {"turn": turn, "shift": shift, "largest_in_deviations": largest}


def _finite(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    values = np.concatenate([*parts, np.zeros(0)])
    return np.asarray(values[np.isfinite(values)], np.float64)
