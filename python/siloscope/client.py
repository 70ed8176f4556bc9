"""A small client of the service: frames out, readings in; nothing to install."""

from __future__ import annotations

import hashlib
import http.client
import json
import ssl
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any

from siloscope.errors import InputError, SiloscopeError

TIMEOUT_S = 60.0


class ServiceError(SiloscopeError):
    """What the service refused a request with (an RFC 9457 problem), or that it could not be reached.

    Attributes
    ----------
    status : int or None
        HTTP status; None where the service could not be reached.
    slug : str
        Stable name of the problem; "unreachable" where there was no answer.
    retry_after : float or None
        Seconds after which to try again, where the service says so.
    """

    exit_code = 3

    def __init__(self, message: str, status: int | None, slug: str, retry_after: float | None = None) -> None:
        super().__init__(message)
        self.status, self.slug, self.retry_after = status, slug, retry_after

    @property
    def passing(self) -> bool:
        """Whether the same request may succeed later."""
        return self.status is None or self.status in (408, 429, 507) or self.status >= 500


@dataclass(frozen=True)
class Sent:
    """A frame that the service has on its disk."""

    frame: str
    new: bool
    """False where it had been sent before."""


class Client:
    """Talks to one service.

    Parameters
    ----------
    root : str
        Its address, ``http://127.0.0.1:8480``; with the path where a proxy puts it below one.
    token : str, optional
        A token of `siloscope monitor token`.
    """

    def __init__(self, root: str, token: str | None = None, *, context: ssl.SSLContext | None = None) -> None:
        if not root.startswith(("http://", "https://")):
            raise InputError(f"'{root}' is no address of a service; give one such as http://127.0.0.1:8480")
        self._root, self._token, self._context = root.rstrip("/"), token, context

    def send(self, camera: str, path: str | PathLike[str], *, captured: float | None = None) -> Sent:
        """Sends a frame's file; returns when the service has it on its disk. Sending it again is no harm.

        Raises
        ------
        ServiceError
            Where it was refused, or the service can't be reached: keep the file and, if `passing`, send it again.
        """
        body = Path(path).read_bytes()
        headers = {"Content-SHA256": hashlib.sha256(body).hexdigest(), "Content-Type": "application/octet-stream"}
        if captured is not None:
            headers["Captured-At"] = datetime.fromtimestamp(captured, UTC).isoformat()
        status, found = self._ask("POST", f"/api/v1/cameras/{_quoted(camera)}/frames", headers, body)
        return Sent(found["frame"], status == 201)

    def silos(self) -> list[dict[str, Any]]:
        """All silos that may be seen, each with its newest answer."""
        found: list[dict[str, Any]] = self.get("/api/v1/silos")["items"]
        return found

    def now(self, silo: str) -> dict[str, Any]:
        """A silo's newest answer with its age."""
        return self.get(f"/api/v1/silos/{_quoted(silo)}/now")

    def readings(self, silo: str, since: float | None = None, until: float | None = None) -> Iterator[dict[str, Any]]:
        """A silo's readings in the order of their times, page by page. Times in seconds since 1970."""
        span = {name: _iso(time) for name, time in (("from", since), ("to", until)) if time is not None}
        yield from self.pages(f"/api/v1/silos/{_quoted(silo)}/readings", span | {"count": "1000"})

    def frame(self, frame: str) -> dict[str, Any]:
        """A frame and what became of it."""
        return self.get(f"/api/v1/frames/{_quoted(frame)}")

    def alerts(self, state: str | None = None) -> Iterator[dict[str, Any]]:
        """Alerts, the newest first; `state` is "firing" or "resolved"."""
        yield from self.pages("/api/v1/alerts", {} if state is None else {"state": state})

    def acknowledge(self, alert: str, note: str | None = None) -> dict[str, Any]:
        """Says that somebody has seen an alert."""
        body = json.dumps({"note": note}).encode()
        headers = {"Content-Type": "application/json"}
        _, found = self._ask("POST", f"/api/v1/alerts/{_quoted(alert)}:acknowledge", headers, body)
        return found

    def pages(self, path: str, query: dict[str, str]) -> Iterator[dict[str, Any]]:
        """The items of all pages."""
        after: str | None = None
        while True:
            page = self.get(path, query | ({} if after is None else {"after": after}))
            yield from page["items"]
            after = page["next"]
            if after is None:
                return

    def send_document(self, method: str, path: str, document: dict[str, Any]) -> dict[str, Any]:
        """Any writing request of the interface; its answer."""
        body = json.dumps(document, allow_nan=False).encode()
        return self._ask(method, path, {"Content-Type": "application/json"}, body)[1]

    def send_file(self, path: str, file: str | PathLike[str]) -> dict[str, Any]:
        """Puts a file's bytes at an address of the interface; its answer."""
        return self._ask("PUT", path, {"Content-Type": "application/octet-stream"}, Path(file).read_bytes())[1]

    def get(self, path: str, query: dict[str, str] | list[tuple[str, str]] | None = None) -> dict[str, Any]:
        """Any document of the interface."""
        tail = f"?{urllib.parse.urlencode(query)}" if query else ""
        return self._ask("GET", path + tail, {}, None)[1]

    def _ask(self, method: str, path: str, headers: dict[str, str], body: bytes | None) -> tuple[int, dict[str, Any]]:
        if self._token is not None:
            headers = {**headers, "Authorization": f"Bearer {self._token}"}
        request = urllib.request.Request(self._root + path, body, headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S, context=self._context) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as error:
            raise _refused(error) from None
        except (OSError, ValueError, http.client.HTTPException) as error:
            reason = getattr(error, "reason", error)
            raise ServiceError(f"{self._root}: no answer ({reason}); is it running", None, "unreachable") from None


def _refused(error: urllib.error.HTTPError) -> ServiceError:
    try:
        told = json.load(error)
    except (OSError, ValueError):
        told = {}
    wait = error.headers.get("Retry-After", "")
    after = float(wait) if wait.isdigit() else None
    detail = told.get("detail") or error.reason
    return ServiceError(f"{detail} ({error.code})", error.code, str(told.get("slug", "unknown")), after)


def _quoted(part: str) -> str:
    return urllib.parse.quote(part, safe="")


def _iso(time: float) -> str:
    return datetime.fromtimestamp(time, UTC).isoformat()
