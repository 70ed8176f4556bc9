"""Calibrate a camera from a discharge, then measure what is in the silo and follow it, in a simulation.

python examples/measure_discharge.py
"""

from __future__ import annotations

from dataclasses import replace

import siloscope
from siloscope.simulation import ASTRA_S, Feed
from siloscope.simulation.scenarios import scenario

LEVELS = (0.55, 0.5, 0.45, 0.4, 0.35, 0.3)
HOUR = 3600.0


def frames(levels: tuple[float, ...], shape: str) -> list[siloscope.Frame]:
    """Frames of one silo at several levels, as a low-cost camera sees them."""
    silo = replace(scenario("silo3"), sensor=ASTRA_S)
    return [replace(silo, feed=Feed(shape, level), seed=i).render().frame() for i, level in enumerate(levels)]


def main() -> None:
    """Prints one reading with its deviation, and the story of a morning."""
    calibration = siloscope.calibrate(
        frames((0.5, 0.4, 0.3, 0.2, 0.1), "gaussian"), sensor="orbbec-astra-s", bottom="cone"
    )
    morning = frames(LEVELS, "funnel")
    content = siloscope.measure(morning[0], calibration, product="wheat")
    if content.volume is None:
        raise SystemExit(content.message)
    print(f"{content.volume:.3f} ± {content.volume_std:.3f} m³, {content.mass:.0f} ± {content.mass_std:.0f} kg")
    print(f"{content.shape.form}, {content.coverage:.0%} of the surface seen")
    story = siloscope.track(morning, calibration, interval=HOUR, product="wheat")
    for event in story.events:
        print(f"{event.kind} of {event.volume:.3f} ± {event.volume_std:.3f} m³ in {len(morning) - 1} hours")


if __name__ == "__main__":
    main()
