"""From cubic metres to kilograms: bulk densities, their spread, and how feed settles under its own weight."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from siloscope.content.units import test_weight
from siloscope.errors import InputError, UsageError
from siloscope.parameters import GRAVITY
from siloscope.vessel.floor import STEEPEST_REPOSE

if TYPE_CHECKING:
    from siloscope.schema.product import ProductFile

DENSITIES = (10.0, 10_000.0)
"""Bulk densities that a silo may hold, kg/m³."""
LOT_SPREAD = 0.01
"""Relative spread of the test weight within a lot, against the 5 % between lots of a product table."""
STEPS = 400
"""Slices of a column in which the pressure is followed."""


@dataclass(frozen=True)
class Density:
    """Bulk density of what is in the silo.

    With a compaction curve the density grows with the vertical pressure, which follows Janssen's equation
    ``σ(h) = ρ g R / (2 μ K) · (1 - exp(-2 μ K h / R))`` at the depth h below the surface of a cylinder of radius R.
    """

    name: str
    loose: float
    """Density as poured, kg/m³."""
    std: float = 0.0
    """Standard deviation of the density, kg/m³."""
    source: str = ""
    """Where the figures come from."""
    compaction: tuple[tuple[float, float], ...] = ()
    """Vertical pressure (Pa) and density there (kg/m³), pressures rising from 0; empty for one density."""
    friction: float = 0.4
    """μ, of the feed on the wall."""
    pressure_ratio: float = 0.5
    """K, horizontal by vertical pressure."""
    steepest: float = STEEPEST_REPOSE
    """Steepest slope at which it lies, radians; a steeper surface is no feed."""

    def __post_init__(self) -> None:
        _between(f"{self.name}: density", self.loose, *DENSITIES)
        _between(f"{self.name}: density_std", self.std, 0.0, self.loose)
        _between(f"{self.name}: friction", self.friction, 0.0, 2.0)
        _between(f"{self.name}: pressure_ratio", self.pressure_ratio, 0.0, 2.0)
        _between(f"{self.name}: steepest_repose", math.degrees(self.steepest), 5.0, 89.0)
        pressures = [p for p, _ in self.compaction]
        rising = all(a < b for a, b in itertools.pairwise(pressures))
        if self.compaction and (pressures[0] != 0.0 or not rising):
            raise InputError(f"{self.name}: compaction must begin at pressure 0 and rise; sort its entries")
        for _, density in self.compaction:
            _between(f"{self.name}: compaction density", density, *DENSITIES)

    def mean(self, heights: NDArray[np.float64], radius: float) -> float:
        """Mean density, kg/m³, of columns of these heights (N,), m, that stand side by side in a silo of a radius."""
        columns = heights[heights > 0.0]
        if not self.compaction or not len(columns):
            return self.loose
        depth = np.linspace(0.0, float(columns.max()), STEPS + 1)
        load = np.concatenate([[0.0], np.cumsum(self._densities(depth, radius))])
        mass = np.interp(columns, depth, load)
        return float(mass.sum() / columns.sum())

    def _densities(self, depth: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
        """Mass per area of each slice, kg/m², the pressure carried down from slice to slice: dσ/dh = ρ g - σ/Λ."""
        pressures, densities = np.array(self.compaction).T
        step = depth[1] - depth[0]
        carried = 2.0 * self.friction * self.pressure_ratio / radius
        sigma, slices = 0.0, np.empty(len(depth) - 1)
        for i in range(len(slices)):
            rho = float(np.interp(sigma, pressures, densities))
            slices[i] = rho * step
            held = math.exp(-carried * step)
            lasting = rho * GRAVITY * (-math.expm1(-carried * step) / carried if carried > 0.0 else step)
            sigma = sigma * held + lasting
        return slices

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "name": self.name,
            "loose_kg_m3": self.loose,
            "std_kg_m3": self.std,
            "source": self.source,
            "steepest_repose_rad": self.steepest,
            "compaction": [list(entry) for entry in self.compaction],
            "friction": self.friction if self.compaction else None,
            "pressure_ratio": self.pressure_ratio if self.compaction else None,
        }


def choose(
    density: float | None = None,
    density_std: float | None = None,
    product: str | Path | Density | None = None,
    weighed: str | None = None,
) -> Density | None:
    """The density that a caller names: a number, a product, a product file, or a test weight; None for none.

    A weighed test weight takes the place of a product's density, and keeps its compaction and repose.

    Raises
    ------
    UsageError
        For a density and a product at once, a deviation alone, or a product that nobody knows.
    InputError
        For a file that is no product.
    """
    if density is not None and (product is not None or weighed is not None):
        raise UsageError("give a density or a product or a test weight, not two of them")
    if weighed is not None:
        return _weighed(weighed, density_std, product)
    if density is None and product is None:
        if density_std is not None:
            raise UsageError("a density's deviation without a density; give --density too")
        return None
    if density is not None:
        return _number(density, density_std)
    chosen = product if isinstance(product, Density) else load(str(product))
    return chosen if density_std is None else _with_std(chosen, density_std)


def _weighed(weighed: str, std: float | None, product: str | Path | Density | None) -> Density:
    loose = test_weight(weighed)
    base = (
        Density("weighed", loose)
        if product is None
        else product
        if isinstance(product, Density)
        else load(str(product))
    )
    return replace(
        base,
        loose=loose,
        std=LOT_SPREAD * loose if std is None else std,
        source=f"test weight of {weighed}; deviation {100.0 * LOT_SPREAD:g} % within a lot",
        compaction=tuple((pressure, dense * loose / base.loose) for pressure, dense in base.compaction),
    )


def products() -> dict[str, Density]:
    """The products that come with siloscope, by name."""
    from siloscope.schema import files, product

    content = resources.files(__package__).joinpath("products.toml").read_bytes()
    table = files.from_toml(content, "products.toml", "table of products", product.REMEDY)
    return {name: _density(product.parse(entry, name), name) for name, entry in table.items()}


ALIASES = {
    "corn": "maize",
    "soya": "soybeans",
    "soy": "soybeans",
    "soybean": "soybeans",
    "soya-meal": "soybean-meal",
    "soy-meal": "soybean-meal",
    "ground-corn": "ground-maize",
    "milo": "sorghum",
    "rapeseed": "canola",
    "linseed": "flax",
    "bran": "wheat-bran",
    "paddy": "rice",
    "pellet": "pellets",
}
"""Other names of the products."""


def load(name: str) -> Density:
    """A product by name or alias, or from a TOML file with ``density`` and what else `Density` has."""
    from siloscope.schema import product

    known = products()
    plain = name.lower().replace("_", "-").replace(" ", "-")
    plain = ALIASES.get(plain, plain)
    if plain in known:
        return known[plain]
    path = Path(name)
    if not path.is_file():
        raise UsageError(f"unknown product '{name}'; give a TOML file's path or one of: {', '.join(sorted(known))}")
    return _density(product.read(path), path.stem)


def _density(told: ProductFile, name: str) -> Density:
    return Density(
        told.name or name,
        told.density,
        told.density_std,
        told.source,
        told.compaction,
        told.friction,
        told.pressure_ratio,
        STEEPEST_REPOSE if told.steepest_repose is None else math.radians(told.steepest_repose),
    )


def _number(density: float, std: float | None) -> Density:
    if isinstance(density, bool) or not DENSITIES[0] <= density <= DENSITIES[1]:
        raise UsageError(f"density must be between {DENSITIES[0]:g} and {DENSITIES[1]:g} kg/m³, got {density}")
    return _with_std(Density("given", float(density), source="given by the caller"), std or 0.0)


def _with_std(chosen: Density, std: float) -> Density:
    if isinstance(std, bool) or not 0.0 <= std <= chosen.loose:
        raise UsageError(f"the density's deviation must be between 0 and {chosen.loose:g} kg/m³, got {std}")
    return replace(chosen, std=float(std))


def _between(what: str, value: float, least: float, most: float) -> None:
    if not (math.isfinite(value) and least <= value <= most):
        raise InputError(f"{what} must be between {least:g} and {most:g}, got {value}")
