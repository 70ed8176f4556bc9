"""The log of changes: live, and from where a client left off."""

from __future__ import annotations

import json
import urllib.request
from pathlib import Path
from typing import Any

from monitor.servers import Server, ago, frame_bytes, serving, write_site


def events(server: Server, last: str | None, until: int) -> list[tuple[str, Any]]:
    """Server-sent events up to the change of a number."""
    request = urllib.request.Request(
        server.root + "/api/v1/events", headers={} if last is None else {"Last-Event-ID": last}
    )
    found: list[tuple[str, Any]] = []
    with urllib.request.urlopen(request, timeout=30) as stream:
        number, name = 0, ""
        for line in stream:
            field, _, value = line.decode().strip().partition(": ")
            if field == "id":
                number = int(value)
            elif field == "event":
                name = value
            elif field == "data":
                found.append((name, json.loads(value)))
            elif not field and number >= until:
                return found
    return found


def newest(server: Server) -> int:
    return int(server.get("/api/v1/site").json["last_change"])


def test_a_lost_link_loses_no_change(shared: Server) -> None:
    begin = newest(shared)
    taken = shared.post("cam7", frame_bytes(0.45), shared.token("camera", "cam7"), Captured_At=ago(minutes=50))
    shared.settled(taken.json["frame"])
    until = newest(shared)
    told = events(shared, str(begin), until)
    assert [name for name, _ in told] == ["change"] * len(told)
    assert [change["id"] for _, change in told] == list(range(begin + 1, until + 1))
    assert {"frame", "reading"} <= {change["kind"] for _, change in told}
    middle = (begin + until) // 2
    assert [change["id"] for _, change in events(shared, str(middle), until)] == list(range(middle + 1, until + 1))
    pages = shared.get(f"/api/v1/changes?after={begin}&count=1").json
    assert pages["items"][0]["id"] == begin + 1
    assert int(pages["next"]) == begin + 1


def test_who_missed_too_much_is_told_to_begin_again(shared: Server) -> None:
    for unknown in ("999999999", "abc", "1" * 30):
        assert events(shared, unknown, newest(shared))[0][0] == "reset"


def test_the_server_stops_while_a_page_listens(tmp_path: Path) -> None:
    with serving(tmp_path / "data", write_site(tmp_path / "site")) as server:
        request = urllib.request.Request(server.root + "/api/v1/events", headers={"Last-Event-ID": "0"})
        with urllib.request.urlopen(request, timeout=30) as stream:
            assert stream.readline()
            assert server.stop() == 0
