"""How often inputs that contradict what is known are refused or warned of, and how often right ones are.

    python benchmarks/contradictions.py --wrong 100 --right 1000

Silos nobody has seen, before the sensors of the profiles with their own cameras, off by what a calibration is off.
A frame is told of where its answer is refused or has a warning.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import siloscope
from siloscope import Camera, Estimate, sensors
from siloscope.io.camera_sizes import scaled
from siloscope.reasons import INPUT_REMARKS
from siloscope.simulation import Feed, defects, sensor_model, true_camera
from siloscope.simulation.scenarios import random_scene

SENSORS = ("realsense-d455", "orbbec-astra", "realsense-d435", "realsense-l515", "realsense-d415")
SHAPES = ("gaussian", "funnel", "mound", "gaussian+tilted", "rathole+lumpy+tilted")
WIDTH = 320
"""Columns to which frames are thinned."""


@dataclass(frozen=True)
class Inputs:
    """A frame as a user gives it."""

    raw: NDArray[np.uint16]
    camera: Camera
    settings: dict[str, Any]

    def locate(self) -> Estimate:
        """The answer."""
        public = {name: value for name, value in self.settings.items() if not name.startswith("_")}
        return siloscope.locate(self.raw, self.camera, **public)


def right(seed: int) -> Inputs:
    """A frame with everything that is known of it, all of it right."""
    draw = np.random.default_rng((seed, 11))
    name = SENSORS[seed % len(SENSORS)]
    profile = sensors.load(name)
    nominal = max(profile.intrinsics, key=lambda camera: camera.width)
    given = scaled(nominal, (WIDTH, WIDTH * nominal.height // nominal.width))
    feed = Feed(SHAPES[seed % len(SHAPES)], float(draw.uniform(0.05, 0.5)), seed=seed)
    scene = random_scene(seed, feed, sensor=replace(sensor_model(name, seed), unit=0.0))
    scene = replace(
        scene, camera=true_camera(given, "calibrated", seed), defects=defects("oval", seed) if seed % 3 == 0 else None
    )
    unit = profile.depth_unit or 0.001
    depth = np.nan_to_num(scene.render().measured)
    raw = np.where(depth < 65534 * unit, np.rint(depth / unit), 0.0).astype(np.uint16)
    settings: dict[str, Any] = {"sensor": name, "depth_unit": unit}
    tilt = draw.normal(0.0, 0.005, 3)
    if seed % 2:
        settings["diameter"] = 2.0 * scene.silo.radius + float(draw.normal(0.0, 0.002))
    if seed % 4 > 1:
        settings["gravity"] = scene.pose.axis_direction + tilt
    return Inputs(raw, given, settings | {"_diameter": 2.0 * scene.silo.radius})


def _unit(factor: float) -> Callable[[Inputs, np.random.Generator], Inputs]:
    def wrong(told: Inputs, _: np.random.Generator) -> Inputs:
        return replace(told, settings=told.settings | {"depth_unit": factor * told.settings["depth_unit"]})

    return wrong


def _colour(told: Inputs, draw: np.random.Generator) -> Inputs:
    """The colour camera's intrinsics: longer by a fifth to a half, with another principal point."""
    by, off = float(draw.uniform(1.2, 1.5)), draw.normal(0.0, 0.01 * WIDTH, 2)
    camera = told.camera
    camera = replace(camera, fx=by * camera.fx, fy=by * camera.fy, cx=camera.cx + off[0], cy=camera.cy + off[1])
    return Inputs(told.raw, camera, told.settings | {"diameter": told.settings["_diameter"]})


EDITS = (("fx",), ("fx", "fy"), ("cx", "cy"), ("fx", "cx"), ("fx", "fy", "cx"), ("cx",))


def _half_edited(told: Inputs, draw: np.random.Generator) -> Inputs:
    """Some of the numbers are of another resolution."""
    by, camera = float(draw.choice([0.5, 2.0 / 3.0, 0.75, 4.0 / 3.0, 1.5, 2.0])), told.camera
    names = EDITS[int(draw.integers(len(EDITS)))]
    wrong = replace(camera, **{name: by * getattr(camera, name) for name in names})
    return replace(told, camera=wrong, settings=told.settings | {"_edit": f"{'+'.join(names)} x{by:.2f}"})


WRONG: dict[str, Callable[[Inputs, np.random.Generator], Inputs]] = {
    **{f"unit x {factor:g}": _unit(factor) for factor in (0.1, 4.0, 5.0, 10.0)},
    "colour intrinsics, tape": _colour,
    "half-edited camera": _half_edited,
}


def outcome(told: Inputs) -> tuple[str, str]:
    """What became of a frame, with the codes.

    "contradicted", "refused" as any frame that does not show enough wall, "warned", or "silent".
    """
    estimate = told.locate()
    codes = [remark.code for remark in estimate.quality if remark.severity != "note"]
    if not estimate.ok:
        return ("contradicted" if estimate.reason in INPUT_REMARKS else "refused"), str(estimate.reason)
    return ("warned" if codes else "silent"), ", ".join(codes)


def outcomes(kind: str, frames: int, first: int = 0) -> Iterator[tuple[int, str, str]]:
    """Seed, outcome and codes of each frame of a kind of mistake, or of "right"."""
    for seed in range(first, first + frames):
        told = right(seed)
        if kind != "right":
            told = WRONG[kind](told, np.random.default_rng((seed, 23)))
        yield seed, *outcome(told)


def main() -> None:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wrong", type=int, default=100, help="frames a mistake")
    parser.add_argument("--right", type=int, default=1000, help="right frames")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    chosen = parser.parse_args()
    print("| input | frames | contradicted | refused | warned | silent | codes |\n|---|--:|--:|--:|--:|--:|---|")
    for kind in (*WRONG, "right"):
        frames = chosen.right if kind == "right" else chosen.wrong
        found = list(outcomes(kind, frames, chosen.first))
        counts = Counter(result for _, result, _ in found)
        codes = Counter(code for _, result, code in found if result != "silent")
        row = " | ".join(str(counts[result]) for result in ("contradicted", "refused", "warned", "silent"))
        said = "; ".join(f"{code} {count}" for code, count in codes.most_common())
        print(f"| {kind} | {frames} | {row} | {said} |", flush=True)


if __name__ == "__main__":
    main()
