"""Laws of the paper's pose (Eqs. 5–7)."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from siloscope import SiloPose

angles = st.floats(-1.4, 1.4)
lengths = st.floats(-5.0, 5.0)


@given(angles, angles, lengths, lengths)
def test_pose_and_axis_are_inverse(r_x: float, r_y: float, t_x: float, t_y: float) -> None:
    pose = SiloPose(r_x, r_y, t_x, t_y)
    back = SiloPose.from_axis(-2 * pose.axis_direction, pose.axis_point + 3 * pose.axis_direction)
    assert np.allclose([back.r_x, back.r_y, back.t_x, back.t_y], [r_x, r_y, t_x, t_y], rtol=0, atol=1e-12)


@given(angles, angles, lengths, lengths)
def test_the_axis_becomes_z_and_the_camera_keeps_its_height(r_x: float, r_y: float, t_x: float, t_y: float) -> None:
    pose = SiloPose(r_x, r_y, t_x, t_y)
    on_axis = pose.axis_point + 2.0 * pose.axis_direction
    assert np.allclose(pose.to_silo(on_axis), [0, 0, 2], rtol=0, atol=1e-12)
    assert np.allclose(pose.to_silo(np.zeros(3)), [t_x, t_y, 0], rtol=0, atol=1e-12)
    x, y, _ = pose.axis_direction
    assert np.isclose(np.arcsin(y / np.sqrt(1 - x * x)), r_x, rtol=0, atol=1e-7)
