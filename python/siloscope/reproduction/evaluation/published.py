"""What the paper prints, as it prints it: millimetres and milliradians."""

from __future__ import annotations

from dataclasses import dataclass

MEASURES = ("t_x", "t_y", "r_x", "r_y", "distance")
"""Rows of Tables 3 to 5, in the paper's order."""

UNITS = {"t_x": "mm", "t_y": "mm", "r_x": "mrad", "r_y": "mrad", "distance": "mm"}
"""Their units."""

NAMES = {"t_x": "t_x", "t_y": "t_y", "r_x": "r_x", "r_y": "r_y", "distance": "PC average distance"}
"""Their names in tables."""


@dataclass(frozen=True)
class Adjustment:
    """A column of Tables 3 to 5."""

    t_x: float
    t_y: float
    r_x: float
    r_y: float
    distance: float


TABLE3 = {
    "Silo1": Adjustment(0.61, -0.02, -0.01, -0.39, 0.66),
    "Silo2": Adjustment(-0.01, 0.57, 0.13, 0.06, 0.32),
    "Silo3": Adjustment(-0.40, 0.67, 0.33, -0.25, 0.96),
}
"""Perfect silos, last estimate."""

TABLE4 = {
    "Silo1": Adjustment(-1.68, -1.66, -0.69, -4.21, 14.06),
    "Silo2": Adjustment(-52.29, -4.50, -1.56, -10.43, 62.55),
    "Silo3": Adjustment(-12.55, 6.55, -10.89, -10.29, 27.67),
}
"""Perturbed silos, mean of the last 10 estimates."""

TABLE5 = {
    "SiloR1": Adjustment(-47.92, 58.50, -22.99, 1.01, 28.09),
    "SiloR2": Adjustment(-38.33, 37.69, -0.02, -0.01, 11.94),
}
"""Real silos, mean of the last 10 estimates."""

TABLE6 = {"Orbbec Astra": 37.66, "D415": 59.87, "D455": 28.06, "L515": 45.48}
"""PC average distance to the ideal silo."""


@dataclass(frozen=True)
class AccelerometerRow:
    """A column of Table 7: (r_x, r_y) of the accelerometer and of the method, and the distance with the latter."""

    accelerometer: tuple[float, float]
    method: tuple[float, float]
    distance: float


TABLE7 = {
    "D455": AccelerometerRow((75.88, 312.65), (64.23, 307.80), 22.09),
    "L515": AccelerometerRow((-19.17, 305.32), (-9.86, 300.59), 18.41),
}
"""Accelerometer beside method; the paper's table calls the L515 "D515"."""

STEPS = {"Silo1": 100, "Silo2": 100, "Silo3": 100, "SiloR1": 296, "SiloR2": 418}
"""Frames of each discharge (sections 2.4.1 and 2.4.3)."""

SETTLED_LEVEL = 35.0
"""Feed level in % of the height from which on results of perfect silos are stable (section 3.1)."""

FIG17_MOST = 30.0
"""Section 3.5: under this distance in almost all cases, except Silo2."""

FIG17_MOST_SILO2 = 60.0
"""Section 3.5: Silo2."""

RUNNING_TIME = 8.03
"""Average running time over the last frames of the analysed silos, s (section 3.5)."""
