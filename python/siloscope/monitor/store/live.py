"""How the cameras fare that the service drives itself: a fact of the site, so that every process of it knows."""

from __future__ import annotations

from typing import Any, TypedDict

from sqlalchemy import Connection

from siloscope.monitor.store import changes, places

KEY = "live"

STARTING, OK, FAILING = "starting", "ok", "failing"


class State(TypedDict):
    """Of one camera."""

    source: str
    """Kind of source, without its address: a command may hold a password."""
    state: str
    problem: str | None
    since: int
    """µs."""


def states(connection: Connection) -> dict[str, State]:
    """By camera; those that others drive are not there."""
    found: dict[str, State] = places.fact(connection, KEY) or {}
    return found


def set_all(connection: Connection, sources: dict[str, str], now: int) -> None:
    """Says which cameras are driven; of one that was driven from the same source before, the state stays."""
    before = states(connection)
    found = {key: State(source=kind, state=STARTING, problem=None, since=now) for key, kind in sources.items()}
    found |= {key: one for key, one in before.items() if sources.get(key) == one["source"]}
    if found != before:
        places.set_fact(connection, KEY, found)


def tell(connection: Connection, camera: str, state: str, problem: str | None, now: int) -> None:
    """Notes a camera's state, where it is another one than before."""
    known: dict[str, Any] = dict(states(connection))
    before = known.get(camera)
    if before is None or (before["state"], before["problem"]) == (state, problem):
        return
    since = before["since"] if before["state"] == state else now
    places.set_fact(connection, KEY, known | {camera: {**before, "state": state, "problem": problem, "since": since}})
    row = places.get(connection, "camera", camera)
    changes.note(connection, "camera", camera, None if row is None else row.silo, now)
