"""Calibration files: JSON of the schema ``siloscope.calibration/1``, written whole and read strictly."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope import sensors
from siloscope.errors import InputError
from siloscope.reasons import CALIBRATION_REMARKS, FRAME_STATUSES
from siloscope.types.calibration import SCHEMA, Calibration, Evidence, FrameRecord
from siloscope.types.frame_factor import PARAMETERS, SIZE, FrameFactor, SummedFactor
from siloscope.types.move import Move
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry

LARGEST_FILE = 50_000_000
"""Bytes; 300 frames of evidence take about 2 MB."""

LARGEST_NUMBER = 1e300
"""No number of a calibration is larger; whole numbers of JSON may be of any length."""

MOST_RAYS = 1000
"""No frame keeps as many."""

REMEDY = "take the file as `siloscope calibrate` wrote it, or calibrate again"

_UPPER = np.triu_indices(SIZE)
_VECTORS = ("parameters", "gradient", "prior_mean", "prior_information", "base")
_MATRICES = ("information", "scatter", "noise")
_SUM_VECTORS = ("origin", "pull", "prior_information", "prior_mean")
_SUM_MATRICES = ("information", "noise", "shared")


def write(calibration: Calibration, path: Path) -> None:
    """Writes the document; a file that is already there stays whole until the new one is complete."""
    text = json.dumps(calibration.to_dict(), allow_nan=False, separators=(",", ":"))
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_text(text + "\n", encoding="utf-8")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def read(path: Path) -> Calibration:
    """Reads the document strictly.

    Raises
    ------
    InputError
        Where the file can't be read, is no calibration, or an entry is missing or can't be right.
    """
    document = _document(path)
    try:
        return _calibration(document)
    except _Wrong as wrong:
        raise InputError(f"{path}: {wrong}; {REMEDY}") from None


def evidence_to_dict(evidence: Evidence) -> dict[str, Any]:
    """Plain data; of symmetric matrices only the upper triangle, row by row."""
    return {
        "names": list(PARAMETERS),
        "frames": [_frame_to_dict(number, frame) for number, frame in evidence.frames],
        "earlier": None if evidence.earlier is None else _sums_to_dict(evidence.earlier),
    }


def _frame_to_dict(number: int, frame: FrameFactor) -> dict[str, Any]:
    return {
        "index": number,
        **{name: _nullable(getattr(frame, name)) for name in _VECTORS},
        **{name: _triangle(getattr(frame, name)) for name in _MATRICES},
        "free": [bool(f) for f in frame.free],
        "rays": frame.rays.tolist(),
        "scale_std": frame.scale_std,
    }


def _sums_to_dict(sums: SummedFactor) -> dict[str, Any]:
    return {
        **{name: getattr(sums, name).tolist() for name in _SUM_VECTORS},
        **{name: _triangle(getattr(sums, name)) for name in _SUM_MATRICES},
        "weight": sums.weight,
        "frames": sums.frames,
    }


def _nullable(values: NDArray[np.float64]) -> list[float | None]:
    return [float(v) if math.isfinite(v) else None for v in values]


def _triangle(matrix: NDArray[np.float64]) -> list[float]:
    upper: list[float] = matrix[_UPPER].tolist()
    return upper


class _Wrong(Exception):
    """An entry that can't be right: where, and what is wrong with it."""


def _document(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{path}: too large for a calibration; {REMEDY}")
        document = json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: can't be read ({error.strerror}); check the path and its permissions") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path}: no JSON document, or a damaged one; {REMEDY}") from None
    schema = document.get("schema") if isinstance(document, dict) else None
    if schema != SCHEMA:
        found = f"its schema is {schema!r}" if schema else "it names no schema"
        raise InputError(f"{path}: no calibration of the schema {SCHEMA} ({found}); {REMEDY}")
    return dict(document)


def _calibration(document: dict[str, Any]) -> Calibration:
    status = _one_of(document, "status", ("ok", "refused"))
    ok = status == "ok"
    pose = _pose(document, "") if ok else None
    values, covariance = _parameters(document) if ok else (None, None)
    silo = _entry(document, "silo", dict)
    return Calibration(
        status,
        rule=_entry(document, "rule", str),
        pose=pose,
        covariance=_covariance_or_none(document) if ok else None,
        silo=_possible(_geometry(silo, "silo")),
        silo_std=_geometry(_entry(silo, "std", dict, "silo.std"), "silo.std", least=0.0),
        parameters=values,
        parameter_covariance=covariance,
        excess=_number(document, "excess", least=1.0),
        scale_std=_number(document, "scale_std", least=0.0),
        moves=tuple(_each(document, "moves", _move)),
        frames=tuple(_each(document, "frames", _record)),
        quality=tuple(_code(code) for code in _entry(document, "quality", list)),
        reason=_text_or_none(document, "reason"),
        message=_text_or_none(document, "message"),
        config=_config(document),
        timing_ms={str(k): _finite(v, f"timing_ms.{k}") for k, v in _entry(document, "timing_ms", dict).items()},
        evidence=_evidence(_entry(document, "evidence", dict)),
        method=_entry(document, "method", str),
    )


def _covariance_or_none(document: dict[str, Any]) -> NDArray[np.float64] | None:
    """The pose's covariance; one frame averaged by the paper's rule has none."""
    if document.get("covariance") is None and document.get("rule") == "mean-of-last-10":
        return None
    return _covariance(_entry(document, "covariance", list), "covariance", 4)


def _config(document: dict[str, Any]) -> dict[str, Any]:
    """The settings; those that are gone on with are checked."""
    config: dict[str, Any] = _entry(document, "config", dict)
    if config.get("diameter") is not None and not 0.01 <= _number(config, "diameter", where="config") <= 200.0:
        raise _Wrong("'config.diameter' must be between 0.01 and 200 m")
    if config.get("gravity") is not None:
        _vector(config, "gravity", "config.gravity", length=3)
    if config.get("sensor") is not None:
        _sensor(_entry(config, "sensor", dict, "config.sensor"))
    return config


def _sensor(table: dict[str, Any]) -> None:
    _entry(table, "name", str, "config.sensor.name")
    for part, names in (("bias", sensors.BIAS), ("bias_std", sensors.BIAS), ("noise", sensors.NOISE)):
        if part == "noise" and table.get(part) is None:
            continue
        values = _entry(table, part, dict, f"config.sensor.{part}")
        for name in names:
            _number(values, name, where=f"config.sensor.{part}")


def _parameters(document: dict[str, Any]) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    table = document.get("parameters")
    if table is None:
        return None, None
    if not isinstance(table, dict):
        raise _Wrong("'parameters' must be an object or null")
    _check_names(table, "parameters")
    values = _vector(table, "values", "parameters.values", nullable=True)
    return values, _covariance(_entry(table, "covariance", list), "parameters.covariance", SIZE)


def _check_names(table: dict[str, Any], where: str) -> None:
    if table.get("names") != list(PARAMETERS):
        raise _Wrong(f"'{where}.names' must be {', '.join(PARAMETERS)}, as this version of siloscope has them")


def _evidence(table: dict[str, Any]) -> Evidence:
    earlier = table.get("earlier")
    if earlier or table.get("frames"):
        _check_names(table, "evidence")
    if earlier is not None and not isinstance(earlier, dict):
        raise _Wrong("'evidence.earlier' must be an object or null")
    return Evidence(
        frames=tuple(_each(table, "frames", _frame_evidence, "evidence.frames")),
        earlier=None if earlier is None else _sums(earlier),
    )


def _frame_evidence(table: dict[str, Any], where: str) -> tuple[int, FrameFactor]:
    free = _entry(table, "free", list, f"{where}.free")
    if len(free) != SIZE or not all(isinstance(f, bool) for f in free):
        raise _Wrong(f"'{where}.free' must be {SIZE} times true or false")
    vectors = {name: _vector(table, name, f"{where}.{name}", nullable=name != "gradient") for name in _VECTORS}
    matrices = {name: _symmetric(table, name, f"{where}.{name}") for name in _MATRICES}
    scale_std = _number(table, "scale_std", least=0.0, where=where)
    rays = _rays(table, f"{where}.rays")
    frame = FrameFactor(**vectors, **matrices, free=np.array(free), scale_std=scale_std, rays=rays)
    for name in ("parameters", "base"):
        if not np.isfinite(vectors[name][frame.free]).all():
            raise _Wrong(f"'{where}.{name}' lacks a value that was estimated")
    return _index(table, where), frame


def _rays(table: dict[str, Any], where: str) -> NDArray[np.float64]:
    rows = _entry(table, "rays", list, where)
    if len(rows) > MOST_RAYS or not all(isinstance(row, list) and len(row) == 3 for row in rows):
        raise _Wrong(f"'{where}' must be at most {MOST_RAYS} times 3 numbers")
    rays = np.array([[_finite(v, where) for v in row] for row in rows]).reshape(-1, 3)
    if (rays[:, 2] < 0.0).any():
        raise _Wrong(f"'{where}' has information below zero")
    return rays


def _sums(table: dict[str, Any]) -> SummedFactor:
    where = "evidence.earlier"
    return SummedFactor(
        **{name: _vector(table, name, f"{where}.{name}") for name in _SUM_VECTORS},
        **{name: _symmetric(table, name, f"{where}.{name}") for name in _SUM_MATRICES},
        weight=_number(table, "weight", least=0.0, where=where),
        frames=_index(table, where, "frames"),
    )


def _record(table: dict[str, Any], where: str) -> FrameRecord:
    deviation, timestamp = (table.get(name) for name in ("deviation", "timestamp"))
    return FrameRecord(
        index=_index(table, where),
        name=_entry(table, "name", str, f"{where}.name"),
        status=_one_of(table, "status", tuple(FRAME_STATUSES), where),
        weight=_number(table, "weight", least=0.0, where=where),
        deviation=None if deviation is None else _finite(deviation, f"{where}.deviation"),
        pose=None if table.get("r_x") is None else _pose(table, where),
        timestamp=None if timestamp is None else _finite(timestamp, f"{where}.timestamp"),
        reason=_text_or_none(table, "reason", where),
    )


def _move(table: dict[str, Any], where: str) -> Move:
    turn, shift, significance = (_number(table, k, least=0.0, where=where) for k in ("turn", "shift", "significance"))
    return Move(_index(table, where), turn, shift, significance)


def _geometry(table: dict[str, Any], where: str, least: float = -math.inf) -> SiloGeometry:
    names = ("radius", "cylinder_bottom", "apex")
    known = (name for name in names if table.get(name) is not None)
    return SiloGeometry(**{name: _number(table, name, least=least, where=where) for name in known})


def _possible(silo: SiloGeometry) -> SiloGeometry:
    """The geometry, if a silo can have it."""
    if silo.radius is not None and silo.radius <= 0.0:
        raise _Wrong(f"'silo.radius' must be above 0, not {silo.radius:g}")
    if silo.cylinder_bottom is not None and silo.apex is not None and silo.apex < silo.cylinder_bottom:
        raise _Wrong(f"'silo.apex' must lie below the cylinder's bottom, not at {silo.apex:g}")
    return silo


def _pose(table: dict[str, Any], where: str) -> SiloPose:
    return SiloPose(*(_number(table, name, where=where) for name in ("r_x", "r_y", "t_x", "t_y")))


def _code(code: Any) -> str:
    if code not in CALIBRATION_REMARKS:
        raise _Wrong(f"'quality' holds the unknown code {code!r}")
    return str(code)


def _each(
    table: dict[str, Any], key: str, parse: Callable[[dict[str, Any], str], Any], where: str | None = None
) -> list[Any]:
    name = where or key
    rows = _entry(table, key, list, name)
    for number, row in enumerate(rows):
        if not isinstance(row, dict):
            raise _Wrong(f"'{name}[{number}]' must be an object")
    return [parse(row, f"{name}[{number}]") for number, row in enumerate(rows)]


def _entry(table: dict[str, Any], key: str, kind: type, where: str | None = None) -> Any:
    value = table.get(key)
    if not isinstance(value, kind):
        meant = {"dict": "an object", "list": "a list", "str": "a text"}[kind.__name__]
        raise _Wrong(f"'{where or key}' must be {meant}" if key in table else f"'{where or key}' is missing")
    return value


def _one_of(table: dict[str, Any], key: str, known: tuple[str, ...], where: str = "") -> str:
    name = f"{where}.{key}" if where else key
    value: str = _entry(table, key, str, name)
    if value not in known:
        raise _Wrong(f"'{name}' is {value!r}; known are {', '.join(known)}")
    return value


def _text_or_none(table: dict[str, Any], key: str, where: str = "") -> str | None:
    name = f"{where}.{key}" if where else key
    return None if table.get(key) is None else str(_entry(table, key, str, name))


def _index(table: dict[str, Any], where: str, key: str = "index") -> int:
    value = table.get(key)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise _Wrong(f"'{where}.{key}' must be a whole number from 0, not {value!r}")
    return value


def _number(table: dict[str, Any], key: str, *, least: float = -math.inf, where: str = "") -> float:
    name = f"{where}.{key}" if where else key
    if key not in table:
        raise _Wrong(f"'{name}' is missing")
    value = _finite(table[key], name)
    if value < least:
        raise _Wrong(f"'{name}' must be at least {least:g}, not {value:g}")
    return value


def _finite(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LARGEST_NUMBER:
        raise _Wrong(f"'{where}' must be a finite number, not {str(value)[:40]!r}")
    return float(value)


def _vector(
    table: dict[str, Any], key: str, where: str, *, nullable: bool = False, length: int = SIZE
) -> NDArray[np.float64]:
    rows = _entry(table, key, list, where)
    if len(rows) != length:
        raise _Wrong(f"'{where}' must have {length} numbers, not {len(rows)}")
    return np.array([math.nan if nullable and v is None else _finite(v, where) for v in rows])


def _symmetric(table: dict[str, Any], key: str, where: str) -> NDArray[np.float64]:
    upper = np.zeros((SIZE, SIZE))
    upper[_UPPER] = _vector(table, key, where, length=len(_UPPER[0]))
    full = upper + upper.T - np.diag(np.diag(upper))
    _check_positive(full, where)
    return full


def _covariance(rows: list[Any], where: str, size: int) -> NDArray[np.float64]:
    if len(rows) != size or not all(isinstance(row, list) and len(row) == size for row in rows):
        raise _Wrong(f"'{where}' must be {size} rows of {size} numbers")
    full = np.array([[_finite(v, where) for v in row] for row in rows])
    if not np.allclose(full, full.T, rtol=1e-6, atol=1e-9 * float(np.abs(full).max(initial=0.0))):
        raise _Wrong(f"'{where}' must be symmetric")
    _check_positive(full, where)
    return full


def _check_positive(matrix: NDArray[np.float64], where: str) -> None:
    """No variance below zero; in units of the diagonal, so that metres don't hide radians."""
    diagonal = np.diag(matrix)
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.maximum(diagonal, 1e-300)), 0.0)
    if (diagonal < 0.0).any() or np.linalg.eigvalsh(matrix * scale * scale[:, None]).min() < -1e-6:
        raise _Wrong(f"'{where}' is no covariance or information: a variance in it is negative")
