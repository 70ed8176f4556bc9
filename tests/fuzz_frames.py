"""Mutates good files of every format and checks that reading them ends in frames or in `InputError`: no other
exception, no hang over two seconds, no memory beyond twice what a file of that size can honestly declare.

    python -m tests.fuzz_frames --count 10000 [--name depth.png] [--seed 1]

A file that breaks a rule is kept in ``fuzz/artifacts`` and its name printed; the exit code is then 1.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import resource
import signal
import struct
import sys
import tempfile
import time
import tracemalloc
import warnings
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

import camera_texts
import frame_files
import more_files
import recording_files
import siloscope
from siloscope import InputError
from siloscope.io import camera_files


def _camera_file(suffix: str) -> Callable[[], bytes]:
    def make() -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"camera{suffix}"
            camera = replace(frame_files.CAMERA, distortion_model="rational", distortion=(0.5, -0.02, 1e-5, 2e-5))
            camera_files.dump(camera, path, depth_unit=None if suffix == ".yaml" else 0.001)
            return path.read_bytes()

    return make


def _first_lines(name: str, count: int) -> Callable[[], bytes]:
    return lambda: b"".join(frame_files.MAKERS[name]().splitlines(keepends=True)[:count])


_SHORT = {"points.xyz": 200, "points.csv": 200, "image.csv": 12}

SEEDS: dict[str, Callable[[], bytes]] = {
    **frame_files.MAKERS,
    **{name: _first_lines(name, count) for name, count in _SHORT.items()},
    **recording_files.MAKERS,
    **more_files.MAKERS,
    **{f"camera{suffix}": _camera_file(suffix) for suffix in (".json", ".toml", ".yaml")},
    **{f"camera, {name}": text.encode for name, text in (camera_texts.PLAIN | camera_texts.LENSES).items()},
    "camera, Kalibr": camera_texts.KALIBR.encode,
}
"""Good files by name, the text tables short."""

LONGEST_S = 2.0
"""Of the processor's time, which a busy machine does not stretch."""
LONGEST_WAIT_S = 60.0
"""By the clock, for readers that wait for something that never comes."""
BEST_RATIO = 1032
"""What deflate, the strongest compression read, can make of a byte."""
FLOOR_BYTES = 16 << 20
"""Memory that reading may take whatever the file's size: buffers, headers, imported modules."""

MOST_BYTES = 4 << 30
"""Address space of the long run: a decoder of native code that asks for more ends the process, for all to see."""

_WORDS = (b"0", b"-1", b"1", b"65536", b"2147483648", b"99999999999999", b"1e308", b"nan", b"", b"x" * 300)
_VALUES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF)


class Hang(BaseException):
    """Reading took too long; no reader catches it."""


def mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """The file with one to four changes, half of them in its head."""
    for _ in range(int(rng.integers(1, 5))):
        change = _CHANGES[int(rng.integers(len(_CHANGES)))]
        data = change(rng, data)
    return _with_checksums(data) if rng.random() < 0.7 else data


def _place(rng: np.random.Generator, data: bytes) -> int:
    end = min(len(data), 512) if rng.random() < 0.5 else len(data)
    return int(rng.integers(end)) if end else 0


def _flip(rng: np.random.Generator, data: bytes) -> bytes:
    at = _place(rng, data)
    return data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :] if data else data


def _overwrite(rng: np.random.Generator, data: bytes) -> bytes:
    at, size = _place(rng, data), int(rng.choice([1, 2, 4, 8]))
    value = _VALUES[int(rng.integers(len(_VALUES)))] & (1 << 8 * size) - 1
    return data[:at] + value.to_bytes(size, "little" if rng.random() < 0.5 else "big") + data[at + size :]


def _cut(rng: np.random.Generator, data: bytes) -> bytes:
    return data[: _place(rng, data)]


def _remove(rng: np.random.Generator, data: bytes) -> bytes:
    at = _place(rng, data)
    return data[:at] + data[at + int(rng.integers(1, 64)) :]


def _repeat(rng: np.random.Generator, data: bytes) -> bytes:
    at = _place(rng, data)
    return data[:at] + data[at : at + int(rng.integers(1, 256))] * int(rng.integers(2, 5)) + data[at:]


def _insert(rng: np.random.Generator, data: bytes) -> bytes:
    at = _place(rng, data)
    return data[:at] + rng.bytes(int(rng.integers(1, 64))) + data[at:]


def _number(rng: np.random.Generator, data: bytes) -> bytes:
    """Another number in a text header."""
    found = list(islice(re.finditer(rb"-?\d+(\.\d+)?", data[:4096]), 200))
    if not found:
        return data
    match = found[int(rng.integers(len(found)))]
    return data[: match.start()] + _WORDS[int(rng.integers(len(_WORDS)))] + data[match.end() :]


_CHANGES = (_flip, _overwrite, _cut, _remove, _repeat, _insert, _number)


def _with_checksums(data: bytes) -> bytes:
    """Checksums made right again, so that the damage reaches what is behind them."""
    if not data.startswith(b"\x89PNG\r\n\x1a\n"):
        return recording_files.with_checksums(data)
    out, at = bytearray(data), 8
    while at + 12 <= len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        if at + 12 + length > len(data):
            break
        out[at + 8 + length : at + 12 + length] = struct.pack(">I", zlib.crc32(data[at + 4 : at + 8 + length]))
        at += 12 + length
    return bytes(out)


def broken_rule(path: Path) -> str | None:
    """What reading a file does that it must not; None where all is well."""
    largest = FLOOR_BYTES + 2 * BEST_RATIO * path.stat().st_size
    tracemalloc.start()
    try:
        with _time_limit(), warnings.catch_warnings(action="error"):
            read(path)
    except InputError as error:
        if str(path) not in str(error):
            return f"an error that does not name the file: {error}"
    except Hang:
        return f"longer than {LONGEST_S} s"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    return f"{peak >> 20} MiB of memory" if peak > largest else None


def read(path: Path) -> None:
    if "camera" in path.name:
        camera_files.read(path)
        return
    with siloscope.open(path, depth_unit=0.001) as source:
        source.describe()
        for frame in islice(source, 100):
            assert (frame.depth is None) != (frame.points is None)


@contextlib.contextmanager
def _time_limit() -> Iterator[None]:
    def too_long(*_: object) -> None:
        raise Hang

    kinds = ((signal.SIGPROF, signal.ITIMER_PROF, LONGEST_S), (signal.SIGALRM, signal.ITIMER_REAL, LONGEST_WAIT_S))
    before = [(number, timer, signal.signal(number, too_long)) for number, timer, _ in kinds]
    for _, timer, seconds in kinds:
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for number, timer, handler in before:
            signal.setitimer(timer, 0)
            signal.signal(number, handler)


def fuzz(name: str, count: int, seed: int, folder: Path) -> Iterator[tuple[bytes, str]]:
    """The mutations of one good file that break a rule, with the rule."""
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    good, path = SEEDS[name](), folder / f"mutated-{name}"
    for _ in range(count):
        data = mutated(rng, good)
        path.write_bytes(data)
        if (rule := broken_rule(path)) is not None:
            yield data, rule


def main() -> int:
    """The long run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000, help="mutations of every file")
    parser.add_argument("--name", choices=sorted(SEEDS), action="append", help="only this file")
    parser.add_argument("--seed", type=int, default=0)
    wanted = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    failures = 0
    for name in wanted.name or SEEDS:
        started = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            for data, rule in fuzz(name, wanted.count, wanted.seed, Path(folder)):
                failures += 1
                kept = Path("fuzz/artifacts") / f"{zlib.crc32(data):08x}-{name}"
                kept.parent.mkdir(parents=True, exist_ok=True)
                kept.write_bytes(data)
                print(f"{kept}: {rule}")
        print(f"{name}: {wanted.count} mutations in {time.perf_counter() - started:.0f} s")
    print(f"{failures} failures")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
