"""From the core's numbers to the answer: capacity, level, volume, mass, remarks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from siloscope import _core
from siloscope.content import quality
from siloscope.content.alone import meaning, spoken_alone
from siloscope.content.beyond import break_std, hidden_std, widened
from siloscope.content.capacity import Strapping
from siloscope.content.density import Density
from siloscope.content.fitting import lengths_for_core
from siloscope.content.knowledge import DETECTABLE, PARAMETERS, WALL_STD, Knowledge
from siloscope.content.measured import Measured
from siloscope.content.over_floor import OverFloor, volume_over
from siloscope.content.setup import CoreVessel
from siloscope.content.ullage import Ullage, ullage_of
from siloscope.reasons import sentence
from siloscope.types.content import Content, Level, with_movement
from siloscope.types.frame import Frame
from siloscope.types.remark import Remark
from siloscope.types.surface_map import Shape, SurfaceMap
from siloscope.vessel.datasheet import Datasheet
from siloscope.vessel.floor import settles

FEWEST = 3
"""Fewer cells than this that seem to show content on an otherwise bare floor are no content."""

STRAY = 0.02
"""Nor is a smaller fraction of the bare cells."""


@dataclass(frozen=True, eq=False)
class Request:
    """What the caller wants to know, checked."""

    data: Frame | ArrayLike
    known: Knowledge
    sheet: Datasheet
    strapping: Strapping | None
    density: Density | None
    previous: Content | None
    located: bool
    said: tuple[Remark, ...] = ()
    """What the inputs say against each other."""


def content_of(
    request: Request,
    core: _core.ContentMeasure,
    config: dict[str, Any],
    times: dict[str, float],
) -> Content:
    """The core's numbers as the answer to a request: refused, or with everything that can be told."""
    known = request.known
    silo = lengths_for_core(known, request.sheet)
    lacking = _lacking(known, core)
    over = None if known.floor.map is None else volume_over(known.floor.map, core, known, silo)
    free = ullage_of(core, known, silo) if over is None else over.free
    coverage = _coverage(core)
    more = hidden_std(core) if core.surface is None else break_std(SurfaceMap(core.surface, 0.0, silo[0]), coverage)
    found, over, free = widened(Measured.of(core), over, free, more)
    lacking = lacking or _vague(over)
    capacity, capacity_from = _capacity(request, silo, lacking, over)
    found = _with_hidden(_with_total(found, over, free if lacking else None), known)
    said = (*request.said, *known.remarks, *quality.remarks(found, coverage, capacity, math.pi * silo[0] ** 2))
    said = spoken_alone(said) if request.located else said
    frame: dict[str, Any] = {
        "source": source_of(request.data),
        "timestamp": request.data.timestamp if isinstance(request.data, Frame) else None,
        "config": {**_config(request), **config},
        "timing_ms": times,
        "lengths": known.lengths,
        "floor": known.floor,
        "missing": lacking,
        "assumed": known.assumed,
        "capacity": capacity,
        "capacity_from": capacity_from,
        "quality": said,
    }
    against = _beyond_range(known, next((remark for remark in said if remark.refuses), None))
    if against is not None:
        return _refused(against, frame)
    if any(remark.code == "camera-moved" for remark in said):
        found = _with_move(found)
    volume = core.volume
    answer = (
        _empty(request, core, silo, lacking, over)
        if volume is None
        else _filled(request, found, volume, silo, lacking, over)
    )
    parts = None if lacking else found.parts
    if lacking:
        frame |= {"message": settles(known.floor, lacking), "quality": (*said, _unknown_bottom(known, lacking))}
    if free is not None:
        frame |= {"ullage": free.volume, "ullage_std": free.std, "ullage_parts": free.parts}
        frame["ullage_derivatives"] = free.derivatives
    now = Content("ok", parts=parts, coverage=coverage, shape=Shape.of(core.shape), **answer, **frame)
    return with_movement(now, request.previous)


def _with_total(found: Measured, over: OverFloor | None, free: Ullage | None) -> Measured:
    """The core's answer with the deviations of what is stated: content over a map, or ullage alone."""
    if over is not None and free is None:
        return replace(found, parts=over.parts, total=over.std)
    return found if free is None else replace(found, total=free.std)


def _beyond_range(known: Knowledge, against: Remark | None) -> Remark | None:
    """The refusal, by its cause where the floor lies beyond what the sensor can measure."""
    floor, far = known.floor.map, known.range[1]
    deepest = known.lengths.geometry.apex if floor is None else floor.lowest
    if against is None or against.code != "too-little-seen" or deepest is None or deepest <= far:
        return against
    return Remark("beyond-range", f"the floor lies at {deepest:.1f} m, the sensor measures up to {far:g} m", True)


def _with_hidden(found: Measured, known: Knowledge) -> Measured:
    """The core's answer with what the unseen part of the bottom adds to the deviation."""
    hidden = known.floor.hidden_std
    if hidden == 0.0:
        return found
    parts = replace(found.parts, geometry=math.hypot(found.parts.geometry, hidden))
    return replace(found, parts=parts, total=math.hypot(found.total, hidden))


def _unknown_bottom(known: Knowledge, lacking: tuple[str, ...]) -> Remark:
    seen = "" if known.floor.seen is None else f"; a conical surface of {known.floor.seen} is seen"
    return Remark("bottom-unknown", f"not known: {', '.join(lacking)}{seen}")


def _with_move(found: Measured) -> Measured:
    """The volume's deviations when the camera seems to have moved a little: the move counts as the pose's error."""
    matter = quality.move_matters(found)
    parts = replace(found.parts, pose=math.hypot(found.parts.pose, matter))
    return replace(found, parts=parts, total=math.hypot(found.total, matter))


def _is_empty(core: _core.ContentMeasure) -> bool:
    """Nothing but bare floor is seen."""
    few = max(FEWEST, STRAY * core.cells.bare)
    return core.volume is None and core.cells.content < few and core.bare is not None


def _coverage(core: _core.ContentMeasure) -> float | None:
    """Share of the surface that is seen; None where there is no surface."""
    volume = core.volume
    if volume is None:
        return 1.0 if _is_empty(core) else None
    return volume.seen / max(volume.area, 1e-12)


def _filled(
    request: Request,
    found: Measured,
    under: _core.SurfaceVolume,
    silo: CoreVessel,
    lacking: tuple[str, ...],
    over: OverFloor | None,
) -> dict[str, Any]:
    """Heights, volume and mass under a surface."""
    core, floor = found.core.surface, request.known.floor.map
    vertex = request.known.lengths.geometry.apex is not None
    lowest = silo[2] if vertex else under.lowest
    datum = lowest if floor is None else floor.lowest
    level = _level(under, found.total, core, datum)
    surface = None if core is None else SurfaceMap(core, datum, silo[0])
    volume, std = (None, None) if lacking else _volume(request, (under.volume, found.total), silo, level, over)
    return {
        "volume": volume,
        "volume_std": std,
        "level": level,
        "height_datum": _datum(request.known),
        "surface": surface,
        **_mass(request.density, volume, std, lambda: _columns(surface, silo, over), silo),
    }


def _empty(
    request: Request, core: _core.ContentMeasure, silo: CoreVessel, lacking: tuple[str, ...], over: OverFloor | None
) -> dict[str, Any]:
    """No content seen: none, but a heap on the vertex or a layer on a mapped floor, and what the unseen floor hides."""
    known = request.known
    volume, std = None, None
    if over is not None and not lacking:
        volume, std = 0.0, over.std
    elif not known.missing and not lacking:
        thin = DETECTABLE * math.hypot(WALL_STD, math.sqrt(max(float(known.covariance[6, 6]), 0.0)))
        heap = _core.vessel_volume_below(silo, [silo[2] - thin])[0]
        volume, std = 0.0, math.hypot(heap, hidden_std(core))
    return {
        "volume": volume,
        "volume_std": std,
        "level": Level(*[0.0] * 4),
        "height_datum": _datum(known),
        **_mass(request.density, volume, std, lambda: np.zeros(0), silo),
    }


def _datum(known: Knowledge) -> str:
    """What heights are measured from."""
    if known.lengths.geometry.apex is None and known.floor.map is None:
        return "lowest-seen"
    return "cone-vertex" if known.floor.kind == "cone" else "floor"


def _lacking(known: Knowledge, core: _core.ContentMeasure) -> tuple[str, ...]:
    """Lengths without which there is no volume; of a cone alone, the radius where the content may reach beyond it."""
    if not known.lengths.cone_only:
        return known.missing
    volume, bare = core.volume, core.bare
    inside = volume is None or (bare is not None and volume.reach <= bare.farthest)
    return () if inside else ("radius",)


def _vague(over: OverFloor | None) -> tuple[str, ...]:
    """The floor, where so little of it was seen that it gives no volume, while the free space is known."""
    if over is None:
        return ()
    largest = quality.LARGEST_STD * over.capacity
    return ("floor",) if over.std > largest >= over.free.std else ()


def refused(code: str, seen: str, data: Frame | ArrayLike, known: Knowledge) -> Content:
    """A reading without an answer, before the core was asked."""
    frame = {"source": source_of(data), "timestamp": data.timestamp if isinstance(data, Frame) else None}
    return _refused(Remark(code, seen, True), {**frame, "floor": known.floor, "config": known.config})


def _refused(remark: Remark, frame: dict[str, Any]) -> Content:
    message = sentence(meaning(remark.code), f" ({remark.seen})")
    others = tuple(other for other in frame.get("quality", ()) if not other.refuses or other.code == remark.code)
    frame = {**frame, "quality": others if remark in others else (*others, remark)}
    return Content("refused", remark.code, message, **frame)


def _capacity(
    request: Request, silo: CoreVessel, lacking: tuple[str, ...], over: OverFloor | None
) -> tuple[float | None, str | None]:
    if request.strapping is not None:
        return request.strapping.capacity, "strapping"
    if lacking or request.known.lengths.cone_only:
        return None, None
    source = "datasheet" if request.known.lengths.top_from == "datasheet" else "calibration"
    if request.known.floor.map is not None:
        return (None, None) if over is None else (over.capacity, source)
    return _core.vessel_volume_below(silo, [silo[3]])[0], source


def _level(under: _core.SurfaceVolume, std: float, core: _core.ContentSurface | None, datum: float) -> Level:
    """Heights over the datum; `std` is the volume's deviation."""
    if under.area <= 0.0 or core is None:
        return Level(*[0.0] * 4)
    at_axis = float(core.z_at(np.zeros((1, 2)))[0])
    return Level(
        datum - under.moment / under.area,
        datum - under.lowest,
        datum - under.highest,
        max(datum - at_axis, 0.0),
        None if under.at_wall is None else datum - under.at_wall,
        std / under.area,
    )


def _volume(
    request: Request, found: tuple[float, float], silo: CoreVessel, level: Level, over: OverFloor | None
) -> tuple[float, float]:
    """Volume by the geometry; with a strapping table, the table's below the mean level and the rest by geometry."""
    if over is not None:
        return over.volume, over.std
    volume, std = found
    if request.strapping is None or level.mean is None:
        return volume, std
    below = _core.vessel_volume_below(silo, [silo[2] - level.mean])[0]
    return volume - below + request.strapping.volume(level.mean), std


def _mass(
    density: Density | None,
    volume: float | None,
    std: float | None,
    columns: Callable[[], NDArray[np.float64]],
    silo: CoreVessel,
) -> dict[str, Any]:
    if density is None or volume is None or std is None:
        return {"density": None if density is None else density.to_dict()}
    mean = density.mean(columns(), silo[0])
    own = density.std / density.loose * mean
    return {
        "mass": mean * volume,
        "mass_std": math.hypot(mean * std, own * volume),
        "density": {**density.to_dict(), "mean_kg_m3": mean},
    }


def _columns(surface: SurfaceMap | None, silo: CoreVessel, over: OverFloor | None) -> NDArray[np.float64]:
    """Heights of the content over the floor in the map's cells."""
    if over is not None:
        return over.columns[over.columns > 0.0]
    if surface is None:
        return np.zeros(0)
    radius, bottom, apex, *_ = silo
    across = np.hypot(surface.x[None, :], surface.y[:, None])
    floor = np.minimum((apex - bottom) * across / radius, apex - bottom)
    rise = np.where(surface.inside, surface.heights - floor, 0.0)
    return np.asarray(rise[rise > 0.0])


def _config(request: Request) -> dict[str, Any]:
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


def contradicted(data: Frame | ArrayLike, against: Remark, said: tuple[Remark, ...]) -> Content:
    """The answer where the frame contradicts what is known of its sensor."""
    message = sentence((against.text, against.advice))
    return Content("refused", against.code, message, source=source_of(data), quality=said)


def source_of(data: Frame | ArrayLike) -> str:
    """Name of the frame."""
    return data.source if isinstance(data, Frame) else "frame"
