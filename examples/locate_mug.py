"""Find the axis of a mug on a table, seen from outside: PCL's cylinder segmentation cloud.

    python examples/locate_mug.py table_scene_mug_stereo_textured.pcd

The cloud shows a table and a mug; a box in the camera frame keeps the mug's side. PCL's tutorial publishes the cylinder
it finds, which is what the answer is compared with.
"""

from __future__ import annotations

import sys

import numpy as np

import siloscope
from siloscope.estimation.region import box_mask

BOX = (0.005, 0.105, 0.03, 0.11, 0.70, 0.80)
"""Where the mug is, metres in the camera frame; its foot and the table are left out."""

PCL_POINT = np.array([0.0543319, 0.100139, 0.787577])
PCL_AXIS = np.array([-0.0135876, 0.834831, 0.550338])
PCL_RADIUS = 0.0387446


def locate(path: str) -> siloscope.Estimate:
    """The mug's axis; its size asks for a fine grid."""
    with siloscope.open(path) as frames:
        frame = frames[0]
    return siloscope.locate(frame, mask=box_mask(frame, BOX), grid=0.003)


def main() -> None:
    """Prints how far the answer is from PCL's."""
    estimate = locate(sys.argv[1])
    if estimate.pose is None:
        sys.exit(f"refused: {estimate.message}")
    axis, point = estimate.pose.axis_direction, estimate.pose.axis_point
    angle = np.degrees(np.arcsin(np.linalg.norm(np.cross(axis, PCL_AXIS)) / np.linalg.norm(PCL_AXIS)))
    beside = 1e3 * np.linalg.norm(np.cross(PCL_POINT - point, axis))
    print(f"axis {angle:.2f}° from PCL's, {beside:.1f} mm beside its point")
    if estimate.silo.radius is not None:
        print(f"radius {1e3 * estimate.silo.radius:.1f} mm, PCL's {1e3 * PCL_RADIUS:.1f} mm")


if __name__ == "__main__":
    main()
