"""On which file system a folder lies: a database on a network share is lost sooner or later."""

from __future__ import annotations

from pathlib import Path

from siloscope.errors import UsageError

NETWORK = frozenset(
    ("nfs", "nfs4", "cifs", "smb3", "smbfs", "9p", "afs", "ceph", "glusterfs", "fuse.sshfs", "fuse.glusterfs",
     "fuse.rclone", "fuse.s3fs", "lustre", "ncpfs", "davfs")
)  # fmt: skip
"""Their locks and flushes keep no promise."""

MOUNTS = Path("/proc/self/mounts")


def kind_of(folder: Path, mounts: Path = MOUNTS) -> str | None:
    """The file system's kind of a folder; None where the system does not tell."""
    try:
        lines = [line.split() for line in mounts.read_text("utf-8", "replace").splitlines()]
    except OSError:
        return None
    place = folder.absolute().resolve()
    over = [(Path(line[1].replace("\\040", " ")), line[2]) for line in lines if len(line) > 2]
    holding = [(len(point.parts), kind) for point, kind in over if place.is_relative_to(point)]
    return max(holding, default=(0, None), key=lambda found: found[0])[1]


def refuse_network(folder: Path, mounts: Path = MOUNTS) -> None:
    """Raises `UsageError` for a folder on a network file system."""
    kind = kind_of(folder, mounts)
    if kind in NETWORK:
        raise UsageError(
            f"{folder}: is on a network file system ({kind}), whose locks and flushes can't be relied on; "
            "put --data on a disk of this machine, or use --database with PostgreSQL"
        )
