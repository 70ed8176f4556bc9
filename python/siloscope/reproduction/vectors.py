"""The estimated vectors of step 4 (Eq. 3), as the paper's Fig. 14 shows them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from siloscope.estimation import steps
from siloscope.simulation import Feed, Scene
from siloscope.simulation.scenarios import scenario
from siloscope.simulation.stand_ins import real_silo

PAIRS = 2000
"""Pairs of candidates drawn for a picture."""


@dataclass(frozen=True)
class Vectors:
    """Estimated vectors of pairs of candidates in a scene's frame."""

    scene: Scene
    alone = False

    def settings(self) -> dict[str, Any]:
        """Everything the result depends on."""
        return {"scene": self.scene.to_dict(), "pairs": PAIRS}

    def run(self) -> dict[str, Any]:
        """Unit vectors (M, 3), camera frame."""
        frame = self.scene.render()
        candidates = steps.run(steps.back_project(frame.measured, frame.camera)).candidates
        return {"vectors": steps.estimated_vectors(candidates.E1, PAIRS).tolist()}


def frames() -> dict[str, Vectors]:
    """Three frames of stand-ins for real silos and three of perfect ones, as in the figure."""
    real = {
        "SiloR1 (stand-in), 50 % full": _filled(real_silo("silo-r1", 11), 0.5),
        "SiloR1 (stand-in), 10 % full": _filled(real_silo("silo-r1", 11), 0.1),
        "SiloR2 (stand-in), 10 % full": _filled(real_silo("silo-r2", 12), 0.1),
    }
    perfect = {f"Silo{n}, 10 % full": _filled(scenario(f"silo{n}"), 0.1) for n in (1, 2, 3)}
    return {name: Vectors(scene) for name, scene in {**real, **perfect}.items()}


def _filled(scene: Scene, level: float) -> Scene:
    return replace(scene, feed=replace(scene.feed or Feed(), level=level))
