"""The input cloud, the adjusted cloud, and the candidates on it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from siloscope.reporting.plots.depth import paint_depth
from siloscope.reporting.plots.style import BLUE, GREY, INK, RED, figure, heading, legend, tidy
from siloscope.reporting.plots.view import Points, View, bare, circle, outline, subsample
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry


def clouds(points: Points, corrected: Points, pose: SiloPose, silo: SiloGeometry) -> Figure:
    """Input cloud (red, as the camera sees it) and adjusted cloud (blue, in the silo frame) with the silo's axis.

    `points` is (N, 3) in the camera frame, in metres, `corrected` the same without the sensor's bias: what is adjusted.
    """
    seen, adjusted = subsample(points), pose.to_silo(subsample(corrected))
    made = figure(12.0, 6.2)
    overview, front, side = made.subplots(1, 3, width_ratios=(1.25, 1.0, 1.0))
    _overview(overview, seen, adjusted, silo)
    _elevation(front, seen, adjusted, 0, silo, pose.t_x)
    _elevation(side, seen, adjusted, 1, silo, pose.t_y)
    legend(front, columns=5)
    heading(made, "Before (red, camera frame) and after (blue, silo frame): the axis stands on z")
    return made


def overview(
    depth: NDArray[np.floating], points: Points, corrected: Points, pose: SiloPose, silo: SiloGeometry
) -> Figure:
    """What goes in and what comes out: the depth image (H, W), and `clouds` from the side."""
    made = figure(12.0, 5.2)
    left, right = made.subplots(1, 2, width_ratios=(1.35, 1.0))
    paint_depth(left, depth)
    _overview(right, subsample(points), pose.to_silo(subsample(corrected)), silo)
    legend(right, columns=3, gap=0.02)
    return made


def candidates(points: Points, chosen: NDArray[np.bool_], pose: SiloPose, silo: SiloGeometry) -> Figure:
    """The points step 3 chose, on the cloud: from the side and along the axis.

    `points` is (N, 3) in the camera frame, `chosen` (N,) tells the candidates.
    """
    adjusted = pose.to_silo(points)
    rest, picked = subsample(adjusted[~chosen]), subsample(adjusted[chosen])
    made = figure(12.0, 6.2)
    overview, plan = made.subplots(1, 2, width_ratios=(1.0, 1.15))
    view = View()
    view.scatter(overview, rest, GREY, "other points")
    view.scatter(overview, picked, RED, "candidates", size=4.0)
    outline(overview, view, silo, _top(adjusted))
    bare(overview)
    plan.scatter(rest[:, 0], rest[:, 1], s=1.2, c=GREY, linewidths=0, label="other points", rasterized=True)
    plan.scatter(picked[:, 0], picked[:, 1], s=4.0, c=RED, linewidths=0, label="candidates", rasterized=True)
    _plan(plan, silo)
    share = 100.0 * np.count_nonzero(chosen) / max(len(chosen), 1)
    heading(made, f"Candidates: {np.count_nonzero(chosen):,} of {len(chosen):,} points ({share:.0f} %)")
    return made


def _overview(axes: Axes, seen: Points, adjusted: Points, silo: SiloGeometry) -> None:
    view = View()
    view.scatter(axes, seen, RED, "input cloud")
    view.scatter(axes, adjusted, BLUE, "adjusted cloud")
    low, high = float(adjusted[:, 2].min(initial=0.0)), float(adjusted[:, 2].max(initial=0.0))
    view.line(axes, np.array([[0, 0, low], [0, 0, high]]), color=INK, linewidth=1.6, label="silo axis")
    outline(axes, view, silo, _top(adjusted))
    bare(axes)


def _elevation(axes: Axes, seen: Points, adjusted: Points, across: int, silo: SiloGeometry, beside: float) -> None:
    for cloud, colour in ((seen, RED), (adjusted, BLUE)):
        label = "input cloud" if colour == RED else "adjusted cloud"
        axes.scatter(
            cloud[:, across], cloud[:, 2], s=0.8, c=colour, linewidths=0, alpha=0.5, label=label, rasterized=True
        )
    axes.axvline(0.0, color=INK, linewidth=1.6, label="silo axis")
    if silo.radius is not None and silo.cylinder_bottom is not None and silo.apex is not None:
        wall = np.array([[silo.radius, _top(adjusted)], [silo.radius, silo.cylinder_bottom], [0.0, silo.apex]])
        for mirror in (-1.0, 1.0):
            axes.plot(mirror * wall[:, 0], wall[:, 1], color=INK, linewidth=0.9, alpha=0.55)
    for place, colour in ((0.0, RED), (beside, BLUE)):
        axes.plot([place], [0.0], marker="v", color=colour, markersize=9, zorder=5, linestyle="", label="camera")
    tidy(axes, "xy"[across] + "–z", f"{'xy'[across]} (m)", "z, down (m)" if across == 0 else "")
    axes.set_aspect("equal")
    axes.invert_yaxis()


def _plan(axes: Axes, silo: SiloGeometry) -> None:
    if silo.radius is not None:
        ring = circle(silo.radius, 0.0)
        axes.plot(ring[:, 0], ring[:, 1], color=INK, linewidth=1.0, alpha=0.6, label="fitted cylinder")
    axes.plot([0.0], [0.0], marker="+", color=INK, markersize=12, markeredgewidth=1.8)
    tidy(axes, "along the axis", "x (m)", "y (m)")
    axes.set_aspect("equal")
    legend(axes)


def _top(adjusted: Points) -> float:
    """The highest point seen, where the outline starts."""
    return float(np.percentile(adjusted[:, 2], 0.5)) if len(adjusted) else 0.0
