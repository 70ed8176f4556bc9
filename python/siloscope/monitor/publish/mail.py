"""Alerts by mail."""

from __future__ import annotations

import smtplib
import ssl
from email.message import EmailMessage
from email.utils import formatdate
from hashlib import sha256
from typing import Any

from siloscope.monitor.outbox import Delivery, NotDelivered
from siloscope.monitor.outlets import MAIL, MailEntry
from siloscope.monitor.publish import messages
from siloscope.monitor.store.engine import Store

TIMEOUT_S = 20.0

PORTS = {"starttls": 587, "tls": 465, "none": 25}


class Mail:
    """A channel that sends each alert to all addresses."""

    name = MAIL

    def __init__(self, store: Store, entry: MailEntry, password: str | None) -> None:
        self._store, self._entry, self._password = store, entry, password

    def deliver(self, delivery: Delivery) -> None:
        """Returns when the server has taken it; raises `NotDelivered` otherwise."""
        told = messages.document(self._store, delivery)
        if told is None:
            return
        try:
            with self._connected() as server:
                server.send_message(self._message(told))
        except (OSError, smtplib.SMTPException) as error:
            raise NotDelivered(f"{self._entry.host}: {error}") from None

    def _connected(self) -> smtplib.SMTP:
        entry = self._entry
        port = PORTS[entry.security] if entry.port is None else entry.port
        if entry.security == "tls":
            server: smtplib.SMTP = smtplib.SMTP_SSL(
                entry.host, port, timeout=TIMEOUT_S, context=ssl.create_default_context()
            )
        else:
            server = smtplib.SMTP(entry.host, port, timeout=TIMEOUT_S)
        try:
            if entry.security == "starttls":
                server.starttls(context=ssl.create_default_context())
            if entry.username is not None:
                server.login(entry.username, self._password or "")
        except BaseException:
            server.close()
            raise
        return server

    def _message(self, told: dict[str, Any]) -> EmailMessage:
        message = EmailMessage()
        message["From"], message["To"] = self._entry.sender, ", ".join(self._entry.to)
        message["Subject"], message["Date"] = messages.subject(told), formatdate(usegmt=True)
        # The same delivery has the same id: a mail server that got it twice can tell.
        digest = sha256(f"{told['box']}/{told['delivery']}".encode()).hexdigest()[:32]
        message["Message-ID"] = f"<{digest}@siloscope.invalid>"
        message["Auto-Submitted"] = "auto-generated"
        message.set_content(messages.text(told))
        return message
