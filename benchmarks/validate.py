"""Does `validate` convict what is wrong, and acquit what is not? Sequences of the tests' independent oracle.

    python -m benchmarks.validate --seeds 2000:2100

Every seed gives one silo, camera and discharge (the oracle's kind `control`), seen through every fault. Clean: sensor,
intrinsics and wall are as told. The others differ from it by one fault each. Told is, by --intrinsics,

- exact: the true intrinsics, but for the fault's;
- calibrated: what is off by a calibration's deviations (0.2 %, 1 px, 0.003), the fault's on top of it.

Columns: sequences; those with a verdict; convicted among these; those of which no calibration can be made; the cause
that was named first, with how often.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from siloscope import Camera
from siloscope.validation.validate import Validation, validate

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from oracle.bottoms import Cone
from oracle.cameras import Intrinsics
from oracle.scenes import Scene, Shot
from oracle.sensors import Faults
from oracle.sequences import sequence
from oracle.store import sample
from oracle.walls import Bend

KIND = "control"

FAULTS = {
    "clean": "nothing",
    "warp": "sensor warped by 0.5 % at 2 m",
    "centre": "cx off by 3 px",
    "focal": "fx off by 0.5 %",
    "bend": "wall bent by 4 mm",
    "multipath": "light goes round, 1.5 %",
}

Depth = NDArray[np.float32]


@dataclass(frozen=True)
class Sequence:
    """Frames with what the product is told of their camera."""

    fault: str
    depths: list[Depth]
    camera: Camera


def bent(scenes: list[Scene], seed: int) -> list[Scene]:
    """The same with a wall bent by 4 mm in some direction; the cone hangs where the wall ends."""
    vessel = scenes[0].vessel
    assert vessel is not None
    bend = Bend((0.004,), float(np.random.default_rng((seed, 7)).uniform(-3.1, 3.1)), vessel.top, vessel.bottom.rim)
    end = float(bend.shift(vessel.bottom.rim))
    assert isinstance(vessel.bottom, Cone)
    bottom = replace(vessel.bottom, centre=(end * math.cos(bend.azimuth), end * math.sin(bend.azimuth)))
    made = replace(vessel, wall=replace(vessel.wall, reliefs=(bend,)), bottom=bottom)
    return [replace(scene, vessel=made) for scene in scenes]


def read(shots: list[Shot], faults: Faults) -> list[Depth]:
    """What the sensor reads of exact depths, in whole millimetres."""
    made = []
    for shot in shots:
        scene = replace(shot.scene, faults=faults)
        again = replace(shot, scene=scene, reading=scene.reading(shot.depth, shot.points))
        made.append(sample(again).depth.astype(np.float32) * np.float32(1e-3))
    return made


def camera_of(told: Intrinsics) -> Camera:
    """As the product is told."""
    distortion = ("brown_conrady", (told.k1, 0.0, 0.0, 0.0, 0.0)) if told.k1 else ("none", ())
    return Camera(told.width, told.height, told.fx, told.fy, told.cx, told.cy, *distortion)


def sequences(seed: int, frames: int, width: int, intrinsics: str, wanted: list[str]) -> Iterator[Sequence]:
    """Every wanted fault of a seed."""
    scenes = sequence(KIND, seed, frames, width)
    told = scenes[0].camera if intrinsics == "exact" else scenes[0].told
    plain = scenes[0].faults
    shots = [scene.shoot() for scene in scenes]
    clean = read(shots, plain)
    for fault in wanted:
        if fault == "warp":
            yield Sequence(fault, read(shots, replace(plain, warp=0.005)), camera_of(told))
        elif fault == "multipath":
            yield Sequence(fault, read(shots, replace(plain, multipath=0.015)), camera_of(told))
        elif fault == "bend":
            yield Sequence(fault, read([scene.shoot() for scene in bent(scenes, seed)], plain), camera_of(told))
        elif fault == "centre":
            yield Sequence(fault, clean, camera_of(replace(told, cx=told.cx + 3.0)))
        elif fault == "focal":
            yield Sequence(fault, clean, camera_of(replace(told, fx=told.fx * 1.005)))
        else:
            yield Sequence(fault, clean, camera_of(told))


def row(fault: str, found: list[Validation]) -> str:
    """One fault's line of the table."""
    answered = [one for one in found if one.ok]
    convicted = [one for one in answered if one.findings]
    named = Counter(one.findings[0].code for one in convicted).most_common(4)
    share = f"{100.0 * len(convicted) / len(answered):.0f} %" if answered else "–"
    causes = ", ".join(f"{code} {count}" for code, count in named) or "–"
    cells = (FAULTS[fault], len(found), len(answered), len(convicted), share, len(found) - len(answered), causes)
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", default="2000:2100", help="A:B")
    parser.add_argument("--intrinsics", default="exact", choices=("exact", "calibrated"))
    parser.add_argument("--faults", default=",".join(FAULTS), help="names joined by commas")
    parser.add_argument("--frames", type=int, default=10, help="frames of a sequence")
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--resamples", type=int, default=0, help="solves with other noise")
    parser.add_argument("--list", action="store_true", help="list every verdict")
    options = parser.parse_args()
    first, _, end = options.seeds.partition(":")
    wanted = options.faults.split(",")
    found: dict[str, list[Validation]] = {fault: [] for fault in wanted}
    began = time.monotonic()
    for seed in range(int(first), int(end or int(first) + 1)):
        try:
            made = list(sequences(seed, options.frames, options.width, options.intrinsics, wanted))
        except RuntimeError:  # the oracle found no such scene
            continue
        for one in made:
            verdict = validate(
                one.depths,
                camera=one.camera,
                sensor="orbbec-astra-s",
                intrinsics=options.intrinsics,
                resamples=options.resamples,
            )
            found[one.fault].append(replace(verdict, ideal=None, held_out=(), splits=()))
            if options.list:
                rare = ", ".join(f"{f.code} {f.deviation:.1f}" for f in verdict.findings)
                print(f"{seed} {one.fault}: {verdict.verdict or verdict.reason} {rare}", flush=True)
    print("| fault | sequences | with a verdict | convicted | of these | no calibration | named first |")
    print("|---|--:|--:|--:|--:|--:|---|")
    for fault in wanted:
        print(row(fault, found[fault]))
    print(f"\n{time.monotonic() - began:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
