"""Settings carry a version as their ETag: who changes one says which version they saw."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Header, Response

from siloscope.monitor.problems import Problem

IfMatch = Annotated[
    str | None, Header(alias="If-Match", max_length=80, description="ETag of what is changed; not needed to make it.")
]


def etag(row: Any) -> str:
    """Of a row."""
    return f'"{row.version}"'


def tell(response: Response, row: Any) -> None:
    """Puts the ETag into an answer."""
    response.headers["ETag"] = etag(row)


def must_match(row: Any, told: str | None, what: str) -> None:
    """Raises `Problem` unless what is there is what was seen."""
    if row is None:
        if told is not None:
            raise Problem("changed-meanwhile", f"{what} is not there any more")
        return
    if told is None:
        raise Problem("precondition-required", f"{what} is there; send its ETag as If-Match")
    if told.strip() not in (etag(row), "*"):
        raise Problem("changed-meanwhile", f"{what} has the ETag {etag(row)} now")
