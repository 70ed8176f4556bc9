"""What all frames of a calibration have in common: sensor, diameter, gravity, camera and its intrinsics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from siloscope import sensors
from siloscope.errors import InputError, UsageError
from siloscope.fusion.located_frame import LocatedFrame
from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.intrinsics import IntrinsicsStd


@dataclass(frozen=True)
class Settings:
    """What every frame is located with."""

    profile: SensorProfile
    diameter: float | None
    gravity: ArrayLike | None
    intrinsics: str | IntrinsicsStd | None = None

    def described(self) -> dict[str, Any]:
        """For the result's ``config``, and to be gone on with."""
        down = None if self.gravity is None else [float(g) for g in np.ravel(np.asarray(self.gravity, float))]
        exact = self.intrinsics.to_dict() if isinstance(self.intrinsics, IntrinsicsStd) else self.intrinsics
        return {"sensor": self.profile.to_dict(), "diameter": self.diameter, "gravity": down, "intrinsics": exact}


def settings_of(before: Calibration | None, **given: Any) -> Settings:
    """The caller's settings; those of the earlier calibration where the caller says nothing."""
    profile = sensors.load(given["sensor"])
    mine = Settings(profile, given["diameter"], given["gravity"], given["intrinsics"])
    if before is None or not before.config:
        return mine
    earlier = before.config
    if given["sensor"] is None:
        mine = replace(mine, profile=_profile(earlier.get("sensor")))
    if given["diameter"] is None:
        mine = replace(mine, diameter=earlier.get("diameter"))
    if given["gravity"] is None:
        mine = replace(mine, gravity=earlier.get("gravity"))
    if given["intrinsics"] is None:
        mine = replace(mine, intrinsics=_intrinsics(earlier.get("intrinsics")))
    for name in ("sensor", "diameter"):
        if mine.described()[name] != earlier.get(name):
            raise UsageError(
                f"the calibration to continue has another {name} ({_short(earlier.get(name))}); "
                f"leave {name} out, or calibrate all frames anew"
            )
    return mine


def _intrinsics(told: Any) -> str | IntrinsicsStd | None:
    return IntrinsicsStd(**told) if isinstance(told, dict) else told


def _short(value: Any) -> Any:
    return value.get("name", value) if isinstance(value, dict) else value


def _profile(table: Any) -> SensorProfile:
    """The sensor profile that a calibration's ``config`` describes."""
    profile = sensors.from_record(table)
    if profile is None:
        raise InputError("the calibration to continue does not tell its sensor; calibrate all frames anew")
    return profile


def brought_settings(answers: list[LocatedFrame]) -> dict[str, Any]:
    """What the caller's estimates were made with, where all agree on it."""
    configs = [answer.estimate.config for answer in answers if answer.estimate is not None and not answer.made]
    if not configs or len(configs) < len(answers):
        return {}
    common = {name: [config.get(name) for config in configs] for name in ("sensor", "diameter")}
    return {name: told[0] for name, told in common.items() if told[0] is not None and all(v == told[0] for v in told)}


def common_camera(before: Calibration | None, answers: list[LocatedFrame]) -> dict[str, Any] | None:
    """The one camera of all frames, where known."""
    earlier = None if before is None else before.config.get("camera")
    known = [earlier] if earlier is not None else []
    for answer in answers:
        if answer.camera is None:
            continue
        known.append(answer.camera.to_dict())
        if known[-1] != known[0]:
            raise InputError(f"{answer.name}: it is of another camera than the frames before; calibrate it by itself")
    return known[0] if known else None
