"""Packing: other readers agree, appending is safe, an interruption costs nothing, our own reader opens it."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import zarr

import siloscope
from siloscope import Camera, Frame, InputError, UsageError
from siloscope.cli import main
from siloscope.fleet.naming import Series
from siloscope.fleet.pack import pack
from siloscope.fleet.places import open_store
from siloscope.fleet.reading import SealedShard
from siloscope.io import archive
from siloscope.io.archive_layout import decompressed, without_checksum

CAMERA = Camera(64, 48, 57.0, 57.0, 31.5, 23.5)
START = 1_772_000_000.0
"""25 February 2026; four days later it is March."""


def frames(count: int, step: float = 6 * 3600.0, seed: int = 1) -> list[Frame]:
    values = np.random.default_rng(seed).integers(0, 65536, (count, 48, 64), dtype=np.uint16)
    down = np.array([0.1, 9.7, -0.5])
    return [
        Frame(depth=depth, camera=CAMERA, depth_unit=0.001, timestamp=START + step * k, gravity=down + k, source=f"{k}")
        for k, depth in enumerate(values)
    ]


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "silo 7.zarr"
    archive.write(path, frames(20))
    return path


def manifest(store: Path) -> list[dict[str, Any]]:
    return pq.read_table(store / "manifest.parquet").to_pylist()


def test_frames_come_back_as_they_went_in(source: Path, tmp_path: Path) -> None:
    done = pack([source], tmp_path / "store", shard_frames=8)
    assert (done.frames, done.present, done.series) == (20, 0, {"silo-7.cam": 20})
    with siloscope.open(tmp_path / "store") as sealed:
        found = list(sealed)
        assert (len(sealed), sealed.problems, sealed.format) == (20, [], "sealed")
    for one, other in zip(frames(20), found, strict=True):
        assert np.array_equal(one.depth, other.depth)
        assert np.array_equal(one.gravity, other.gravity)
        assert (one.camera, one.depth_unit, one.timestamp) == (other.camera, other.depth_unit, other.timestamp)
    assert sealed[11].timestamp == frames(20)[11].timestamp


def test_a_month_and_a_number_of_frames_bound_a_shard(source: Path, tmp_path: Path) -> None:
    pack([source], tmp_path / "store", shard_frames=8)
    rows = manifest(tmp_path / "store")
    by_object: dict[str, list[Any]] = {}
    for row in rows:
        by_object.setdefault(row["object"], []).append(row["captured"])
    assert all(len(times) <= 8 and len({time.month for time in times}) == 1 for times in by_object.values())
    assert {time.month for time in by_object["silo=silo-7/camera=cam/depth/c.2.0.0"]} == {3}


def test_zarr_python_reads_the_same(source: Path, tmp_path: Path) -> None:
    pack([source], tmp_path / "store", shard_frames=32)
    group: Any = zarr.open_group(tmp_path / "store" / "silo=silo-7" / "camera=cam", mode="r")
    numbers = np.flatnonzero(np.isfinite(group["timestamp"][:]))
    given = frames(20)
    assert len(numbers) == 20
    assert all(np.array_equal(group["depth"][n], frame.depth) for n, frame in zip(numbers, given, strict=True))
    assert group["timestamp"][:][numbers].tolist() == [frame.timestamp for frame in given]
    assert group.attrs["camera"]["fx"] == 57.0
    root: Any = zarr.open_group(tmp_path / "store", mode="r")
    assert root["silo=silo-7/camera=cam/depth"].shape == group["depth"].shape


def test_the_manifest_leads_to_every_frame(source: Path, tmp_path: Path) -> None:
    import hashlib

    store = tmp_path / "store"
    pack([source], store, shard_frames=8)
    for row, frame in zip(manifest(store), frames(20), strict=True):
        with (store / row["object"]).open("rb") as file:
            file.seek(row["offset"])
            chunk = file.read(row["length"])
        assert hashlib.sha256(chunk).hexdigest() == row["sha256"]
        assert np.array_equal(decompressed(without_checksum(chunk), (48, 64), "uint16"), frame.depth)
        assert (row["silo"], row["camera"], row["calibration"]) == ("silo-7", "cam", None)
        assert row["captured"].timestamp() == frame.timestamp == row["seconds"]


def test_packing_again_adds_only_what_is_new(source: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    pack([source], store, shard_frames=8)
    before = {path: path.read_bytes() for path in store.rglob("c.*")}
    assert (pack([source], store).frames, pack([source], store).present) == (0, 20)
    archive.write(source, [replace(frame, timestamp=frame.timestamp + 4e6) for frame in frames(5, seed=2)])
    done = pack([source], store)
    assert (done.frames, done.present, done.shards) == (5, 20, 1)
    assert all(path.read_bytes() == data for path, data in before.items())
    assert len(manifest(store)) == len(siloscope.open(store)) == 25


def test_frames_that_are_alike_are_all_kept(tmp_path: Path) -> None:
    (one,) = frames(1)
    archive.write(tmp_path / "still.zarr", [replace(one, timestamp=None)] * 5)
    assert pack([tmp_path / "still.zarr"], tmp_path / "store").frames == 5
    assert pack([tmp_path / "still.zarr"], tmp_path / "store").present == 5
    assert len(manifest(tmp_path / "store")) == 5


def test_several_silos_are_told_apart(source: Path, tmp_path: Path) -> None:
    other = tmp_path / "b.zarr"
    archive.write(other, frames(3, seed=3))
    pack([source, other], tmp_path / "store", shard_frames=8)
    with siloscope.open(tmp_path / "store", stream="silo=b/") as sealed:
        assert len(sealed) == 3
    with siloscope.open(tmp_path / "store") as several, pytest.raises(InputError, match="choose one with stream"):
        list(several)
    assert main(["info", str(tmp_path / "store")]) == 0
    with pytest.raises(InputError, match="none named 'silo=c'"):
        siloscope.open(tmp_path / "store", stream="silo=c")


def test_a_kill_at_any_write_loses_no_sealed_frame(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from siloscope.fleet import folder_store

    class Killed(BaseException):
        pass

    real, writes = folder_store.FolderStore.put, 0

    def counted(store: Any, name: str, data: bytes) -> None:
        nonlocal writes
        writes -= 1
        if writes < 0:
            raise Killed
        real(store, name, data)

    whole = tmp_path / "whole"
    pack([source], whole, shard_frames=8)
    monkeypatch.setattr(folder_store.FolderStore, "put", counted)
    for least in range(0, 40, 3):
        store, writes = tmp_path / f"killed{least}", least
        try:
            pack([source], store, shard_frames=8)
            break
        except Killed:
            writes = 10_000
            pack([source], store, shard_frames=8)
        assert manifest(store) == manifest(whole)
        assert [f.timestamp for f in siloscope.open(store)] == [f.timestamp for f in frames(20)]
    assert least > 20


def test_damage_costs_its_frame_and_is_told(source: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    pack([source], store, shard_frames=32)
    row = manifest(store)[3]
    path = store / row["object"]
    data = bytearray(path.read_bytes())
    data[row["offset"] + row["length"] // 2] ^= 1
    path.write_bytes(data)
    with siloscope.open(store) as sealed:
        assert len(list(sealed)) == 19
        assert sealed.problems == ["frame 3: its chunk fails the checksum; the file is damaged"]
    path.write_bytes(bytes(data[: len(data) // 2]))
    with siloscope.open(store) as sealed:
        list(sealed)
    (problem,) = sealed.problems
    assert "15 of 20 frames are missing" in problem
    assert "the index at its end fails the checksum" in problem


def test_a_shard_is_read_by_its_index_and_few_ranges(source: Path, tmp_path: Path) -> None:
    pack([source], tmp_path / "store", shard_frames=8)
    shard = SealedShard(open_store(tmp_path / "store"), Series("silo-7", "cam"), 1)
    stored = list(shard.frames())
    assert [frame.time for frame in stored] == [frame.timestamp for frame in frames(20)[8 : 8 + len(stored)]]
    some = list(shard.frames(np.array([1, 5])))
    assert [frame.sha256 for frame in some] == [stored[1].sha256, stored[5].sha256]


def test_what_can_not_be_sealed_is_refused(source: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    pack([source], store)
    archive.write(tmp_path / "other.zarr", [replace(frames(1)[0], depth_unit=0.00025)])
    with pytest.raises(InputError, match="seal it under another camera_id"):
        pack([tmp_path / "other.zarr"], store, silo="silo-7")
    with pytest.raises(UsageError, match="an id has letters"):
        pack([source], store, silo="a/b")
    with pytest.raises(UsageError, match="give 1 to 1024"):
        pack([source], store, shard_frames=1025)


def test_the_command_tells_what_it_did(source: Path, tmp_path: Path, capsys: Any) -> None:
    command = ["pack", str(source), "-o", str(tmp_path / "store"), "--silo", "seven", "--camera-id", "top", "--json"]
    assert main(command) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["schema"], told["frames"], told["series"]) == ("siloscope.pack/1", 20, {"seven.top": 20})


@pytest.fixture
def without_extra(tmp_path: Path) -> list[str]:
    """A Python that has no pyarrow and no obstore."""
    (tmp_path / "hide").mkdir()
    for name in ("pyarrow", "obstore", "ray"):
        (tmp_path / "hide" / f"{name}.py").write_text(f"raise ModuleNotFoundError(name='{name}')")
    program = f"import sys; sys.path.insert(0, {str(tmp_path / 'hide')!r}); from siloscope.cli import main; "
    return [sys.executable, "-c", program + "sys.exit(main(sys.argv[1:]))"]


def test_a_missing_extra_is_named_with_its_remedy(source: Path, tmp_path: Path, without_extra: list[str]) -> None:
    for target in (str(tmp_path / "store"), "s3://bucket/store"):
        done = subprocess.run([*without_extra, "pack", str(source), "-o", target], capture_output=True, text=True)
        assert (done.returncode, "pip install 'siloscope[fleet]'" in done.stderr) == (3, True)
