"""Processor time to read depth recordings and clouds here, and with the libraries that read them, in milliseconds.

python benchmarks/recordings.py
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import siloscope
from bags import START_NS, Maker
from siloscope.io import writers
from siloscope.simulation.scenarios import scenario

RUNS, FRAMES, POINTS = 5, 60, 500_000
TOPIC = "/camera/depth/image_raw"
KINDS: dict[str, tuple[int, dict[str, Any]]] = {
    "ROS 1": (1, {}),
    "ROS 1, LZ4": (1, {"compression": "lz4"}),
    "ROS 2 SQLite": (2, {}),
    "MCAP": (2, {"mcap": True}),
    "MCAP, Zstandard": (2, {"mcap": True, "compression": "zstd"}),
}


def least_ms(action: Callable[[], object]) -> float:
    """Least processor time of an action."""
    times = []
    for _ in range(RUNS):
        started = time.process_time()
        action()
        times.append(time.process_time() - started)
    return 1000.0 * min(times)


def messages(maker: Maker) -> Iterator[tuple[str, int, Any]]:
    """Frames of a simulated silo with noise, each with its camera."""
    depth = writers.to_raw(scenario("silo1").render().measured, 0.001)
    noise = np.random.default_rng(0).integers(0, 9, (8, *depth.shape), dtype=np.uint16)
    height, width = depth.shape
    for number in range(FRAMES):
        time_ns = START_NS + number * 33_000_000
        yield TOPIC, time_ns, maker.image(depth + noise[number % 8], "16UC1")
        k = (570.0, 0.0, 319.5, 0.0, 570.0, 239.5, 0.0, 0.0, 1.0)
        yield "/camera/depth/camera_info", time_ns, maker.camera_info((width, height), k)


def here(path: Path) -> int:
    """Reads all frames through the front door."""
    with siloscope.open(path) as source:
        return sum(1 for _ in source)


def by_rosbags(path: Path) -> int:
    """Reads all frames as `rosbags` does."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        connections = [connection for connection in reader.connections if connection.topic == TOPIC]
        found = reader.messages(connections)
        images: Iterator[Any] = (reader.deserialize(raw, connection.msgtype) for connection, _, raw in found)
        return sum(bool(image.data.view(np.uint16).any()) for image in images)


def clouds(folder: Path) -> dict[str, tuple[Path, Callable[[Path], object]]]:
    """A cloud as E57 and LAS with their libraries."""
    import laspy
    import pye57

    points = np.random.default_rng(0).uniform(-3, 3, (POINTS, 3))
    file = pye57.E57(str(folder / "cloud.e57"), mode="w")
    file.write_scan_raw(dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points.T, strict=True)))
    file.close()
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = np.full(3, 0.0001)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(folder / "cloud.las")
    cloud.write(folder / "cloud.laz")
    return {
        "E57": (folder / "cloud.e57", lambda path: pye57.E57(str(path)).read_scan_raw(0)),
        "LAS": (folder / "cloud.las", lambda path: laspy.read(path).xyz),
        "LAZ": (folder / "cloud.laz", lambda path: laspy.read(path).xyz),
    }


def main() -> None:
    """Prints the table."""
    table = Table("file", "here", "library")
    with tempfile.TemporaryDirectory() as folder:
        for name, (ros, options) in KINDS.items():
            path = Path(folder) / (name + (".bag" if ros == 1 else ""))
            maker = Maker(ros)
            maker.write(path, messages(maker), **options)
            ours, theirs = least_ms(partial(here, path)), least_ms(partial(by_rosbags, path))
            table.add_row(f"{name}, {FRAMES} frames", f"{ours:.0f}", f"{theirs:.0f} (rosbags)")
        for name, (path, read) in clouds(Path(folder)).items():
            ours, theirs = least_ms(partial(here, path)), least_ms(partial(read, path))
            table.add_row(f"{name}, {POINTS} points", f"{ours:.0f}", f"{theirs:.0f}")
    Console().print(table)


if __name__ == "__main__":
    main()
