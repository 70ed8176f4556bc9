"""Frames of populations kept in a folder, so that every judge sees the same ones and none is traced twice."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kinds import draw
from .scenes import Scene, Shot
from .sequences import sequence
from .solids import BOTTOM, CYLINDER, FEED


@dataclass(frozen=True)
class Sample:
    """One frame as the product gets it, and its truth as plain data."""

    depth: NDArray[np.uint16]
    """Millimetres, 0 where there is no reading."""
    truth: dict[str, Any]


def single(folder: Path, kind: str, seed: int, width: int = 640) -> Sample:
    """The frame of a kind and seed."""
    return _kept(folder / f"{kind}-{seed}-{width}.npz", lambda: [draw(kind, seed, width)])[0]


def many(folder: Path, kind: str, seed: int, frames: int, width: int = 640, moved: bool = False) -> list[Sample]:
    """The frames of a sequence."""
    name = f"{kind}-{seed}-{width}-{'moved' if moved else 'still'}{frames}.npz"
    return _kept(folder / name, lambda: sequence(kind, seed, frames, width, moved))


def _kept(path: Path, scenes: Callable[[], list[Scene]]) -> list[Sample]:
    """What the file has, if this oracle wrote it; otherwise traced now and written in one move."""
    if path.is_file():
        with np.load(path) as stored:
            if str(stored["oracle"]) == fingerprint():
                truths = json.loads(str(stored["truths"]))
                return [Sample(stored[f"depth{i}"], truth) for i, truth in enumerate(truths)]
    samples = [sample(scene.shoot()) for scene in scenes()]
    depths = {f"depth{i}": each.depth for i, each in enumerate(samples)}
    truths = json.dumps([each.truth for each in samples])
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{os.getpid()}-{path.name}")
    with partial.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, oracle=fingerprint(), truths=truths, **depths)
    partial.replace(path)
    return samples


def sample(shot: Shot) -> Sample:
    """A shot as the product gets it."""
    scene, vessel = shot.scene, shot.scene.vessel
    truth = {
        "pose": asdict(scene.pose),
        "silo": vessel.geometry if vessel else None,
        "bottoms": vessel.bottoms if vessel else (),
        "sensor": scene.sensor.profile,
        "true": asdict(scene.camera),
        "told": asdict(scene.told),
        "wall": shot.share(CYLINDER),
        "bottom": shot.share(BOTTOM),
        "feed": shot.share(FEED),
        "arc": shot.arc,
        "tilt": shot.tilt,
    }
    millimetres = np.rint(1e3 * shot.reading)
    return Sample(np.where(millimetres < 65535, millimetres, 0).astype(np.uint16), truth)


@cache
def fingerprint() -> str:
    """Digest of the oracle's own text: what another text drew is drawn anew."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files if file.name != "judging.py")).hexdigest()[:16]
