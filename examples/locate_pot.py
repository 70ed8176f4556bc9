"""Find the axis of a pot seen from inside by a Kinect: the mOSD data set, scene learn36.

    python examples/locate_pot.py learn36.pcd

The file has a segmentation: label 43 is the wall inside the yellow pot, 40 its outside. The pot stands on the table, so
its axis is the table's normal, which is what the answer is compared with.
"""

from __future__ import annotations

import sys

import numpy as np

import siloscope
from siloscope.estimation.region import label_mask

TABLE_NORMAL = np.array([0.0014, -0.8243, -0.5661])
INNER_WALL = 43


def locate(path: str) -> siloscope.Estimate:
    """The pot's axis."""
    with siloscope.open(path) as frames:
        frame = frames[0]
    return siloscope.locate(frame, mask=label_mask(frame, INNER_WALL), grid=0.004)


def main() -> None:
    """Prints how far the answer is from the table's normal."""
    estimate = locate(sys.argv[1])
    if estimate.pose is None:
        sys.exit(f"refused: {estimate.message}")
    angle = np.degrees(np.arcsin(np.linalg.norm(np.cross(estimate.pose.axis_direction, TABLE_NORMAL))))
    print(f"axis {angle:.2f}° from the table's normal")


if __name__ == "__main__":
    main()
