"""`measure`: one frame and a calibration in, the content out."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core, sensors
from siloscope.calibrate import calibrate
from siloscope.calibration import Calibration
from siloscope.camera import Camera
from siloscope.content import quality
from siloscope.content.capacity import Datasheet, Strapping, missing
from siloscope.content.density import Density, choose
from siloscope.content.knowledge import PARAMETERS, WALL_STD, Knowledge, know, narrowed
from siloscope.content.quality import QUALITY, Remark
from siloscope.content.result import Content, Level, Parts
from siloscope.content.surface_map import Shape, SurfaceMap
from siloscope.errors import InputError, UsageError
from siloscope.frame import Frame
from siloscope.inputs import Prepared, prepare
from siloscope.locate import locate
from siloscope.sensors import SensorProfile

BOTTOMLESS = 100.0
"""How far below the camera the floor is put while nobody knows it, m: everything seen then is content."""

FEWEST = 3
"""Fewer cells than this that seem to show content on an otherwise bare floor are no content."""

BEHIND = 1.5
"""Cells behind the farthest one that shows the bare cone at which a cone without an end is cut off."""

DETECTABLE = 3.0
"""A heap on the vertex lower than so many standard deviations of a cell's thickness goes unseen."""


def measure(
    data: Frame | ArrayLike,
    calibration: Calibration | str | PathLike[str] | None = None,
    camera: Camera | None = None,
    *,
    sensor: str | Path | SensorProfile | None = None,
    depth_unit: float | None = None,
    diameter: float | None = None,
    cylinder: float | None = None,
    cone: float | None = None,
    top: float | None = None,
    outlet_diameter: float = 0.0,
    outlet_length: float = 0.0,
    strapping: Strapping | str | Path | None = None,
    density: float | None = None,
    density_std: float | None = None,
    product: str | Path | Density | None = None,
    mask: ArrayLike | None = None,
    previous: Content | None = None,
) -> Content:
    """Measure what is in the silo: surface, level, volume, fill and mass, each with its standard deviation.

    The surface is the most probable one under the returns that lie over the silo's floor (`docs/content.md` has the
    formulas); the volume is the integral between it and the floor.

    Parameters
    ----------
    data : Frame, or array
        As for `siloscope.locate`.
    calibration : Calibration or path, optional
        Pose and geometry. Without one the frame itself has to show them: it is located first, and `assumed` says so.
    camera : Camera, optional
        Intrinsics; wins over the frame's own, and those over the calibration's.
    sensor : str, path or SensorProfile, optional
        Sensor profile; the calibration's where not given.
    depth_unit : float, optional
        Metres per raw unit of integer depth.
    diameter, cylinder, cone : float, optional
        Inner lengths of a datasheet, m: diameter, height of the cylinder, height of the cone. They fill in what the
        calibration has not seen and tell the silo's upper edge. Without a calibration, the diameter also fixes the
        depth's scale.
    top : float, optional
        z of the silo's upper edge below the camera, m (negative above it), up to which it can be filled. From
        `cylinder` where not given, else the camera's own height.
    outlet_diameter, outlet_length : float
        Outlet pipe below the cone, m; counts as part of the silo.
    strapping : Strapping or path, optional
        Strapping table: capacity, and the volume below the mean level.
    density, density_std : float, optional
        Bulk density and its standard deviation, kg/m³.
    product : str, path or Density, optional
        A product of the table (`siloscope.content.products()`) or of a TOML file.
    mask : array of bool, optional
        True where the silo is.
    previous : Content, optional
        The reading of the frame before, to see whether the content is moving.

    Raises
    ------
    InputError
        For a frame or file that can't be used.
    UsageError
        For settings that can't be.
    """
    start = time.perf_counter()
    chosen = choose(density, density_std, product)
    sheet = Datasheet(diameter, cylinder, cone, outlet_diameter, outlet_length)
    table = strapping if isinstance(strapping, Strapping | None) else Strapping.read(strapping)
    profile = None if sensor is None else sensors.load(sensor)
    known, located = _known(data, calibration, camera, profile, depth_unit, sheet, top, mask)
    if isinstance(known, Content):
        return known
    prepared = prepare(data, _camera(data, camera, located), profile or sensors.UNKNOWN,
                       depth_unit=depth_unit, mask=mask)  # fmt: skip
    ready = time.perf_counter()
    found, surface = _run(prepared, known, sheet)
    if known.lengths.cone_only:
        known = _closer(known, located, found, surface)
        found, surface = _run(prepared, known, sheet)
    done = time.perf_counter()
    request = _Request(known, sheet, table, chosen, previous, calibration is None)
    times = {"prepare": 1e3 * (ready - start), "measure": 1e3 * (done - ready)}
    return _content(request, data, found, surface, {**prepared.config, **known.config}, times)


@dataclass(frozen=True, eq=False)
class _Request:
    """What the caller wants to know, checked."""

    known: Knowledge
    sheet: Datasheet
    strapping: Strapping | None
    density: Density | None
    previous: Content | None
    located: bool


def _known(
    data: Frame | ArrayLike,
    calibration: Calibration | str | PathLike[str] | None,
    camera: Camera | None,
    profile: SensorProfile | None,
    depth_unit: float | None,
    sheet: Datasheet,
    top: float | None,
    mask: ArrayLike | None,
) -> tuple[Knowledge | Content, Calibration]:
    """Pose and silo: from the calibration, or from the frame itself."""
    if calibration is not None:
        given = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
        return know(given, profile, sheet, top, sheet.diameter), given
    estimate = locate(data, camera, sensor=profile, depth_unit=depth_unit, diameter=sheet.diameter, mask=mask)
    if not estimate.ok:
        reason, message = estimate.reason, f"{estimate.message} A calibration (--calibration) would do without."
        return Content("refused", reason, message, source=_source(data), config=estimate.config), Calibration("refused")
    fused = calibrate([estimate], sensor=profile, diameter=sheet.diameter)
    known = know(fused, profile, sheet, top, None)
    said = ("pose and silo from this frame alone, without a calibration", *known.assumed)
    return replace(known, assumed=said), fused


def _camera(data: Frame | ArrayLike, camera: Camera | None, calibration: Calibration) -> Camera | None:
    """The caller's camera, else the frame's own, else the calibration's."""
    if camera is not None or (isinstance(data, Frame) and (data.camera is not None or data.points is not None)):
        return camera
    table = calibration.config.get("camera")
    try:
        return None if table is None else Camera(**{**table, "distortion": tuple(table["distortion"])})
    except (TypeError, KeyError):
        raise InputError("the calibration's camera is damaged; give --camera FILE") from None


def _run(prepared: Prepared, known: Knowledge, sheet: Datasheet) -> tuple[dict[str, Any], _core.ContentSurface | None]:
    """The core's answer."""
    pose = (known.pose.r_x, known.pose.r_y, known.pose.t_x, known.pose.t_y)
    depth = prepared.depth
    if depth is None and prepared.points is not None:
        depth = np.ascontiguousarray(prepared.points, np.float32)
    assert depth is not None
    silo = _silo(known, sheet)
    camera = prepared.camera
    rays = None if camera is None or camera.distortion_model == "none" else camera.rays()
    try:
        return _core.content_measure(
            depth, camera, rays, pose, silo, known.covariance, WALL_STD, known.bias, known.noise,
            known.noise_known, known.range,
        )  # fmt: skip
    except ValueError as error:
        raise UsageError(str(error)) from None


def _closer(
    known: Knowledge, calibration: Calibration, found: dict[str, Any], core: _core.ContentSurface | None
) -> Knowledge:
    """A cone of which nobody knows where it ends, cut off behind the farthest bare wall, so that the map fits it."""
    radius = known.lengths.geometry.radius
    if found["bare"] is None or core is None or radius is None:
        return known
    _, reach, side = core.grid
    return narrowed(known, calibration, min(found["bare"][1] + BEHIND * 2.0 * reach / side, radius))


def _silo(known: Knowledge, sheet: Datasheet) -> tuple[float, ...]:
    """Lengths as the core takes them; a floor that nobody knows is put out of sight."""
    geometry = known.lengths.geometry
    if geometry.radius is None:
        raise InputError(
            "the calibration has not seen the cylinder, so the silo's radius is not known; give --diameter, or "
            "calibrate with frames of a lower level"
        )
    bottom, apex = geometry.cylinder_bottom, geometry.apex
    if bottom is None or apex is None:
        bottom = apex = BOTTOMLESS
    if sheet.outlet_diameter >= 2.0 * geometry.radius:
        raise UsageError(
            f"an outlet of {sheet.outlet_diameter:g} m does not fit a silo of {2.0 * geometry.radius:.3f} m; "
            "give --outlet-diameter in metres"
        )
    if known.lengths.top >= apex:
        raise UsageError(
            f"the upper edge at {known.lengths.top:g} m below the camera lies under the cone's vertex at {apex:.3f} m; "
            "--top is negative above the camera"
        )
    outlet = sheet.outlet_diameter / 2.0
    return geometry.radius, bottom, apex, known.lengths.top, outlet, sheet.outlet_length, *known.ovality


def _content(
    request: _Request,
    data: Frame | ArrayLike,
    found: dict[str, Any],
    core: _core.ContentSurface | None,
    config: dict[str, Any],
    times: dict[str, float],
) -> Content:
    known, sheet = request.known, request.sheet
    silo = _silo(known, sheet)
    lacking = _lacking(known, found)
    capacity, capacity_from = _capacity(request, silo, lacking)
    numbers = found["volume"]
    empty = numbers is None and found["kinds"][1] < FEWEST and found["bare"] is not None
    coverage = 1.0 if empty else None if numbers is None else numbers["seen"] / max(numbers["area"], 1e-12)
    area = math.pi * silo[0] ** 2
    said = quality.remarks(found, coverage, capacity, area)
    config = {**_config(request), **config}
    frame: dict[str, Any] = {
        "source": _source(data),
        "timestamp": data.timestamp if isinstance(data, Frame) else None,
        "config": config,
        "timing_ms": times,
        "lengths": known.lengths,
        "missing": lacking,
        "assumed": known.assumed,
        "capacity": capacity,
        "capacity_from": capacity_from,
    }
    against = [remark for remark in said if remark.refuses]
    if against:
        return _refused(against[0], tuple(said), frame)
    vertex = known.lengths.geometry.apex is not None
    datum, datum_name = (silo[2], "cone-vertex") if vertex else (_lowest(numbers), "lowest-seen")
    level = Level(*[0.0] * 4) if empty else _level(numbers, found, core, datum)
    surface = None if core is None else SurfaceMap(core, datum, silo[0])
    volume, std = _empty(found, silo, known) if empty else _volume(request, numbers, found, silo, level, lacking)
    mass = _mass(request.density, volume, std, surface, silo)
    now = Content(
        "ok",
        volume=volume,
        volume_std=std,
        parts=None if lacking else Parts(*(found["std"][name] for name in Parts.__dataclass_fields__)),
        level=level,
        height_datum=datum_name,
        coverage=coverage,
        shape=Shape.of(found["shape"]),
        quality=tuple(said),
        surface=surface,
        **mass,
        **frame,
    )
    return _moving(now, request.previous)


def _lacking(known: Knowledge, found: dict[str, Any]) -> tuple[str, ...]:
    """Lengths without which there is no volume; of a cone alone, the radius where the content may reach beyond it."""
    if not known.lengths.cone_only:
        return missing(known.lengths.geometry)
    numbers, bare = found["volume"], found["bare"]
    inside = numbers is None or (bare is not None and numbers["reach"] <= bare[1])
    return () if inside else ("radius",)


def _refused(remark: Remark, said: tuple[Remark, ...], frame: dict[str, Any]) -> Content:
    meaning, advice = QUALITY[remark.code]
    message = f"{meaning[0].upper()}{meaning[1:]} ({remark.seen}); {advice}."
    return Content("refused", remark.code, message, quality=said, **frame)


def _capacity(request: _Request, silo: tuple[float, ...], lacking: tuple[str, ...]) -> tuple[float | None, str | None]:
    if request.strapping is not None:
        return request.strapping.capacity, "strapping"
    if lacking or request.known.lengths.cone_only:
        return None, None
    source = "datasheet" if request.known.lengths.top_from == "datasheet" else "calibration"
    return _core.vessel_volume_below(silo, [silo[3]])[0], source


def _lowest(numbers: dict[str, Any] | None) -> float:
    return 0.0 if numbers is None else float(numbers["extremes"][1])


def _level(numbers: dict[str, Any], found: dict[str, Any], core: _core.ContentSurface | None, datum: float) -> Level:
    area = numbers["area"]
    if area <= 0.0 or core is None:
        return Level(*[0.0] * 4)
    at_axis = float(core.z_at(np.zeros((1, 2)))[0])
    low, high = numbers["extremes"]
    at_wall = numbers["at_wall"]
    return Level(
        datum - numbers["moment"] / area,
        datum - high,
        datum - low,
        max(datum - at_axis, 0.0),
        None if at_wall is None else datum - at_wall,
        found["std"]["total"] / area,
    )


def _volume(
    request: _Request,
    numbers: dict[str, Any],
    found: dict[str, Any],
    silo: tuple[float, ...],
    level: Level,
    lacking: tuple[str, ...],
) -> tuple[float | None, float | None]:
    """Volume by the geometry; with a strapping table, the table's below the mean level and the rest by geometry."""
    if lacking:
        return None, None
    volume, std = float(numbers["volume"]), float(found["std"]["total"])
    if request.strapping is None or level.mean is None:
        return volume, std
    below = _core.vessel_volume_below(silo, [silo[2] - level.mean])[0]
    return volume - below + request.strapping.volume(level.mean), std


def _empty(found: dict[str, Any], silo: tuple[float, ...], known: Knowledge) -> tuple[float | None, float | None]:
    """No content seen: none, up to the level that could hide on the vertex unseen."""
    if missing(known.lengths.geometry):
        return None, None
    radius, bottom, apex, *_ = silo
    slope = (apex - bottom) / radius
    thin = DETECTABLE * math.hypot(WALL_STD, math.sqrt(max(float(known.covariance[6, 6]), 0.0)))
    hidden = max(thin, found["bare"][0] * slope)
    return 0.0, _core.vessel_volume_below(silo, [apex - hidden])[0]


def _mass(
    density: Density | None,
    volume: float | None,
    std: float | None,
    surface: SurfaceMap | None,
    silo: tuple[float, ...],
) -> dict[str, Any]:
    if density is None or volume is None or std is None:
        return {"density": None if density is None else density.to_dict()}
    mean = density.mean(_columns(surface, silo), silo[0])
    own = density.std / density.loose * mean
    return {
        "mass": mean * volume,
        "mass_std": math.hypot(mean * std, own * volume),
        "density": {**density.to_dict(), "mean_kg_m3": mean},
    }


def _columns(surface: SurfaceMap | None, silo: tuple[float, ...]) -> NDArray[np.float64]:
    """Heights of the content over the floor in the map's cells."""
    if surface is None:
        return np.zeros(0)
    radius, bottom, apex, *_ = silo
    across = np.hypot(surface.x[None, :], surface.y[:, None])
    floor = np.minimum((apex - bottom) * across / radius, apex - bottom)
    rise = np.where(surface.inside, surface.heights - floor, 0.0)
    return np.asarray(rise[rise > 0.0])


def _moving(now: Content, previous: Content | None) -> Content:
    """With the remark that the content moved since the frame before, where it did."""
    change = None if previous is None else now.change_since(previous)
    if change is None or abs(change[0]) <= quality.MOVING * change[1]:
        return now
    return replace(
        now, quality=(*now.quality, Remark("filling-in-progress", f"{change[0]:+.3f} m³ since the frame before"))
    )


def _config(request: _Request) -> dict[str, Any]:
    """The effective settings, written beside every result."""
    known = request.known
    std = np.sqrt(np.maximum(np.diag(known.covariance), 0.0))
    values = (known.pose.r_x, known.pose.r_y, known.pose.t_x, known.pose.t_y)
    return {
        "located": request.located,
        "pose": dict(zip(PARAMETERS[:4], values, strict=True)),
        "std": dict(zip(PARAMETERS, std.tolist(), strict=True)),
        "bias": dict(zip(PARAMETERS[7:], known.bias, strict=True)),
        "datasheet": request.sheet.to_dict(),
        "strapping": None if request.strapping is None else request.strapping.source,
        "wall_std": WALL_STD,
    }


def _source(data: Frame | ArrayLike) -> str:
    return data.source if isinstance(data, Frame) else "frame"
