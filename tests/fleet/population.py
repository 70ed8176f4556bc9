"""A population of archives: silos of several sizes, each emptied and filled, as a low-cost sensor sees them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from siloscope import Camera, Frame
from siloscope.io import archive
from siloscope.simulation import ASTRA_S, Feed, Scene, Silo
from siloscope.simulation.scenarios import looking_at

SENSOR = "orbbec-astra-s"
UNIT = 0.001
START = 1_772_000_000.0
"""Near the end of February 2026, so that a population of some days has two months."""
STEP = 6 * 3600.0
"""Seconds between two frames."""
VARIANTS = 5
"""Frames that are measured of one exact scene, with other noise each."""


def camera(width: int) -> Camera:
    """The Astra at a width."""
    scale = width / 640
    height, focal = round(480 * scale), 570.3 * scale
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def scenes(number: int, width: int, steps: int) -> Iterator[Scene]:
    """A silo's scenes: it falls from nearly full to nearly empty, is filled, and falls again."""
    draw = np.random.default_rng(number)
    silo = Silo(radius=draw.uniform(1.1, 1.7), cylinder_height=draw.uniform(2.0, 3.5), cone_height=2.2)
    pose = looking_at(silo, *draw.uniform(-0.4, 0.4, 2))
    sensor = replace(ASTRA_S, unit=UNIT, dropout=0.02, max_range=8.0)
    levels = 0.15 + 0.6 * np.abs(np.linspace(-1.0, 0.6, steps)) ** 0.7
    for step, level in enumerate(levels):
        yield Scene(silo, pose, camera(width), Feed("funnel", level=float(level)), sensor, seed=1000 * number + step)


def frames(number: int, count: int, width: int) -> Iterator[Frame]:
    """A silo's frames with their times."""
    steps = max(count // VARIANTS, 2)
    taken = 0
    for scene in scenes(number, width, steps):
        exact = scene.render()
        for variant in range(-(-count // steps)):
            if taken == count:
                return
            seen = exact.measured_again(scene.seed * VARIANTS + variant)
            time = START + STEP * taken
            yield Frame(depth=seen.raw(UNIT), camera=exact.camera, depth_unit=UNIT, timestamp=time, source=f"{taken}")
            taken += 1


def make(folder: Path, archives: int, count: int, width: int) -> list[Path]:
    """Writes so many archives with so many frames each, named silo00 and so on."""
    paths = [folder / f"silo{number:02d}.zarr" for number in range(archives)]
    for number, path in enumerate(paths):
        if not path.exists():
            archive.write(path, frames(number, count, width))
    return paths


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--archives", type=int, default=20)
    parser.add_argument("--frames", type=int, default=100, help="frames an archive")
    parser.add_argument("--width", type=int, default=640)
    given = parser.parse_args()
    make(given.folder, given.archives, given.frames, given.width)
