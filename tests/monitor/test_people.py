"""Who may do what: the first user, roles, sessions, tokens, the throttle, other sites' pages."""

from __future__ import annotations

import http.cookies
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from monitor.servers import Answer, Server, frame_bytes, monitor, problem, serving, write_site
from siloscope.errors import UsageError
from siloscope.monitor import access
from siloscope.monitor.clock import MINUTE, SECOND
from siloscope.monitor.throttle import FREE, LONGEST, Throttle

PASSWORD = "correct horse battery"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("people")
    more = '[[place]]\nid = "other"\n[[silo]]\nid = "silo8"\nplace = "other"\n'
    with serving(folder / "data", write_site(folder / "site", more=more)) as running:
        taken = running.post("cam7", frame_bytes(0.5), running.token("camera", "cam7"))
        running.settled(taken.json["frame"])
        yield running


def cookie(answer: Answer) -> str:
    found = http.cookies.SimpleCookie(answer.headers["set-cookie"])["siloscope_session"]
    assert found["httponly"]
    assert found["samesite"].lower() == "strict"
    return f"siloscope_session={found.value}"


def test_people_from_the_first_link_to_the_last_role(server: Server) -> None:
    """One story, because each step needs the one before."""
    assert server.get("/api/v1/site").json["role"] == "operator"
    assert problem(server.get("/api/v1/users")) == (403, "forbidden")
    link = server.log().split("/welcome#")[1].split()[0]
    short = server.send("POST", "/api/v1/session:welcome", {"link": link, "name": "ana", "password": "short"})
    assert problem(short) == (422, "invalid")
    made = server.send("POST", "/api/v1/session:welcome", {"link": link, "name": "ana", "password": PASSWORD})
    assert (made.status, made.json["role"]) == (200, "admin")
    ana = cookie(made)

    # From now on nobody is let in without a word.
    assert problem(server.get("/api/v1/silos")) == (401, "unauthorized")
    again = server.send("POST", "/api/v1/session:welcome", {"link": link, "name": "eve", "password": PASSWORD})
    assert problem(again) == (401, "unauthorized")

    invited = server.send("POST", "/api/v1/users", {"name": "tom", "role": "percent", "place": "farm"}, Cookie=ana)
    assert invited.status == 201
    secret = invited.json["link"].split("#")[1]
    tom = cookie(server.send("POST", "/api/v1/session:welcome", {"link": secret, "password": PASSWORD}))
    silos = server.ask("GET", "/api/v1/silos", Cookie=tom).json["items"]
    assert [silo["id"] for silo in silos] == ["silo7"]
    assert silos[0]["now"]["fill_fraction"] > 0
    assert {silos[0]["now"][name] for name in ("volume_m3", "mass_kg", "ullage_m3", "level_m")} == {None}
    assert problem(server.ask("GET", "/api/v1/silos/silo8/now", Cookie=tom)) == (404, "not-found")
    for path in ("surface", "events", "tickets", "calibrations", "readings?format=csv"):
        assert server.ask("GET", f"/api/v1/silos/silo7/{path}", Cookie=tom).status == 403, path
    trend = server.ask("GET", "/api/v1/silos/silo7/readings?buckets=5", Cookie=tom).json["items"]
    assert [(b["fill_fraction"] is None, b["volume_m3"], b["mass_kg"]) for b in trend] == [(False, None, None)]

    grant = {"user": "tom", "place": "farm", "role": "viewer"}
    assert server.send("POST", "/api/v1/grants", grant, Cookie=ana).status == 201
    assert server.ask("GET", "/api/v1/silos/silo7/now", Cookie=tom).json["volume_m3"] > 0
    ticket = {"time": "2026-01-01T00:00:00Z", "mass_kg": 12_000}
    assert problem(server.send("POST", "/api/v1/silos/silo7/tickets", ticket, Cookie=tom)) == (403, "forbidden")
    assert server.send("POST", "/api/v1/grants", grant | {"role": "operator"}, Cookie=ana).status == 201
    assert server.send("POST", "/api/v1/silos/silo7/tickets", ticket, Cookie=tom).json["created_by"] == "tom"
    assert problem(server.send("PUT", "/api/v1/silos/silo7", {"name": "x"}, Cookie=tom)) == (403, "forbidden")

    # Somebody has to be left who can let others in.
    assert problem(server.ask("DELETE", "/api/v1/users/ana", Cookie=ana)) == (409, "conflict")
    assert server.ask("DELETE", "/api/v1/users/tom", Cookie=ana).status == 204
    assert problem(server.ask("GET", "/api/v1/silos", Cookie=tom)) == (401, "unauthorized")
    audit = server.ask("GET", "/api/v1/audit", Cookie=ana).json["items"]
    assert {"add user", "grant", "add ticket", "disable user"} <= {line["action"] for line in audit}
    assert PASSWORD not in str(audit)

    # A page of another site, in the browser of who is signed in here.
    note = {"note": "x"}
    evil = server.send("POST", "/api/v1/alerts/x:acknowledge", note, Cookie=ana, Origin="https://evil.example")
    assert problem(evil) == (403, "cross-origin")
    sent = server.send("POST", "/api/v1/alerts/x:acknowledge", note, Cookie=ana, Sec_Fetch_Site="cross-site")
    assert problem(sent) == (403, "cross-origin")
    own = server.send("POST", "/api/v1/alerts/x:acknowledge", note, Cookie=ana, Origin=server.root)
    assert problem(own) == (404, "not-found")
    assert server.ask("DELETE", "/api/v1/session", Cookie=ana).status == 204
    assert problem(server.ask("GET", "/api/v1/silos", Cookie=ana)) == (401, "unauthorized")

    wrong = {"name": "ana", "password": "wrong"}
    answers = [server.send("POST", "/api/v1/session", wrong).status for _ in range(2 * FREE)]
    assert answers[: FREE - 1] == [401] * (FREE - 1)
    assert answers[-1] == 429
    good = server.send("POST", "/api/v1/session", {"name": "ana", "password": PASSWORD})
    assert problem(good) == (429, "too-many")
    assert int(good.headers["retry-after"]) >= 1


def test_a_token_does_what_it_is_for_until_it_is_revoked(server: Server) -> None:
    admin = server.token("admin")
    made = server.send("POST", "/api/v1/tokens", {"role": "read", "name": "display"}, admin)
    assert made.status == 201
    read = made.json["secret"]
    assert server.get("/api/v1/silos/silo7/now", read).status == 200
    assert server.get("/metrics", read).status == 200
    assert problem(server.send("POST", "/api/v1/tokens", {"role": "read"}, read)) == (403, "forbidden")
    metrics = server.token("metrics")
    assert server.get("/metrics", metrics).status == 200
    assert server.get("/api/v1/silos", metrics).json["items"] == []
    assert problem(server.get("/metrics", server.token("camera", "cam7"))) == (403, "forbidden")
    assert read not in str(server.get("/api/v1/tokens", admin).json)
    assert server.ask("DELETE", f"/api/v1/tokens/{made.json['token']['id']}", token=admin).status == 204
    assert problem(server.get("/api/v1/silos", read)) == (401, "unauthorized")
    files = b"".join(path.read_bytes() for path in server.data.glob("siloscope.db*"))
    assert read.encode() not in files


def test_through_a_proxy_nobody_is_this_machine(shared: Server) -> None:
    assert shared.get("/api/v1/silos").status == 200
    assert shared.ask("GET", "/api/v1/silos", X_Forwarded_For="203.0.113.7").status == 401
    assert shared.ask("GET", "/api/v1/silos", Host="rebound.example").status == 401


def test_only_this_machine_reaches_a_service_without_users(tmp_path: Path) -> None:
    from siloscope.cli import main

    assert main(["serve", "--data", str(tmp_path / "data"), "--bind", "0.0.0.0:0"]) == 2


def listened_on(process: int) -> set[tuple[str, int]]:
    """Addresses on which a process listens, by the kernel."""
    links = [os.readlink(path) for path in Path(f"/proc/{process}/fd").iterdir() if path.is_symlink()]
    sockets = {link[8:-1] for link in links if link.startswith("socket:[")}
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{process}/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and words[9] in sockets:
                address, _, port = words[1].rpartition(":")
                found.add((address, int(port, 16)))
    return found


@pytest.mark.skipif(not Path("/proc/self/net/tcp").exists(), reason="this system does not tell who listens")
def test_nothing_listens_but_the_one_address_of_this_machine(server: Server) -> None:
    """No other port, none that others reach; its interface wants a token from who is not at this machine."""
    (port,) = {int(server.root.rpartition(":")[2])}
    assert listened_on(server.process.pid) == {("0100007F", port)}


def test_a_user_is_made_on_the_command_line(tmp_path: Path) -> None:
    assert monitor(tmp_path / "data", "user", "ana", "--role", "admin").startswith("/welcome#link_")


def test_the_throttle_doubles_its_wait_and_forgets() -> None:
    throttle, now = Throttle(), 0
    keys = ("name ana", "address 1")
    for _ in range(FREE):
        assert throttle.wait(keys, now) == 0
        throttle.failed(keys, now)
    waits = []
    for _ in range(4):
        waits.append(throttle.wait(keys, now))
        now += waits[-1]
        throttle.failed(keys, now)
    assert waits == [SECOND, 2 * SECOND, 4 * SECOND, 8 * SECOND]
    assert throttle.wait(("name bob", "address 1"), now) == 16 * SECOND
    throttle.failed(keys, now + 2 * LONGEST + MINUTE)
    assert throttle.wait(keys, now + 2 * LONGEST + MINUTE) == 0
    throttle.succeeded(keys)
    assert not throttle.failures


def test_a_password_is_kept_as_a_slow_hash() -> None:
    kept = access.hashed_password(PASSWORD)
    assert PASSWORD not in kept
    assert kept != access.hashed_password(PASSWORD)
    assert access.matches(PASSWORD, kept)
    assert not access.matches("correct horse batterx", kept)
    assert not access.matches(PASSWORD, None)
    with pytest.raises(UsageError, match="at least 10"):
        access.hashed_password("short")


def test_a_token_is_made_on_the_command_line(shared: Server) -> None:
    token = monitor(shared.data, "token", "--role", "read").strip()
    assert shared.get("/api/v1/silos", token).status == 200
