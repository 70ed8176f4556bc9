"""The columns of the tables: what a method is told about the silo and its sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from siloscope.locate import locate
from siloscope.sensors import SensorProfile
from siloscope.simulation import SimulatedFrame
from siloscope.types.estimate import Estimate


@dataclass(frozen=True)
class Solver:
    """A method and what it is told."""

    name: str
    heading: str
    method: str
    knows_diameter: bool = False
    knows_profile: bool = False
    grid_per_radius: float | None = None
    """Side of the voxels in radii of the silo; None for the method's own."""

    def __call__(self, frame: SimulatedFrame, profile: SensorProfile, **more: Any) -> Estimate:
        """The pose of a frame taken with a sensor of this profile; the intrinsics are known exactly."""
        known: dict[str, Any] = {"intrinsics": "exact", **more}
        if self.knows_diameter:
            known["diameter"] = 2.0 * frame.scene.silo.radius
        if self.knows_profile:
            known["sensor"] = profile
        if self.grid_per_radius is not None:
            known["grid"] = self.grid_per_radius * frame.scene.silo.radius
        return locate(frame.measured, frame.camera, method=self.method, **known)


SOLVERS = {
    solver.name: solver
    for solver in (
        Solver("shape-tensor", "shape-tensor", "shape-tensor"),
        Solver("surface", "surface", "surface"),
        Solver("surface-diameter", "surface, diameter known", "surface", knows_diameter=True),
        Solver("surface-profile", "surface, profile known", "surface", knows_profile=True),
    )
}
"""Solvers by name, in the tables' order; plain `surface` knows neither diameter nor profile."""

GROWN = Solver("shape-tensor-grown", "shape-tensor, grid grown with the silo", "shape-tensor", grid_per_radius=0.04)
"""For silos larger than the paper's: in its Silo1 this is the paper's grid of 5 cm."""

KNOWN = {**SOLVERS, GROWN.name: GROWN}
"""Everything that a trial can ask for."""

ALL = tuple(SOLVERS)
SURFACE = tuple(name for name, solver in SOLVERS.items() if solver.method == "surface")
