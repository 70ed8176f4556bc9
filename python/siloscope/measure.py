"""`measure`: one frame and a calibration in, the content out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike

from siloscope import sensors
from siloscope.calibrate import calibrate
from siloscope.content.alone import ALONE, unlocated
from siloscope.content.capacity import Strapping
from siloscope.content.density import Density, choose
from siloscope.content.knowledge import know
from siloscope.content.outlined import PlacedPose, outlined
from siloscope.content.reading import source_of
from siloscope.content.silo_content import SiloContent
from siloscope.content.units import at_moisture
from siloscope.errors import UsageError
from siloscope.estimation.inputs import prepare
from siloscope.io.given import given_frame
from siloscope.locate import locate
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.content import Content
from siloscope.types.frame import Frame
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.types.pose import SiloPose
from siloscope.vessel.floor import STEEPEST_REPOSE
from siloscope.vessel.vessel import Vessel, given


def measure(
    data: Frame | ArrayLike | str | PathLike[str],
    calibration: Calibration | str | PathLike[str] | None = None,
    camera: Camera | None = None,
    *,
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: float | None = None,
    diameter: float | None = None,
    cylinder: float | None = None,
    cone: float | None = None,
    bottom: str | None = None,
    top: float | None = None,
    vessel: Vessel | str | Path | None = None,
    outlet_diameter: float = 0.0,
    outlet_length: float = 0.0,
    strapping: Strapping | str | Path | None = None,
    density: float | None = None,
    density_std: float | None = None,
    product: str | Path | Density | None = None,
    test_weight: str | None = None,
    moisture: float | None = None,
    pose: SiloPose | None = None,
    pose_std: tuple[float, float] | None = None,
    mask: ArrayLike | None = None,
    intrinsics: str | IntrinsicsStd | None = None,
    previous: Content | None = None,
    trust: str | Sequence[str] = (),
) -> Content:
    """Measure what is in the silo: surface, level, volume, fill and mass, each with its standard deviation.

    The surface is the most probable one under the returns over the floor; `docs/content.md` has the formulas.

    Parameters
    ----------
    data : Frame, or array
        As for `siloscope.locate`.
    calibration : Calibration or path, optional
        Pose and geometry. Without one the frame itself has to show them: it is located first, and `assumed` says so.
    camera : Camera, optional
        Intrinsics; wins over the frame's own, and those over the calibration's. `trust` is as for `siloscope.locate`.
    sensor : str, path or SensorProfile, optional
        Sensor profile; the calibration's where not given. `depth_unit`: metres per raw unit of integer depth.
    diameter, cylinder, cone : float, optional
        Inner lengths of a datasheet, m: diameter, height of the cylinder, height of the cone, 0 for a flat floor. They
        fill in what the calibration has not seen and tell the silo's upper edge. Without a calibration, the diameter
        also fixes the depth's scale.
    bottom : str, optional
        "cone": the conical surface seen, where `cone` is not given; "flat", or "unknown". Without it a conical surface
        counts as the bottom only if it is steeper than feed can lie.
    top : float, optional
        z of the silo's upper edge below the camera, m (negative above it); from `cylinder`, else the camera's height.
    vessel : Vessel or path, optional
        A vessel file (`siloscope.vessel.vessel.load`), over which single lengths win.
    outlet_diameter, outlet_length : float
        Outlet pipe below the cone, m; counts as part of the silo.
    strapping : Strapping or path, optional
        Strapping table: capacity, and the volume below the mean level.
    density, density_std : float, optional
        Bulk density and its deviation, kg/m³.
    product : str, path or Density, optional
        A product of the table (`siloscope.content.products()`) or of a TOML file.
    test_weight : str, optional
        Weighed test weight: "60" lb/bu, or "77.2kg/hl". It takes the place of the product's density.
    moisture : float, optional
        Of the feed, as a fraction of its wet mass: adds the dry matter.
    pose : SiloPose, optional
        The camera's pose where no calibration tells it, for a bin that is not round: its outline is in the vessel file.
    pose_std : (float, float), optional
        Deviations of a given pose's angles, rad, and of its place, m; else `siloscope.content.outlined.POSE_STD`.
    mask, intrinsics : optional
        As for `siloscope.locate`; `intrinsics` where there is no calibration.
    previous : Content, optional
        The reading of the frame before, to see whether the content is moving.

    Raises
    ------
    InputError
        For a frame or file that can't be used.
    UsageError
        For settings that can't be.
    """
    data, start = given_frame(data, camera, depth_unit), time.perf_counter()
    chosen = choose(density, density_std, product, test_weight)
    if moisture is not None:
        at_moisture(1.0, moisture, 0.0)
    about = given(vessel, top, diameter=diameter, cylinder=cylinder, cone=cone, bottom=bottom,
                  outlet_diameter=outlet_diameter, outlet_length=outlet_length)  # fmt: skip
    sheet, top = about.sheet, about.top
    table = strapping if isinstance(strapping, Strapping | None) else Strapping.read(strapping)
    profile = None if sensor is None else sensors.load(sensor)
    steepest = STEEPEST_REPOSE if chosen is None else chosen.steepest
    if pose is not None and about.outline is None:
        raise UsageError("a pose alone bounds no surface; give a vessel file with an outline, or a calibration")
    if about.outline is not None:
        prepared = prepare(data, camera, profile or sensors.UNKNOWN, depth_unit=depth_unit, mask=mask, clouds="as is")
        placed = PlacedPose.of(pose, pose_std, calibration)
        return replace(outlined(prepared, placed, about, profile, chosen, source_of(data)), moisture=moisture)
    if calibration is None:
        estimate = locate(data, camera, sensor=profile, depth_unit=depth_unit, vessel=about, mask=mask,
                          intrinsics=intrinsics, trust=trust)  # fmt: skip
        silo = calibrate([estimate], sensor=profile, diameter=sheet.diameter) if estimate.ok else None
        if silo is None or not silo.ok:
            return unlocated(data, estimate if silo is None else silo, source_of(data))
        known = know(silo, profile, sheet, top, None, steepest).assuming(ALONE)
    else:
        silo = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
        known, estimate = know(silo, profile, sheet, top, sheet.diameter, steepest), None
    content = SiloContent(silo, about, known, profile, table, chosen, moisture, estimate, trust)
    return content.measure(data, camera, depth_unit=depth_unit, mask=mask, previous=previous, since=start)
