"""Many frames in, the silo's calibration out."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from siloscope.errors import UsageError
from siloscope.estimation.contradictions import trusted
from siloscope.fusion.counted import UncountedFrames
from siloscope.fusion.history import History
from siloscope.fusion.report import calibration_of
from siloscope.fusion.schedule import FrameLocator, Inline, located, pool_of
from siloscope.fusion.settings import brought_settings, common_camera, settings_of
from siloscope.io import FrameSource
from siloscope.io.given import given_frames
from siloscope.locate import locate
from siloscope.reasons import INPUT_REMARKS
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.vessel.floor import with_floor
from siloscope.wording import counted

RULES = ("information", "mean-of-last-10")
"""How frames become one: weighed by their information, or the mean of the last 10 answers (section 2.4.4)."""


Pathlike = str | PathLike[str]


def calibrate(
    frames: Iterable[Frame | Estimate | ArrayLike] | FrameSource | Pathlike | Iterable[Pathlike],
    *,
    camera: Camera | None = None,
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: float | None = None,
    diameter: float | None = None,
    gravity: ArrayLike | None = None,
    bottom: str | None = None,
    intrinsics: str | IntrinsicsStd | None = None,
    continue_from: Calibration | Pathlike | None = None,
    rule: str = "information",
    jobs: int = 1,
    trust: str | Sequence[str] = (),
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> Calibration:
    """Fuse the frames of one camera in one silo to the camera's pose and the silo's geometry.

    Frames count by what they show, in any order; frames that disagree with the majority don't count. Where the
    sequence shows that the camera has moved, only the frames since its last move are fused. From the 17th frame on, a
    quarter of a frame's pixels is asked, if that gives an answer: its deviations are twice as large, and stated so.

    Parameters
    ----------
    frames : files, frame source, or iterable of Frame, depth array or Estimate
        A path or several, what `siloscope.open` gives, frames, arrays, or answers of `locate` (method surface) with
        their details.
    camera, sensor, depth_unit, diameter, gravity
        As for `locate`. Estimates bring their own.
    bottom : str, optional
        "cone": the conical surface of these frames is the vessel's bottom; "flat"; "unknown". Without it a surface
        counts as the bottom only if it is steeper than feed can lie.
    intrinsics : {"exact", "calibrated", "nominal"} or IntrinsicsStd, optional
        How exactly the camera's intrinsics are known, as for `locate`.
    continue_from : Calibration or path, optional
        An earlier calibration of the same camera and silo; its frames come before these. A frame that it has counted
        is known by its measurements and does not count again.
    rule : str
        One of `RULES`.
    jobs : int
        Frames located at the same time.
    trust : str or sequence of str
        As for `locate`: what to go by although frames contradict it.
    progress : callable, optional
        Is given the frames and gives them on, to show how far it has come.

    Returns
    -------
    Calibration
        With status ``refused`` and a reason of `CALIBRATION_REFUSALS` where no frame shows enough wall.

    Raises
    ------
    InputError
        Where no frame can be read, or the earlier calibration can't be used.
    UsageError
        For an unknown rule or sensor, a setting outside its bounds, or settings other than the earlier calibration's.
    """
    if rule not in RULES:
        raise UsageError(f"unknown rule '{rule}'; known are {', '.join(RULES)}")
    if not 1 <= jobs <= 256:
        raise UsageError(f"jobs {jobs} is not between 1 and 256; give the number of frames to locate at a time")
    start = time.perf_counter()
    before = Calibration.load(continue_from) if isinstance(continue_from, str | PathLike) else continue_from
    settings = settings_of(before, sensor=sensor, diameter=diameter, gravity=gravity, intrinsics=intrinsics)
    source = given_frames(frames, camera, depth_unit)
    one = FrameLocator(partial(locate, trust=tuple(sorted(trusted(trust)))), camera, depth_unit, settings)
    ahead = 0 if jobs == 1 else 2 * jobs
    with pool_of(jobs) as pool:
        read = source.ahead(pool, ahead) if isinstance(source, FrameSource) and not isinstance(pool, Inline) else source
        uncounted = UncountedFrames(progress(read) if progress else read, before)
        answers = uncounted.marked(located(uncounted, one, pool, ahead))
    lost = source.problems if isinstance(source, FrameSource) else []
    read_until = time.perf_counter()
    told = {name: value for name, value in (("sensor", sensor), ("diameter", diameter)) if value is not None}
    brought = {} if before is not None else brought_settings(answers)
    config = {**settings.described(), **{k: v for k, v in brought.items() if k not in told}}
    config["camera"] = common_camera(before, answers)
    found = calibration_of(History.of(before, rule).extended(answers, lost), rule, config)
    times = {"frames": 1e3 * (read_until - start), "fusion": 1e3 * (time.perf_counter() - read_until)}
    found = _with_what_inputs_say(found, [answer.estimate for answer in answers if answer.estimate is not None])
    quality = (*found.quality, *uncounted.remarks)
    return with_floor(replace(found, timing_ms=times, quality=quality), bottom, before)


def _with_what_inputs_say(found: Calibration, estimates: list[Estimate]) -> Calibration:
    """The calibration with the frames' warnings of their inputs, and with the contradiction that refused them."""
    warned = (remark.code for one in estimates if one.ok for remark in one.quality if remark.severity == "warning")
    against = Counter(one.reason for one in estimates if one.reason in INPUT_REMARKS)
    if not found.ok and against:
        (code, count), *_ = against.most_common(1)
        first = next(one for one in estimates if one.reason == code)
        found = replace(found, message=f"{found.message} {counted(count, 'frame')}: {first.message}")
    return replace(found, quality=(*found.quality, *dict.fromkeys(warned)))
