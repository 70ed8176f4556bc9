"""`locate`: one frame in, the camera's pose in its silo out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike

from siloscope import sensors
from siloscope.errors import UsageError
from siloscope.estimation import contradictions, second_look
from siloscope.estimation.input_checks import input_remarks
from siloscope.estimation.inputs import prepare
from siloscope.estimation.methods import FEW_TILES, METHODS
from siloscope.estimation.settings import Number, Settings
from siloscope.estimation.steps import NEIGHBOURS
from siloscope.estimation.unused_options import unused_options
from siloscope.estimation.vessel_checks import vessel_remarks
from siloscope.io.given import given_frame
from siloscope.sensors import SensorProfile
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate
from siloscope.types.frame import Frame
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.vessel.vessel import Vessel, given


def locate(
    data: Frame | ArrayLike | str | PathLike[str],
    camera: Camera | None = None,
    *,
    method: str = "surface",
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: Number = None,
    diameter: Number = None,
    vessel: Vessel | str | Path | None = None,
    gravity: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    crop: Sequence[float] | None = None,
    grid: Number = None,
    neighbours: int = NEIGHBOURS,
    threads: int = 1,
    start: Estimate | None = None,
    ratios: bool = True,
    intrinsics: str | IntrinsicsStd | None = None,
    trust: str | Sequence[str] = (),
) -> Estimate:
    """Find the silo's axis in one frame, and with it the camera's pose (Eqs. 5–7).

    Parameters
    ----------
    data : Frame, path, or array
        A depth image (H, W), floats in metres or unsigned integers in raw units; points (N, 3) or (H, W, 3) in the
        camera frame, metres; or a file whose first frame counts. 0, NaN, negative depths and raw 65535 are "no
        measurement".
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
    vessel : Vessel or path, optional
        A vessel file (`siloscope.vessel.vessel.load`): its diameter counts, its bottom is held against the frame.
    gravity : array (3,), optional
        Direction of gravity in the camera frame, any length; for a cloud in its file's frame.
    mask : array of bool, optional
        True where the silo is, of the frame's shape.
    crop : (xmin, xmax, ymin, ymax, zmin, zmax), optional
        Box in the camera frame, metres; only points inside are used.
    grid : float, optional
        Side of the voxel grid's cells, m; `siloscope.estimation.steps.GRID` (step 1), or less for small clouds. To the
        method ``surface`` it lets the points of a small cloud answer where the image of its rays shows no wall.
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
    trust : str or sequence of {"range", "camera", "bias", "diameter", "gravity"}
        What to go by although it contradicts the sensor's profile or the frame by more than 5 standard deviations;
        the contradiction then is a warning in `Estimate.quality`, where it would be a refusal.

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
    profile, known = sensors.load(sensor), given(vessel, None, diameter=diameter)
    settings = Settings.checked(
        profile,
        diameter=known.sheet.diameter,
        told_cone=known.sheet.bottom == "cone" or bool(known.sheet.cone),
        gravity=gravity,
        grid=grid,
        neighbours=neighbours,
        threads=threads,
        start=start,
        ratios=ratios,
        intrinsics=intrinsics,
        trust=trust,
    )
    data = given_frame(data, camera, depth_unit)
    brought = partial(prepare, data, camera, profile, depth_unit=depth_unit, mask=mask, crop=crop)
    prepared = brought(clouds="resampled" if method == "surface" else "points")
    settings = settings.with_gravity_of(prepared)
    config = settings.effective(method, prepared)
    found = input_remarks(data, prepared, profile, depth_unit)
    against = contradictions.refused(method, found, settings.trust, config)
    if against is not None:
        return against
    estimate = run(prepared, settings, config)
    if grid is not None and method == "surface" and estimate.reason in FEW_TILES and prepared.turn is not None:
        prepared = brought(clouds="rays")
        estimate = run(prepared, settings, settings.effective(method, prepared))
    if method == "surface":
        estimate, more = second_look.looked_at_again(run, estimate, prepared, settings)
        found = (*found, *more, *vessel_remarks(estimate, known))
    found = (*found, *unused_options(estimate, prepared, settings))
    return contradictions.judged(estimate, found, settings.trust)
