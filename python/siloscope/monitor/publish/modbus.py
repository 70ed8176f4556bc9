"""Modbus TCP for controllers: a server that only reads out, a silo a unit.

Registers 0-25 have the order of Rosemount's 5708 (manual 00809-0100-4570, table B-1), registers 100-129 are ours;
from 1000 on both come again with the words of every number swapped. Numbers are big-endian float32 unless said
otherwise. An answer that is too old is NaN, never an old number.
"""

from __future__ import annotations

import asyncio
import math
import socket
import struct
import time

from siloscope.errors import UsageError
from siloscope.monitor.clock import SECOND
from siloscope.monitor.outlets import ModbusEntry
from siloscope.monitor.publish.asynchronous import AsyncPart
from siloscope.monitor.publish.image import STATUSES, Image, images
from siloscope.monitor.service import Service
from siloscope.reasons import CONTENT_REMARKS

SWAPPED = 1000
"""Where the registers with swapped words begin."""

OURS = 100

MOST = 125
"""Registers of one request."""

FUNCTION, ADDRESS, VALUE, NO_UNIT = 1, 2, 3, 11
"""Exception codes."""

IDLE_S, KEPT_S = 120.0, 1.0
"""A connection without a request for so long is closed; the registers are made anew so often."""

UNKNOWN = 0xFFFF_FFFF
"""Of an unsigned number."""

QUALITY = tuple(CONTENT_REMARKS)[:16]
"""Remarks by the bit of register 129, the lowest first."""

MASS = {"kg": 1.0, "t": 1e-3, "lb": 1.0 / 0.45359237}

Words = dict[int, int]


class Modbus(AsyncPart):
    """The server; it listens from the beginning."""

    def __init__(self, service: Service, entry: ModbusEntry) -> None:
        super().__init__("modbus")
        self._service, self._entry = service, entry
        try:
            self._socket = socket.create_server((entry.host, entry.port))
        except OSError as error:
            raise UsageError(
                f"[modbus] {entry.host}:{entry.port}: {error.strerror}; give another port (ports below 1024 need "
                "the right to take them)"
            ) from None
        self.port: int = self._socket.getsockname()[1]
        self._units: dict[int, Words] = {}
        self.made = -math.inf

    async def main(self) -> None:
        """Serves until it is cancelled."""
        async with await asyncio.start_server(self._serve, sock=self._socket) as server:
            await server.serve_forever()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                head = await asyncio.wait_for(reader.readexactly(7), IDLE_S)
                transaction, protocol, length, unit = struct.unpack(">HHHB", head)
                if protocol != 0 or not 2 <= length <= 254:
                    return
                body = await asyncio.wait_for(reader.readexactly(length - 1), IDLE_S)
                answer = self.answer(unit, body)
                writer.write(struct.pack(">HHHB", transaction, 0, len(answer) + 1, unit) + answer)
                await writer.drain()
        except (asyncio.IncompleteReadError, TimeoutError, ConnectionError):
            return
        finally:
            writer.close()

    def answer(self, unit: int, request: bytes) -> bytes:
        """What a unit answers to a request, both without their heads."""
        function = request[0]
        if function not in (3, 4):
            return _refused(function, FUNCTION)
        if len(request) != 5:
            return _refused(function, VALUE)
        first, count = struct.unpack(">HH", request[1:])
        if not 1 <= count <= MOST:
            return _refused(function, VALUE)
        words = self._registers().get(unit)
        if words is None:
            return _refused(function, NO_UNIT)
        try:
            found = [words[number] for number in range(first, first + count)]
        except KeyError:
            return _refused(function, ADDRESS)
        return struct.pack(f">BB{count}H", function, 2 * count, *found)

    def _registers(self) -> dict[int, Words]:
        if time.monotonic() - self.made > KEPT_S:
            with self._service.store.read() as connection:
                found = images(connection, self._service.clock.now())
            self._units = {
                image.silo.modbus_unit: registers(image, self._entry)
                for image in found
                if image.silo.modbus_unit is not None
            }
            self.made = time.monotonic()
        return self._units


def _refused(function: int, code: int) -> bytes:
    return bytes((function & 0x7F | 0x80, code))


def registers(image: Image, entry: ModbusEntry) -> Words:
    """All registers of a silo by their number."""
    numbers = _of_the_5708(image, entry) | _ours(image)
    words: Words = {}
    for number, data in numbers.items():
        high, low = struct.unpack(">HH", data)
        words[number], words[number + 1] = high, low
        words[SWAPPED + number], words[SWAPPED + number + 1] = low, high
    for base in (0, SWAPPED):  # text and single words have no order to swap
        words[base + 24], words[base + 25] = struct.unpack(">HH", _tag(image))
        words[base + OURS + 28] = STATUSES.index(image.status)
        words[base + OURS + 29] = sum(1 << QUALITY.index(code) for code in set(image.codes) if code in QUALITY)
    return words


def _of_the_5708(image: Image, entry: ModbusEntry) -> dict[int, bytes]:
    fill, density, mass = (_fresh(image, name) for name in ("fill", "density", "mass"))
    floats = {
        0: _fresh(image, "distance"),
        2: _fresh(image, "distance_min"),
        4: _fresh(image, "distance_max"),
        6: None if fill is None else 100.0 * fill * entry.volume_scale,
        8: None if fill is None else 4.0 + 16.0 * min(1.0, max(0.0, fill)),
        10: None,
        12: None,
        14: None,
        16: _fresh(image, "level"),
        18: None if density is None else density / 1000.0,
        20: None if mass is None else mass * MASS[entry.mass_unit],
    }
    return {number: _float(value) for number, value in floats.items()} | {22: _unsigned(image.silo.serial)}


def _ours(image: Image) -> dict[int, bytes]:
    fill, volume, capacity = (_fresh(image, name) for name in ("fill", "volume", "capacity"))
    floats = (
        volume,
        _fresh(image, "volume_std"),
        None if volume is None or capacity is None else capacity - volume,
        None if fill is None else 100.0 * fill,
        *(_fresh(image, name) for name in ("mass", "mass_std", "level_min", "level_max", "level_axis", "coverage")),
        image.days_left,
    )
    times = (None if image.last is None else image.last.time, image.empty_by, image.age)
    found = {OURS + 2 * place: _float(value) for place, value in enumerate(floats)}
    return found | {
        OURS + 22 + 2 * place: _unsigned(None if value is None else value // SECOND)
        for place, value in enumerate(times)
    }


def _fresh(image: Image, name: str) -> float | None:
    return getattr(image.last, name) if image.fresh else None


def _float(value: float | None) -> bytes:
    return struct.pack(">f", math.nan if value is None else value)


def _unsigned(value: int | None) -> bytes:
    return struct.pack(">I", UNKNOWN if value is None else min(max(0, value), UNKNOWN))


def _tag(image: Image) -> bytes:
    """The end of the silo's id: its beginning is often that of all silos."""
    return str(image.silo.id)[-4:].rjust(4).encode("ascii", "replace")
