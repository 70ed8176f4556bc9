"""Processor time to read one frame: PNG beside Pillow, and the other formats, in milliseconds.

python benchmarks/frames.py
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image
from rich.console import Console
from rich.table import Table

import siloscope
from siloscope.io import writers
from siloscope.simulation.scenarios import scenario

RUNS = 31


def median_ms(action: Callable[[], object]) -> float:
    """Median processor time of an action over `RUNS` runs after one to warm up."""
    times = []
    for _ in range(RUNS + 1):
        started = time.process_time()
        action()
        times.append(time.process_time() - started)
    return 1000.0 * float(np.median(times[1:]))


def read(path: Path) -> object:
    """The frame of a file, through the front door."""
    with siloscope.open(path, depth_unit=0.001) as source:
        return next(iter(source))


def decoded(path: Path) -> object:
    """The pixels of an image file, by Pillow."""
    return np.asarray(Image.open(path))


def files(folder: Path) -> dict[str, Path]:
    """One frame of a simulated silo, with the noise of a real sensor, in several formats."""
    scene = scenario("silo1")
    depth = scene.render().measured
    noise = np.random.default_rng(0).normal(0.0, 0.004, depth.shape)
    noisy = np.where(depth > 0, np.maximum(depth + noise, 0.0), 0.0)
    points = np.dstack([scene.camera.rays() * noisy[..., None], noisy]).astype(np.float32)
    raw = writers.to_raw(noisy, 0.001)
    writers.write_png(folder / "noisy.png", raw)
    writers.write_png(folder / "perfect.png", writers.to_raw(depth, 0.001))
    writers.write_npy(folder / "depth.npy", raw)
    writers.write_npz(folder / "depth.npz", raw)
    Image.fromarray(raw).save(folder / "depth.tif", compression="tiff_deflate")
    writers.write_ply(folder / "points.ply", points)
    np.savetxt(folder / "points.xyz", points.reshape(-1, 3), fmt="%.5f")
    return {path.name: path for path in sorted(folder.iterdir())}


def main() -> None:
    """Prints the table."""
    table = Table("file", "kB", "siloscope ms", "Pillow ms")
    with tempfile.TemporaryDirectory() as folder:
        for name, path in files(Path(folder)).items():
            ours = median_ms(partial(read, path))
            image = path.suffix in (".png", ".tif")
            theirs = f"{median_ms(partial(decoded, path)):.2f}" if image else "-"
            table.add_row(name, str(path.stat().st_size // 1024), f"{ours:.2f}", theirs)
    Console().print(table)


if __name__ == "__main__":
    main()
