"""What is known before a frame: the sensor's depth error, the silo's diameter, the direction of gravity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from siloscope.parameters import OVALITY, PARAMETERS, SIZE
from siloscope.sensors import SensorProfile
from siloscope.types.pose import SiloPose

DIAMETER_STD = 0.002
"""Standard deviation of a tape-measured diameter, m."""

GRAVITY_STD = 0.01
"""Standard deviation of an accelerometer's direction at rest, rad (Table 7 of the paper: 5 to 12 mrad)."""

TILT = slice(0, 2)
RADIUS = PARAMETERS.index("radius")
DEPTH_BIAS = slice(PARAMETERS.index("offset"), PARAMETERS.index("offset") + 3)

CLOUD = SensorProfile("none: a cloud is taken as it is")
"""A cloud has no rays along which a depth could be biased."""


@dataclass(frozen=True, eq=False)
class Priors:
    """Priors of the surface fit, which the core reads by the names of the fields."""

    profile: SensorProfile
    """The sensor's depth error."""
    diameter: float | None = None
    """Inner diameter of the silo's cylinder, m."""
    gravity: NDArray[np.float64] | None = None
    """(3,) direction of gravity in the camera frame, any length."""
    diameter_std: float = DIAMETER_STD
    gravity_std: float = GRAVITY_STD
    camera_std: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """Standard deviations of fx and fy (relative), of cx and cy in units of the rays, and of k1; 0 where exact."""
    told_cone: bool = False
    """Whether the vessel is said to end in a cone about its own axis: then one that is seen alone has that axis."""
    judged: bool = True
    """Whether an answer that is no vessel's or not sure is refused; else it is given, to tell what is wrong with it."""

    @property
    def tilt(self) -> SiloPose | None:
        """The pose's angles as gravity has them; None where it is not known."""
        return None if self.gravity is None else SiloPose.from_axis(self.gravity, np.zeros(3))

    @property
    def mean(self) -> NDArray[np.float64]:
        """(12,) what is expected of each parameter, in the order of `PARAMETERS`; NaN where nothing is."""
        expected = np.full(SIZE, np.nan)
        expected[DEPTH_BIAS] = self.profile.bias
        expected[OVALITY] = 0.0
        if self.diameter is not None:
            expected[RADIUS] = self.diameter / 2.0
        if self.tilt is not None:
            expected[TILT] = self.tilt.r_x, self.tilt.r_y
        return expected
