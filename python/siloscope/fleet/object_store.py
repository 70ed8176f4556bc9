"""An object store by its URL, through obstore: create-only by If-None-Match, exchanges by the entity tag."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from datetime import timedelta
from typing import Any, TypeVar

from siloscope.errors import InputError
from siloscope.fleet.store import Missing
from siloscope.io.extras import need

Result = TypeVar("Result")

ATTEMPTS = 4
"""Times a read is begun, whatever obstore itself repeats: a connection may also break inside an answer."""

PAUSE = 0.2
"""Seconds before the second attempt; doubled for each further one."""

RETRY = {"max_retries": 5, "retry_timeout": timedelta(seconds=60)}


class ObjectStore:
    """A store at ``s3://bucket/prefix``, ``gs://…``, ``az://…``; see `siloscope.fleet.store.Store`.

    Region, endpoint and credentials are what the environment and the machine's role say, under the names that the
    provider's own tools use (``AWS_REGION``, ``AWS_ENDPOINT_URL``, …).
    """

    def __init__(self, url: str) -> None:
        self.place = url.rstrip("/")
        self._obstore = need("obstore", "fleet", f"the object store {self.place}")
        self._errors = self._obstore.exceptions
        plain = {"allow_http": "true"} if url.startswith("s3://") and _plain_endpoint() else {}
        try:
            self._store = self._obstore.store.from_url(self.place, retry_config=RETRY, client_options=plain or None)
        except (self._errors.BaseError, ValueError) as error:
            raise InputError(f"{self.place}: no object store can be opened ({_line(error)}); check the URL") from None

    def get(self, name: str) -> bytes:
        """The whole object."""
        return self._read(name, lambda: bytes(self._obstore.get(self._store, name).bytes()))

    def get_range(self, name: str, start: int, length: int) -> bytes:
        """`length` bytes from `start`."""
        return self._read(name, lambda: bytes(self._obstore.get_range(self._store, name, start=start, length=length)))

    def get_tail(self, name: str, length: int) -> bytes:
        """The last `length` bytes."""
        options = {"range": {"suffix": length}}
        return self._read(name, lambda: bytes(self._obstore.get(self._store, name, options=options).bytes()))

    def create(self, name: str, data: bytes) -> bool:
        """Puts with ``If-None-Match: *``."""
        return self._put(name, data, "create")

    def put(self, name: str, data: bytes) -> None:
        """Puts, whatever is there."""
        self._put(name, data, "overwrite")

    def exchange(self, name: str, known: str | None, data: bytes) -> bool:
        """Puts with ``If-Match``, or ``If-None-Match: *`` where nothing was there."""
        return self._put(name, data, "create" if known is None else {"e_tag": known})

    def version(self, name: str) -> str | None:
        """The entity tag."""
        head = self._head(name)
        return None if head is None else str(head["e_tag"])

    def size(self, name: str) -> int | None:
        """Bytes of the object."""
        head = self._head(name)
        return None if head is None else int(head["size"])

    def _head(self, name: str) -> Any | None:
        try:
            return self._read(name, lambda: self._obstore.head(self._store, name))
        except Missing:
            return None

    def names(self, prefix: str) -> Iterator[str]:
        """All objects of a prefix, a thousand a request."""
        try:
            for page in self._obstore.list(self._store, prefix.rstrip("/") or None, chunk_size=1000):
                yield from (entry["path"] for entry in page)
        except self._errors.BaseError as error:
            raise self._failed(prefix, error) from None

    def below(self, prefix: str) -> list[str]:
        """Names of objects and common prefixes."""
        found = self._read(prefix, lambda: self._obstore.list_with_delimiter(self._store, prefix.rstrip("/") or None))
        paths = [*found["common_prefixes"], *(entry["path"] for entry in found["objects"])]
        return [path.rstrip("/").rpartition("/")[2] for path in paths]

    def _put(self, name: str, data: bytes, mode: Any) -> bool:
        try:
            self._obstore.put(self._store, name, data, mode=mode, use_multipart=False)
        except (self._errors.AlreadyExistsError, self._errors.PreconditionError):
            return False
        except self._errors.BaseError as error:
            raise self._failed(name, error) from None
        return True

    def _read(self, name: str, read: Callable[[], Result]) -> Result:
        for attempt in range(ATTEMPTS):
            try:
                return read()
            except (self._errors.NotFoundError, FileNotFoundError):
                raise Missing(f"{self.place}/{name}: no such object; check the place") from None
            except self._errors.BaseError as error:
                if attempt == ATTEMPTS - 1 or not isinstance(error, self._errors.GenericError):
                    raise self._failed(name, error) from None
            time.sleep(PAUSE * 2**attempt)
        raise InputError(f"{self.place}/{name}: can't be read; check the connection")

    def _failed(self, name: str, error: Exception) -> InputError:
        return InputError(
            f"{self.place}/{name}: the object store does not answer as it should ({_line(error)}); check the "
            "connection, the region and the credentials in the environment"
        )


def _plain_endpoint() -> bool:
    """Whether the environment names an endpoint without TLS, as a server in the own network may be."""
    import os

    return os.environ.get("AWS_ENDPOINT_URL", os.environ.get("AWS_ENDPOINT", "")).startswith("http://")


def _line(error: Exception) -> str:
    """The beginning of an error's text, which may have many lines."""
    return " ".join(str(error).split())[:200]
