"""Formats that are known but not read are called by their name, with one line of advice."""

from __future__ import annotations

import io
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from PIL import Image

import siloscope
from frame_files import METRES, put, xyz
from siloscope import InputError
from siloscope.io import registry

MARKED = {f"{known.name} {i}": (mark, known) for known in registry.UNREAD for i, mark in enumerate(known.magics)}
BY_ENDING = {suffix: known for known in registry.UNREAD for suffix in known.suffixes}


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        siloscope.open(path)
    return str(caught.value)


@pytest.mark.parametrize(("mark", "known"), MARKED.values(), ids=MARKED.keys())
def test_every_mark_gives_its_name_and_advice(tmp_path: Path, mark: bytes, known: registry.Known) -> None:
    told = refusal(put(tmp_path, mark + bytes(64), "frame"))
    assert told == f"{tmp_path}/frame: is {known.name}, which is not read; {known.advice}"


@pytest.mark.parametrize(("suffix", "known"), BY_ENDING.items())
def test_every_ending_gives_its_name_and_advice(tmp_path: Path, suffix: str, known: registry.Known) -> None:
    assert f"is {known.name}, which is not read; {known.advice}" in refusal(put(tmp_path, b"\1\0" * 40, f"a{suffix}"))


def zipped() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("rgbd/0.depth", b"1")
    return file.getvalue()


def matlab() -> bytes:
    file = io.BytesIO()
    scipy.io.savemat(file, {"depth": METRES})
    return file.getvalue()


def jpeg() -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.zeros((9, 9), np.uint8)).save(file, "JPEG")
    return file.getvalue()


STL = b"solid silo\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 1\n   vertex 1 0 1\n   vertex 0 1 1\n"
GENUINE = {
    "depth.mat": (matlab(), "a MATLAB file"),
    "frame.pkl": (pickle.dumps(METRES), "a Python pickle"),
    "frame": (pickle.dumps(METRES), "a Python pickle"),
    "clip.mp4": (b"\0\0\0\x20ftypisom\0\0\2\0", "a video"),
    "clip": (b"\0\0\0\x20ftypisom\0\0\2\0", "a video"),
    "mesh": (STL, "an STL mesh"),
    "capture.r3d": (zipped(), "a Record3D capture"),
    "frames.zip": (zipped(), "a ZIP archive"),
    "depth.png": (b"version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 12345 6 7\n", "a Git LFS pointer"),
    "depth.tif": (b"\n<!DOCTYPE html><html><body>1 2 3</body></html>", "a web page"),
    "picture.png": (jpeg(), "a JPEG picture"),
    "values.json": (b'{"depth": [1, 2, 3]}', "a JSON document"),
    "dump.raw": (b"\1\0" * 640, "bytes without a header"),
}


@pytest.mark.parametrize(("name", "content"), [(name, content) for name, (content, _) in GENUINE.items()])
def test_genuine_files_are_called_by_their_name(tmp_path: Path, name: str, content: bytes) -> None:
    assert GENUINE[name][1] in refusal(put(tmp_path, content, name))


@pytest.mark.parametrize("name", ["points.dat", "points.bin", "points.txt"])
def test_a_table_stays_one_whatever_its_ending(tmp_path: Path, name: str) -> None:
    with siloscope.open(put(tmp_path, xyz(), name)) as source:
        assert source.format == "xyz"


def test_advice_is_one_line_of_its_own() -> None:
    for known in (*registry.UNREAD, registry.WITHOUT_HEADER):
        assert known.name.split()[0] in ("a", "an", "bytes")
        assert known.advice
        assert "\n" not in known.advice
        assert known.magics or known.suffixes
