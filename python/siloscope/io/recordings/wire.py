"""The fields of ROS messages one after the other: ROS 1 serialisation and CDR (ROS 2).

Every read is checked against what is left, before anything is allocated. Of the formats only what depth recordings
use is here; the layouts of the messages are in `ros_messages`.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from siloscope.errors import InputError

Buffer = bytes | memoryview


class Header(NamedTuple):
    """``std_msgs/Header``: time of the measurement in seconds, and the frame it is in."""

    stamp: float
    frame_id: str


class Wire:
    """A message being read in ROS 1 serialisation: packed, little-endian, strings without a closing zero."""

    order = "<"

    def __init__(self, data: Buffer) -> None:
        self.data = memoryview(data)
        self.at = 0

    @property
    def left(self) -> int:
        """Bytes not read yet."""
        return len(self.data) - self.at

    def take(self, count: int, align: int = 1) -> memoryview:
        """The next `count` bytes; `align` is the size of the elements, for encodings that pad."""
        self._pad(align)
        if count > self.left:
            raise InputError(f"message ends {count - self.left} bytes early")
        part = self.data[self.at : self.at + count]
        self.at += count
        return part

    def _pad(self, align: int) -> None:
        """ROS 1 does not pad."""

    def _number(self, code: str, size: int) -> int:
        number: int = struct.unpack(self.order + code, self.take(size, size))[0]
        return number

    def u8(self) -> int:
        """One ``uint8`` or ``bool``."""
        return self._number("B", 1)

    def u16(self) -> int:
        """One ``uint16``."""
        return self._number("H", 2)

    def u32(self) -> int:
        """One ``uint32``."""
        return self._number("I", 4)

    def u64(self) -> int:
        """One ``uint64``."""
        return self._number("Q", 8)

    def f32(self) -> float:
        """One ``float32``."""
        return float(struct.unpack(self.order + "f", self.take(4, 4))[0])

    def floats(self, count: int, size: int = 8) -> NDArray[np.float64]:
        """`count` numbers of ``float32`` (size 4) or ``float64``, as float64 array (count,)."""
        part = self.take(count * size, size if count else 1)
        return np.frombuffer(part, dtype=f"{self.order}f{size}").astype(np.float64)

    def f64s(self) -> NDArray[np.float64]:
        """A counted sequence of ``float64``."""
        return self.floats(self.u32())

    def blob(self) -> memoryview:
        """A counted sequence of bytes."""
        return self.take(self.u32())

    def string(self) -> str:
        """A string; bytes that are no UTF-8 become marks."""
        return bytes(self.take(self.u32())).decode("utf-8", "replace")

    def header(self) -> Header:
        """``std_msgs/Header`` with its sequence number."""
        self.u32()
        return Header(self.u32() + self.u32() * 1e-9, self.string())


class Cdr(Wire):
    """A message in CDR: numbers padded to their own size, strings closed by a zero, no sequence number."""

    def __init__(self, data: Buffer) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise InputError("message is not in plain CDR")
        super().__init__(memoryview(data)[4:])
        self.order = "<" if data[1] == 1 else ">"

    def _pad(self, align: int) -> None:
        self.at += -self.at % align

    def string(self) -> str:
        """A string without its closing zero."""
        return super().string().removesuffix("\0")

    def header(self) -> Header:
        """``std_msgs/msg/Header``; its seconds are signed."""
        seconds = struct.unpack(self.order + "i", self.take(4, 4))[0]
        return Header(seconds + self.u32() * 1e-9, self.string())
