"""Stand-ins for what the paper recorded and did not publish: real silos, and four sensors in one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from siloscope.sensors import SensorProfile, load
from siloscope.simulation import Defects, Feed, Scene, SensorModel, sensor_model
from siloscope.simulation.scenarios import scenario

IRREGULAR = Feed("funnel+lumpy+tilted", angle=0.5, centre=(0.12, -0.08), tilt=0.12, tilt_azimuth=0.9, seed=3)
"""A discharge funnel off the axis, tilted and lumpy."""

WALL = Defects(
    ovality=0.004,
    ovality_azimuth=0.7,
    seam_spacing=0.9,
    upright_seams=4,
    dents=5,
    dent_depth=0.02,
    dent_radius=0.25,
)
"""What a farm's silo has after some years: out of round, seams, dents."""

FILM = ((0.2, 0.6, 0.01),)
"""Feed stuck to the wall while a silo is in use."""

DUSTY: dict[str, Any] = {
    "correlation": 0.3,
    "correlation_length": 6.0,
    "max_incidence": 1.45,
    "dropout": 0.06,
    "dropout_length": 5.0,
    "flying": 0.3,
    "dust": 0.0005,
}
"""What every sensor does in a silo besides bias and noise: patches and grazing surfaces lost, flying pixels, dust."""


def one_device(profile: str, device: int, warp: float = 0.0, baseline: float = 0.0) -> SensorModel:
    """A sensor of a kind with this device's own bias, rounded to the kind's raw unit, in a dusty silo."""
    unit = load(profile).depth_unit or 0.001
    return replace(
        sensor_model(profile, device), unit=unit, warp=warp, warp_seed=device, baseline=baseline, **DUSTY
    )  # fmt: skip


REAL_PROFILE = "orbbec-astra"
"""The sensor of the paper's real silos."""


def real_silo(name: str, seed: int) -> Scene:
    """A real silo of Table 2 with an Astra, wall defects and irregular feed."""
    sensor = one_device(REAL_PROFILE, seed, warp=0.0008, baseline=0.075)
    wall = replace(WALL, film_bands=FILM, film_lobes=3, seed=seed)
    return replace(scenario(name), sensor=sensor, feed=IRREGULAR, defects=wall, seed=seed)


@dataclass(frozen=True)
class Mounted:
    """A sensor in the empty silo of section 2.4.5."""

    name: str
    scene_name: str
    profile_name: str
    accelerometer: bool
    stereo: bool

    @property
    def profile(self) -> SensorProfile:
        """What is known of its kind."""
        return load(self.profile_name)

    def scene(self, device: int) -> Scene:
        """What one device of this kind sees."""
        sensor = one_device(self.profile_name, device, warp=0.001 if self.stereo else 0.0)
        return replace(scenario(self.scene_name), sensor=sensor, defects=replace(WALL, seed=5), seed=device)


FOUR_SENSORS = (
    Mounted("Orbbec Astra", "comparison-astra", "orbbec-astra", False, False),
    Mounted("D415", "comparison-d415", "realsense-d415", False, True),
    Mounted("D455", "comparison-d455", "realsense-d455", True, True),
    Mounted("L515", "comparison-l515", "realsense-l515", True, False),
)
"""The four sensors; those with an accelerometer are in Table 7."""
