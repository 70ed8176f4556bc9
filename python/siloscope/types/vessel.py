"""The silo's walls as lengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SiloGeometry:
    """A silo as a cylinder on a cone, in the silo frame (z along gravity, 0 at the camera's height), in metres.

    What was not seen is None.
    """

    radius: float | None = None
    """Radius of the cylinder."""
    cylinder_bottom: float | None = None
    """z where the cylinder meets the cone."""
    apex: float | None = None
    """z of the cone's vertex."""

    def to_dict(self) -> dict[str, float | None]:
        """The contract's ``silo`` object."""
        return {"radius": self.radius, "cylinder_bottom": self.cylinder_bottom, "apex": self.apex}


@dataclass(frozen=True)
class Lengths:
    """A silo's lengths for measuring: what was calibrated, completed by a datasheet. z as in `SiloGeometry`."""

    geometry: SiloGeometry
    top: float
    """z of the silo's upper edge."""
    top_from: str
    """Where `top` comes from: "datasheet", "given", or "camera" for the camera's own height."""
    assumed: tuple[str, ...]
    """What was taken from elsewhere than the calibration, in words."""
    added_variance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """What the datasheet adds to the variance of radius, cylinder_bottom and apex, m²."""
    bottom_from: str = "wall"
    """Where `cylinder_bottom` comes from: "wall" where cone and cylinder meet, "vertex", or "top"."""
    apex_from: str = "wall"
    """Where `apex` comes from: "wall", or "bottom" for the cylinder's bottom."""
    cone_only: bool = False
    """Whether nobody knows the cylinder, so that `geometry` is the cone continued up to the camera."""


def to_plain(lengths: Lengths) -> dict[str, Any]:
    """Plain data for a result's ``silo``."""
    geometry = SiloGeometry(apex=lengths.geometry.apex) if lengths.cone_only else lengths.geometry
    return {**geometry.to_dict(), "top": lengths.top, "top_from": lengths.top_from}


def vessel_to_dict(
    silo: SiloGeometry, std: SiloGeometry, ovality: float | None, bottom: dict[str, Any]
) -> dict[str, Any]:
    """The contract's ``silo`` of an estimate or a calibration.

    ``ovality`` is the amplitude of the radius' second harmonic over the radius; ``courses`` is null, for frames alone
    tell no courses; ``bottom`` has a kind, and for a cone its heights.
    """
    heights = ("cylinder_bottom", "apex")
    if silo.apex is not None:
        bottom |= {name: getattr(silo, name) for name in heights}
        bottom["std"] = {name: getattr(std, name) for name in heights}
    return {**silo.to_dict(), "courses": None, "ovality": ovality, "bottom": bottom, "std": std.to_dict()}


def geometry_of(
    radius: float | None, cone: tuple[float, float] | None, covariance: NDArray[np.float64]
) -> tuple[SiloGeometry, SiloGeometry]:
    """Geometry and its standard deviations from radius R, cone slope m and intercept b; the cone has radius b − m·z."""
    std = np.sqrt(np.diag(covariance))
    r_std = None if radius is None else float(std[4])
    if cone is None:
        return SiloGeometry(radius=radius), SiloGeometry(radius=r_std)
    slope, intercept = cone

    def height(radius: float, by_radius: float) -> tuple[float, float]:
        z = (intercept - radius) / slope
        jacobian = np.array([by_radius, -z, 1.0]) / slope
        return z, float(np.sqrt(jacobian @ covariance[4:7, 4:7] @ jacobian))

    apex, apex_std = height(0.0, 0.0)
    if radius is None:
        return SiloGeometry(apex=apex), SiloGeometry(apex=apex_std)
    bottom, bottom_std = height(radius, -1.0)
    return SiloGeometry(radius, bottom, apex), SiloGeometry(r_std, bottom_std, apex_std)
