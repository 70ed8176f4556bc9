"""What kind of file a frame is, by its first bytes; nothing is decoded and nothing of the readers is loaded here."""

from __future__ import annotations

MAGICS: tuple[tuple[str, bytes, int], ...] = (
    ("png", b"\x89PNG\r\n\x1a\n", 0),
    ("npy", b"\x93NUMPY", 0),
    ("zip", b"PK\x03\x04", 0),
    ("ply", b"ply", 0),
    ("pcd", b"# .PCD", 0),
    ("pcd", b"VERSION", 0),
    ("tiff", b"II*\x00", 0),
    ("tiff", b"MM\x00*", 0),
    ("tiff", b"II+\x00", 0),
    ("tiff", b"MM\x00+", 0),
    ("netpbm", b"P5", 0),
    ("netpbm", b"P2", 0),
    ("netpbm", b"Pf", 0),
    ("rosbag1", b"#ROSBAG", 0),
    ("mcap", b"\x89MCAP0\r\n", 0),
    ("sqlite", b"SQLite format 3\x00", 0),
    ("mkv", b"\x1a\x45\xdf\xa3", 0),
    ("e57", b"ASTM-E57", 0),
    ("las", b"LASF", 0),
    ("exr", b"v/1\x01", 0),
    ("off", b"OFF", 0),
)
"""Name, first bytes, and where they stand."""

HEAD = 16
"""Bytes that are looked at."""


def format_of(head: bytes) -> str | None:
    """Name of a format that a frame may have; "text" for tables of points; None for what is certainly none."""
    for name, magic, at in MAGICS:
        if head[at : at + len(magic)] == magic:
            return name
    return "text" if head[:HEAD].isascii() and all(byte >= 32 or byte in b"\t\r\n" for byte in head[:HEAD]) and any(
        48 <= byte <= 57 for byte in head[:HEAD]
    ) else None  # fmt: skip
