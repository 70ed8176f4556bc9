"""What `siloscope monitor` does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from siloscope.errors import InputError, UsageError
from siloscope.monitor import access
from siloscope.monitor.blobs import Blobs, flush
from siloscope.monitor.clock import SystemClock
from siloscope.monitor.lock import Lock
from siloscope.monitor.settings import Settings
from siloscope.monitor.store import aging, people, places, transfer
from siloscope.monitor.store.engine import Store, opened, whole

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


def user(data: Path, database: str | None, name: str, role: str, place: str | None, password: str | None) -> Answer:
    """A new user, or a known one that gets another role or password; without a password, a link to set one."""
    if role not in people.ROLES:
        raise UsageError(f"unknown role '{role}' of a user; known are {', '.join(people.ROLES)}")
    hashed = None if password is None else access.hashed_password(password)
    store, now, secret = _opened(data, database), SystemClock().now(), access.new_secret("link")
    with store.write() as connection:
        if place is not None and places.get(connection, "place", place) is None:
            raise InputError(f"there is no place '{place}'; SITE.toml names places")
        found = people.user_named(connection, name)
        key = people.add_user(connection, name, None, now) if found is None else str(found.id)
        people.add_grant(connection, key, place, role)
        if hashed is not None:
            people.set_password(connection, key, hashed)
        else:
            people.add_link(connection, access.hash_of(secret), key, now, now + access.LINK)
        people.log(connection, now, "command line", "set user", name, detail={"role": role, "place": place})
    store.close()
    link = None if hashed is not None else f"welcome#{secret}"
    printed = f"{name}: {role}" if link is None else f"/{link}"
    told = [] if link is None else [f"open this at the service's address within a day to set the password of {name}"]
    return {"printed": printed, "user": name, "role": role, "place": place, "link": link, "told": told}


def backup(data: Path, database: str | None, file: Path) -> Answer:
    """The database as a file; the frames' bytes are not in it."""
    store = _opened(data, database)
    try:
        size = transfer.write_file(store, file)
    finally:
        store.close()
    told = ["readings, surfaces, calibrations, settings and people are in it; the frames' own bytes are not"]
    return {"printed": str(file), "file": str(file), "bytes": size, "told": told}


def restore(data: Path, database: str | None, file: Path) -> Answer:
    """Puts a backup in place of the database; what was there is kept beside it."""
    data.mkdir(parents=True, exist_ok=True)
    source = transfer.read_file(file)
    lock = Lock(data / "lock")
    try:
        if database is not None:
            target = opened(database)
            transfer.copy(source, target)
            target.close()
            return {"printed": f"restored into {database.split('@')[-1]}", "told": []}
        return {"printed": f"restored {data}", "kept": _in_place(data, source), "told": []}
    finally:
        source.close()
        lock.release()


def _in_place(data: Path, source: Store) -> str | None:
    """Puts the file of a backup where the database is; the name under which the former one is kept."""
    path = data / "siloscope.db"
    fresh = data / "siloscope.restored.db"
    fresh.unlink(missing_ok=True)
    transfer.write_file(source, fresh)
    kept = None
    if path.exists():
        former = opened(f"sqlite:///{path.absolute()}")
        kept = data / f"siloscope.before-restore-{SystemClock().now()}.db"
        transfer.write_file(former, kept)
        former.close()
    for left in (data / "siloscope.db-wal", data / "siloscope.db-shm"):
        left.unlink(missing_ok=True)
    fresh.replace(path)
    flush(data)
    return None if kept is None else str(kept)


def check(data: Path, database: str | None) -> Answer:
    """Whether the database is whole and every kept frame's bytes are there and right."""
    store, blobs = _opened(data, database), Blobs(data / "frames")
    with store.read() as connection:
        wrong = whole(connection)
        hashes = aging.kept_hashes(connection)
    damaged = [sha256 for sha256 in hashes if not blobs.intact(sha256)]
    extra = len(set(blobs.hashes()) - set(hashes))
    store.close()
    wrong += [f"the bytes of {sha256} are gone or damaged" for sha256 in damaged]
    good = f"whole: {len(hashes)} frames' bytes are there and right"
    spare = [f"{extra} files belong to no frame; they do no harm"] if extra else []
    found: Answer = {"printed": "damaged" if wrong else good, "wrong": wrong, "frames": len(hashes), "extra": extra}
    return found | {"told": wrong + spare, "exit_code": 5 if wrong else 0}


def copy(data: Path, database: str | None, to: str) -> Answer:
    """All rows into another, empty database."""
    source, target = _opened(data, database), opened(to)
    try:
        counts = transfer.copy(source, target)
    finally:
        source.close()
        target.close()
    rows = sum(counts.values())
    told = [f"start the service with --database {to.split('@')[-1]} and the same --data, where the frames are"]
    return {"printed": f"{rows} rows", "rows": counts, "told": told}
