"""The surface of the content as a map."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core
from siloscope.errors import UsageError
from siloscope.types.by_value import ByValue

KINDS = {"unseen": 0, "content": 1, "rim": 2, "floor": 3, "other": 4}
"""What a cell of a map shows."""


@dataclass(frozen=True)
class Shape:
    """How a surface lies. Angles in radians, heights upwards."""

    form: str
    """"flat", "tilted", "mound", "funnel" or "irregular"."""
    flank: float
    """Mean angle at which it rises away from the centre; negative for a mound. Its size is the angle of repose."""
    steepness: float
    """Mean angle of the surface, whatever its direction."""
    centre: tuple[float, float] | None
    """Where the lines of steepest slope meet (x, y), m; None where they don't."""
    tilt: tuple[float, float]
    """Mean rise along x and y, as tangents."""
    asymmetry: float
    """Share of the height's variance that a profile about the axis does not explain: 0 for a surface of revolution."""
    irregularity: float
    """The same for a profile about the centre."""

    @classmethod
    def of(cls, found: _core.Shape | None) -> Shape | None:
        """From the core's numbers, whose slopes are tangents."""
        if found is None:
            return None
        flank, steepness = (float(np.arctan(slope)) for slope in (found.flank, found.steepness))
        return cls(found.form, flank, steepness, found.centre, found.tilt, found.asymmetry, found.irregularity)

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "form": self.form,
            "flank_rad": self.flank,
            "steepness_rad": self.steepness,
            "centre_m": None if self.centre is None else list(self.centre),
            "tilt": list(self.tilt),
            "asymmetry": self.asymmetry,
            "irregularity": self.irregularity,
        }


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceMap(ByValue):
    """Heights of a surface on square cells, and everywhere between them. Metres, heights upwards.

    In a silo, x and y are the silo frame's and heights are over `datum`, the z of height 0. For a bare cloud they are
    along `axes`, and heights are the cloud's own along the vertical.
    """

    core: _core.ContentSurface
    datum: float = 0.0
    """z of height 0."""
    radius: float | None = None
    """The silo's radius; None for a bare cloud."""

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3) rows: the horizontal axes and up, in the axes of the cloud."""
        return np.array(self.core.axes)

    @property
    def cell(self) -> float:
        """Side of a cell."""
        grid = self.core.grid
        return 2.0 * grid.reach / grid.side

    @cached_property
    def x(self) -> NDArray[np.float64]:
        """(n,) x of the columns' middles."""
        return self._middles(0)

    @cached_property
    def y(self) -> NDArray[np.float64]:
        """(n,) y of the rows' middles."""
        return self._middles(1)

    def _middles(self, axis: int) -> NDArray[np.float64]:
        grid = self.core.grid
        return np.asarray(grid.centre[axis] - grid.reach + (np.arange(grid.side) + 0.5) * self.cell)

    @cached_property
    def heights(self) -> NDArray[np.float64]:
        """(n, n) heights of the cells' middles, rows along y; NaN outside the silo."""
        return np.where(self.inside, self.datum - self.core.z(), np.nan)

    @cached_property
    def std(self) -> NDArray[np.float64]:
        """(n, n) standard deviations of `heights`: what the sensor's noise and the unseen leave."""
        return np.where(self.inside, self.core.std(), np.nan)

    @cached_property
    def kinds(self) -> NDArray[np.uint8]:
        """(n, n) what each cell shows (`KINDS`)."""
        return self.core.kinds()

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(n, n) cells that show the content's surface."""
        seen: NDArray[np.bool_] = (self.kinds == KINDS["content"]) | (self.kinds == KINDS["rim"])
        return seen

    @cached_property
    def inside(self) -> NDArray[np.bool_]:
        """(n, n) cells whose middle is in the silo; all for a bare cloud."""
        across = np.hypot(self.x[None, :], self.y[:, None])
        return np.full(across.shape, True) if self.radius is None else across <= self.radius

    def height(self, places: ArrayLike) -> NDArray[np.float64]:
        """Heights at places (..., 2)."""
        xy = np.asarray(places, np.float64)
        if xy.shape[-1:] != (2,):
            raise UsageError(f"places of shape {xy.shape}; give (..., 2)")
        flat = self.core.z_at(xy.reshape(-1, 2))
        return np.asarray(self.datum - flat).reshape(xy.shape[:-1])

    def cells(self, places: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of the cells at places (..., 2), the nearest ones beyond the map."""
        xy = np.asarray(places, np.float64)
        column, row = (np.floor((xy[..., k] - first[0]) / self.cell + 0.5) for k, first in ((0, self.x), (1, self.y)))
        side = len(self.x) - 1
        return np.clip(row, 0, side).astype(np.intp), np.clip(column, 0, side).astype(np.intp)

    @cached_property
    def shape(self) -> Shape | None:
        """How the seen part lies; None where it is too small to tell."""
        return Shape.of(self.core.shape())
