"""A reading without a calibration: what its refusal means where the frame itself had to show the silo."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope.reasons import CONTENT_REMARKS, INPUT_REMARKS, estimate_refusals, sentence
from siloscope.types.calibration import Calibration
from siloscope.types.content import Content
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.types.remark import Remark

ALONE = "pose and silo from this frame alone, without a calibration"
"""What is assumed where no calibration is given."""

FLOATING = 0.8
"""A return nearer than this fraction of the median around it floats before the surface."""

DUSTY = 0.05
"""Fraction of floating returns with which a frame is refused for its dust; clean frames have 0.01 at most."""

STRIDE = 3
"""Columns and rows from one pixel that is looked at to the next."""

NO_SILO = ("no-wall", "flat-wall", "bent-wall")
"""Reasons of frames in which nothing is of revolution."""


def floating_returns(depth: NDArray[Any]) -> float:
    """Fraction of the returns of a depth image (H, W), in any unit, that float alone before what is around them."""
    seen = np.where(np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)
    height, width = seen.shape
    if min(height, width) < STRIDE:
        return 0.0
    rows, columns = np.arange(1, height - 1, STRIDE), np.arange(1, width - 1, STRIDE)
    around = [seen[np.ix_(rows + dv, columns + du)] for dv in (-1, 0, 1) for du in (-1, 0, 1)]
    returns = around[4] > 0.0
    if not returns.any():
        return 0.0
    near = np.stack(around)[:, returns]
    typical = np.nanmedian(np.where(near > 0.0, near, np.nan), axis=0)
    return float(np.mean(near[4] < FLOATING * typical))


def unlocated(data: Frame | ArrayLike, refused: Estimate | Calibration, source: str) -> Content:
    """The answer where the frame does not show the silo's axis: for dust, for what is no silo, else for little wall."""
    said = refused.quality if isinstance(refused, Estimate) else ()
    answer = Content("refused", refused.reason, refused.message, source=source, config=refused.config, quality=said)
    depth = data.depth if isinstance(data, Frame) else np.asarray(data)
    dust = floating_returns(np.asarray(depth)) if depth is not None and np.ndim(depth) == 2 else 0.0
    if dust > DUSTY and refused.reason not in INPUT_REMARKS:
        return _dusty(answer, f"{100 * dust:.0f} % of the returns float alone")
    message = str(refused.message)
    if refused.reason in NO_SILO:
        message = f"This does not look like the inside of a silo: {message[0].lower()}{message[1:]}"
    return replace(answer, message=message)


def _dusty(answer: Content, seen: str) -> Content:
    message = sentence(CONTENT_REMARKS["dust-or-fog"], f" ({seen})")
    remark = Remark("dust-or-fog", seen, True)
    return replace(answer, reason="dust-or-fog", message=message, quality=(*answer.quality, remark))


def spoken_alone(said: tuple[Remark, ...]) -> tuple[Remark, ...]:
    """The remarks without a calibration's: where returns lie outside the wall, dust put it there, or it is no wall."""
    dust = next((remark for remark in said if remark.code == "dust-or-fog"), None)
    spoken: list[Remark] = []
    for remark in said:
        if remark.code != "camera-moved":
            spoken.append(remark)
        elif remark.refuses:
            code, seen = ("behind-wall", remark.seen) if dust is None else (dust.code, dust.seen)
            spoken.append(Remark(code, seen, True))
    return tuple(remark for remark in spoken if remark is not dust or not any(r.refuses for r in spoken))


def meaning(code: str) -> tuple[str, str]:
    """What a code of a reading's refusal means, and what to do."""
    return CONTENT_REMARKS.get(code) or estimate_refusals()[code]
