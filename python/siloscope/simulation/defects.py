"""What real silos have and perfect ones lack: uneven walls, and things that hang in view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from siloscope.errors import UsageError
from siloscope.simulation.silo import Silo

Bar = tuple[float, float, float, float, float, float, float]
"""A round bar: both ends (x, y, z) and the radius."""


@dataclass(frozen=True)
class Defects:
    """Deviations from the perfect silo. Metres and radians; azimuths are about the axis, from x towards y.

    Bumps stand inwards. Corrugation, seams and bolts are on the cylinder, the rest also on the cone.
    """

    corrugation_depth: float = 0.0
    """Crest to trough of sinusoidal sheet, waves along z; common sheet has 0.013."""
    corrugation_pitch: float = 0.076
    """Length of a wave."""
    ovality: float = 0.0
    """Share of the radius by which the wall is out of round: ``r = R (1 + ovality cos 2(azimuth - axis))``."""
    ovality_azimuth: float = 0.0
    """Azimuth of the long diameter."""
    bend: float = 0.0
    """Generatrix that is not straight: displacement of both ends of the cylinder, half of it the other way in the
    middle, so that the axis is the best straight line. The cone hangs at the lower end; its vertex is on the axis."""
    bend_azimuth: float = 0.0
    """Direction of the ends' displacement."""
    seam_spacing: float = 0.0
    """Distance between overlaps around the silo, 0 for none."""
    upright_seams: int = 0
    """Number of overlaps along the silo."""
    seam_height: float = 0.003
    """How far an overlap stands out."""
    seam_width: float = 0.05
    """Its width."""
    bolts: int = 0
    """Bolts on every overlap around the silo."""
    bolt_height: float = 0.008
    """Height of a bolt's head."""
    bolt_radius: float = 0.012
    """Radius of a bolt's head."""
    dents: int = 0
    """Number of dents at random places."""
    dent_depth: float = 0.03
    """Greatest depth of a dent; each has between 0.3 and 1 of it."""
    dent_radius: float = 0.3
    """Radius of a dent."""
    film_bands: tuple[tuple[float, float, float], ...] = ()
    """Feed stuck to the wall: (distance of the band's upper and lower end from the top edge, thickness)."""
    film_lobes: int = 0
    """How many times around the silo the bands are thick and thin; 0 for even ones."""
    film_azimuth: float = 0.0
    """Azimuth at which they are thickest."""
    ladder: bool = False
    """A ladder down the cylinder, 0.15 m off the wall, 0.4 m wide, a rung every 0.3 m."""
    ladder_azimuth: float = 2.0
    """Azimuth of its middle."""
    cables: int = 0
    """Temperature cables that hang from the top, 8 mm thick, at random places."""
    auger: bool = False
    """A sweep auger, 0.2 m thick, from the axis to the wall at the cylinder's bottom."""
    auger_azimuth: float = 0.8
    """Its direction."""
    bars: tuple[Bar, ...] = ()
    """Round bars at given places of the silo frame: beams, cables, pipes."""
    seed: int = 0
    """Draws the places of dents and cables."""

    def __post_init__(self) -> None:
        for name in ("dents", "cables", "upright_seams", "bolts", "film_lobes", "seed"):
            count = getattr(self, name)
            if isinstance(count, bool) or not isinstance(count, int) or not 0 <= count <= 10_000:
                raise UsageError(f"{name} must be a whole number between 0 and 10000, got {count!r}")

    def resolved(self, silo: Silo) -> ResolvedDefects:
        """Everything at its place in a silo."""
        bundles = [self._cables(silo), *([bar] for bar in self.bars)]
        if self.ladder:
            bundles.append(_ladder(silo, self.ladder_azimuth))
        if self.auger:
            bundles.append(_auger(silo, self.auger_azimuth))
        return ResolvedDefects(
            corrugation_depth=self.corrugation_depth,
            corrugation_pitch=self.corrugation_pitch,
            ovality=self.ovality,
            ovality_azimuth=self.ovality_azimuth,
            bend=self.bend,
            bend_azimuth=self.bend_azimuth,
            seam_spacing=self.seam_spacing,
            upright_seams=self.upright_seams,
            seam_height=self.seam_height,
            seam_width=self.seam_width,
            bolts=self.bolts,
            bolt_height=self.bolt_height,
            bolt_radius=self.bolt_radius,
            dents=self._dents(silo),
            film_bands=[(silo.top + start, silo.top + end, thick) for start, end, thick in self.film_bands],
            film_lobes=self.film_lobes,
            film_azimuth=self.film_azimuth,
            bundles=[bundle for bundle in bundles if bundle],
        )

    def _dents(self, silo: Silo) -> list[tuple[float, float, float, float]]:
        """(azimuth, z, radius, height inwards) of every dent; on cylinder and upper half of the cone."""
        draw = np.random.default_rng((self.seed, 1))
        azimuths = draw.uniform(-math.pi, math.pi, self.dents)
        heights = silo.top + draw.uniform(0.0, silo.cylinder_height + 0.5 * silo.cone_height, self.dents)
        depths = self.dent_depth * draw.uniform(0.3, 1.0, self.dents)
        rows = zip(azimuths.tolist(), heights.tolist(), depths.tolist(), strict=True)
        return [(azimuth, z, self.dent_radius, depth) for azimuth, z, depth in rows]

    def _cables(self, silo: Silo) -> list[Bar]:
        """Cables from the top to 0.9 of the cylinder, each a little out of plumb."""
        draw = np.random.default_rng((self.seed, 2))
        azimuths = draw.uniform(-math.pi, math.pi, self.cables)
        distances = silo.radius * np.sqrt(draw.uniform(0.15**2, 0.8**2, self.cables))
        drifts = draw.normal(0.0, 0.01 * silo.cylinder_height, (self.cables, 2))
        places = np.stack([distances * np.cos(azimuths), distances * np.sin(azimuths)], axis=-1)
        end = silo.top + 0.9 * silo.cylinder_height
        return [(*place, silo.top, *foot, end, 0.004) for place, foot in zip(places, places + drifts, strict=True)]


DEFECTS: dict[str, dict[str, Any]] = {
    "corrugated": {"corrugation_depth": 0.013},
    "oval": {"ovality": 0.01, "ovality_azimuth": 0.5},
    "bent": {"bend": 0.005, "bend_azimuth": 1.2},
    "seams": {"seam_spacing": 1.0, "upright_seams": 5, "bolts": 40},
    "dents": {"dents": 12},
    "film": {"film_bands": ((0.6, 1.2, 0.03), (1.8, 2.3, 0.05)), "film_lobes": 2},
    "cake": {"film_bands": ((0.9, 2.6, 0.04),)},
    "build-up": {"film_bands": ((1.0, 2.4, 0.04),), "film_lobes": 1},
    "ladder": {"ladder": True},
    "cables": {"cables": 4},
    "auger": {"auger": True},
}
"""Usual sizes of each defect by name."""

ALL = ("corrugated", "oval", "seams", "dents", "film", "ladder", "cables", "auger")
"""Those that "all" means."""


def defects(names: str, seed: int = 0) -> Defects:
    """Defects of usual size: names of `DEFECTS` joined by "+" or ",", or "all" of `ALL`.

    Raises `UsageError` for an unknown name.
    """
    wanted = list(ALL) if names == "all" else [name.strip() for name in names.replace("+", ",").split(",")]
    unknown = [name for name in wanted if name not in DEFECTS]
    if unknown:
        raise UsageError(f"unknown defect '{unknown[0]}'; known are {', '.join(DEFECTS)} and all")
    fields = {key: value for name in wanted for key, value in DEFECTS[name].items()}
    return Defects(**fields, seed=seed)


@dataclass(frozen=True)
class ResolvedDefects:
    """`Defects` at their places in a silo; z in the silo frame."""

    corrugation_depth: float
    corrugation_pitch: float
    ovality: float
    ovality_azimuth: float
    bend: float
    bend_azimuth: float
    seam_spacing: float
    upright_seams: int
    seam_height: float
    seam_width: float
    bolts: int
    bolt_height: float
    bolt_radius: float
    dents: list[tuple[float, float, float, float]]
    film_bands: list[tuple[float, float, float]]
    film_lobes: int
    film_azimuth: float
    bundles: list[list[Bar]]


def _ladder(silo: Silo, azimuth: float) -> list[Bar]:
    """Two rails and the rungs between them."""
    out, along = (math.cos(azimuth), math.sin(azimuth)), (-math.sin(azimuth), math.cos(azimuth))
    distance, bottom = silo.radius - 0.15, silo.top + silo.cylinder_height

    def place(offset: float) -> tuple[float, float]:
        return (distance * out[0] + offset * along[0], distance * out[1] + offset * along[1])

    left, right = place(-0.2), place(0.2)
    rails = [(*side, silo.top, *side, bottom, 0.02) for side in (left, right)]
    heights = np.arange(silo.top + 0.15, bottom, 0.3).tolist()
    return rails + [(*left, z, *right, z, 0.0125) for z in heights]


def _auger(silo: Silo, azimuth: float) -> list[Bar]:
    """A tube with a gear box at the axis."""
    reach = 0.9 * silo.radius
    z = silo.top + silo.cylinder_height - 0.1
    end = (reach * math.cos(azimuth), reach * math.sin(azimuth), z)
    return [(0.0, 0.0, z, *end, 0.1), (0.0, 0.0, z, 0.0, 0.0, z + 0.2, 0.15)]
