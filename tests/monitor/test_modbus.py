"""The registers as a controller reads them: by pymodbus, by mbpoll, and by somebody who sends rubbish."""

from __future__ import annotations

import math
import random
import re
import shutil
import socket
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import pytest
from pymodbus.client import ModbusTcpClient

from monitor import farm
from monitor.farm import Farm
from siloscope.errors import UsageError
from siloscope.monitor.publish.modbus import QUALITY, Modbus

MODBUS = "[modbus]\nport = 0\n"


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Farm]:
    made = farm.make(tmp_path, MODBUS)
    farm.reading(made)
    farm.forecast(made)
    server(made).start()
    yield made
    server(made).stop()
    farm.close(made)


def server(service: Farm) -> Modbus:
    found = service.parts[0]
    assert isinstance(found, Modbus)
    return found


@pytest.fixture
def client(service: Farm) -> Iterator[ModbusTcpClient]:
    with ModbusTcpClient("127.0.0.1", port=server(service).port, timeout=10) as connected:
        yield connected


def read(
    client: ModbusTcpClient, kind: str, first: int, count: int = 2, *, unit: int = 7, swapped: bool = False
) -> Any:
    found = client.read_holding_registers(first, count=count, device_id=unit)
    assert not found.isError(), found
    order: Literal["little", "big"] = "little" if swapped else "big"
    return client.convert_from_registers(found.registers, getattr(client.DATATYPE, kind), word_order=order)


def test_a_level_transmitters_registers_have_its_order(client: ModbusTcpClient) -> None:
    values = read(client, "FLOAT32", 0, 22)
    assert values[:3] == [4.0, 3.5, 4.5]
    assert values[3:5] == [50.0, 12.0]
    assert all(math.isnan(value) for value in values[5:8])
    assert values[8:] == pytest.approx([3.0, 0.77, 7700.0])
    assert read(client, "UINT32", 22) == 4711
    assert read(client, "STRING", 24) == "ilo7"


def test_our_registers_say_more(client: ModbusTcpClient, service: Farm) -> None:
    values = read(client, "FLOAT32", 100, 22)
    assert values == pytest.approx([10.0, 0.1, 10.0, 50.0, 7700.0, 100.0, 2.5, 3.5, 3.2, 0.9, 3.0])
    now = service.clock.now() // 1_000_000
    assert read(client, "UINT32", 122, 6) == [now, now + 3 * 86_400, 0]
    assert read(client, "UINT16", 128, 2) == [0, 0]


@pytest.mark.parametrize(("first", "count", "kind"), [(0, 22, "FLOAT32"), (100, 22, "FLOAT32"), (122, 6, "UINT32")])
def test_both_word_orders_say_the_same(client: ModbusTcpClient, first: int, count: int, kind: str) -> None:
    high, low = (read(client, kind, base + first, count, swapped=base > 0) for base in (0, 1000))
    assert high == pytest.approx(low, nan_ok=True)
    assert read(client, "STRING", 1024) == "ilo7"


def test_an_old_answer_is_no_number(client: ModbusTcpClient, service: Farm) -> None:
    service.clock.time += farm.LATE
    server(service).made = -math.inf
    assert all(math.isnan(value) for value in read(client, "FLOAT32", 0, 22) + read(client, "FLOAT32", 100, 22))
    assert read(client, "UINT16", 128, 1) == 3
    assert read(client, "UINT32", 126) == farm.LATE // 1_000_000


def test_remarks_are_bits(client: ModbusTcpClient, service: Farm) -> None:
    farm.reading(service, time=service.clock.now() + 1, quality=[{"code": "lens-film"}, {"code": "rathole"}])
    server(service).made = -math.inf
    assert read(client, "UINT16", 129, 1) == 1 << QUALITY.index("lens-film") | 1 << QUALITY.index("rathole")


def test_a_silo_without_a_reading_is_silent(client: ModbusTcpClient) -> None:
    assert math.isnan(read(client, "FLOAT32", 100, unit=8))
    assert read(client, "UINT32", 122, 6, unit=8) == [0xFFFF_FFFF] * 3
    assert read(client, "UINT16", 128, 1, unit=8) == 3


def test_what_cannot_be_is_refused_by_its_code(client: ModbusTcpClient) -> None:
    assert client.write_register(0, 1, device_id=7).exception_code == 1
    assert client.write_coils(0, [True], device_id=7).exception_code == 1
    assert client.read_coils(0, count=1, device_id=7).exception_code == 1
    assert client.read_holding_registers(26, count=1, device_id=7).exception_code == 2
    assert client.read_input_registers(25, count=2, device_id=7).exception_code == 2
    assert client.read_holding_registers(0, count=2, device_id=9).exception_code == 11
    assert not client.read_input_registers(0, count=26, device_id=7).isError()


@pytest.mark.parametrize("count", [0, 126, 65_535])
def test_a_wrong_count_is_refused(service: Farm, count: int) -> None:
    assert server(service).answer(7, struct.pack(">BHH", 3, 0, count)) == b"\x83\x03"


def test_rubbish_ends_a_connection_and_nothing_else(client: ModbusTcpClient, service: Farm) -> None:
    noise = random.Random(7)
    for _ in range(100):
        with socket.create_connection(("127.0.0.1", server(service).port), timeout=10) as sock:
            sock.sendall(noise.randbytes(noise.randrange(1, 300)))
    assert read(client, "UINT32", 22) == 4711


@pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not installed; `make services` installs it")
def test_a_foreign_client_reads_the_same(service: Farm) -> None:
    """Its addresses begin at 1, as a manual's 40001."""
    command = ["mbpoll", "-m", "tcp", "-p", str(server(service).port), "-a", "7", "-1", "-B", "-t", "4:float"]
    done = subprocess.run([*command, "-r", "101", "-c", "4", "127.0.0.1"], capture_output=True, text=True, check=True)
    values = [line.split("\t")[-1].strip() for line in done.stdout.splitlines() if line.startswith("[")]
    assert [float(value) for value in values] == pytest.approx([10.0, 0.1, 10.0, 50.0])


def test_the_documented_addresses_are_those_that_answer(client: ModbusTcpClient) -> None:
    """The table in `integrator.md` has both ways of counting, one apart, and both orders hold its numbers."""
    text = (Path(__file__).parents[2] / "docs" / "monitor" / "integrator.md").read_text("utf-8")
    rows = re.findall(r"^\| ([\d, ]+) \| (4[\d, ]+) \| (float32|uint32|uint16|4 characters) \|", text, re.MULTILINE)
    kinds = {"float32": "FLOAT32", "uint32": "UINT32", "uint16": "UINT16", "4 characters": "STRING"}
    known = 0
    for addresses, counted, kind in rows:
        for address, other in zip(addresses.split(","), counted.split(","), strict=True):
            assert int(other) == 40_001 + int(address)
            length = 1 if kind == "uint16" else 2
            high = read(client, kinds[kind], int(address), length)
            low = read(client, kinds[kind], 1000 + int(address), length, swapped=kind.endswith("32"))
            assert high == low or (math.isnan(high) and math.isnan(low))
            known += 1
    assert known == 29


def test_a_taken_port_is_told_at_the_start(service: Farm, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="modbus"):
        farm.make(tmp_path / "second", f"[modbus]\nport = {server(service).port}\n")
