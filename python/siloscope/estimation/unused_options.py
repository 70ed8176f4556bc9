"""Options that can't act on an input: none of them passes without a note."""

from __future__ import annotations

from collections.abc import Iterator

from siloscope.estimation.inputs import Prepared, PreparedDepth, PreparedPoints
from siloscope.estimation.settings import Settings
from siloscope.sensors import UNKNOWN
from siloscope.types.estimate import Estimate
from siloscope.types.remark import Remark


def unused_options(estimate: Estimate, prepared: Prepared, settings: Settings) -> Iterator[Remark]:
    """A note for each option that was given and did not act."""
    six_steps = estimate.method == "shape-tensor"
    told = [*(_by_the_six_steps(prepared, settings) if six_steps else _by_the_fit(prepared, settings))]
    if not six_steps and estimate.ok and estimate.silo.radius is None and settings.diameter is not None:
        told.append(("diameter", "no cylinder is in view"))
    for option, why in told:
        yield Remark("option-unused", f"{option}: {why}")


def _by_the_six_steps(prepared: Prepared, settings: Settings) -> Iterator[tuple[str, str]]:
    """Sensor and intrinsics act on the deviations of an image's answer; of a cloud no errors are known."""
    why = "the method shape-tensor takes nothing as known"
    cloud = isinstance(prepared, PreparedPoints)
    if cloud and settings.profile != UNKNOWN:
        yield "sensor", why
    if settings.diameter is not None:
        yield "diameter", why
    if settings.gravity_given:
        yield "gravity", why
    if cloud and settings.intrinsics is not None:
        yield "intrinsics", why


def _by_the_fit(prepared: Prepared, settings: Settings) -> Iterator[tuple[str, str]]:
    if settings.grid is not None and isinstance(prepared, PreparedDepth):
        yield "grid", "the method surface cuts images into tiles, and clouds whose rays are known are images"
    if settings.start is not None and isinstance(prepared, PreparedPoints):
        yield "start", "a cloud is searched as a whole"
    if settings.intrinsics not in (None, "exact") and isinstance(prepared, PreparedPoints) and prepared.camera is None:
        yield "intrinsics", "no one place has seen this cloud, so its points are taken as they are"
