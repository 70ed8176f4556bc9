"""What all frames of one silo are measured with, worked out once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from numpy.typing import ArrayLike

from siloscope import sensors
from siloscope.content.capacity import Strapping
from siloscope.content.density import Density
from siloscope.content.input_judgement import inputs_say
from siloscope.content.knowledge import Knowledge, camera_of
from siloscope.content.measuring import content_in_silo
from siloscope.content.reading import Request
from siloscope.estimation.inputs import prepare
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.content import Content
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.vessel.vessel import Vessel


@dataclass(frozen=True, eq=False)
class SiloContent:
    """A silo whose pose and lengths are known, ready to be asked for its content frame by frame."""

    silo: Calibration
    about: Vessel
    known: Knowledge
    profile: SensorProfile | None = None
    strapping: Strapping | None = None
    density: Density | None = None
    moisture: float | None = None
    located: Estimate | None = None
    """The estimate that `silo` was made of where it is of the very frame that is measured."""
    trust: str | Sequence[str] = ()
    """What to go by although a frame contradicts it."""

    def measure(
        self,
        data: Frame | ArrayLike,
        camera: Camera | None = None,
        *,
        depth_unit: float | None = None,
        mask: ArrayLike | None = None,
        previous: Content | None = None,
        since: float | None = None,
    ) -> Content:
        """The content of a frame, with the arguments of `siloscope.measure`.

        `since` is the moment on ``time.perf_counter`` from which its preparation counts; now where not given.
        """
        start = time.perf_counter() if since is None else since
        alone = self.located is not None
        profile = sensors.with_map(self.profile or sensors.UNKNOWN, self.silo.config.get("sensor"))
        prepared = prepare(data, camera_of(data, camera, self.silo), profile,
                           depth_unit=depth_unit, mask=mask, clouds="pixels")  # fmt: skip
        if self.located is not None:
            said = self.located.quality
        else:
            said = inputs_say(data, prepared, self.profile, self.silo, (depth_unit, self.trust))
        request = Request(data, self.known, self.about.sheet, self.strapping, self.density, previous, alone, said)
        ms = 1e3 * (time.perf_counter() - start)
        return replace(content_in_silo(prepared, self.silo, self.about, request, ms), moisture=self.moisture)
