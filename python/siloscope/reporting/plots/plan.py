"""A plan on the roof: where a camera sees most, and what it would state at each level."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from siloscope.planning.plan import Place, Plan
from siloscope.reporting.plots.style import BLUE, GREY, INK, RED, figure, tidy


def plan_picture(plan: Plan) -> Figure:
    """Left the roof from above, the axis' deviation at each place; right the levels at the best place."""
    made = figure(11.0, 5.2)
    roof, levels = made.subplots(1, 2, width_ratios=(1.0, 1.1))
    _roof(roof, plan)
    _levels(levels, plan.best)
    return made


def _roof(axes: Axes, plan: Plan) -> None:
    radius = plan.view.inside.radius
    tidy(axes, "the roof from above: deviation of the axis (mm)", "x (m)", "y (m)")
    turn = np.linspace(0.0, 2.0 * math.pi, 181)
    axes.plot(radius * np.cos(turn), radius * np.sin(turn), color=INK, linewidth=1.2)
    best: dict[tuple[float, float], Place] = {}
    for place in plan.places:
        best.setdefault((round(place.placement.x, 6), round(place.placement.y, 6)), place)
    for (x, y), place in best.items():
        shown = place.best_axis_std
        chosen = place is plan.best
        colour = GREY if shown is None else RED if chosen else BLUE
        axes.plot(x, y, "o", color=colour, markersize=11 if chosen else 8)
        text = "refused" if shown is None else f"{1e3 * shown:.1f}"
        axes.annotate(text, (x, y), (0, 10), textcoords="offset points", ha="center", fontsize=9, color=INK)
    a = plan.best.placement
    c = math.cos(a.pose.r_x)
    sight = np.array([c * math.sin(a.pose.r_y), -math.sin(a.pose.r_x)])
    if np.hypot(*sight) > 1e-6:
        tip = 0.35 * radius * sight / np.hypot(*sight)
        axes.annotate("", (a.x + tip[0], a.y + tip[1]), (a.x, a.y), arrowprops={"arrowstyle": "->", "color": RED})
    axes.set_aspect("equal")


def _levels(axes: Axes, place: Place) -> None:
    a = place.placement
    title = f"best: {math.hypot(a.x, a.y):.2f} m from the axis, {a.aim} ({math.degrees(a.tilt):.0f}°)"
    tidy(axes, title, "standard deviation of the axis by one frame (mm)", "level (%)")
    rows = [one for one in place.levels if one.axis_std is not None]
    axes.plot([1e3 * (one.axis_std or 0.0) for one in rows], [100.0 * one.level for one in rows], "o-", color=BLUE)
    for one in place.levels:
        said = one.reason or (f"volume ± {one.volume_std:.3f} m³" if one.volume_std is not None else "no volume")
        axes.annotate(
            said, (0.98, 100.0 * one.level), xycoords=("axes fraction", "data"), ha="right", fontsize=9, color=INK
        )
    axes.set_xlim(0.0, 1.45 * max((1e3 * (one.axis_std or 0.0) for one in rows), default=1.0))
    axes.set_ylim(0.0, 100.0)
