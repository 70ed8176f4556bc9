"""Recordings packed whole by Zstandard, as ``ros2 bag record --compression-mode file`` does: unpacked to disk."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Callable
from pathlib import Path

from siloscope.errors import InputError
from siloscope.io.recordings.containers import mcap, rosbag1, sqlite_bag
from siloscope.io.recordings.dialects import source
from siloscope.io.recordings.recording import Entry, Recording, Topic
from siloscope.io.recordings.wire import Wire
from siloscope.io.source import Format, FrameSource, Options

MAGIC = b"\x28\xb5\x2f\xfd"
SUFFIXES = (".zstd", ".zst")
_CONTAINERS: dict[bytes, tuple[str, Callable[[Path], Recording]]] = {
    mcap.MAGIC: ("mcap", mcap.Mcap),
    sqlite_bag.MAGIC: ("db3", sqlite_bag.SqliteBag),
    rosbag1.MAGIC: ("bag", rosbag1.Rosbag1),
}
"""What may be packed, by what it begins with."""
_STEP = 1 << 20
_MOST_RATIO = 1032
"""How many times larger the content may be: deflate, too, makes no more of depth."""
_ROOM = 16 << 20
"""Bytes that any content may have, and that stay free on the disk."""


class Packed(Recording):
    """A recording in a packed file; it is unpacked into a temporary folder, which goes when it is closed.

    Attributes
    ----------
    form : str
        Name of the container.

    Raises
    ------
    InputError
        Where the file is damaged, holds no recording, or is larger than the disk has room for.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        folder = Path(tempfile.mkdtemp(prefix="siloscope-"))
        self._remove = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        plain = folder / "recording"
        try:
            _unpack(path, plain)
            self.form, self.inner = _opened(path, plain)
        except InputError as error:
            self._remove()
            raise InputError(str(error).replace(str(plain), self.name)) from None
        except BaseException:
            self._remove()
            raise
        self.inner.name = self.name
        self.topics = self.inner.topics
        self.damage = self.inner.damage and self.inner.damage.replace(str(plain), self.name)

    def read(self, topic: Topic, entry: Entry) -> Wire:
        """One message."""
        return self.inner.read(topic, entry)

    def close(self) -> None:
        """Lets go of the file, and of what was unpacked."""
        self.inner.close()
        self._remove()


def _opened(path: Path, plain: Path) -> tuple[str, Recording]:
    with plain.open("rb") as file:
        head = file.read(max(map(len, _CONTAINERS)))
    for magic, (form, container) in _CONTAINERS.items():
        if head.startswith(magic):
            return form, container(plain)
    raise InputError(f"{path}: holds no recording; unpack it: zstd -d {path.name}")


def _unpack(path: Path, plain: Path) -> None:
    from siloscope.io import zstandard

    most = path.stat().st_size * _MOST_RATIO + _ROOM
    free = shutil.disk_usage(plain.parent).free - _ROOM
    have = 0
    try:
        with plain.open("wb") as file:
            for part in zstandard.steps(path, _STEP):
                have += len(part)
                if have > min(most, free):
                    why = "which depth does not" if have > most else "more than the disk has room for"
                    raise InputError(f"{path}: unpacks to more than {have >> 20} MB, {why}; check the file")
                file.write(part)
    except EOFError:
        return  # what there is of it is read as of any recording whose end is missing
    except zstandard.DamagedError as error:
        raise InputError(f"{path}: damaged Zstandard file ({error}); copy it again") from None


def _open(path: Path, options: Options) -> FrameSource:
    recording = Packed(path)
    return source(path, f"{recording.form}, packed", options, recording)


FORMAT = Format("zstd", lambda head, path: head.startswith(MAGIC), _open)
