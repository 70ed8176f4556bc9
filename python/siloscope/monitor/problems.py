"""What a request is refused with: RFC 9457 problems, each with a stable slug and what to do."""

from __future__ import annotations

from dataclasses import dataclass, field

PROBLEMS: dict[str, tuple[int, str]] = {
    "unauthorized": (401, "sign in, or send a token that is valid"),
    "forbidden": (403, "this may not be done with what you signed in with"),
    "cross-origin": (403, "the request comes from another site"),
    "not-found": (404, "there is no such thing"),
    "method-not-allowed": (405, "the address does not know this method"),
    "hash-differs": (409, "the bytes that came are not those that were sent; send them again"),
    "conflict": (409, "it can't be done in the present state"),
    "changed-meanwhile": (412, "somebody else changed it; get it again"),
    "too-large": (413, "the body is larger than the service takes"),
    "unknown-format": (415, "the body is no file that a frame can be read from"),
    "invalid": (422, "an entry can't be right"),
    "precondition-required": (428, "say which version is changed, with If-Match"),
    "too-many": (429, "too much at once; wait and send again"),
    "storage-full": (507, "the disk is full; the frame was not taken, keep it and send it again"),
    "unavailable": (503, "the service can't answer now; try again"),
}
"""Slug: HTTP status and title."""


@dataclass
class Problem(Exception):
    """A refused request."""

    slug: str
    detail: str
    headers: dict[str, str] = field(default_factory=dict)

    @property
    def status(self) -> int:
        """HTTP status."""
        return PROBLEMS[self.slug][0]

    @property
    def title(self) -> str:
        """What it is, whatever the case."""
        return PROBLEMS[self.slug][1]

    def to_dict(self) -> dict[str, object]:
        """The document of ``application/problem+json``."""
        return {
            "type": f"about:blank#{self.slug}",
            "title": self.title,
            "status": self.status,
            "detail": self.detail,
            "slug": self.slug,
        }
