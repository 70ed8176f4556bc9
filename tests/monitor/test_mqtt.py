"""MQTT with a real broker: what is retained, what comes back after each of the two was killed, what is taken away."""

from __future__ import annotations

import json
import queue
import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from monitor import farm, home_assistant
from monitor.farm import Farm
from monitor.servers import eventually, serving
from siloscope.monitor.publish import discovery
from siloscope.monitor.publish.image import images
from siloscope.monitor.publish.mqtt import Mqtt, state

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")

broken = pytest.mark.skipif(MOSQUITTO is None, reason="mosquitto is not installed; `make services` installs it")


class Broker:
    """A mosquitto that keeps what is retained on its disk."""

    def __init__(self, folder: Path, *lines: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        with socket.create_server(("127.0.0.1", 0)) as sock:
            self.port = sock.getsockname()[1]
        self.config = folder / "mosquitto.conf"
        text = [f"listener {self.port} 127.0.0.1", "persistence true", f"persistence_location {folder}/"]
        text += ["autosave_on_changes true", "autosave_interval 1", "user root", *(lines or ["allow_anonymous true"])]
        self.config.write_text("\n".join(text) + "\n")
        self.start()

    def start(self) -> None:
        log = self.config.with_name("mosquitto.log").open("a")
        self.process = subprocess.Popen([str(MOSQUITTO), "-c", str(self.config)], stdout=log, stderr=log)
        eventually(self._listens)

    def _listens(self) -> bool:
        with socket.socket() as sock:
            return sock.connect_ex(("127.0.0.1", self.port)) == 0

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


class Reader:
    """Another client: keeps the newest message of each topic."""

    def __init__(self, port: int) -> None:
        self.topics: dict[str, bytes] = {}
        self.events: queue.Queue[tuple[str, bytes]] = queue.Queue()
        self.client = paho.Client(CallbackAPIVersion.VERSION2)
        self.client.on_connect = lambda client, *_: client.subscribe([("siloscope/#", 1), ("homeassistant/#", 1)])
        self.client.on_message = self._came
        self.client.reconnect_delay_set(1, 1)
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()

    def _came(self, _client: Any, _data: Any, message: Any) -> None:
        self.topics[message.topic] = message.payload
        if message.topic.endswith("/event"):
            self.events.put((message.topic, message.payload))

    def has(self, topic: str, wanted: Callable[[bytes], bool]) -> bytes:
        """The topic's message once it is wanted."""
        eventually(lambda: topic in self.topics and wanted(self.topics[topic]))
        return self.topics[topic]

    def stop(self) -> None:
        self.client.loop_stop()
        self.client.disconnect()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    made = Broker(tmp_path / "broker")
    yield made
    made.kill()


@pytest.fixture
def reader(broker: Broker) -> Iterator[Reader]:
    made = Reader(broker.port)
    yield made
    made.stop()


def entry(port: int, more: str = "") -> str:
    return f'[mqtt]\nhost = "127.0.0.1"\nport = {port}\nbox = "box1"\n{more}'


def running(folder: Path, port: int, more: str = "") -> Farm:
    service = farm.make(folder, entry(port, more) + farm.rule("mqtt"))
    farm.reading(service)
    for part in service.parts:
        part.start()
    return service


def stopped(service: Farm) -> None:
    for part in service.parts:
        part.stop()
    farm.close(service)


@pytest.mark.parametrize("tell", [discovery.by_device, discovery.by_entity])
def test_home_assistant_takes_every_message(tmp_path: Path, tell: Any) -> None:
    service = farm.make(tmp_path, silos=farm.SILOS.replace("silo8", "silo.8"))
    farm.reading(service)
    with service.store.read() as connection:
        messages = tell(discovery.Topics("box1", "homeassistant"), images(connection, service.clock.now()))
    assert len(messages) == (3 if tell is discovery.by_device else 16)
    for topic, message in messages.items():
        assert home_assistant.faults(topic, message) == []
    ids = [
        entity["unique_id"]
        for message in messages.values()
        for entity in message.get("components", {"": message}).values()
    ]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda m: m.pop("origin"), "the origin needs a name"),
        (lambda m: m["device"].pop("identifiers"), "the device needs an identifier"),
        (lambda m: m["components"]["volume"].update(unit_of_measurement="m3"), "volume: unit m3"),
        (lambda m: m["components"]["empty_by"].update(state_class="measurement"), "empty_by: state_class measurement"),
        (lambda m: m["components"]["fill"].update(colour="red"), "fill: : unknown entry colour"),
    ],
)
def test_the_check_finds_what_home_assistant_would_refuse(tmp_path: Path, change: Any, fault: str) -> None:
    service = farm.make(tmp_path)
    with service.store.read() as connection:
        messages = discovery.by_device(discovery.Topics("b", "ha"), images(connection, service.clock.now()))
    message = json.loads(json.dumps(messages["ha/device/b_silo7/config"]))
    change(message)
    assert fault in home_assistant.faults("ha/device/b_silo7/config", message)


def test_an_old_answer_is_null_and_unavailable(tmp_path: Path) -> None:
    service = farm.make(tmp_path, entry(1))
    farm.reading(service)
    mqtt = service.parts[0]
    assert isinstance(mqtt, Mqtt)
    assert mqtt.wanted()["siloscope/box1/silo7/status"] == "online"
    service.clock.time += farm.LATE
    wanted = mqtt.wanted()
    assert wanted["siloscope/box1/silo7/status"] == wanted["siloscope/box1/silo8/status"] == "offline"
    told = json.loads(wanted["siloscope/box1/silo7/state"])
    assert (told["volume_m3"], told["fill_percent"], told["status"], told["problem"]) == (None, None, "silent", "ON")
    assert told["time"] == "2026-12-31T12:00:01.000Z"
    with service.store.read() as connection:
        assert state(images(connection, service.clock.now())[1])["seq"] is None


@broken
def test_states_devices_and_alerts_come_and_are_kept(tmp_path: Path, broker: Broker, reader: Reader) -> None:
    service = running(tmp_path / "service", broker.port)
    reader.has("siloscope/box1/status", lambda body: body == b"online")
    told = json.loads(reader.has("siloscope/box1/silo7/state", bool))
    assert (told["volume_m3"], told["volume_std_m3"], told["fill_percent"], told["mass_kg"]) == (
        10.0,
        0.1,
        50.0,
        7700.0,
    )
    device = json.loads(reader.has("homeassistant/device/box1_silo7/config", bool))
    assert device["components"]["volume"]["expire_after"] == 7200
    number = farm.reading(service, fill=0.1)
    farm.look(service)
    topic, event = reader.events.get(timeout=60)
    assert topic == "siloscope/box1/silo7/event"
    assert (json.loads(event)["event"], json.loads(event)["kind"]) == ("firing", "low")
    reader.has("siloscope/box1/silo7/state", lambda body: json.loads(body)["seq"] == number and b"low" in body)
    late = Reader(broker.port)
    assert json.loads(late.has("siloscope/box1/silo7/state", bool))["problem"] == "ON"
    assert "siloscope/box1/silo7/event" not in late.topics
    late.stop()
    stopped(service)
    reader.has("siloscope/box1/status", lambda body: body == b"offline")


@broken
def test_home_assistants_birth_has_all_told_again(tmp_path: Path, broker: Broker, reader: Reader) -> None:
    service = running(tmp_path / "service", broker.port)
    topic = "homeassistant/device/box1_silo7/config"
    reader.has(topic, bool)
    reader.topics.clear()
    reader.client.publish("homeassistant/status", "online")
    reader.has(topic, bool)
    reader.has("siloscope/box1/silo7/state", bool)
    stopped(service)


@broken
def test_a_killed_broker_gets_all_of_it_again(tmp_path: Path, broker: Broker, reader: Reader) -> None:
    service = running(tmp_path / "service", broker.port)
    reader.has("siloscope/box1/silo7/state", bool)
    broker.kill()
    farm.reading(service, fill=0.1)
    farm.look(service)
    time.sleep(1)
    (broker.config.parent / "mosquitto.db").unlink(missing_ok=True)
    reader.topics.clear()
    broker.start()
    told = json.loads(reader.has("siloscope/box1/silo7/state", bool))
    assert told["volume_m3"] == pytest.approx(2.0)
    reader.has("homeassistant/device/box1_silo7/config", bool)
    reader.has("siloscope/box1/status", lambda body: body == b"online")
    service.clock.time += 60 * 1_000_000  # what failed meanwhile is due
    assert json.loads(reader.events.get(timeout=60)[1])["event"] == "firing"
    stopped(service)


@broken
def test_a_killed_service_is_offline(tmp_path: Path, broker: Broker, reader: Reader) -> None:
    site = tmp_path / "SITE.toml"
    site.write_text(farm.SILOS + entry(broker.port))
    with serving(tmp_path / "data", site) as server:
        reader.has("siloscope/box1/status", lambda body: body == b"online")
        server.kill()
        reader.has("siloscope/box1/status", lambda body: body == b"offline")


@broken
def test_a_removed_silo_leaves_nothing_behind_even_after_a_restart(
    tmp_path: Path, broker: Broker, reader: Reader
) -> None:
    service = running(tmp_path / "service", broker.port)
    reader.has("siloscope/box1/silo8/state", bool)
    stopped(service)
    without = farm.SILOS.replace('[[silo]]\nid = "silo8"\nmodbus_unit = 8\n', "")
    without = without.replace('[[camera]]\nid = "cam8"\nsilo = "silo8"\n', "")
    service = farm.make(tmp_path / "service", entry(broker.port), silos=without)
    farm.gone(service, "silo8")
    for part in service.parts:
        part.start()
    for topic in (
        "homeassistant/device/box1_silo8/config",
        "siloscope/box1/silo8/state",
        "siloscope/box1/silo8/status",
    ):
        reader.has(topic, lambda body: body == b"")
    assert reader.topics["homeassistant/device/box1_silo7/config"] != b""
    stopped(service)


def certificates(folder: Path) -> Path:
    """A certificate of 127.0.0.1 by itself."""
    folder.mkdir(parents=True, exist_ok=True)
    command = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=127.0.0.1"]
    command += [
        "-addext",
        "subjectAltName=IP:127.0.0.1",
        "-keyout",
        str(folder / "key.pem"),
        "-out",
        str(folder / "cert.pem"),
    ]
    subprocess.run(command, check=True, capture_output=True)
    return folder


@broken
@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed")
def test_tls_and_password_are_asked_for_and_given(tmp_path: Path) -> None:
    folder = certificates(tmp_path / "broker")
    passwords = folder / "passwords"
    passwords.touch(mode=0o600)
    subprocess.run(["mosquitto_passwd", "-b", str(passwords), "farm", "a password"], check=True, capture_output=True)
    lines = [
        f"certfile {folder}/cert.pem",
        f"keyfile {folder}/key.pem",
        f"password_file {passwords}",
        "allow_anonymous false",
    ]
    broker = Broker(folder, *lines)
    try:
        (tmp_path / "service").mkdir()
        (tmp_path / "service" / "password").write_text("a password\n")
        shutil.copy(folder / "cert.pem", tmp_path / "service" / "ca.pem")
        more = 'tls = true\nusername = "farm"\npassword_file = "password"\nca_file = "ca.pem"\n'
        service = running(tmp_path / "service", broker.port, more)
        client = paho.Client(CallbackAPIVersion.VERSION2)
        client.username_pw_set("farm", "a password")
        client.tls_set_context(ssl.create_default_context(cafile=str(folder / "cert.pem")))
        came: queue.Queue[bytes] = queue.Queue()
        client.on_connect = lambda connected, *_: connected.subscribe("siloscope/box1/status", 1)
        client.on_message = lambda _client, _data, message: came.put(bytes(message.payload))
        client.connect("127.0.0.1", broker.port)
        client.loop_start()
        assert came.get(timeout=20) == b"online"
        client.loop_stop()
        stopped(service)
    finally:
        broker.kill()
