"""What `siloscope monitor` does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.monitor import access
from siloscope.monitor.clock import SystemClock
from siloscope.monitor.settings import Settings
from siloscope.monitor.store import people, places
from siloscope.monitor.store.engine import Store, opened

Answer = dict[str, Any]


def _opened(data: Path, database: str | None) -> Store:
    settings = Settings(data, database)
    if not data.is_dir():
        if database is None and data.exists():
            raise InputError(f"{data}: is no folder; give the service's --data folder")
        data.mkdir(parents=True)
    return opened(settings.url)


def token(data: Path, database: str | None, role: str, camera: str | None, name: str | None) -> Answer:
    """A new token, told once."""
    if role not in people.TOKEN_ROLES:
        raise UsageError(f"unknown role '{role}' of a token; known are {', '.join(people.TOKEN_ROLES)}")
    if (role == "camera") != (camera is not None):
        raise UsageError("a token of the role camera needs --camera ID, and no other takes one")
    store = _opened(data, database)
    secret, now = access.new_secret(f"silo_{role}"), SystemClock().now()
    with store.write() as connection:
        key = people.add_token(connection, access.hash_of(secret), role, camera, name, now)
        people.log(connection, now, "command line", "token", key, detail={"role": role, "camera": camera})
        known = camera is None or places.get(connection, "camera", camera) is not None
    store.close()
    told = [] if known else [f"there is no camera '{camera}' yet; the token works once SITE.toml names it"]
    return {"printed": secret, "token": secret, "id": key, "role": role, "camera": camera, "told": told}
