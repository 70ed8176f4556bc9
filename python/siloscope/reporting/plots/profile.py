"""The r–z profile: every point folded about the axis, the fitted silo, and what is left over."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from siloscope.reporting.plots.style import AMBER, BLUE, INK, MUTED, figure, heading, legend, tidy
from siloscope.reporting.plots.view import Points
from siloscope.types.vessel import SiloGeometry

MOST = 40_000


def profile(
    points: Points, wall: NDArray[np.bool_], silo: SiloGeometry, residuals: Points | None = None, what: str = "points"
) -> Figure:
    """Profile of a frame and residuals of its wall.

    `points` is (N, 3) in the silo frame, `wall` (N,) tells those the fit took for wall; the others were rejected
    (feed, clutter, flying pixels). `residuals` (N,) are the fit's own distances from the wall in metres, outwards;
    without them they are taken from `silo`. `what` names what the points are.
    """
    r, z = np.hypot(points[:, 0], points[:, 1]), points[:, 2]
    off = 1e3 * (wall_distance(r, z, silo) if residuals is None else residuals)
    made = figure(12.0, 6.4)
    low, high = _reach(z, silo)
    share = float(np.clip(1.2 * r.max(initial=1e-6) / (high - low), 0.4, 1.2))
    left, right = made.subplots(1, 2, width_ratios=(share, 2.0 - share))
    _profile(left, r, z, wall, silo)
    _residuals(right, off, z, wall)
    for axes in (left, right):
        axes.set_ylim(high, low)
    share = 100.0 * np.count_nonzero(wall) / max(len(wall), 1)
    heading(made, f"r–z profile: {share:.0f} % of the {what} are wall")
    return made


def wall_distance(r: Points, z: Points, silo: SiloGeometry) -> Points:
    """Signed distance (N,) of points (r, z) from cylinder and cone, positive outside; NaN where no wall is known."""
    distances = []
    if silo.radius is not None:
        distances.append(r - silo.radius)
        if silo.cylinder_bottom is not None and silo.apex is not None:
            height = silo.apex - silo.cylinder_bottom
            slant = np.hypot(height, silo.radius)
            distances.append(((z - silo.apex) * silo.radius + r * height) / slant)
    if not distances:
        return np.full(r.shape, np.nan)
    farthest: Points = np.max(distances, axis=0)
    return farthest


def _profile(axes: Axes, r: Points, z: Points, wall: NDArray[np.bool_], silo: SiloGeometry) -> None:
    few = _few(len(r))
    for kind, colour, label in ((~wall, AMBER, "rejected: feed, clutter"), (wall, BLUE, "wall")):
        chosen = few[kind[few]]
        axes.scatter(
            r[chosen], z[chosen], s=_dot(len(few)), c=colour, linewidths=0, alpha=0.5, label=label, rasterized=True
        )
    top = float(z.min()) if len(z) else 0.0
    if silo.radius is not None:
        bottom = silo.cylinder_bottom if silo.cylinder_bottom is not None else float(z[wall].max(initial=top))
        line = [(silo.radius, top), (silo.radius, bottom)]
        if silo.apex is not None and silo.cylinder_bottom is not None:
            line.append((0.0, silo.apex))
        axes.plot(*zip(*line, strict=True), color=INK, linewidth=1.4, label="fitted silo")
    axes.axvline(0.0, color=MUTED, linewidth=1.0, linestyle=(0, (6, 3)))
    axes.set_xlim(left=-0.02 * float(r.max(initial=1.0)))
    tidy(axes, "folded about the axis", "r, distance from the axis (m)", "z, below the camera (m)")
    axes.set_aspect("equal")
    legend(axes, columns=1)


def _residuals(axes: Axes, off: Points, z: Points, wall: NDArray[np.bool_]) -> None:
    few = _few(len(off))
    chosen = few[wall[few]]
    spread = float(np.nanpercentile(np.abs(off[wall]), 99.0)) if np.isfinite(off[wall]).any() else 1.0
    axes.axvline(0.0, color=MUTED, linewidth=1.0)
    others = few[~wall[few]]
    size = _dot(len(few))
    axes.scatter(off[others], z[others], s=size, c=AMBER, linewidths=0, alpha=0.35, rasterized=True)
    axes.scatter(off[chosen], z[chosen], s=size, c=BLUE, linewidths=0, alpha=0.25, rasterized=True)
    _running_quantiles(axes, off[wall], z[wall])
    axes.set_xlim(-1.4 * spread, 1.4 * spread)
    known = off[wall][np.isfinite(off[wall])]
    rms = f": {np.sqrt(np.mean(known**2)):.2g} mm rms" if len(known) else ""
    tidy(axes, f"what is left over on the wall{rms}", "distance from the fitted wall, outwards (mm)")


def _running_quantiles(axes: Axes, off: Points, z: Points) -> None:
    """The middle and the spread of the residuals by height: a fit that bends shows here long before the cloud does."""
    if len(z) < 500:
        return
    bins = np.array_split(np.argsort(z), 30)
    height = [np.median(z[part]) for part in bins]
    low, middle, high = np.array([np.percentile(off[part], (5.0, 50.0, 95.0)) for part in bins]).T
    axes.plot(low, height, color=INK, linewidth=1.2, linestyle="--", label="5 and 95 % of the points")
    axes.plot(high, height, color=INK, linewidth=1.2, linestyle="--")
    axes.plot(middle, height, color=INK, linewidth=2.4, label="median by height")
    legend(axes)


def _reach(z: Points, silo: SiloGeometry) -> tuple[float, float]:
    """Heights to show: the points and the apex, with a little air."""
    ends = [z.min(), z.max()] if len(z) else [0.0, 1.0]
    low, high = float(ends[0]), float(max(ends[1], silo.apex or ends[1]))
    air = max(0.03 * (high - low), 1e-3)
    return low - air, high + air


def _dot(count: int) -> float:
    """Size of a dot: fewer points may be bigger."""
    return float(np.clip(40_000.0 / max(count, 1), 1.6, 9.0))


def _few(count: int) -> NDArray[np.intp]:
    """Indices of at most `MOST` points, drawn with a fixed seed."""
    order: NDArray[np.intp] = np.random.default_rng(0).permutation(count)[:MOST]
    return order
