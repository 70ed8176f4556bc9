"""Find the axis of a steel tank from a total station's scan, outside view, with 8 % of the points off the tank.

    python examples/locate_tank.py scan.csv

The survey's z is up and plumb, so a vertical tank's axis is z.
"""

from __future__ import annotations

import sys

import numpy as np

import siloscope


def locate(path: str) -> siloscope.Estimate:
    """The tank's axis. Fifteen metres wide and a thousand points: the grid is coarse."""
    with siloscope.open(path) as frames:
        return siloscope.locate(frames[0], grid=0.2)


def main() -> None:
    """Prints the tilt from the plumb line, and the radius."""
    estimate = locate(sys.argv[1])
    if estimate.pose is None:
        sys.exit(f"refused: {estimate.message}")
    tilt = np.degrees(np.arccos(min(1.0, abs(float(estimate.pose.axis_direction[2])))))
    print(f"axis {tilt:.2f}° from the plumb line")
    if estimate.silo.radius is not None:
        print(f"radius {estimate.silo.radius:.3f} m")


if __name__ == "__main__":
    main()
