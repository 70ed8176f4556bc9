"""What a vessel file adds to a reading: courses of another diameter, the roof's space, obstacles cut out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from siloscope.content.knowledge import Knowledge
from siloscope.estimation.inputs import Prepared, PreparedPoints
from siloscope.types.content import Content
from siloscope.vessel.vessel import Vessel

MARGIN = 0.02
"""Clearance around an obstacle within which returns are cut out too, m: mixed pixels lie there."""


def with_vessel(content: Content, vessel: Vessel) -> Content:
    """The reading with the volume of courses and roof, without that of obstacles; all keep the deviations."""
    lengths = content.lengths
    if not content.ok or lengths is None or lengths.geometry.radius is None:
        return content
    radius, bottom = lengths.geometry.radius, lengths.geometry.cylinder_bottom
    roof = vessel.roof_volume(radius)
    under, over = (0.0, 0.0) if bottom is None else _courses(content, vessel, radius, bottom, bottom - lengths.top)
    sunk, free = (0.0, 0.0) if bottom is None else _obstacles(content, vessel, radius, bottom, lengths.top)
    under, over = under - sunk, over - free
    volume = None if content.volume is None else content.volume + under
    mass = content.mass
    if mass is not None and content.volume and volume is not None:
        mass *= volume / content.volume
    return replace(
        content,
        volume=volume,
        mass=mass,
        ullage=None if content.ullage is None else content.ullage + over + roof,
        capacity=None if content.capacity is None else content.capacity + under + over + roof,
    )


def _courses(content: Content, vessel: Vessel, radius: float, bottom: float, edge: float) -> tuple[float, float]:
    """Volume that the courses add below and above the surface, m³; `edge` is the fill height over `bottom`."""
    wall = content.level.at_wall
    surface = content.surface
    height = 0.0 if wall is None or surface is None else min(max(bottom - (surface.datum - wall), 0.0), edge)
    return vessel.radius_change(0.0, height, radius), vessel.radius_change(height, edge, radius)


def _obstacles(content: Content, vessel: Vessel, radius: float, edge: float, top: float) -> tuple[float, float]:
    """Volume of the obstacles under the surface and over it, m³, as far as they are inside the vessel."""
    surface = content.surface
    sunk = free = 0.0
    for bar in vessel.obstacles:
        places, each = bar.pieces(edge)
        x, y, z = places.T
        inside = (np.hypot(x, y) < radius) & (z > top) & (z < _floor(content, x, y, radius, edge))
        under = np.zeros(len(z), np.bool_) if surface is None else z > surface.datum - surface.height(places[:, :2])
        sunk += each * float((inside & under).sum())
        free += each * float((inside & ~under).sum())
    return sunk, free


def _floor(
    content: Content, x: NDArray[np.float64], y: NDArray[np.float64], radius: float, edge: float
) -> NDArray[np.float64]:
    """z of the floor at places; endless where nobody knows it."""
    floor, lengths = content.floor.map, content.lengths
    if floor is not None:
        return floor.at(floor.z, x, y)
    apex = None if lengths is None else lengths.geometry.apex
    if apex is None:
        return np.full(len(x), np.inf)
    return apex - (apex - edge) * np.minimum(np.hypot(x, y) / radius, 1.0)


def without_obstacles(prepared: Prepared, known: Knowledge, vessel: Vessel) -> Prepared:
    """The frame without the returns from the vessel's obstacles; as it was where their heights have no place."""
    edge = known.lengths.geometry.cylinder_bottom
    if not vessel.obstacles or edge is None:
        return prepared
    if isinstance(prepared, PreparedPoints):
        hidden = vessel.in_obstacle(known.pose.to_silo(prepared.points), edge, MARGIN)
        return replace(prepared, points=prepared.points[~hidden])
    seen = np.nonzero(prepared.depth > 0.0)
    hidden = vessel.in_obstacle(known.pose.to_silo(seen_points(prepared, known.bias)), edge, MARGIN)
    cut = prepared.depth.copy()
    cut[seen[0][hidden], seen[1][hidden]] = 0.0
    return replace(prepared, depth=cut)


def seen_points(prepared: Prepared, bias: tuple[float, float, float]) -> NDArray[np.float64]:
    """The measured points (N, 3) of a frame in the camera frame, an image's without the sensor's bias."""
    if isinstance(prepared, PreparedPoints):
        return prepared.points
    seen = np.nonzero(prepared.depth > 0.0)
    deep = _unbiased(prepared.depth[seen].astype(np.float64), bias)
    return np.column_stack([prepared.camera.rays()[seen] * deep[:, None], deep])


def _unbiased(measured: NDArray[np.float64], bias: tuple[float, float, float]) -> NDArray[np.float64]:
    """Depth d with ``measured = d + offset + scale d + quadratic d²`` (Eq. 10)."""
    offset, scale, quadratic = bias
    gain, rest = 1.0 + scale, measured - offset
    return np.asarray(2.0 * rest / (gain + np.sqrt(np.maximum(gain**2 + 4.0 * quadratic * rest, 0.0))))
