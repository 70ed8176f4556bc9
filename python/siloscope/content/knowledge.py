"""What is known before a frame is measured: pose, silo and sensor with one covariance over all of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import sensors
from siloscope.content.capacity import complete, lacking
from siloscope.content.taped import taped
from siloscope.errors import InputError, UsageError
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.floor import Floor
from siloscope.types.frame import Frame
from siloscope.types.pose import SiloPose
from siloscope.types.remark import Remark
from siloscope.types.vessel import Lengths, SiloGeometry
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.floor import CONTRADICTION_STD, STEEPEST_REPOSE, floor_of, has_seen_cone, with_cone
from siloscope.vessel.limits import LENGTH_STD
from siloscope.vessel.vessel import Vessel

PARAMETERS = ("r_x", "r_y", "t_x", "t_y", "radius", "cylinder_bottom", "apex", "offset", "scale", "quadratic")
"""Order of the covariance; the last three are the sensor's depth bias."""

TYPICAL_NOISE = (0.002, 0.0, 0.0, 0.0, 0.0019, 2.36)
"""Noise law where nothing tells the sensor's own: that of a structured-light camera (`orbbec-astra`)."""

ANOTHER_VESSEL = 0.1
"""Share by which a diameter may differ from the calibration's and still be of the same vessel."""

WALL_STD = 0.002
"""How uneven a wall is that nothing tells more about, m (standard deviation)."""

DETECTABLE = 3.0
"""Content thinner than so many standard deviations of a cell's thickness goes unseen."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Everything that the core needs beside the frame."""

    pose: SiloPose
    lengths: Lengths
    covariance: NDArray[np.float64]
    """(10, 10) over `PARAMETERS`."""
    bias: tuple[float, float, float]
    noise: tuple[float, float, float, float, float, float]
    noise_known: bool
    """Whether that is the sensor's own noise and not `TYPICAL_NOISE`."""
    range: tuple[float, float]
    ovality: tuple[float, float] = (0.0, 0.0)
    """How oval the silo is, as the calibration has it (`siloscope.estimation.surface`)."""
    assumed: tuple[str, ...] = ()
    config: dict[str, Any] = field(default_factory=dict)
    floor: Floor = field(default_factory=Floor)
    missing: tuple[str, ...] = ()
    """What a volume needs and nobody knows, in the words of the options."""
    remarks: tuple[Remark, ...] = ()
    """Contradictions between what was given and what was seen."""

    def assuming(self, what: str) -> Knowledge:
        """The same, with something that was taken for granted before the rest."""
        return replace(self, assumed=(what, *self.assumed))


def know(
    calibration: Calibration,
    sensor: SensorProfile | None,
    sheet: Datasheet,
    top: float | None,
    diameter: float | None,
    steepest: float = STEEPEST_REPOSE,
) -> Knowledge:
    """Puts calibration, sensor profile and datasheet together.

    Raises
    ------
    InputError
        For a calibration that was refused.
    UsageError
        For a diameter of another vessel, or a sensor with another bias than the calibration's.
    """
    pose = calibration.pose
    if pose is None:
        raise InputError(f"the calibration has no answer ({calibration.reason}); calibrate with frames that show wall")
    own = sensors.from_record(calibration.config.get("sensor"))
    profile = sensors.with_map(sensor or own or sensors.UNKNOWN, calibration.config.get("sensor"))
    if sensor is not None and own is not None and sensor.bias != own.bias:
        raise UsageError(
            f"the calibration was made with the depth bias of '{own.name}', not of '{sensor.name}'; leave the sensor "
            "out, or calibrate with it"
        )
    sheet = _with_tape(sheet, calibration)
    remarks = _other_diameter(diameter, calibration)
    calibration = taped(calibration, diameter)
    floor, contradicted = floor_of(calibration, sheet, steepest)
    if floor.kind == "flat":
        sheet = replace(sheet, bottom="flat", cone=None)
    calibration = with_cone(calibration) if has_seen_cone(floor) else _without_cone(calibration)
    lengths = _cone_alone(calibration, _joint(calibration, complete(calibration.silo, sheet, top), sheet))
    floor = _placed(floor, sheet, lengths.geometry)
    covariance = _covariance(calibration, lengths)
    remarks += contradicted + _other_joint(calibration, sheet, top)
    assumed = list(lengths.assumed)
    if profile.noise is None:
        assumed.append("noise of a typical structured-light sensor")
    if calibration.parameters is None:
        assumed.append("the calibration was averaged by the paper's rule: its lengths have no covariance")
    return Knowledge(
        pose,
        lengths,
        covariance,
        _bias(calibration, profile),
        profile.noise or TYPICAL_NOISE,
        profile.noise is not None,
        profile.range,
        _ovality(calibration),
        tuple(assumed),
        {"sensor": profile.to_dict()},
        floor,
        _missing(floor, lengths.geometry, sheet, top),
        remarks,
    )


def _placed(floor: Floor, sheet: Datasheet, geometry: SiloGeometry) -> Floor:
    """A bottom of a datasheet hung at the cylinder's lower edge."""
    if sheet.shape is None or geometry.radius is None or geometry.cylinder_bottom is None:
        return floor
    return replace(floor, map=sheet.shape.floor_map(geometry.radius, geometry.cylinder_bottom))


def _missing(floor: Floor, geometry: SiloGeometry, sheet: Datasheet, top: float | None) -> tuple[str, ...]:
    """What a volume needs and nobody knows."""
    if not floor.known:
        return ("bottom",)
    if floor.map is not None:
        return () if geometry.radius is not None else ("radius",)
    names = lacking(geometry, sheet, top)
    return tuple(name for name in names if name != "apex")


def _without_cone(calibration: Calibration) -> Calibration:
    """The calibration without the conical surface that it has seen, which is not the bottom."""
    values, covariance = calibration.parameters, calibration.parameter_covariance
    if values is not None:
        values = values.copy()
        values[5:7] = np.nan
    if covariance is not None:
        covariance = covariance.copy()
        covariance[5:7] = covariance[:, 5:7] = 0.0
    silo = SiloGeometry(radius=calibration.silo.radius)
    return replace(calibration, parameters=values, parameter_covariance=covariance, silo=silo)


def _with_tape(sheet: Datasheet, calibration: Calibration) -> Datasheet:
    """The datasheet with the diameter that the calibration was given, where it has none of its own."""
    own = calibration.config.get("diameter")
    if sheet.diameter is not None or not isinstance(own, int | float):
        return sheet
    return replace(sheet, diameter=float(own))


def filled_to(known: Knowledge, vessel: Vessel) -> Knowledge:
    """The same, filled up to the vessel's own fill height."""
    edge, cylinder = vessel.fill_height, vessel.sheet.cylinder
    if edge is None or cylinder is None or edge >= cylinder or known.lengths.top_from == "camera":
        return known
    return replace(known, lengths=replace(known.lengths, top=known.lengths.top + cylinder - edge))


def narrowed(known: Knowledge, calibration: Calibration, radius: float) -> Knowledge:
    """The same, with a cone of which nobody knows where it ends cut off at a radius."""
    apex, slope = known.lengths.geometry.apex, _slope(calibration)
    if apex is None:
        return known
    lengths = replace(known.lengths, geometry=SiloGeometry(radius, apex - radius / slope, apex))
    return replace(known, lengths=lengths, covariance=_covariance(calibration, lengths))


def _slope(calibration: Calibration) -> float:
    """The cone's, dr/dz; NaN where it was not seen."""
    slope = math.nan if calibration.parameters is None else float(calibration.parameters[5])
    return slope if slope > 0.0 else math.nan


def _joint(calibration: Calibration, lengths: Lengths, sheet: Datasheet) -> Lengths:
    """The cylinder's bottom where the cone that was seen is as wide as the datasheet's diameter."""
    geometry = lengths.geometry
    slope = _slope(calibration)
    if geometry.radius is None or geometry.cylinder_bottom is not None or geometry.apex is None or math.isnan(slope):
        return lengths
    bottom = geometry.apex - geometry.radius / slope
    edge = lengths.top if sheet.cylinder is None or lengths.top_from == "given" else bottom - sheet.cylinder
    told = lengths.top_from if edge == lengths.top else "datasheet"
    said = (*lengths.assumed, "cylinder's bottom where the seen cone is as wide as the given diameter")
    made = SiloGeometry(geometry.radius, bottom, geometry.apex)
    return replace(lengths, geometry=made, top=edge, top_from=told, assumed=said)


def _cone_alone(calibration: Calibration, lengths: Lengths) -> Lengths:
    """Where nobody knows the cylinder, the cone continued up to the camera: content in the cone needs no more."""
    if lengths.geometry.radius is not None or calibration.parameters is None:
        return lengths
    slope, intercept = (float(v) for v in calibration.parameters[5:7])
    if not (math.isfinite(slope * intercept) and slope > 0.0 and intercept > 0.0):
        return lengths
    said = ("the content lies in the cone: the cylinder was never seen",)
    return replace(
        lengths,
        geometry=SiloGeometry(intercept, 0.0, intercept / slope),
        assumed=tuple(a for a in lengths.assumed if "filled" not in a) + said,
        cone_only=True,
    )


def _bias(calibration: Calibration, profile: SensorProfile) -> tuple[float, float, float]:
    """The depth bias that the calibration found, or the profile's."""
    if calibration.parameters is None or not np.isfinite(calibration.parameters[7:10]).all():
        return profile.bias
    offset, scale, quadratic = (float(b) for b in calibration.parameters[7:10])
    return offset, scale, quadratic


def _ovality(calibration: Calibration) -> tuple[float, float]:
    """Cosine and sine part of the ovality; 0 where the calibration has none."""
    known = calibration.parameters
    if known is None or not np.isfinite(known[10:12]).all() or len(known) < 12:
        return 0.0, 0.0
    return float(known[10]), float(known[11])


def _covariance(calibration: Calibration, lengths: Lengths) -> NDArray[np.float64]:
    """The calibration's covariance and the datasheet's, with z_b and z_a in place of the cone's slope and intercept."""
    if calibration.parameters is None or calibration.parameter_covariance is None:
        made = np.diag([0.0] * 4 + list(lengths.added_variance) + [0.0] * 3)
        if calibration.covariance is not None:
            made[:4, :4] = calibration.covariance
        return made
    of_radius, of_bottom, of_apex = lengths.added_variance
    own = np.nan_to_num(calibration.parameter_covariance)[:10, :10]
    own[4, 4] += of_radius
    jacobian = _jacobian(calibration, lengths)
    extra = np.zeros((10, 10))
    both = slice(5, 7) if lengths.apex_from == "bottom" else slice(5, 6)
    extra[both, both] = of_bottom
    extra[6, 6] += of_apex
    made = jacobian @ own @ jacobian.T + extra
    return np.asarray(0.5 * (made + made.T))


def _jacobian(calibration: Calibration, lengths: Lengths) -> NDArray[np.float64]:
    """Derivatives of `PARAMETERS` by the calibration's, which have the cone's slope m and intercept b after the radius.

    The cone has the radius b - m z: it ends at z_a = b / m, and where cone and cylinder meet, z_b = (b - R) / m. Of a
    cone alone z_b is where we cut it, and R = b - m z_b.
    """
    jacobian = np.eye(10)
    slope, geometry = _slope(calibration), lengths.geometry
    jacobian[5:7] = 0.0
    if geometry.apex is not None:
        jacobian[6, 5:7] = np.array([-geometry.apex, 1.0]) / slope
    if geometry.radius is not None and geometry.cylinder_bottom is not None and geometry.apex is not None:
        if lengths.cone_only:
            jacobian[4, 4:7] = (0.0, -geometry.cylinder_bottom, 1.0)
        elif lengths.bottom_from == "wall":
            jacobian[5, 4:7] = np.array([-1.0, -geometry.cylinder_bottom, 1.0]) / slope
        elif lengths.bottom_from == "vertex":
            jacobian[5] = jacobian[6]
        if lengths.apex_from == "bottom":
            jacobian[6] = jacobian[5]
    return np.nan_to_num(jacobian)


def _other_diameter(diameter: float | None, calibration: Calibration) -> tuple[Remark, ...]:
    """A warning where a diameter contradicts the calibration's; it belongs into the calibration."""
    silo, covariance = calibration.silo, calibration.parameter_covariance
    if diameter is None or silo.radius is None:
        return ()
    variance = 0.0 if covariance is None else float(covariance[4, 4])
    gap, std = abs(diameter - 2.0 * silo.radius), math.hypot(2.0 * math.sqrt(variance), LENGTH_STD)
    if gap > ANOTHER_VESSEL * diameter:
        raise UsageError(
            f"a diameter of {diameter:g} m does not fit the calibration's {2.0 * silo.radius:.3f} m; check the number "
            "and the calibration, they are of two vessels"
        )
    if gap <= CONTRADICTION_STD * std:
        return ()
    numbers = f"a diameter of {diameter:.3f} m is given, the calibration has {2.0 * silo.radius:.3f} m, which counts; "
    return (Remark("vessel-contradicted", f"{numbers}calibrate with --diameter, which puts every length right"),)


def _other_joint(calibration: Calibration, sheet: Datasheet, top: float | None) -> tuple[Remark, ...]:
    """A warning where the cylinder's bottom that was seen is not where top and cylinder put it."""
    seen = calibration.silo.cylinder_bottom
    if seen is None or top is None or sheet.cylinder is None:
        return ()
    std = math.hypot(calibration.silo_std.cylinder_bottom or 0.0, math.sqrt(2.0) * LENGTH_STD)
    if abs(top + sheet.cylinder - seen) <= CONTRADICTION_STD * std:
        return ()
    numbers = f"top and cylinder put the cylinder's bottom at {top + sheet.cylinder:.3f} m, it is seen at {seen:.3f} m"
    return (Remark("vessel-contradicted", f"{numbers}, which counts"),)


def camera_of(data: Frame | ArrayLike, camera: Camera | None, calibration: Calibration) -> Camera | None:
    """The caller's camera, else the frame's own, else the calibration's."""
    if camera is not None or (isinstance(data, Frame) and (data.camera is not None or data.points is not None)):
        return camera
    table = calibration.config.get("camera")
    try:
        return None if table is None else Camera(**{**table, "distortion": tuple(table["distortion"])})
    except (TypeError, KeyError, ValueError):
        raise InputError("the calibration's camera is damaged; give --camera FILE") from None
