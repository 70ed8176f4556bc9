"""What the demo's silo holds in every frame, beside the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from siloscope.reporting import plots
from siloscope.reporting.demo import Step
from siloscope.reporting.plots.solid import surface_3d
from siloscope.reporting.plots.trend import trend
from siloscope.reporting.report import picture, table, text
from siloscope.types.content import Content
from siloscope.wording import with_std

SHOWN = 6
"""Rows of the table."""
_DPI = 100


def section(steps: Sequence[Step], found: Sequence[Content]) -> list[str]:
    """Volumes beside their truth, the body of one frame, the discharge over time."""
    told = [(step, content) for step, content in zip(steps, found, strict=False) if content.volume is not None]
    if not told:
        return [text("No frame has a volume: no calibration, or the cone was never seen.")]
    rows = [_row(step, content) for step, content in told[:: max(1, len(told) // SHOWN)]]
    drawn = [content for _, content in told if content.surface is not None]  # an empty silo has none
    body = [] if not drawn else [plots.png(surface_3d(drawn[len(drawn) // 2]), dpi=_DPI)]
    volume, std = (np.array([np.nan if v is None else v for v in values]) for values in zip(
        *((content.volume, content.volume_std) for content in found), strict=True))  # fmt: skip
    story = trend(list(range(len(found))), volume, std, capacity=told[0][1].capacity, label="frame")
    return [
        text(
            "With the calibration, even a full silo's frame tells what is in it: the content's surface is mapped, "
            "continued where it is not seen, and the volume under it integrated, with what pose, silo, sensor and the "
            "unseen leave open. The mass is that of wheat."
        ),
        table(["level", "measured", "truth", "off by", "mass"], rows),
        *(picture(png, "The content of one frame in the cut-open silo.", True) for png in body),
        picture(plots.png(story, dpi=_DPI), "The volume in every frame of the discharge."),
    ]


def _row(step: Step, content: Content) -> list[str]:
    volume, true = float(content.volume or 0.0), step.seen.true_volume
    off = f"{1e3 * (volume - true):+.1f} l"
    mass = with_std(content.mass, content.mass_std, 1e-3, " t")
    return [f"{step.level:.0%}", with_std(volume, content.volume_std, 1.0, " m³"), f"{true:.4f} m³", off, mass]
