"""Formats that are known by name but not read: what they are, and one line of advice each."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple


class Known(NamedTuple):
    """A format that is not read."""

    name: str
    """With its article: ``a MATLAB file``."""
    advice: str
    """What to do instead."""
    magics: tuple[bytes, ...] = ()
    """What such files begin with."""
    suffixes: tuple[str, ...] = ()
    """Endings, in lower case, of kinds whose content has no mark of its own."""


_EXPORT = "export the points as PLY or PCD"
_UNPACK = "unpack it and give what is inside"
_PICTURE = "distances are lost in pictures; save the depth as 16-bit grey PNG or TIFF"
_ARRAY = "save the depth array with numpy.save"

_VIDEO = Known(
    "a video",
    "distances are lost in videos; record the depth stream itself",
    suffixes=(".mp4", ".mov", ".m4v", ".avi", ".h264", ".h265"),
)

UNREAD: tuple[Known, ...] = (
    Known("a Git LFS pointer, not the file itself", "fetch the file with: git lfs pull", (b"version https://git-lfs",)),
    Known(
        "a web page",
        "the download went wrong; download the file itself",
        (b"<!DOCTYPE html", b"<!doctype html", b"<html"),
    ),
    Known("a Record3D capture", "export EXR and RGB or a PLY sequence from the app", suffixes=(".r3d",)),
    Known("a ZED recording", "export depth as 16-bit PNG with the ZED SDK's SVO export", suffixes=(".svo", ".svo2")),
    Known(
        "a ScanNet sensor file",
        "take the depth out with ScanNet's SensReader (--export_depth_images)",
        suffixes=(".sens",),
    ),
    Known("a Zivid frame", "export it as PLY or PCD from Zivid Studio", suffixes=(".zdf",)),
    Known("a Photoneo scan", "export it as PLY from PhoXi Control", suffixes=(".praw",)),
    Known("a Kinect Studio recording", "save the depth as 16-bit PNG from Kinect Studio", suffixes=(".xef", ".xrf")),
    Known(
        "a scan of a terrestrial scanner",
        "export it as E57 from the scanner's own program",
        suffixes=(".fls", ".lsproj", ".zfs", ".rcp", ".rcs", ".clr", ".cl3", ".rdbx", ".dp"),
    ),
    Known("a Potree cloud", "give the LAS or LAZ it was made from", suffixes=(".hrc",)),
    Known("an OpenNI recording", "play it with OpenNI2 and save the depth as 16-bit PNG", (b"NI10",), (".oni",)),
    Known(
        "a Rerun recording", "save the depth where it is logged, as 16-bit PNG or .npy", (b"RRF", b"RRIO"), (".rrd",)
    ),
    Known(
        "a network capture",
        "let the lidar's own program turn it into PCD or LAS",
        (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d", b"\n\r\r\n"),
    ),
    Known(
        "a MATLAB file",
        "in MATLAB: imwrite(uint16(depth), 'depth.png'); in Python: scipy.io.loadmat and numpy.save",
        (b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"),
    ),
    Known("an HDF5 file", f"open it with h5py and {_ARRAY}", (b"\x89HDF\r\n\x1a\n",), (".h5", ".hdf5")),
    Known(
        "a Python pickle",
        f"reading one can run code; {_ARRAY}",
        (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05"),
        (".pkl", ".pickle"),
    ),
    Known("a Parquet table", "write it as CSV with the columns x, y, z", (b"PAR1",)),
    Known("an Arrow table", "write it as CSV with the columns x, y, z", (b"ARROW1",)),
    Known("a ROS 1 bag of version 1", "bring it to version 2.0 with: rosbag fix", (b"#ROSBAG V1", b"#ROSRECORD")),
    Known("a glTF model", _EXPORT, (b"glTF",), (".gltf", ".glb")),
    Known("an STL mesh", "save its vertices as PLY", (b"solid ",), (".stl",)),
    Known("an FBX model", _EXPORT, (b"Kaydara FBX",), (".fbx",)),
    Known("a USD scene", _EXPORT, (b"PXR-USDC", b"#usda"), (".usdz", ".usd", ".usda")),
    Known("a Draco cloud", _EXPORT, (b"DRACO",), (".drc",)),
    Known("a drawing", _EXPORT, (b"AC10",), (".dxf", ".dwg", ".3ds", ".step", ".stp", ".iges")),
    Known("a JPEG picture", _PICTURE, (b"\xff\xd8\xff",)),
    Known("a GIF picture", _PICTURE, (b"GIF8",)),
    Known("a BMP picture", _PICTURE, (b"BM",)),
    Known("a colour picture (PPM)", _PICTURE, (b"P6\n", b"P6 ", b"P3\n", b"P3 ", b"P4\n", b"P1\n")),
    Known("a PSD picture", _PICTURE, (b"8BPS",)),
    Known("a video or picture in a RIFF file", _PICTURE, (b"RIFF",)),
    _VIDEO,
    Known("a PDF document", "give the depth frame itself", (b"%PDF",)),
    Known("a gzip file", f"{_UNPACK}: gunzip", (b"\x1f\x8b",)),
    Known("a bzip2 file", f"{_UNPACK}: bunzip2", (b"BZh",)),
    Known("an xz file", f"{_UNPACK}: unxz", (b"\xfd7zXZ\0",)),
    Known("an LZ4 file", f"{_UNPACK}: lz4 -d", (b"\x04\x22\x4d\x18",)),
    Known("a 7z archive", _UNPACK, (b"7z\xbc\xaf\x27\x1c",)),
    Known("a RAR archive", _UNPACK, (b"Rar!",)),
    Known("a ZIP archive", _UNPACK, (b"PK\x03\x04", b"PK\x05\x06")),
    Known("a tar archive", _UNPACK, suffixes=(".tar",)),
    Known("a JSON document", "it has no frame; give a camera file as the camera", (b"{", b"[{")),
    Known("an XML document", "it has no frame; give a camera file as the camera", (b"<?xml",)),
    Known(
        "a YAML document",
        "it has no frame; give a camera file as the camera",
        (b"%YAML",),
        (".yaml", ".yml"),
    ),
)
"""In the order in which they are asked; a longer mark stands before a shorter one that it begins with."""


WITHOUT_HEADER = Known(
    "bytes without a header",
    "nothing tells size and type; save them as PNG, TIFF or .npy, or lay the Viewer's …_metadata.csv beside",
    suffixes=(".raw", ".bin", ".dat", ".depth"),
)

_SURE = 3
"""Bytes of a mark that a text does not have by chance."""


def unread(head: bytes, path: Path) -> Known | None:
    """The format that a file's beginning or ending shows, of those that are not read."""
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n")
    is_text = b"\0" not in head
    for known in UNREAD:
        marks = tuple(mark for mark in known.magics if len(mark) >= _SURE or not is_text or mark in (b"{", b"[{"))
        if start.startswith(marks) or head.startswith(marks) or path.suffix.lower() in known.suffixes:
            return known
    return _VIDEO if head[4:8] == b"ftyp" else None


def without_header(head: bytes, path: Path) -> Known | None:
    """What a file without any mark is by its ending."""
    return WITHOUT_HEADER if path.suffix.lower() in WITHOUT_HEADER.suffixes else None
