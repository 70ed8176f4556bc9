"""The archive: what goes in comes out, other Zarr readers agree, and an interruption costs no frame before it."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fuzz_frames
import siloscope
from siloscope import Camera, Frame, InputError
from siloscope.cli import main
from siloscope.io import archive

CAMERA = Camera(64, 48, 57.0, 57.0, 31.5, 23.5, "brown_conrady", (0.1, -0.05, 1e-3, -2e-3, 0.01))
RAW = np.random.default_rng(1).integers(0, 65536, (5, 48, 64), dtype=np.uint16)
FRAMES = [
    Frame(
        depth=raw,
        camera=CAMERA,
        depth_unit=0.00025,
        timestamp=1.7e9 + number / 30,
        gravity=np.array([0.1 * number, 9.7, -0.5]),
        source=f"frame {number}",
        provenance={"device": "D455", "serial_number": "000123"},
    )
    for number, raw in enumerate(RAW)
]


def read(path: Path) -> list[Frame]:
    with siloscope.open(path) as source:
        return list(source)


def alike(one: Frame, other: Frame) -> bool:
    assert one.depth is not None
    assert other.depth is not None
    same = np.array_equal(one.depth, other.depth, equal_nan=one.depth.dtype.kind == "f")
    same = same and one.depth.dtype == other.depth.dtype and one.camera == other.camera
    same = same and (one.depth_unit, one.timestamp) == (other.depth_unit, other.timestamp)
    return same and np.array_equal(one.gravity, other.gravity)


def test_what_goes_in_comes_out(tmp_path: Path) -> None:
    path = tmp_path / "many.zarr"
    assert archive.write(path, FRAMES) == 5
    with siloscope.open(path) as source:
        frames = list(source)
    assert all(alike(*pair) for pair in zip(FRAMES, frames, strict=True))
    assert source.timestamps == [frame.timestamp for frame in FRAMES]
    assert source.provenance["serial_number"] == "000123"
    assert (len(source), source.depth_unit, source.problems) == (5, 0.00025, [])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_metres_keep_their_precision_and_their_holes(tmp_path: Path, dtype: Any) -> None:
    metres = (RAW[0] / 7919).astype(dtype)
    metres[3] = np.nan
    bare = Frame(depth=metres)
    archive.write(tmp_path / "a", [bare])
    (frame,) = read(tmp_path / "a")
    assert alike(frame, bare)
    assert (frame.camera, frame.timestamp, frame.gravity, frame.depth_unit) == (None, None, None, None)


def test_zarrs_own_reader_agrees(tmp_path: Path) -> None:
    zarr = pytest.importorskip("zarr")
    archive.write(tmp_path / "a", FRAMES)
    group = zarr.open_group(tmp_path / "a", mode="r")
    np.testing.assert_array_equal(group["depth"][:], RAW)
    np.testing.assert_array_equal(group["timestamp"][:], [frame.timestamp for frame in FRAMES])
    np.testing.assert_array_equal(group["gravity"][:], [frame.gravity for frame in FRAMES])
    assert group.attrs["camera"]["fx"] == 57.0
    assert group["depth"].attrs["scale_factor"] == 0.00025


def test_frames_are_known_again_by_their_measurements(tmp_path: Path) -> None:
    path = tmp_path / "a"
    archive.write(path, FRAMES[:3])
    renamed = replace(FRAMES[1], source="another name", timestamp=0.0)
    with archive.Writer(path) as writer:
        assert [frame in writer for frame in (*FRAMES, renamed)] == [True] * 3 + [False] * 2 + [True]
    shutil.rmtree(path / "digest")  # an archive of before they were kept
    with archive.Writer(path) as writer:
        assert [frame in writer for frame in FRAMES] == [True] * 3 + [False] * 2


def test_writing_goes_on_across_the_chunks_of_the_small_arrays(tmp_path: Path) -> None:
    tiny = [Frame(depth=np.full((1, 2), n, np.uint16), depth_unit=0.001, timestamp=float(n)) for n in range(1030)]
    for start in (0, 400, 1023, 1025):
        stop = {0: 400, 400: 1023, 1023: 1025, 1025: 1030}[start]
        archive.write(tmp_path / "a", tiny[start:stop])
    frames = read(tmp_path / "a")
    assert [frame.timestamp for frame in frames] == list(range(1030))
    assert [int(frame.depth[0, 1]) for frame in frames if frame.depth is not None] == list(range(1030))


def test_an_interruption_at_any_write_leaves_the_frames_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = _write_until(tmp_path / "counted", None, monkeypatch)
    assert calls > 24
    for stop in range(calls):
        path = tmp_path / f"stopped{stop}"
        assert _write_until(path, stop, monkeypatch) == stop
        try:
            frames = read(path)
        except InputError:
            frames = []
        finished = max(0, (stop - 5) // 8)
        assert len(frames) >= finished
        assert all(alike(*pair) for pair in zip(FRAMES, frames, strict=False))
        if finished:
            archive.write(path, FRAMES[len(frames) : 3])
            assert all(alike(*pair) for pair in zip(FRAMES[:3], read(path), strict=True))


def _write_until(path: Path, stop: int | None, monkeypatch: pytest.MonkeyPatch) -> int:
    """Writes three frames; the file after `stop` others is cut in half and never gets its name. How many got theirs."""
    whole, named = Path.replace, 0

    def replace(beside: Path, target: Path) -> Path:
        nonlocal named
        if named == stop:
            beside.write_bytes(beside.read_bytes()[: beside.stat().st_size // 2])
            raise KeyboardInterrupt
        named += 1
        return whole(beside, target)

    monkeypatch.setattr(Path, "replace", replace)
    with contextlib.nullcontext() if stop is None else pytest.raises(KeyboardInterrupt):
        archive.write(path, FRAMES[:3])
    monkeypatch.setattr(Path, "replace", whole)
    return named


_ENDLESS = """
import sys, itertools, numpy as np
from siloscope import Frame
from siloscope.io import archive
with archive.Writer(sys.argv[1]) as writer:
    for n in itertools.count():
        writer.append(Frame(depth=np.full((48, 64), n % 65535, np.uint16), depth_unit=0.001, timestamp=float(n)))
"""


def test_a_killed_writer_leaves_a_readable_archive(tmp_path: Path) -> None:
    path = tmp_path / "killed"
    writer = subprocess.Popen([sys.executable, "-c", _ENDLESS, str(path)])
    try:
        while not (path / "depth" / "c.20.0.0").exists():
            assert writer.poll() is None
            time.sleep(0.01)
    finally:
        os.kill(writer.pid, signal.SIGKILL)
        writer.wait()
    frames = read(path)
    assert len(frames) >= 20
    assert all(np.all(frame.depth == n) and frame.timestamp == n for n, frame in enumerate(frames))


def test_a_damaged_chunk_costs_its_frame_a_missing_one_too(tmp_path: Path) -> None:
    path = tmp_path / "a"
    archive.write(path, FRAMES)
    chunk = path / "depth" / "c.1.0.0"
    data = bytearray(chunk.read_bytes())
    data[-100] ^= 1
    chunk.write_bytes(data)
    (path / "depth" / "c.3.0.0").unlink()
    source = siloscope.open(path)
    frames = list(source)
    assert [frame.timestamp for frame in frames] == [FRAMES[n].timestamp for n in (0, 2, 4)]
    assert "fails the checksum" in source.problems[0]
    assert "1 of 5 frames are missing" in source.problems[1]


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"camera": None}, "its camera is None"),
        ({"depth_unit": 0.001}, "its depth unit is 0.001"),
        ({"depth": RAW[0][:40]}, "its height is 40"),
        ({"depth": (RAW[0] / 1000).astype(np.float32)}, "dtype is float32|depth unit is None"),
        ({"depth": None, "points": np.zeros((3, 3))}, "not points"),
    ],
)
def test_a_frame_unlike_the_others_is_refused(tmp_path: Path, change: dict[str, Any], cause: str) -> None:
    path = tmp_path / "a"
    archive.write(path, FRAMES[:1])
    with pytest.raises(InputError, match=cause):
        archive.write(path, [replace(FRAMES[1], **change)])
    assert len(read(path)) == 1


def test_another_zarr_folder_is_told_apart(tmp_path: Path) -> None:
    (tmp_path / "zarr.json").write_text('{"zarr_format": 3, "node_type": "group", "attributes": {}}')
    with pytest.raises(InputError, match="no archive of depth frames"):
        siloscope.open(tmp_path)
    with pytest.raises(InputError, match="no archive of depth frames"):
        archive.write(tmp_path, FRAMES)


def test_a_file_in_the_way_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError):
        archive.write(tmp_path, FRAMES)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt"]


def test_convert_makes_an_archive_and_adds_what_it_lacks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording, out = str(Path(__file__).parent / "data" / "realsense.bag"), tmp_path / "all.zarr"
    with siloscope.open(recording) as source:
        first = next(iter(source))
    archive.write(out, [first])
    for written, repeated in ((2, 1), (0, 3)):
        assert main(["convert", recording, "-o", str(out), "--json"]) == 0
        document = json.loads(capsys.readouterr().out)
        assert (document["frames"], document["repeated"]) == (written, repeated)
        assert len(siloscope.open(out)) == 3
    assert main(["info", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["depth_unit"] == pytest.approx(0.00025)


def test_mutated_archives_break_no_rule(tmp_path: Path) -> None:
    path, rng = tmp_path / "a.zarr", np.random.default_rng(4)
    archive.write(path, FRAMES[:2])
    files = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    for _ in range(300):
        file = list(files)[int(rng.integers(len(files)))]
        file.write_bytes(fuzz_frames.mutated(rng, files[file]))
        assert fuzz_frames.broken_rule(path) is None
        file.write_bytes(files[file])


def test_a_declared_length_without_its_frames_costs_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    archive.write(path, FRAMES)
    head = path / "depth" / "zarr.json"
    head.write_text(head.read_text().replace("5,\n", "999999999999,\n", 1))
    source = siloscope.open(path)
    assert len(list(source)) == 5
    assert "999999999994 of 999999999999 frames are missing" in source.problems[0]
