"""`validate`: is what a calibration from these frames states true?"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from siloscope.errors import UsageError
from siloscope.io import FrameSource
from siloscope.io.given import given_frames
from siloscope.sensors import SensorProfile
from siloscope.types.by_value import ByValue
from siloscope.types.camera import Camera
from siloscope.types.frame import Frame
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.validation.families import Score, scores
from siloscope.validation.findings import CONVICTS, NAMES, Finding, findings
from siloscope.validation.frames import Asked, Reading, read
from siloscope.validation.holdout import HeldOut, held_out
from siloscope.validation.ideal import Ideal, fitted
from siloscope.validation.resampling import Resampled, resampled
from siloscope.validation.splits import Split, splits
from siloscope.wording import counted

SCHEMA = "siloscope.validation/1"

FEWEST_FRAMES = 4
"""Frames with an answer that can be split in two."""

FEWEST_TILES = 200
"""Wall tiles over all frames that tell patterns."""

RESAMPLES = 12
"""Solves of the exact frames with other noise."""

REFUSALS = {
    "no-frame-answers": "no frame shows enough wall; take frames at a lower level, or turn the camera to the wall",
    "too-few-frames": f"fewer than {FEWEST_FRAMES} frames have an answer; give more frames, at other levels too",
    "too-little-wall": "the frames have answers, but too little wall in common; take frames at a lower level",
}
"""Why nothing can be validated."""

Pathlike = str | PathLike[str]
Progress = Callable[[Iterable[Any], str], Iterable[Any]]


@dataclass(frozen=True, eq=False, repr=False)
class Validation(ByValue):
    """What a user's own frames say about the calibration that they give."""

    status: str
    """ok, or refused: then nothing can be said, and `reason` says why."""
    verdict: str | None = None
    """agrees, or departs: then `findings` say what is off."""
    summary: str = ""
    """The verdict in a sentence."""
    findings: tuple[Finding, ...] = ()
    tests: dict[str, Score] = field(default_factory=dict)
    """Patterns on the wall by family."""
    splits: tuple[Split, ...] = ()
    held_out: tuple[HeldOut, ...] = ()
    resampled: Resampled | None = None
    used: int = 0
    """Frames that were used."""
    without: tuple[tuple[str, str], ...] = ()
    """Names of frames without an answer, and why."""
    every: int = 1
    """Of how many frames one was asked."""
    reason: str | None = None
    message: str | None = None
    config: dict[str, Any] = field(default_factory=dict)
    ideal: Ideal | None = field(default=None, compare=False)
    """The ideal vessel with the tiles against it, for pictures."""

    @property
    def ok(self) -> bool:
        """Whether there is a verdict."""
        return self.status == "ok"

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope validate --json``."""
        tests = [
            {
                "family": name,
                "meaning": NAMES[name],
                "deviation": one.deviation,
                "from_frame_to_frame": one.unsteady,
                "patterns": one.dof,
            }
            for name, one in self.tests.items()
        ]
        return {
            "schema": SCHEMA,
            "status": self.status,
            "reason": self.reason,
            "message": self.message,
            "verdict": self.verdict,
            "summary": self.summary,
            "convicts_beyond": CONVICTS,
            "findings": [one.to_dict() for one in self.findings],
            "tests": tests,
            "splits": [one.to_dict() for one in self.splits],
            "held_out": [one.to_dict() for one in self.held_out],
            "resampled": None if self.resampled is None else self.resampled.to_dict(),
            "frames": {
                "used": self.used,
                "every": self.every,
                "without_answer": [{"name": name, "reason": reason} for name, reason in self.without],
            },
            "config": self.config,
        }


def validate(
    frames: Iterable[Frame | ArrayLike] | FrameSource | Pathlike | Iterable[Pathlike],
    *,
    camera: Camera | None = None,
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: float | None = None,
    diameter: float | None = None,
    intrinsics: str | IntrinsicsStd | None = None,
    resamples: int = RESAMPLES,
    seed: int = 0,
    progress: Progress | None = None,
) -> Validation:
    """Check on the frames themselves what a calibration from them states.

    Patterns that the sensor, the camera or the wall would leave on the wall's tiles are looked for; the frames are
    split and calibrated twice; the frames of each level are predicted by those of the others; and the solve is repeated
    with other noise.

    Parameters
    ----------
    frames : files, frame source, or iterable of Frame or depth array
        As for `calibrate`, of one camera that hangs still. Of more than 80 frames some are asked, evenly spread.
    camera, sensor, depth_unit, diameter, intrinsics
        As for `calibrate`. An error of the intrinsics within their stated deviations is none.
    resamples : int
        How often the solve is repeated with other noise; 0 for not at all.
    seed : int
        Of that noise.
    progress : callable, optional
        Called with what is run through and a label.

    Returns
    -------
    Validation
        With status ``refused`` and a reason of `REFUSALS` where the frames can't tell.

    Raises
    ------
    InputError
        Where no frame can be read.
    UsageError
        For an unknown sensor, or a setting outside its bounds.
    """
    if not 0 <= resamples <= 1000:
        raise UsageError(f"resamples {resamples} is not between 0 and 1000; give how often the solve is repeated")
    asked = Asked.of(sensor, camera=camera, depth_unit=depth_unit, diameter=diameter, intrinsics=intrinsics)
    source = given_frames(frames, camera, depth_unit)
    reading = read(progress(source, "locating") if progress else source, asked)
    config = _config(asked, reading)
    if len(reading.seen) < FEWEST_FRAMES:
        return _refused("too-few-frames" if reading.seen else "no-frame-answers", reading, config)
    ideal = fitted(reading.seen)
    if len(ideal.tiles) < FEWEST_TILES:
        return _refused("too-little-wall", reading, config)
    found = scores(ideal)
    halves = splits(reading.seen, asked, ideal.tiles)
    held = held_out(reading.seen, ideal, found["image"].scale)
    show = (lambda items: progress(items, "solving anew")) if progress else None
    again = resampled(reading.seen, ideal, asked, resamples, seed, show)
    off = findings(ideal, found, halves, held, again, reading.seen[0].frame.camera)
    return Validation(
        "ok",
        "departs" if off else "agrees",
        _summary(off, len(reading.seen)),
        off,
        found,
        tuple(halves),
        tuple(held),
        again,
        len(reading.seen),
        reading.without,
        reading.every,
        config=config,
        ideal=ideal,
    )


def _config(asked: Asked, reading: Reading) -> dict[str, Any]:
    seen = reading.seen
    return {
        "sensor": asked.profile.to_dict(),
        "diameter": asked.diameter,
        "camera": seen[0].frame.camera.to_dict() if seen else None,
        "intrinsics_std": seen[0].estimate.config.get("intrinsics_std") if seen else None,
    }


def _summary(found: tuple[Finding, ...], frames: int) -> str:
    if not found:
        return (
            f"The {frames} frames agree with what a calibration from them states: halves, held-out levels and answers "
            "with other noise differ no more than the deviations say, and no pattern is left on the wall."
        )
    more = f" {counted(len(found) - 1, 'further finding')}." if len(found) > 1 else ""
    return f"The {frames} frames do not agree with what they are told to be. {found[0].message}{more}"


def _refused(reason: str, reading: Reading, config: dict[str, Any]) -> Validation:
    counts: dict[str, int] = {}
    for _, why in reading.without:
        counts[why] = counts.get(why, 0) + 1
    commonest = max(counts, key=lambda why: counts[why], default=None)
    often = f" ({counts[commonest]} of {len(reading.without) + len(reading.seen)}: {commonest})" if commonest else ""
    return Validation(
        "refused", used=len(reading.seen), without=reading.without, every=reading.every, reason=reason,
        message=f"{REFUSALS[reason]}{often}", config=config,
    )  # fmt: skip
