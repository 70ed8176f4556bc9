"""Alerts on their way out: signed requests, mails, waiting in the outbox, giving up."""

from __future__ import annotations

import hashlib
import hmac
import http.server
import json
import smtplib
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from email import message_from_bytes, policy
from pathlib import Path
from typing import Any

import pytest
from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult, LoginPassword

from monitor import farm
from monitor.farm import Farm
from monitor.servers import Server
from siloscope.errors import InputError
from siloscope.monitor.clock import DAY, HOUR, SECOND, SetClock
from siloscope.monitor.outbox import GIVE_UP, LAST_RETRY, NotDelivered, Outbox, retry
from siloscope.monitor.publish import webhook
from siloscope.monitor.store import deliveries

SECRET = "a secret of the receiver"


class Receiver(http.server.BaseHTTPRequestHandler):
    """Answers with what it is told to and keeps what came."""

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.came.append((self.path, self.headers, body))  # type: ignore[attr-defined]
        self.send_response(self.server.status)  # type: ignore[attr-defined]
        self.send_header("Location", "http://169.254.169.254/")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_arguments: Any) -> None:
        return


@contextmanager
def receiving(status: int = 200) -> Iterator[Any]:
    server: Any = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Receiver)
    server.status, server.came = status, []
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()


def hooked(folder: Path, port: int, *, private: bool = True, clock: SetClock | None = None) -> Farm:
    """A service with a webhook, and a low silo that is to be told of."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "secret").write_text(SECRET + "\n")
    entry = f'[[webhook]]\nid = "erp"\nurl = "http://127.0.0.1:{port}/in?x=1"\nsecret_file = "secret"\n'
    entry += f"allow_private = {str(private).lower()}\n"
    return farm.make(folder, entry + farm.rule("erp"), clock=clock)


def low(service: Farm) -> None:
    farm.reading(service, fill=0.1)
    farm.look(service)


def waiting(service: Farm) -> dict[str, int]:
    with service.store.read() as connection:
        return deliveries.pending(connection)


def test_a_webhook_brings_the_alert_signed_with_its_time(tmp_path: Path) -> None:
    with receiving() as server:
        service = hooked(tmp_path, server.server_port)
        low(service)
        assert service.outbox.deliver(service.clock.now()) == 1
        service.clock.time += HOUR
        farm.reading(service, fill=0.6)
        farm.look(service)
        assert service.outbox.deliver(service.clock.now()) == 1
    (path, headers, body), (_, _, second) = server.came
    assert path == "/in?x=1"
    told = json.loads(body)
    assert (told["event"], told["kind"], told["silo"], told["place_name"]) == ("firing", "low", "silo7", "Farm North")
    assert (told["value"], told["threshold"], told["fired"]) == (0.1, 0.2, "2026-12-31T12:00:01.000Z")
    assert json.loads(second)["event"] == "resolved"
    assert json.loads(second)["alert"] == told["alert"]
    time, digest = (part.partition("=")[2] for part in headers[webhook.SIGNATURE].split(","))
    assert int(time) == farm.NOON // SECOND + 1
    assert digest == hmac.new(SECRET.encode(), time.encode() + b"." + body, hashlib.sha256).hexdigest()
    assert headers[webhook.DELIVERY] == told["delivery"]
    assert waiting(service) == {}


@pytest.mark.parametrize("status", [302, 404, 500])
def test_anything_but_success_is_tried_again(tmp_path: Path, status: int) -> None:
    with receiving(status) as server:
        service = hooked(tmp_path, server.server_port)
        low(service)
        assert service.outbox.deliver(service.clock.now()) == 0
        assert service.outbox.deliver(service.clock.now() + SECOND) == 0  # it is not due yet
        assert len(server.came) == 1
        server.status = 204
        assert service.outbox.deliver(service.clock.now() + 10 * SECOND) == 1


def test_nothing_is_lost_by_a_restart(tmp_path: Path) -> None:
    with receiving() as server:
        port = server.server_port
    service = hooked(tmp_path, port)
    low(service)
    assert service.outbox.deliver(service.clock.now()) == 0
    farm.close(service)
    with receiving() as server:
        service = hooked(tmp_path, server.server_port)
        assert waiting(service) == {"erp": 1}
        assert service.outbox.deliver(service.clock.now() + 10 * SECOND) == 1
        assert json.loads(server.came[0][2])["event"] == "firing"


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "10.1.2.3", "169.254.169.254", "::1", "::ffff:192.168.1.1"])
def test_a_private_target_is_refused_unless_allowed(host: str) -> None:
    with pytest.raises(NotDelivered, match="not in the public network"):
        webhook.public_address(host, 80, False)
    assert webhook.public_address(host, 80, True)


def test_a_refused_target_stands_in_the_outbox_with_its_reason(tmp_path: Path) -> None:
    with receiving() as server:
        service = hooked(tmp_path, server.server_port, private=False)
        low(service)
        assert service.outbox.deliver(service.clock.now()) == 0
        assert server.came == []
    with service.store.read() as connection:
        assert "allow_private" in deliveries.listed(connection, "pending", None, 5)[0].error


def test_waits_grow_to_an_hour_and_vary() -> None:
    waits = [retry(attempts) / SECOND for attempts in range(30)]
    assert 4 <= waits[0] <= 6
    assert all(0.79 * LAST_RETRY <= wait * SECOND <= 1.21 * LAST_RETRY for wait in waits[12:])
    assert len(set(waits)) > 25


class Broken:
    """A channel that never delivers."""

    def __init__(self, name: str) -> None:
        self.name = name

    def deliver(self, delivery: Any) -> None:
        raise NotDelivered("out of order")


def test_what_is_given_up_stays_in_sight_and_can_be_tried_again(tmp_path: Path) -> None:
    with receiving() as server:
        service = hooked(tmp_path, server.server_port)
        hook, service.outbox.channels["erp"] = service.outbox.channels["erp"], Broken("erp")
        low(service)
        now = service.clock.now()
        for day in range(9):
            service.outbox.deliver(now + day * DAY)
        with service.store.write() as connection:
            assert deliveries.pending(connection) == {}
            assert deliveries.given_up(connection) == {"erp": 1}
            (row,) = deliveries.listed(connection, "failed", None, 5)
            assert (row.error, row.attempts) == ("out of order", 1 + GIVE_UP // DAY + 1)
            assert deliveries.again(connection, row.id, now + 20 * DAY)
        service.outbox.channels["erp"] = hook
        assert service.outbox.deliver(now + 20 * DAY) == 1
        assert len(server.came) == 1


def test_a_channel_that_fails_holds_up_no_other(tmp_path: Path) -> None:
    with receiving() as server:
        service = hooked(tmp_path, server.server_port)
        service.outbox.channels = {"broken": Broken("broken"), **service.outbox.channels}
        low(service)
        with service.store.write() as connection:
            service.outbox.put(connection, "broken", "anything", {}, 0)
        assert service.outbox.deliver(service.clock.now()) == 1


def test_an_unknown_channel_is_told_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="channel 'erb'"):
        farm.make(tmp_path, farm.rule("erb"))
    with pytest.raises(InputError, match="secret"):
        farm.make(tmp_path / "other", '[[webhook]]\nid = "erp"\nurl = "https://example.org"\nsecret_file = "missing"\n')


class Mailbox:
    """What a mail server took, and from whom."""

    def __init__(self) -> None:
        self.mails: list[Any] = []

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        self.mails.append((envelope, message_from_bytes(envelope.content, policy=policy.default)))
        return "250 taken"


def authenticated(_server: Any, _session: Any, _envelope: Any, mechanism: str, data: Any) -> AuthResult:
    known = isinstance(data, LoginPassword) and (data.login, data.password) == (b"farm", SECRET.encode())
    return AuthResult(success=known)


@contextmanager
def mail_server() -> Iterator[tuple[Mailbox, int]]:
    box = Mailbox()
    with socket.create_server(("127.0.0.1", 0)) as sock:
        port = sock.getsockname()[1]
    controller = Controller(
        box,
        "127.0.0.1",
        port,
        ready_timeout=60,
        authenticator=authenticated,
        auth_required=True,
        auth_require_tls=False,
    )
    controller.start()
    try:
        yield box, port
    finally:
        controller.stop()


def mailing(folder: Path, port: int, user: str = "farm") -> Farm:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "password").write_text(SECRET)
    entry = f'[mail]\nhost = "127.0.0.1"\nport = {port}\nsecurity = "none"\nusername = "{user}"\n'
    entry += 'password_file = "password"\nsender = "silo@example.org"\nto = ["a@example.org", "b@example.org"]\n'
    return farm.make(folder, entry + farm.rule("mail"))


def test_a_mail_says_what_is_low(tmp_path: Path) -> None:
    with mail_server() as (box, port):
        service = mailing(tmp_path, port)
        low(service)
        assert service.outbox.deliver(service.clock.now()) == 1
    ((envelope, mail),) = box.mails
    assert envelope.rcpt_tos == ["a@example.org", "b@example.org"]
    assert mail["Subject"] == "ALERT: Silo 7, Farm North: the fill is low"
    assert "Value: 10 % (limit 20 %)" in mail.get_content()
    assert mail["Message-ID"].endswith("@siloscope.invalid>")


def test_a_mail_server_that_refuses_or_is_away_is_tried_again(tmp_path: Path) -> None:
    with mail_server() as (box, port):
        service = mailing(tmp_path, port, "nobody")
        low(service)
        assert service.outbox.deliver(service.clock.now()) == 0
        assert box.mails == []
    assert service.outbox.deliver(service.clock.now() + HOUR) == 0
    assert waiting(service) == {"mail": 1}


def test_mail_without_tls_where_it_is_asked_for_is_not_sent(tmp_path: Path) -> None:
    with mail_server() as (box, port):
        service = mailing(tmp_path, port)
        site = tmp_path / "SITE.toml"
        site.write_text(site.read_text().replace('security = "none"', 'security = "starttls"'))
        farm.close(service)
        service = farm.make(tmp_path, "", silos=site.read_text())
        low(service)
        assert service.outbox.deliver(service.clock.now()) == 0
        assert box.mails == []
    assert issubclass(smtplib.SMTPNotSupportedError, smtplib.SMTPException)


def test_threads_deliver_by_themselves(tmp_path: Path) -> None:
    with receiving() as server:
        service = hooked(tmp_path, server.server_port)
        assert isinstance(service.outbox, Outbox)
        for part in service.parts:
            part.start()
        low(service)
        deadline = threading.Event()
        for _ in range(200):
            if server.came or deadline.wait(0.05):
                break
        for part in service.parts:
            part.stop()
        assert len(server.came) == 1


def test_deliveries_are_told_to_who_may_see_them(shared: Server) -> None:
    assert shared.get("/api/v1/deliveries?state=failed").json == {"items": [], "next": None}
    assert shared.ask("POST", "/api/v1/deliveries/1:retry", b"").status == 404
    assert shared.get("/api/v1/deliveries", shared.token("read")).status == 403
