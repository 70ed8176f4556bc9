"""`locate`: one frame in, the camera's pose in its silo out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from siloscope import sensors
from siloscope.errors import UsageError
from siloscope.estimation.inputs import prepare
from siloscope.estimation.methods import METHODS
from siloscope.estimation.settings import Number, Settings
from siloscope.estimation.steps import NEIGHBOURS
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.types.intrinsics import IntrinsicsStd


def locate(
    data: Frame | ArrayLike,
    camera: Camera | None = None,
    *,
    method: str = "surface",
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: Number = None,
    diameter: Number = None,
    gravity: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    crop: Sequence[float] | None = None,
    grid: Number = None,
    neighbours: int = NEIGHBOURS,
    threads: int = 1,
    start: Estimate | None = None,
    ratios: bool = True,
    intrinsics: str | IntrinsicsStd | None = None,
    vessels: str = "any",
) -> Estimate:
    """Find the silo's axis in one frame, and with it the camera's pose (Eqs. 5–7).

    Parameters
    ----------
    data : Frame, or array
        A depth image (H, W), floats in metres or unsigned integers in raw units; or points (N, 3) or (H, W, 3) in the
        camera frame, metres. 0, NaN, negative depths and raw 65535 are "no measurement".
    camera : Camera, optional
        Intrinsics; wins over the frame's own. Without any, the sensor profile's nominal ones for the image's size.
    method : {"surface", "shape-tensor"}
        Cylinder and cone fitted to the wall, or the six steps of the paper's section 2.3.
    sensor : str, path or SensorProfile, optional
        Profile of the depth error (`siloscope.sensors.names()`); without one it is estimated from the frame.
    depth_unit : float, optional
        Metres per raw unit; required for integer depth whose frame does not tell.
    diameter : float, optional
        Inner diameter of the silo's cylinder in metres, which fixes the scale of a sensor that is not known.
    gravity : array (3,), optional
        Direction of gravity in the camera frame, any length; z is positive, as the camera looks down.
    mask : array of bool, optional
        True where the silo is, of the frame's shape.
    crop : (xmin, xmax, ymin, ymax, zmin, zmax), optional
        Box in the camera frame, metres; only points inside are used.
    grid : float, optional
        Side of the voxel grid's cells, m; `siloscope.estimation.steps.GRID` (step 1), or less for small clouds.
    neighbours : int
        Neighbours for normals and shape tensors (method ``shape-tensor``).
    threads : int
        Threads for what can be shared; the answer does not depend on it.
    start : Estimate, optional
        An answer for another frame of the same camera in the same silo (method ``surface``, depth images). The wall is
        looked for there first, which is quicker; a frame that does not plainly confirm it is searched as without.
    ratios : bool
        Whether to work out how much of the frame is cylinder, cone and feed (method ``surface``).
    intrinsics : {"exact", "calibrated", "nominal"} or IntrinsicsStd, optional
        How exactly the intrinsics are known (method ``surface``): "calibrated" where a camera is given or recorded,
        "nominal" where the sensor profile's own are used.
    vessels : {"any", "coaxial"}
        Which vessels may be in view (method ``surface``, depth images from inside): those of the joint fit, which
        compete, or a cylinder on a coaxial cone seen through exact intrinsics, the model in which frames are fused.

    Returns
    -------
    Estimate
        With status "refused" and a reason where the frame does not show enough wall for a trustworthy answer.

    Raises
    ------
    InputError
        For a frame that can't be used.
    UsageError
        For settings that can't be.
    """
    run = METHODS.get(method)
    if run is None:
        raise UsageError(f"unknown method '{method}'; known are {', '.join(METHODS)}")
    profile = sensors.load(sensor)
    settings = Settings.checked(
        profile,
        diameter=diameter,
        gravity=gravity,
        grid=grid,
        neighbours=neighbours,
        threads=threads,
        start=start,
        ratios=ratios,
        intrinsics=intrinsics,
        vessels=vessels,
    )
    prepared = prepare(data, camera, profile, depth_unit=depth_unit, mask=mask, crop=crop)
    settings = settings.with_gravity_of(prepared)
    return run(prepared, settings, settings.effective(method, prepared))
