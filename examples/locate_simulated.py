"""Find the axis of a simulated silo and compare with the truth.

python examples/locate_simulated.py
"""

from __future__ import annotations

from dataclasses import replace

import siloscope
from siloscope.simulation import ASTRA_S
from siloscope.simulation.metrics import pc_average_distance, transform_error
from siloscope.simulation.scenarios import scenario


def main() -> None:
    """Locates the paper's second silo, seen by a sensor with the Astra S's bias and noise."""
    seen = replace(scenario("silo2"), sensor=ASTRA_S, seed=1).render()
    for method, sensor in (("surface", "orbbec-astra-s"), ("shape-tensor", None)):
        estimate = siloscope.locate(seen.frame(), method=method, sensor=sensor)
        if estimate.pose is None:
            print(f"{method:13s} refused: {estimate.message}")
            continue
        error = transform_error(estimate.pose, seen.pose)
        distance = pc_average_distance(estimate.pose, seen.pose, seen.depth, seen.camera, stride=10)
        turns = f"r {1e3 * error.r_x:+.2f} {1e3 * error.r_y:+.2f} mrad"
        print(
            f"{method:13s} {turns}, t {1e3 * error.t_x:+.2f} {1e3 * error.t_y:+.2f} mm, Eq. 11 {1e3 * distance:.2f} mm"
        )


if __name__ == "__main__":
    main()
