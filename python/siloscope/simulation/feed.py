"""The feed's shape and level."""

from __future__ import annotations

from dataclasses import dataclass

from siloscope.errors import UsageError

BASES = ("gaussian", "funnel", "mound", "crater", "flat")
"""Feed shapes that stand alone."""

EXTRAS = ("tilted", "lumpy", "rathole")
"""What can be added to a feed shape."""


@dataclass(frozen=True)
class Feed:
    """Feed in the silo. Lengths in metres, angles in radians; None takes the default for the silo's radius R.

    Parameters
    ----------
    shape : str
        A base (`BASES`) and any `EXTRAS`, joined by "+": "gaussian" is the paper's (section 2.4.1), "funnel" an
        inverted cone (over a flat floor a ring of dead feed), "mound" an upright one, "crater" a plain with a
        funnel drawn down in it; "tilted", "lumpy" and "rathole" alone stand on a flat base.
    level : float
        Height of the highest feed point over the vertex as a share of cylinder and cone height.
    angle, tip : float
        Angle of repose of funnel and mound (0.45) and the radius over which their tip is rounded (0.1 R).
    centre : pair of float
        Where funnel, mound, crater or Gaussian have their axis.
    crater_depth : float
        Depth of a crater below its plain (0.6 R).
    tilt, tilt_azimuth : float
        Slope of the whole surface (0.15 where "tilted") and the direction in which it rises.
    lump_height, lump_size : float
        Bound of the smooth random bumps (0.08 R where "lumpy") and the distance between them (0.35 R).
    rathole_radius, rathole_depth, rathole_centre
        A steep hole (0.2 R, 0.8 R, (0.35 R, 0.2 R) where "rathole").
    seed : int
        Draws the bumps.
    """

    shape: str = "gaussian"
    level: float = 0.1
    angle: float | None = None
    tip: float | None = None
    centre: tuple[float, float] = (0.0, 0.0)
    crater_depth: float | None = None
    tilt: float | None = None
    tilt_azimuth: float = 0.0
    lump_height: float | None = None
    lump_size: float | None = None
    rathole_radius: float | None = None
    rathole_depth: float | None = None
    rathole_centre: tuple[float, float] | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        parts = self.parts
        unknown = [part for part in parts if part not in BASES + EXTRAS]
        bases = [part for part in parts if part in BASES]
        if unknown or len(bases) > 1 or len(set(parts)) < len(parts):
            known = ", ".join(BASES)
            raise UsageError(
                f"feed shape '{self.shape}': give one of {known}, with any of {', '.join(EXTRAS)} after '+'"
            )

    @property
    def parts(self) -> list[str]:
        """The names in `shape`."""
        return [part.strip() for part in self.shape.split("+")]

    def resolved(self, radius: float) -> ResolvedFeed:
        """All numbers for a silo of this radius."""
        parts = self.parts

        def chosen(value: float | None, part: str, default: float) -> float:
            return (default if part in parts else 0.0) if value is None else value

        def given(value: float | None, default: float) -> float:
            return default if value is None else value

        return ResolvedFeed(
            base=next((part for part in parts if part in BASES), "flat"),
            level=self.level,
            angle=given(self.angle, 0.45),
            tip=given(self.tip, 0.1 * radius),
            centre=self.centre,
            crater_depth=given(self.crater_depth, 0.6 * radius),
            tilt=chosen(self.tilt, "tilted", 0.15),
            tilt_azimuth=self.tilt_azimuth,
            lump_height=chosen(self.lump_height, "lumpy", 0.08 * radius),
            lump_size=given(self.lump_size, 0.35 * radius),
            rathole_radius=given(self.rathole_radius, 0.2 * radius),
            rathole_depth=chosen(self.rathole_depth, "rathole", 0.8 * radius),
            rathole_centre=(0.35 * radius, 0.2 * radius) if self.rathole_centre is None else self.rathole_centre,
            seed=self.seed,
        )


@dataclass(frozen=True)
class ResolvedFeed:
    """A `Feed` with no default left open; see there."""

    base: str
    level: float
    angle: float
    tip: float
    centre: tuple[float, float]
    crater_depth: float
    tilt: float
    tilt_azimuth: float
    lump_height: float
    lump_size: float
    rathole_radius: float
    rathole_depth: float
    rathole_centre: tuple[float, float]
    seed: int
