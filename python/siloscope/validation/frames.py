"""A user's frames, located each by itself, with the tiles that show the wall."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import _core, sensors
from siloscope.errors import InputError
from siloscope.estimation import surface
from siloscope.estimation.inputs import PreparedDepth, prepare
from siloscope.estimation.methods import priors_of
from siloscope.estimation.priors import Priors
from siloscope.estimation.settings import Settings
from siloscope.locate import locate
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera
from siloscope.types.depth_frame import DepthFrame
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.types.frame_factor import FrameFactor
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.types.wall import Wall

COAXIAL = ("coaxial-cone", "cone-alone")
OBLIQUE = ("oblique-cone", "oblique-cone-alone")
"""Models of the joint fit whose cone is the vessel's own."""


@dataclass(frozen=True, eq=False)
class SeenFrame:
    """A frame with an answer of its own."""

    name: str
    frame: DepthFrame
    priors: Priors
    """What was known before it."""
    estimate: Estimate
    factor: FrameFactor
    """What it says about every parameter."""
    shown: NDArray[np.bool_]
    """Which of its tiles show the wall by its own answer."""
    refused: str | None = None
    """Why the frame has no answer that stands; the estimate then is the one that was refused."""

    @property
    def shows_vessels_cone(self) -> bool:
        """Whether its cone, if any, is the vessel's: another conical surface is one of feed."""
        return self.factor.model in COAXIAL + OBLIQUE

    def without_feed(self) -> SeenFrame:
        """Without the tiles of a conical surface that is not the vessel's."""
        own = self.factor
        if self.shows_vessels_cone or not own.has_cone:
            return self
        tiles = _core.wall_tiles(self.frame, self.priors, Wall(own.state, own.has_cylinder, True, own.reference))
        shown = np.zeros_like(self.shown)
        shown[tiles.number[~tiles.on_cone].astype(np.int64)] = True
        return replace(self, shown=self.shown & shown)


@dataclass(frozen=True)
class Asked:
    """What every frame is located with."""

    camera: Camera | None
    depth_unit: float | None
    profile: SensorProfile
    diameter: float | None
    intrinsics: str | IntrinsicsStd | None

    @classmethod
    def of(cls, sensor: Any, **given: Any) -> Asked:
        """With a sensor's profile, its name or file; raises `UsageError` for one that is none."""
        return cls(profile=sensors.load(sensor), **given)

    def located(self, frame: Any, start: Estimate | None) -> Estimate:
        """The frame's own answer."""
        return locate(
            frame,
            self.camera,
            sensor=self.profile,
            depth_unit=self.depth_unit,
            diameter=self.diameter,
            intrinsics=self.intrinsics,
            start=start,
            ratios=False,
        )

    def prepared(self, frame: Any) -> tuple[DepthFrame, Priors]:
        """The frame as the core takes it.

        Raises `InputError` where it is no image from one place.
        """
        made = prepare(frame, self.camera, self.profile, depth_unit=self.depth_unit, clouds="resampled")
        if not isinstance(made, PreparedDepth):
            raise InputError("a cloud that was not seen from one place has no image to be validated by; give images")
        settings = Settings.checked(
            self.profile, diameter=self.diameter, gravity=None, grid=None, neighbours=6, threads=1, start=None,
            ratios=False, intrinsics=self.intrinsics,
        )  # fmt: skip
        return DepthFrame(made.depth, made.camera, made.camera.rays()), priors_of(made, settings)


@dataclass(frozen=True)
class Reading:
    """All frames that were read."""

    seen: tuple[SeenFrame, ...]
    without: tuple[tuple[str, str], ...]
    """Names of frames that have no answer, with the reason."""
    every: int = 1
    """Of how many frames one was asked."""


MOST_FRAMES = 40
"""Frames that are kept; of twice as many every second one is."""


def read(frames: Iterable[Any], asked: Asked) -> Reading:
    """Locates frames, from where the first one has shown the wall; of many frames some, evenly spread.

    An answer that is refused is looked at all the same, where a wall of revolution is seen: what is wrong with it shall
    be told, and not only that something is.
    """
    seen: list[SeenFrame] = []
    without: list[tuple[str, str]] = []
    start: Estimate | None = None
    every = 1
    for number, frame in enumerate(frames):
        if number % every:
            continue
        name = frame.source if isinstance(frame, Frame) else f"frame {number}"
        try:
            found = _located(name, frame, asked, start)
        except InputError as error:
            without.append((name, str(error)))
            continue
        if isinstance(found, str):
            without.append((name, found))
            continue
        start = start or (found.estimate if found.refused is None else None)
        seen.append(found)
        if len(seen) == 2 * MOST_FRAMES:
            seen, every = seen[::2], 2 * every
    return Reading(tuple(seen), tuple(without), every)


def _located(name: str, frame: Any, asked: Asked, start: Estimate | None) -> SeenFrame | str:
    """A frame with its answer, or why it has none."""
    depth, priors = asked.prepared(frame)
    refused = None
    answer = first = asked.located(frame, start)
    if not first.ok:
        refused, unjudged = first.reason, replace(priors, judged=False)
        answer = surface.fit_depth(depth.depth, depth.camera, unjudged, ratios=False, config=first.config)
    if answer.details is None or answer.evidence is None:
        return refused or "refused"
    shown = np.isfinite(answer.details.residuals)
    return SeenFrame(name, depth, priors, answer, answer.evidence, shown, refused).without_feed()
