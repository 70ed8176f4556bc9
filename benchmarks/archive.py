"""Measures what an archive of depth frames could be: PNG folder, our archive, Zarr v3 by zarr-python, Blosc2.

``pip install zarr blosc2``, then ``python benchmarks/archive.py`` prints the table of docs/design/archive.md.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import resource
import shutil
import signal
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import siloscope
from siloscope import Camera, Frame
from siloscope.io import archive, writers
from siloscope.simulation import ASTRA_S
from siloscope.simulation.scenarios import SILO1

UNIT = 0.001
CAMERA = Camera(640, 480, 570.3, 570.3, 319.5, 239.5)
Depth = NDArray[np.uint16]


def raw_frames(count: int) -> list[Depth]:
    """Frames of the paper's first silo as an Astra S sees it, in millimetres; the noise differs, the view does not."""
    sensor = replace(ASTRA_S, unit=UNIT)
    return [writers.to_raw(replace(SILO1, sensor=sensor, seed=seed).render().measured, UNIT) for seed in range(count)]


class Store(NamedTuple):
    """One way to keep frames."""

    name: str
    add: Callable[[Path, Iterable[Depth]], Iterator[int]]
    """Creates or goes on with it; yields after every frame."""
    read: Callable[[Path], Iterator[Depth]]


def add_png(path: Path, frames: Iterable[Depth]) -> Iterator[int]:
    path.mkdir(exist_ok=True)
    for number, raw in enumerate(frames, len(list(path.iterdir()))):
        writers.write_png(path / f"{number:06}.png", raw)
        yield number


def read_source(path: Path) -> Iterator[Depth]:
    with siloscope.open(path, depth_unit=UNIT) as source:
        for frame in source:
            assert frame.depth is not None
            yield frame.depth


def add_ours(path: Path, frames: Iterable[Depth]) -> Iterator[int]:
    with archive.Writer(path) as writer:
        for raw in frames:
            writer.append(Frame(depth=raw, camera=CAMERA, depth_unit=UNIT, timestamp=float(writer.count)))
            yield writer.count


def add_zarr(path: Path, frames: Iterable[Depth]) -> Iterator[int]:
    import zarr
    from zarr.codecs import BloscCodec

    frames = iter(frames)
    if path.exists():
        depth = zarr.open_array(path, mode="r+")
    else:
        blosc = BloscCodec(cname="lz4hc", clevel=5, shuffle="shuffle", typesize=2)
        shape = (0, 480, 640)
        depth = zarr.create_array(path, shape=shape, chunks=(1, 480, 640), dtype="uint16", compressors=blosc)
    for raw in frames:
        depth.append(raw[None])
        yield depth.shape[0]


def read_zarr(path: Path) -> Iterator[Depth]:
    import zarr

    depth = zarr.open_array(path, mode="r")
    for number in range(depth.shape[0]):
        yield np.asarray(depth[number])


def add_blosc2(path: Path, frames: Iterable[Depth], contiguous: bool) -> Iterator[int]:
    import blosc2

    setting = {"codec": blosc2.Codec.LZ4HC, "clevel": 5, "filters": [blosc2.Filter.SHUFFLE], "typesize": 2}
    setting["nthreads"] = 1
    if path.exists():
        chunks = blosc2.open(str(path), mode="a")
    else:
        storage = {"urlpath": str(path), "contiguous": contiguous, "cparams": setting}
        chunks = blosc2.SChunk(chunksize=480 * 640 * 2, **storage)
    for raw in frames:
        yield int(chunks.append_data(raw))


def read_blosc2(path: Path) -> Iterator[Depth]:
    import blosc2

    blosc2.set_nthreads(1)
    chunks = blosc2.open(str(path), mode="r")
    for number in range(chunks.nchunks):
        yield np.frombuffer(chunks.decompress_chunk(number), np.uint16).reshape(480, 640)


STORES = (
    Store("PNG folder", add_png, read_source),
    Store("siloscope archive (Zarr v3)", add_ours, read_source),
    Store("Zarr v3 by zarr-python", add_zarr, read_zarr),
    Store("Blosc2, one file", lambda path, frames: add_blosc2(path, frames, True), read_blosc2),
    Store("Blosc2, a folder", lambda path, frames: add_blosc2(path, frames, False), read_blosc2),
)


def best_ms(work: Callable[[], Any], frames: int, repeat: int = 5) -> float:
    """Least time of several, in milliseconds a frame."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times) / frames * 1e3


def size_of(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


def exhaust(frames: Iterator[Any]) -> None:
    for _ in frames:
        pass


def survivors(store: Store, folder: Path, kills: int) -> str:
    """How many archives can be read, with every frame that was finished, after their writer was killed at random."""
    few = list(np.random.default_rng(0).integers(0, 4000, (4, 480, 640), dtype=np.uint16))
    draw = np.random.default_rng(1)
    good = 0
    for kill in range(kills):
        path = folder / f"killed{kill}"
        ours, theirs = os.pipe()
        writer = in_child(partial(write_endlessly, store, path, few, theirs))
        os.close(theirs)
        done = len(os.read(ours, 3))
        time.sleep(draw.uniform(0, 0.1))
        os.kill(writer, signal.SIGKILL)
        os.waitpid(writer, 0)
        while more := os.read(ours, 1000):
            done += len(more)
        os.close(ours)
        reader = in_child(partial(check_readable, store, path, few, done))
        good += os.waitstatus_to_exitcode(os.waitpid(reader, 0)[1]) == 0
    return f"{good} of {kills}"


def after_full_disk(store: Store, folder: Path) -> str:
    """How many of ten frames can be read after the eleventh was cut off by a disk that is full."""
    path, few = folder / "full", list(np.random.default_rng(0).integers(0, 4000, (10, 480, 640), dtype=np.uint16))
    os.waitpid(in_child(lambda: append_to_full_disk(store, path, few)), 0)
    for count in range(len(few), 0, -1):
        reader = in_child(partial(check_readable, store, path, few, count))
        if os.waitstatus_to_exitcode(os.waitpid(reader, 0)[1]) == 0:
            return f"{count} of {len(few)}"
    return f"0 of {len(few)}"


def append_to_full_disk(store: Store, path: Path, few: list[Depth]) -> None:
    exhaust(store.add(path, few))
    limit = 1000 + (path.stat().st_size if path.is_file() else 0)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    exhaust(store.add(path, few[:1]))


def in_child(work: Callable[[], Any]) -> int:
    """Runs something in a process of its own, silently; gives its number."""
    child = os.fork()
    if child:
        return child
    with contextlib.suppress(BaseException):
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        work()
        os._exit(0)
    os._exit(1)


def write_endlessly(store: Store, path: Path, few: list[Depth], pipe: int) -> None:
    for _ in store.add(path, (few[n % 4] for n in range(10_000))):
        os.write(pipe, b".")


def check_readable(store: Store, path: Path, few: list[Depth], done: int) -> None:
    frames = list(store.read(path))
    assert len(frames) >= done
    assert all(np.array_equal(frame, few[n % len(few)]) for n, frame in enumerate(frames[:done]))


def row(store: Store, frames: list[Depth], folder: Path, kills: int) -> str:
    alive, spared = survivors(store, folder, kills), after_full_disk(store, folder)
    path = folder / "store"
    count = len(frames)
    write = best_ms(lambda: exhaust(store.add(path, frames)), count, 1)
    kilobytes = size_of(path) / count / 1e3
    assert all(np.array_equal(*pair) for pair in zip(frames, store.read(path), strict=True))
    read = best_ms(lambda: exhaust(store.read(path)), count)
    append = best_ms(lambda: exhaust(store.add(path, frames[:1])), 1, 3)
    return f"| {store.name} | {kilobytes:.0f} | {write:.1f} | {read:.2f} | {append:.0f} | {alive} | {spared} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--kills", type=int, default=100)
    options = parser.parse_args()
    frames = raw_frames(options.frames)
    titles = ("store", "kB a frame", "ms to write", "ms to read", "ms to open and append one", "whole after a kill")
    print("| " + " | ".join((*titles, "frames left by a full disk")) + " |")
    print("|---|---|---|---|---|---|---|")
    for store in STORES:
        folder = Path(tempfile.mkdtemp())
        print(row(store, frames, folder, options.kills), flush=True)
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
