"""A silo that is emptied, a frame a step (section 2.4.4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from siloscope.reproduction.trials import Trial
from siloscope.sensors import SensorProfile, load
from siloscope.simulation import ASTRA_S, Scene, discharge
from siloscope.simulation.scenarios import scenario
from siloscope.simulation.stand_ins import REAL_PROFILE, real_silo

EXACT = SensorProfile("exact", source="The perfect scenes of section 2.4.1 have no depth error.")
"""What is known about the sensor of perfect scenes."""


@dataclass(frozen=True)
class Discharge:
    """A scene whose feed level falls."""

    name: str
    scene: Scene
    steps: int
    """As many as the paper has."""
    profile: SensorProfile
    highest: float = 0.9
    moving: Callable[[Scene, int], Scene] | None = None
    """Changes a step's scene, so that the feed moves."""

    def trials(self, steps: int | None = None) -> list[Trial]:
        """A trial a step; `steps` of them instead of the paper's number."""
        scenes = list(discharge(self.scene, steps or self.steps, self.highest))
        if self.moving is not None:
            scenes = [self.moving(scene, step) for step, scene in enumerate(scenes)]
        return [Trial(scene, self.profile) for scene in scenes]


def perfect() -> list[Discharge]:
    """Table 3: exact depths."""
    return [Discharge(name, scenario(name.lower()), 100, EXACT) for name in ("Silo1", "Silo2", "Silo3")]


def perturbed() -> list[Discharge]:
    """Table 4: the same silos with Eqs. 8 to 10."""
    profile = load("orbbec-astra-s")
    return [
        Discharge(silo.name, replace(silo.scene, sensor=ASTRA_S, seed=seed), silo.steps, profile)
        for seed, silo in enumerate(perfect(), start=1)
    ]


PRINTED = 4
"""One step of so many is simulated with the rotation as printed: enough for rows that the paper does not have."""


def real() -> list[Discharge]:
    """Table 5: stand-ins for the recordings; the printed rotation too, in every `PRINTED`-th step."""
    return [
        Discharge(name, real_silo(scene, seed), steps, load(REAL_PROFILE), moving=_shifting_feed)
        for name, scene, steps, seed in (
            ("SiloR1", "silo-r1", 296, 11),
            ("SiloR2", "silo-r2", 418, 12),
            ("SiloR1 as printed", "silo-r1-printed", 296 // PRINTED, 11),
            ("SiloR2 as printed", "silo-r2-printed", 418 // PRINTED, 12),
        )
    ]


def _shifting_feed(scene: Scene, step: int) -> Scene:
    """Slides reshape the surface every few steps."""
    feed = scene.feed
    return scene if feed is None else replace(scene, feed=replace(feed, seed=feed.seed + step // 8))
