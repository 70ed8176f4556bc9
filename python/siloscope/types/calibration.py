"""A silo's calibration: the camera's pose and the silo's geometry as many frames have them, and what they rest on."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from siloscope.parameters import OVALITY, PARAMETERS
from siloscope.reasons import FRAME_STATUSES, calibration_remark
from siloscope.schema import CALIBRATION
from siloscope.types.by_value import ByValue
from siloscope.types.floor import Floor, FloorMap, SeenCone
from siloscope.types.frame_factor import GROUPS, FrameFactor, SummedFactor
from siloscope.types.move import Move
from siloscope.types.pose import SiloPose
from siloscope.types.vessel import SiloGeometry, vessel_to_dict

if TYPE_CHECKING:
    from siloscope.schema.calibration import CalibrationDocument, Record
    from siloscope.schema.calibration import Evidence as EvidenceDocument
    from siloscope.schema.floor import FloorDocument


@dataclass(frozen=True)
class FrameRecord:
    """How one frame of the sequence agreed."""

    index: int
    """Number in the sequence, from 0, counted on when a calibration is continued."""
    name: str
    status: str
    """One of `FRAME_STATUSES`."""
    weight: float = 0.0
    """With which it was fused, 0 to 1."""
    deviation: float | None = None
    """Distance of its answer from the fused one, as the equally rare deviation of a normal variable."""
    pose: SiloPose | None = None
    timestamp: float | None = None
    reason: str | None = None
    """Why it has no answer."""
    cone_reach: tuple[float, float] | None = None
    """Distances from the axis between which it shows the bare cone, m."""
    digest: str | None = None
    """Hash of its measurements (`Frame.digest`); None for an estimate that was brought."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        pose = self.pose
        return {
            "index": self.index,
            "name": self.name,
            "status": self.status,
            "weight": self.weight,
            "deviation": self.deviation,
            **{name: None if pose is None else getattr(pose, name) for name in ("r_x", "r_y", "t_x", "t_y")},
            "timestamp": self.timestamp,
            "reason": self.reason,
            "cone_reach": None if self.cone_reach is None else list(self.cone_reach),
            "digest": self.digest,
        }


@dataclass(frozen=True, eq=False, repr=False)
class Evidence(ByValue):
    """What a calibration rests on, and is continued from."""

    frames: tuple[tuple[int, FrameFactor], ...] = ()
    """Frame number and what it says, in the order of the sequence."""
    earlier: SummedFactor | None = None
    """Frames before those, added up."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "names": list(GROUPS),
            "frames": [{"index": number, **factor.to_dict()} for number, factor in self.frames],
            "earlier": None if self.earlier is None else self.earlier.to_dict(),
        }


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(ByValue):
    """Pose of the camera in its silo and the silo's geometry, from many frames. Radians and metres.

    A refused calibration (`status` "refused") has no numbers; `reason` and `message` say why.
    """

    status: str
    rule: str = "information"
    pose: SiloPose | None = None
    covariance: NDArray[np.float64] | None = None
    """(4, 4) covariance of (r_x, r_y, t_x, t_y)."""
    silo: SiloGeometry = field(default_factory=SiloGeometry)
    silo_std: SiloGeometry = field(default_factory=SiloGeometry)
    parameters: NDArray[np.float64] | None = None
    """(12,) in the order of `PARAMETERS`; NaN where not seen. None for the paper's rule."""
    parameter_covariance: NDArray[np.float64] | None = None
    """(12, 12) covariance of `parameters`, with zero rows for what is fixed or not seen."""
    excess: float = 1.0
    """Scatter of the frames' answers over what they state, as a factor of the variance; at least 1."""
    scale_std: float = 0.0
    """Standard deviation of the depth scale where nothing determines it; contained in the covariances."""
    moves: tuple[Move, ...] = ()
    """Moves of the camera in the sequence."""
    frames: tuple[FrameRecord, ...] = ()
    quality: tuple[str, ...] = ()
    """Codes of `CALIBRATION_REMARKS`."""
    reason: str | None = None
    message: str | None = None
    config: dict[str, Any] = field(default_factory=dict)
    timing_ms: dict[str, float] = field(default_factory=dict, compare=False)
    """Milliseconds by stage; no part of the answer, so it is not compared."""
    evidence: Evidence = field(default_factory=Evidence)
    method: str = "surface"
    floor: Floor = field(default_factory=Floor)
    """What the calibration was told of the bottom, or has proved."""
    models: tuple[tuple[str, float], ...] = ()
    """Vessel models with their probabilities, most probable first."""
    covariance_relative: NDArray[np.float64] | None = None
    """(4, 4) covariance of the pose if the intrinsics were exact: of poses of one camera to each other."""

    @property
    def ok(self) -> bool:
        """Whether there is an answer."""
        return self.status == "ok"

    @property
    def r_x(self) -> float | None:
        """Rotation about the x-axis."""
        return self.pose.r_x if self.pose else None

    @property
    def r_y(self) -> float | None:
        """Rotation about the y-axis."""
        return self.pose.r_y if self.pose else None

    @property
    def t_x(self) -> float | None:
        """Translation along the silo's x-axis."""
        return self.pose.t_x if self.pose else None

    @property
    def t_y(self) -> float | None:
        """Translation along the silo's y-axis."""
        return self.pose.t_y if self.pose else None

    @property
    def T_silo_camera(self) -> NDArray[np.float64] | None:
        """Homogeneous (4, 4) transform with ``p_silo = T_silo_camera @ p_camera`` (Eq. 5)."""
        return self.pose.T_silo_camera if self.pose else None

    @property
    def moved_at(self) -> Move | None:
        """The last move of the camera, or None."""
        return self.moves[-1] if self.moves else None

    @property
    def cone_reach(self) -> tuple[float, float] | None:
        """Distances from the axis between which the fused frames show the bare cone, m; None where none does."""
        seen = [r.cone_reach for r in self.frames if r.cone_reach is not None and r.status in ("used", "not-averaged")]
        return (min(near for near, _ in seen), max(far for _, far in seen)) if seen else None

    @property
    def counts(self) -> dict[str, int]:
        """Number of frames by status."""
        found = Counter(record.status for record in self.frames)
        return {status: found[status] for status in FRAME_STATUSES}

    def to_dict(self) -> dict[str, Any]:
        """The document of ``siloscope calibrate`` (schema ``siloscope.calibration/1``)."""
        names = ("r_x", "r_y", "t_x", "t_y")
        pose = self.pose
        std = None if self.covariance is None else np.sqrt(np.diag(self.covariance))
        return {
            "schema": CALIBRATION,
            "status": self.status,
            "reason": self.reason,
            "message": self.message,
            "method": self.method,
            "rule": self.rule,
            **{name: None if pose is None else getattr(pose, name) for name in names},
            "std": {name: None if std is None else float(std[i]) for i, name in enumerate(names)},
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "std_relative": dict(zip(names, _stds(self.covariance_relative), strict=True)),
            "covariance_relative": None if self.covariance_relative is None else self.covariance_relative.tolist(),
            "models": [{"model": name, "probability": probability} for name, probability in self.models],
            "T_silo_camera": None if pose is None else pose.T_silo_camera.tolist(),
            "axis": {
                "direction": None if pose is None else pose.axis_direction.tolist(),
                "point": None if pose is None else pose.axis_point.tolist(),
            },
            "silo": vessel_to_dict(self.silo, self.silo_std, self._ovality(), self.floor.to_dict()),
            "floor": {**self.floor.to_dict(), "map": None if self.floor.map is None else self.floor.map.to_dict()},
            "ratios": {"pixels": None, "area": None},
            "parameters": self._parameters(),
            "excess": self.excess,
            "scale_std": self.scale_std,
            "moved_at": None if self.moved_at is None else self._move_to_dict(self.moved_at),
            "moves": [self._move_to_dict(move) for move in self.moves],
            "quality": [calibration_remark(code) for code in self.quality],
            "counts": self.counts,
            "frames": [record.to_dict() for record in self.frames],
            "config": self.config,
            "timing_ms": self.timing_ms,
            "evidence": self.evidence.to_dict(),
        }

    def _ovality(self) -> float | None:
        values = None if self.parameters is None else self.parameters[OVALITY]
        return float(np.hypot(*values)) if values is not None and np.isfinite(values).all() else None

    def _parameters(self) -> dict[str, Any] | None:
        """All parameters with their covariance; what was not seen is null."""
        if self.parameters is None or self.parameter_covariance is None:
            return None
        values = [float(v) if np.isfinite(v) else None for v in self.parameters]
        return {"names": list(PARAMETERS), "values": values, "covariance": self.parameter_covariance.tolist()}

    def _move_to_dict(self, move: Move) -> dict[str, Any]:
        name = next((record.name for record in self.frames if record.index == move.index), None)
        return {
            "index": move.index,
            "name": name,
            "turn": move.turn,
            "shift": move.shift,
            "significance": move.significance,
        }

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the JSON document; raises `OSError` where that is not possible."""
        from siloscope.schema.files import write_json

        write_json(Path(path), self.to_dict())

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Calibration:
        """Reads a calibration file; raises `InputError` that names the file, the entry and the remedy."""
        from siloscope.schema.calibration import read

        return _from_document(*read(Path(path)))


def _stds(covariance: NDArray[np.float64] | None) -> list[float | None]:
    return [None] * 4 if covariance is None else np.sqrt(np.diag(covariance)).tolist()


def _from_document(told: CalibrationDocument, config: dict[str, Any]) -> Calibration:
    ok = told.status == "ok"
    parameters = told.parameters if ok else None
    return Calibration(
        told.status,
        told.rule,
        SiloPose(*told.pose) if ok and told.pose else None,
        told.covariance if ok else None,
        SiloGeometry(**_fields(SiloGeometry, told.silo)),
        SiloGeometry(**_fields(SiloGeometry, told.silo.std)),
        None if parameters is None else parameters.values,
        None if parameters is None else parameters.covariance,
        told.excess,
        told.scale_std,
        tuple(Move(**_fields(Move, move)) for move in told.moves),
        tuple(_record(record) for record in told.frames),
        tuple(told.quality),
        told.reason,
        told.message,
        config,
        told.timing_ms,
        _evidence(told.evidence),
        told.method,
        Floor() if told.floor is None else _floor(told.floor),
        tuple((one.model, one.probability) for one in told.models),
        told.covariance_relative if ok else None,
    )


def _floor(told: FloorDocument) -> Floor:
    seen = told.seen_cone
    cone = None if seen is None else SeenCone(seen.angle_rad, seen.std_rad)
    seen_map = None if told.map is None else FloorMap(**_fields(FloorMap, told.map))
    return Floor(told.kind, told.evidence, cone, map=seen_map)


def _record(told: Record) -> FrameRecord:
    return FrameRecord(**{**_fields(FrameRecord, told), "pose": SiloPose(*told.pose) if told.pose else None})


def _evidence(told: EvidenceDocument) -> Evidence:
    frames = tuple((frame.index, FrameFactor.read(frame)) for frame in told.frames)
    return Evidence(frames, None if told.earlier is None else SummedFactor.read(told.earlier))


def _fields(kind: type[Any], told: Any) -> dict[str, Any]:
    """A document's entries that are a type's fields."""
    return {field.name: getattr(told, field.name) for field in fields(kind)}
