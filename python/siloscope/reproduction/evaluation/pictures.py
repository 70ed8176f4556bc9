"""Pictures that several chapters have; drawing imports matplotlib only when a picture is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from siloscope.reproduction.evaluation.chapter import Picture
from siloscope.reproduction.evaluation.series import Series
from siloscope.reproduction.evaluation.tables import LEAST
from siloscope.types.pose import SiloPose

if TYPE_CHECKING:
    from matplotlib.figure import Figure


READING = (
    "Grey: every method of the panel refuses. A panel of errors is cut where a full silo's few wild steps would "
    f"flatten the rest; distances below {LEAST:g} mm are drawn at it."
)
"""How to read the curves."""


def curves(name: str, caption: str, series: Sequence[Series], title: str) -> Picture:
    """Errors, shares and distances over the discharge."""

    def draw() -> Figure:
        from siloscope.reproduction.evaluation import figures

        return figures.discharges(series, title)

    return Picture(name, f"{caption} {READING}", draw)


def clouds(
    name: str, caption: str, series: Sequence[Series], poses: Mapping[str, SiloPose | None], title: str
) -> Picture:
    """Each silo's last frame adjusted with the true pose and with the estimated one."""

    def draw() -> Figure:
        from siloscope.reproduction.evaluation import figures

        return figures.adjusted({one.name: one.observations[-1].scene for one in series}, poses, title)

    return Picture(name, caption, draw)
