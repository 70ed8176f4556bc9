"""How much feed there is."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from siloscope import _core
from siloscope.simulation.checked import checked
from siloscope.simulation.feed import Feed
from siloscope.simulation.silo import Silo


@dataclass(frozen=True)
class Content:
    """The feed's truth, by quadrature (relative error below 1e-6). Heights are over the cone's vertex, metres.

    Only feed inside cylinder and cone counts; feed in the outlet pipe or stuck to walls does not.
    """

    volume: float
    """m³."""
    area: float
    """Area of the feed surface seen from above, m²."""
    mean_height: float | None
    """Mean height of the surface by area seen from above; None where there is no feed."""
    max_height: float | None
    """Highest feed point."""
    min_height: float | None
    """Lowest point of the surface."""

    def to_dict(self) -> dict[str, float | None]:
        """Plain data."""
        return asdict(self)


EMPTY = Content(volume=0.0, area=0.0, mean_height=None, max_height=None, min_height=None)
"""No feed at all."""


def content_of(silo: Silo, feed: Feed | None) -> Content:
    """Volume and heights of a feed in its silo."""
    found = checked(_core.feed_content, silo, feed)
    if found is None or found.area == 0.0:
        return EMPTY
    return Content(found.volume, found.area, found.mean_height, found.max_height, found.min_height)
