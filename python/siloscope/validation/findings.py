"""What the tests found, in words: what is off, where, by how much, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.types.camera import Camera
from siloscope.validation.families import Score
from siloscope.validation.holdout import HeldOut
from siloscope.validation.ideal import Ideal
from siloscope.validation.resampling import Resampled
from siloscope.validation.splits import Split

Vector = NDArray[np.float64]

CONVICTS = 3.0
"""A test convicts beyond so many deviations: by chance in one calibration of some hundred, all tests taken together."""

CONVICTS_ONE = 4.0
"""The same for the worst of many frames."""

BARELY = 0.02
"""Of families whose evidence differs by no more than this fraction, the one with the fewest patterns is named."""

AS_GOOD = 0.85
"""Another family that explains so much of what the best one does can't be told from it."""

WALL = {
    "rings": "the wall's radius changes with the height",
    "bend": "the wall is bent",
    "oval": "the wall is out of round",
    "sheets": "the wall has flat sheets or dents",
    "cone": "the cone is no straight cone",
}
"""Families of the vessel, which the calibration's stated deviations allow for."""

NAMES = {
    **WALL,
    "camera": "the camera's intrinsics are not as told",
    "image": "the sensor reads wrong over parts of its image",
    "multipath": "light goes round",
    "bias": "the sensor's depth bias is not its profile's",
    "diameter": "the diameter is not the one that is given",
}
"""Every family in words."""

REMEDIES = {
    **dict.fromkeys(
        WALL, "This is the vessel itself: poses and volumes are stated with it, but it is no ideal cylinder and cone."
    ),
    "camera": "Calibrate the camera, or state how well it is known: --intrinsics calibrated, or nominal.",
    "image": "Map the sensor's error from these frames, or have the sensor checked.",
    "multipath": "Shade or move the camera, or use a sensor that does not measure times of flight.",
    "bias": "Check the name given with --sensor, and give a diameter by tape.",
    "diameter": "Measure the diameter again, at the height of the wall in view; check the depth's unit and the sensor.",
}


@dataclass(frozen=True)
class Finding:
    """Something that does not agree."""

    code: str
    deviation: float
    """How rare it is by chance, as the equally rare deviation of a normal variable."""
    message: str
    remedy: str
    stated: bool
    """Whether the calibration's stated deviations allow for it."""
    others: tuple[str, ...] = ()
    """Other causes that these frames can't tell from it."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {**asdict(self), "others": list(self.others)}


def findings(
    ideal: Ideal,
    scores: dict[str, Score],
    splits: Sequence[Split],
    held: Sequence[HeldOut],
    again: Resampled | None,
    camera: Camera,
) -> tuple[Finding, ...]:
    """All that does not agree, the surest cause first."""
    found = [_pattern(ideal, scores, camera), _unsteady(ideal, scores["image"])]
    found += [_split(one) for one in splits if one.deviation > CONVICTS]
    return tuple(one for one in (*found, _prediction(held), _scatter(again)) if one is not None)


def _pattern(ideal: Ideal, scores: dict[str, Score], camera: Camera) -> Finding | None:
    """What is left on the wall in all frames, by the family that explains it best."""
    worst = max(score.deviation for score in scores.values())
    if worst <= CONVICTS:
        return None
    scale = max(scores["image"].scale, 1.0)
    explains = {name: one.evidence(len(ideal.tiles), scale) for name, one in scores.items() if one.dof}
    most = max(explains.values())
    best = min((name for name in explains if explains[name] >= most - BARELY * abs(most)), key=lambda k: scores[k].dof)
    others = [name for name, value in explains.items() if name != best and value > AS_GOOD * most > 0.0]
    said = f"{NAMES[best][:1].upper()}{NAMES[best][1:]}: {_size(best, scores[best], ideal, camera)}."
    if others:
        said += f" These frames can't tell it from this: {', or '.join(NAMES[name] for name in others)}."
    stated = best in WALL and all(name in WALL for name in others)
    return Finding(best, worst, said, REMEDIES[best], stated, tuple(others))


def _size(name: str, score: Score, ideal: Ideal, camera: Camera) -> str:
    if name == "camera":
        return _intrinsics(score, camera)
    tiles = ideal.tiles
    if name == "diameter":
        off = -2e3 * score.amplitudes[0]
        return f"the frames have it {abs(off):.0f} mm {'larger' if off > 0.0 else 'smaller'}"
    if name in WALL:
        across = score.off * tiles.across
        at = int(np.argmax(np.abs(across)))
        side = np.degrees(tiles.azimuth[at]) % 360.0
        return f"up to {1e3 * abs(across[at]):.1f} mm, most {tiles.height[at]:.1f} m below the camera at {side:.0f}°"
    relative = score.off / tiles.depth
    at = int(np.argmax(np.abs(relative)))
    far = "too far" if relative[at] > 0.0 else "too near"
    mm, percent = 1e3 * abs(score.off[at]), 100.0 * abs(relative[at])
    return f"up to {mm:.1f} mm ({percent:.2f} %) {far}, most {in_image(tiles.ray[at])}"


def _intrinsics(score: Score, camera: Camera) -> str:
    """The two surest errors of the intrinsics."""
    sure = np.abs(score.amplitudes) / np.maximum(score.std, 1e-12)
    shown = np.argsort(-sure)[:2]
    off, std = -score.amplitudes, score.std
    words = [
        ("focal length across off by", 100.0, " %"),
        ("focal length down off by", 100.0, " %"),
        ("principal point across off by", camera.fx, " px"),
        ("principal point down off by", camera.fy, " px"),
        ("radial distortion k1 off by", 1.0, ""),
    ]
    told = [f"{words[k][0]} {words[k][1] * off[k]:+.2g}{words[k][2]} ± {words[k][1] * std[k]:.1g}" for k in shown]
    return ", ".join(told)


def in_image(ray: Vector) -> str:
    """Where in the image a ray is."""
    words = [[("left", "right"), ("top", "bottom")][k][int(ray[k] > 0.0)] for k in range(2) if abs(ray[k]) > 0.15]
    return f"at the {' '.join(reversed(words))} of the image" if words else "in the middle of the image"


def _unsteady(ideal: Ideal, score: Score) -> Finding | None:
    if score.unsteady <= CONVICTS:
        return None
    times = float(np.sqrt(score.scale))
    said = (
        f"The same places of the wall read differently from frame to frame, {times:.1f} times as far as noise does, "
        "over whole parts of the image."
    )
    remedy = (
        "Light that goes round, dust and a camera that moves or warms up do this: look which frames stand out, "
        "and take frames at the same level again."
    )
    return Finding("unsteady", score.unsteady, said, remedy, False)


def _split(one: Split) -> Finding:
    name, (off, std) = max(one.differences.items(), key=lambda item: abs(item[1][0]) / item[1][1])
    unit, factor = ("mrad", 1e3) if name.startswith("r_") else ("", 1.0) if name == "cone_slope" else ("mm", 1e3)
    said = (
        f"The {one.name} calibrate differently, most in {name}: by {factor * off:+.2g} {unit}, "
        f"{abs(off) / std:.1f} times the deviation of both."
    )
    return Finding("split", one.deviation, said, "Look whether the camera moved between them.", False)


def _prediction(held: Sequence[HeldOut]) -> Finding | None:
    worst = max(held, key=lambda one: one.deviation, default=None)
    if worst is None or worst.deviation <= CONVICTS_ONE:
        return None
    count = sum(one.deviation > CONVICTS_ONE for one in held)
    said = (
        f"{count} of {len(held)} frames read the wall otherwise than frames of other levels foretell, most "
        f"{worst.name}: {1e3 * worst.rms:.1f} mm, where {1e3 * worst.expected:.1f} mm are expected, and in a pattern."
    )
    return Finding("prediction", worst.deviation, said, "Expect such errors at levels that were not calibrated.", False)


def _scatter(again: Resampled | None) -> Finding | None:
    if again is None or again.deviation <= CONVICTS:
        return None
    worst = max(again.stated, key=lambda name: again.scatter[name] / again.stated[name])
    said = (
        f"With other noise the answers scatter {again.scatter[worst] / again.stated[worst]:.1f} times as far as stated."
    )
    return Finding("scatter", again.deviation, said, "Please report this: the stated deviation is too small.", False)
