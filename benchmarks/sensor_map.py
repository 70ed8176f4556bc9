"""What does a map of the sensor gain, and is one ever kept that harms? Sequences of the tests' independent oracle.

    python -m benchmarks.sensor_map --seeds 4000:4020

The sequences of `benchmarks.validate`, and `rings`: a relative error of 0.4 % in rings about the image's middle, as of
a D415. Columns: sequences; those with a map; residuals of held-out frames with the map over those without (median,
worst); error of the axis at the vessel's lowest point by `calibrate` with the map over that without (of the medians),
and both medians; errors of the pose with the map within two stated deviations.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from benchmarks.validate import FAULTS, KIND, Depth, Sequence, sequences

import siloscope
from oracle.cameras import Pose
from oracle.scenes import Scene
from oracle.sequences import sequence
from siloscope.types.calibration import Calibration

SENSOR = "orbbec-astra-s"
MAPPED = {**FAULTS, "rings": "rings of 0.4 %"}


@dataclass(frozen=True)
class Outcome:
    """One sequence with and without a map."""

    kept: bool
    held_out: float
    plain_mm: float
    mapped_mm: float
    z: tuple[float, ...]


def ringed(depth: Depth, phase: float) -> Depth:
    """With a relative error in rings of a quarter of the image's width."""
    height, width = depth.shape
    v, u = np.mgrid[:height, :width]
    distance = np.hypot(u - 0.5 * (width - 1), v - 0.5 * (height - 1))
    error = 0.004 * np.cos(2.0 * math.pi * distance / (0.25 * width) + phase)
    return (np.rint(1e3 * depth * (1.0 + error)) * 1e-3).astype(np.float32)


def axis_off(found: Calibration, scene: Scene) -> float:
    """How far the axis is off at the vessel's lowest point, mm; infinite without an answer."""
    if found.pose is None or scene.vessel is None:
        return math.inf
    low, true = scene.vessel.bottom.lowest, scene.pose
    answer = Pose(*(float(getattr(found.pose, name)) for name in ("r_x", "r_y", "t_x", "t_y")))
    ends = [_to_camera(pose, low) for pose in (true, answer)]
    return 1e3 * float(np.linalg.norm(ends[0] - ends[1]))


def _to_camera(pose: Pose, z: float) -> np.ndarray:
    point: np.ndarray = pose.rotation.T @ (np.array([0.0, 0.0, z]) - pose.origin)
    return point


def outcome(one: Sequence, scene: Scene) -> Outcome | None:
    """A sequence calibrated without and with its map; None where there is no calibration."""
    told: dict[str, Any] = {"camera": one.camera, "intrinsics": "exact"}
    plain = siloscope.calibrate(one.depths, sensor=SENSOR, **told)
    if not plain.ok:
        return None
    learned = siloscope.sensor_map(one.depths, sensor=SENSOR, **told)
    if learned.map is None:
        return Outcome(False, 1.0, axis_off(plain, scene), axis_off(plain, scene), ())
    mapped = siloscope.calibrate(one.depths, sensor=learned.profile, **told)
    z: tuple[float, ...] = ()
    if mapped.pose is not None and mapped.covariance is not None:
        names = ("r_x", "r_y", "t_x", "t_y")
        off = np.array([getattr(mapped.pose, name) - getattr(scene.pose, name) for name in names])
        z = tuple(np.abs(off) / np.sqrt(np.diag(mapped.covariance)))
    return Outcome(True, learned.held_out, axis_off(plain, scene), axis_off(mapped, scene), z)


def row(fault: str, found: list[Outcome]) -> str:
    """One fault's line of the table."""
    kept = [one for one in found if one.kept]
    cells = [MAPPED[fault], str(len(found)), str(len(kept))]
    if kept:
        ratios = [one.held_out for one in kept]
        plain, mapped = (np.median([getattr(one, name) for one in kept]) for name in ("plain_mm", "mapped_mm"))
        within = np.mean(np.array([z for one in kept for z in one.z]) < 2.0)
        cells += [f"{np.median(ratios):.2f}", f"{max(ratios):.2f}", f"{mapped / plain:.2f}", f"{plain:.1f}"]
        cells += [f"{mapped:.1f}", f"{100.0 * within:.0f}"]
    else:
        cells += ["–"] * 6
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", default="4000:4020", help="A:B")
    parser.add_argument("--faults", default=",".join(MAPPED), help="names joined by commas")
    parser.add_argument("--frames", type=int, default=10, help="frames of a sequence")
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--list", action="store_true", help="list every sequence")
    options = parser.parse_args()
    first, _, end = options.seeds.partition(":")
    wanted = options.faults.split(",")
    found: dict[str, list[Outcome]] = {fault: [] for fault in wanted}
    began = time.monotonic()
    for seed in range(int(first), int(end or int(first) + 1)):
        try:
            scene = sequence(KIND, seed, options.frames, options.width)[0]
            asked = ["clean", *(fault for fault in wanted if fault in FAULTS and fault != "clean")]
            made = list(sequences(seed, options.frames, options.width, "exact", asked))
        except RuntimeError:  # the oracle found no such scene
            continue
        if "rings" in wanted:
            made.append(replace(made[0], fault="rings", depths=[ringed(depth, 0.1 * seed) for depth in made[0].depths]))
        for one in made:
            result = outcome(one, scene) if one.fault in wanted else None
            if result is not None:
                found[one.fault].append(result)
                if options.list:
                    print(seed, one.fault, result, flush=True)
    print("| fault | calibrated | mapped | held out | worst | axis error | without, mm | with, mm | within 2, % |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for fault in wanted:
        print(row(fault, found[fault]))
    print(f"\n{time.monotonic() - began:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
