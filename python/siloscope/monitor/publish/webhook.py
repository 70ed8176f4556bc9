"""Alerts as signed requests to an address of the user's."""

from __future__ import annotations

import hashlib
import hmac
import http.client
import ipaddress
import json
import socket
import ssl
from typing import Any
from urllib.parse import SplitResult, urlsplit

from siloscope import _core
from siloscope.monitor.clock import SECOND, Clock
from siloscope.monitor.outbox import Delivery, NotDelivered
from siloscope.monitor.outlets import WebhookEntry
from siloscope.monitor.publish import messages
from siloscope.monitor.store.engine import Store

TIMEOUT_S = 10.0

SIGNATURE, DELIVERY = "Siloscope-Signature", "Siloscope-Delivery"


def signature(secret: str, time: int, body: bytes) -> str:
    """The header's value: the time in s and the HMAC-SHA256 of ``<time>.<body>``, so that nobody can send it later."""
    digest = hmac.new(secret.encode(), f"{time}.".encode() + body, hashlib.sha256).hexdigest()
    return f"t={time},v1={digest}"


class Webhook:
    """A channel that posts each alert as JSON."""

    def __init__(self, store: Store, clock: Clock, entry: WebhookEntry, secret: str) -> None:
        self._store, self._clock, self._entry, self._secret = store, clock, entry, secret
        self.name = entry.id

    def deliver(self, delivery: Delivery) -> None:
        """Returns on a status of 2xx; raises `NotDelivered` otherwise. Redirections are not followed."""
        told = messages.document(self._store, delivery)
        if told is None:
            return
        body = json.dumps(told, allow_nan=False).encode()
        signed = signature(self._secret, self._clock.now() // SECOND, body)
        headers = {
            "Content-Type": "application/json",
            "User-Agent": f"siloscope/{_core.__version__}",
            SIGNATURE: signed,
            DELIVERY: delivery.key,
        }
        url = urlsplit(self._entry.url)
        try:
            status = self._posted(url, body, headers)
        except (OSError, ValueError, http.client.HTTPException) as error:
            raise NotDelivered(f"{url.hostname}: {error or type(error).__name__}") from None
        if not 200 <= status < 300:
            raise NotDelivered(f"{url.hostname}: answered {status}")

    def _posted(self, url: SplitResult, body: bytes, headers: dict[str, str]) -> int:
        connection = _connection(url, self._entry.allow_private)
        try:
            path = (url.path or "/") + (f"?{url.query}" if url.query else "")
            connection.request("POST", path, body, headers)
            return connection.getresponse().status
        finally:
            connection.close()


def _connection(url: SplitResult, allow_private: bool) -> http.client.HTTPConnection:
    port = url.port or (443 if url.scheme == "https" else 80)
    address = public_address(url.hostname or "", port, allow_private)
    if url.scheme == "https":
        return _PinnedTls(address, url.hostname or "", port)
    return _Pinned(address, url.hostname or "", port)


def public_address(host: str, port: int, allow_private: bool) -> str:
    """The address that is connected to: looked up once, so that a name can't lead elsewhere after the check."""
    found = [str(entry[4][0]) for entry in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
    private = [address for address in found if not _is_public(address)]
    if private and not allow_private:
        raise NotDelivered(
            f"{host} leads to {private[0]}, which is not in the public network; set allow_private where that is meant"
        )
    return found[0]


def _is_public(address: str) -> bool:
    found: Any = ipaddress.ip_address(address.partition("%")[0])
    inner = getattr(found, "ipv4_mapped", None)
    return bool((inner or found).is_global) and not (inner or found).is_multicast


class _Pinned(http.client.HTTPConnection):
    """Connects to an address, and asks for a name."""

    def __init__(self, address: str, host: str, port: int) -> None:
        super().__init__(host, port, timeout=TIMEOUT_S)
        self._address = address

    def connect(self) -> None:
        self.sock = socket.create_connection((self._address, self.port), TIMEOUT_S)


class _PinnedTls(_Pinned):
    """The same with TLS, whose certificate is the name's."""

    def connect(self) -> None:
        super().connect()
        self.sock = ssl.create_default_context().wrap_socket(self.sock, server_hostname=self.host)
