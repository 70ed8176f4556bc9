"""MQTT: what is in every silo now, retained; alerts as they come; Home Assistant's devices.

A broker keeps the newest state and no history: whoever needs every reading asks the HTTP interface.
"""

from __future__ import annotations

import asyncio
import json
import random
import ssl
from concurrent.futures import CancelledError as Cancelled
from pathlib import Path
from typing import Any

import aiomqtt

from siloscope.errors import InputError
from siloscope.monitor.clock import iso
from siloscope.monitor.outbox import Delivery, NotDelivered
from siloscope.monitor.outlets import MQTT, MqttEntry, secret
from siloscope.monitor.publish import discovery, messages
from siloscope.monitor.publish.asynchronous import AsyncPart
from siloscope.monitor.publish.discovery import OFFLINE, ONLINE, Topics
from siloscope.monitor.publish.image import Image, images
from siloscope.monitor.service import Service
from siloscope.monitor.store import places

LOOK_S = 1.0
"""How often silos are looked at."""

FIRST_WAIT_S, LAST_WAIT_S = 0.5, 60.0
"""Between attempts to connect; doubled each time."""

DELIVER_S = 15.0

KEEP_ALIVE_S = 20
"""The broker publishes the last will when it has heard nothing for one and a half times that."""

ANNOUNCED = "mqtt_topics"
"""The fact that holds which retained topics there are, so that those of a removed silo are emptied in the end."""


class _Followed(OSError):
    """Another process has taken over: the connection ends without a word."""


class Mqtt(AsyncPart):
    """Publishes while it is connected, connects while its process leads; a channel for alerts too."""

    name = MQTT

    def __init__(self, service: Service, entry: MqttEntry, site: Path) -> None:
        super().__init__("mqtt")
        self._service, self._entry = service, entry
        self._password = secret(site, entry.password_file)
        self._tls = _tls(entry, site)
        with service.store.read() as connection:
            box = entry.box or str(places.fact(connection, "box")).rpartition("-")[2]
        self.topics = Topics(box, entry.prefix)
        self._client: aiomqtt.Client | None = None
        self._sent: dict[str, str] = {}

    async def main(self) -> None:
        """Connects, publishes, and begins again when the link is lost."""
        wait = FIRST_WAIT_S
        while True:
            while not self._service.leads:
                await asyncio.sleep(LOOK_S)
            try:
                async with self._connection() as client:
                    wait = FIRST_WAIT_S
                    await self._session(client)
            except* (aiomqtt.MqttError, OSError):
                self._client = None
            await asyncio.sleep(wait * random.uniform(0.5, 1.0))
            wait = min(2.0 * wait, LAST_WAIT_S)

    def _connection(self) -> aiomqtt.Client:
        entry = self._entry
        return aiomqtt.Client(
            entry.host,
            entry.port or (8883 if entry.tls else 1883),
            username=entry.username,
            password=self._password,
            identifier=f"siloscope-{self.topics.box}",
            keepalive=KEEP_ALIVE_S,
            will=aiomqtt.Will(self.topics.box_status, OFFLINE, qos=1, retain=True),
            tls_context=self._tls,
        )

    async def _session(self, client: aiomqtt.Client) -> None:
        self._sent = {}
        await client.subscribe(self.topics.birth, qos=1)
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._listen(client))
                tasks.create_task(self._publish(client))
        finally:
            self._client = None

    async def _publish(self, client: aiomqtt.Client) -> None:
        try:
            await self._put(client, self.topics.box_status, ONLINE)
            self._client = client
            while True:
                if not self._service.leads:
                    raise _Followed("another process publishes")
                await self._tell(client)
                await asyncio.sleep(LOOK_S)
        except asyncio.CancelledError:
            await self._put(client, self.topics.box_status, OFFLINE)
            raise

    async def _listen(self, client: aiomqtt.Client) -> None:
        """Home Assistant has started and knows nothing: it is told all of it again."""
        async for message in client.messages:
            if message.payload == b"online":
                self._sent = {}

    async def _tell(self, client: aiomqtt.Client) -> None:
        wanted = self.wanted()
        with self._service.store.read() as connection:
            before = set(places.fact(connection, ANNOUNCED) or ())
        if not before >= wanted.keys():  # noted before it is published: nothing retained is ever forgotten
            self._note(before | wanted.keys())
        for topic in before - wanted.keys():
            await client.publish(topic, b"", qos=1, retain=True)
        for topic, payload in wanted.items():
            if self._sent.get(topic) != payload:
                await self._put(client, topic, payload)
                self._sent[topic] = payload
        if before - wanted.keys():
            self._note(set(wanted))

    def _note(self, topics: set[str]) -> None:
        with self._service.store.write() as connection:
            places.set_fact(connection, ANNOUNCED, sorted(topics))

    def wanted(self) -> dict[str, str]:
        """All retained topics as they are to be: devices first, then states."""
        with self._service.store.read() as connection:
            found = images(connection, self._service.clock.now())
        documents: dict[str, dict[str, Any]] = {}
        if self._entry.discovery != "off":
            tell = discovery.by_device if self._entry.discovery == "device" else discovery.by_entity
            documents |= tell(self.topics, found)
        documents |= {self.topics.of(image.silo.id, "state"): state(image) for image in found}
        texts = {topic: json.dumps(document, allow_nan=False) for topic, document in documents.items()}
        status = {self.topics.of(image.silo.id, "status"): ONLINE if image.fresh else OFFLINE for image in found}
        return texts | status

    async def _put(self, client: aiomqtt.Client, topic: str, payload: str) -> None:
        await client.publish(topic, payload, qos=1, retain=True)

    def deliver(self, delivery: Delivery) -> None:
        """Publishes an alert; returns when the broker has it, raises `NotDelivered` otherwise."""
        told = messages.document(self._service.store, delivery)
        if told is None:
            return
        loop, client = self.loop, self._client
        if loop is None or client is None:
            raise NotDelivered(f"{self._entry.host}: not connected")
        event = client.publish(self.topics.of(told["silo"], "event"), json.dumps(told), qos=1)
        try:
            asyncio.run_coroutine_threadsafe(event, loop).result(DELIVER_S)
        except (aiomqtt.MqttError, OSError, TimeoutError, Cancelled) as error:
            raise NotDelivered(f"{self._entry.host}: {error or type(error).__name__}") from None


def state(image: Image) -> dict[str, Any]:
    """A silo's newest answer; null where it is too old."""
    last = image.last if image.fresh else None

    def of(name: str) -> Any:
        return None if last is None else getattr(last, name)

    fill = of("fill")
    return {
        "time": None if image.last is None else iso(image.last.time),
        "seq": None if image.last is None else image.last.id,
        "status": image.status,
        "volume_m3": of("volume"),
        "volume_std_m3": of("volume_std"),
        "fill_percent": None if fill is None else 100.0 * fill,
        "mass_kg": of("mass"),
        "mass_std_kg": of("mass_std"),
        "level_m": of("level"),
        "coverage": of("coverage"),
        "empty_by": None if image.empty_by is None else iso(image.empty_by),
        "quality": list(image.codes),
        "alerts": list(image.alerts),
        "problem": "ON" if image.alerts or image.status != "ok" else "OFF",
    }


def _tls(entry: MqttEntry, site: Path) -> ssl.SSLContext | None:
    if not entry.tls:
        return None
    try:
        context = ssl.create_default_context(cafile=None if entry.ca_file is None else str(site.parent / entry.ca_file))
        if entry.cert_file is not None:
            key = None if entry.key_file is None else str(site.parent / entry.key_file)
            context.load_cert_chain(str(site.parent / entry.cert_file), key)
    except OSError as error:
        raise InputError(f"{site}: [mqtt]: the certificates can't be used ({error}); give PEM files") from None
    return context
