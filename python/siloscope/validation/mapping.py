"""A map of the sensor's error from a user's own frames: smooth over the image, proportional to the depth.

The map is a Gaussian process over the image, fitted jointly with the ideal vessel. What frames can't tell apart (a turn
of the camera, and an error that is linear over the image) is shared by both, and stated. Its amplitude, its length and
whether it grows with the depth or with its square are those of the largest evidence. It is kept only where it foretells
held-out frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from siloscope.sensors import SensorProfile
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.intrinsics import IntrinsicsStd
from siloscope.types.sensor_map import SensorMap
from siloscope.types.wall import INTERCEPT, RADIUS, SIZE, SLOPE, Wall
from siloscope.validation.families import Score, scores
from siloscope.validation.findings import NAMES, WALL
from siloscope.validation.frames import Asked, SeenFrame, read
from siloscope.validation.ideal import Ideal, fitted, inverse_of, referred
from siloscope.validation.levels import by_level
from siloscope.validation.tiles import Tiles, against

Vector = NDArray[np.float64]

WAVES = 18
"""Half waves over image and margins, across and down, of the finest patterns."""

MARGIN = 0.3
"""Of the image's sides beyond its edges, where the cosines' slope is zero: the map's is not at the edges."""

GRID = (25, 33)
"""Nodes of the stored map, down and across."""

POWERS = (1, 2)
"""Of the depth, with which the error may grow."""

AMPLITUDES = tuple(float(v) for v in np.geomspace(1e-4, 2e-2, 9))
LENGTHS = (0.12, 0.2, 0.3, 0.45, 0.7, 1.1)
"""Standard deviations of the error at 1 m, and lengths over which it changes in halves of the image's width, that are
tried."""

LEAST_VARIANCE = 1e-12
"""Of a pattern, over the whole."""

SURELY = 10.0
"""Logarithm of the evidence from which on there is a map."""

LENGTHS_AND_POSE = (0, 1, 2, 3, RADIUS, SLOPE, INTERCEPT)
"""Columns of the first seven of `siloscope.parameters.PARAMETERS`."""

FEWEST_FRAMES = 4
"""Frames with an answer from which a map is learned."""

ROUNDS = 3
"""Linearisations of vessel and map together."""

AS_WELL = 0.9
"""Fewer patterns that explain this fraction of what a map explains are as likely the cause: a map would be learned of
what is no sensor's."""

BY_CHANCE = 3.0
"""The squares of held-out residuals have to fall by more than so many deviations of what chance makes of them."""


@dataclass(frozen=True, eq=False)
class Mapping:
    """What became of a map."""

    map: SensorMap | None
    """None where none was kept."""
    message: str
    """What was found, and why there is no map."""
    profile: SensorProfile
    """The sensor with the map, or as it was."""
    held_out: float
    """Root mean square of held-out frames' residuals with the map, over that without; 1 where nothing was learned."""
    frames: int


def sensor_map(
    frames: Iterable[Any],
    *,
    camera: Camera | None = None,
    sensor: str | Any = None,
    depth_unit: float | None = None,
    diameter: float | None = None,
    intrinsics: str | IntrinsicsStd | None = None,
) -> Mapping:
    """Learn what a sensor reads wrong over its image from frames of one camera in one silo.

    Parameters
    ----------
    frames, camera, sensor, depth_unit, diameter, intrinsics
        As for `siloscope.validate`; a map that the sensor's profile has is left aside.

    Returns
    -------
    Mapping
        With the map where it foretells the wall in frames of levels that were left out.

    Raises
    ------
    InputError
        Where no frame can be read.
    UsageError
        For an unknown sensor.
    """
    asked = Asked.of(sensor, camera=camera, depth_unit=depth_unit, diameter=diameter, intrinsics=intrinsics)
    asked = replace(asked, profile=replace(asked.profile, map=None))
    seen = read(frames, asked).seen
    if len(seen) < FEWEST_FRAMES:
        return Mapping(None, f"fewer than {FEWEST_FRAMES} frames have an answer", asked.profile, 1.0, len(seen))
    return _learned(seen, asked.profile)


def _learned(seen: Sequence[SeenFrame], profile: SensorProfile) -> Mapping:
    whole = fitted(seen)
    found = scores(whole)
    process = process_of(seen, whole, found["image"])
    if process is None:
        return Mapping(None, "no pattern lasts over the image", profile, 1.0, len(seen))
    if (other := _other_cause(found, whole, process)) is not None:
        why = f"another cause explains the pattern about as well: {NAMES[other]}"
        return Mapping(None, why, profile, 1.0, len(seen))
    before, after, tiles = _held_out(seen, whole, process)
    ratio = float(np.sqrt(after.sum() / max(before.sum(), 1e-300)))
    if (after > before).any() or before.sum() - after.sum() < BY_CHANCE * np.sqrt(2.0 * tiles):
        return Mapping(None, "it does not foretell frames of other levels", profile, ratio, len(seen))
    made = _stored(process, process.fit(seen, whole), whole)
    said = f"the residuals of held-out frames fall to {100.0 * ratio:.0f} %"
    return Mapping(made, said, replace(profile, map=made), ratio, len(seen))


def with_map(found: Calibration, learned: Mapping) -> Calibration:
    """A calibration that tells whether its sensor was mapped."""
    code = "sensor-not-mapped" if learned.map is None else "sensor-mapped"
    return replace(found, quality=(*found.quality, code))


def _other_cause(found: dict[str, Score], whole: Ideal, process: Process) -> str | None:
    """A group of the wall's form, or the intrinsics, where they explain the residuals about as well as a map does."""
    explains = {name: found[name].evidence(len(whole.tiles), process.scale) for name in (*WALL, "camera")}
    best = max(explains, key=lambda name: explains[name])
    return best if explains[best] > AS_WELL * 2.0 * process.evidence else None  # both in squares


@dataclass(frozen=True, eq=False)
class Waves:
    """Cosines over an image, the patterns of the map."""

    size: tuple[int, int]
    """Width and height of the image, pixels."""
    side: int
    """Pixels of a tile's side."""

    @property
    def numbers(self) -> Vector:
        """(K, 2) half waves across and down, the constant first."""
        ratio = self.size[0] / self.size[1]
        line = range(WAVES + 1)
        pairs = [(a, b) for a in line for b in line if a**2 + (b * ratio) ** 2 <= WAVES**2]
        return np.array(pairs, float)

    def at(self, u: Vector, v: Vector) -> Vector:
        """(N, K) at places (N,) from 0 to 1 across and down the image, of unit mean square."""
        a, b = self.numbers.T
        size = np.sqrt(np.where(a > 0, 2.0, 1.0) * np.where(b > 0, 2.0, 1.0))
        u, v = ((place + MARGIN) / (1.0 + 2.0 * MARGIN) for place in (u, v))
        made: Vector = np.cos(np.pi * u[:, None] * a) * np.cos(np.pi * v[:, None] * b) * size
        return made

    def over(self, tiles: Tiles) -> Vector:
        """(N, K) at tiles."""
        u, v = ((tiles.spot[:, k] + 0.5) * self.side / self.size[k] for k in range(2))
        return self.at(u, v)

    def variances(self, amplitude: float, length: float) -> Vector:
        """(K,) of a process with a squared-exponential kernel, by its spectrum (Solin and Särkkä, 2020).

        The length is in halves of the image's width.
        """
        a, b = self.numbers.T
        omega2 = (0.5 * np.pi / (1.0 + 2.0 * MARGIN)) ** 2 * (a**2 + (b * self.size[0] / self.size[1]) ** 2)
        spectrum = np.exp(-0.5 * omega2 * length**2)
        variance: Vector = amplitude**2 * np.maximum(spectrum / spectrum.sum(), LEAST_VARIANCE)
        return variance


def waves_of(frames: Sequence[SeenFrame], tiles: Tiles) -> Waves:
    """The patterns over the frames' image; a tile's side is told by how its rays go with its column."""
    camera = frames[0].frame.camera
    across = np.polyfit(tiles.spot[:, 0], camera.fx * tiles.ray[:, 0], 1)[0]
    return Waves((camera.width, camera.height), max(round(float(across)), 1))


@dataclass(frozen=True, eq=False)
class Joint:
    """Vessel and map, fitted together."""

    wall: Wall
    free: NDArray[np.int64]
    amplitudes: Vector
    """(K,) of the map's patterns."""
    covariance: Vector
    """Of the free columns and the amplitudes behind them."""


@dataclass(frozen=True, eq=False)
class Process:
    """The map before it is learned: its patterns, and how large they may be."""

    waves: Waves
    power: int
    variance: Vector
    scale: float
    """Scatter from frame to frame over the stated noise, at least 1."""
    evidence: float
    """Logarithm of its evidence over that of no map."""

    def fit(self, frames: Sequence[SeenFrame], start: Ideal) -> Joint:
        """Vessel and map together, by some linearisations."""
        wall, amplitudes = start.wall, np.zeros(len(self.variance))
        covariance = np.zeros((0, 0))
        known = np.concatenate([start.prior_information[start.free], 1.0 / self.variance])
        for _ in range(ROUNDS):
            tiles = against([self.corrected(one, amplitudes) for one in frames], wall)
            weight = 1.0 / np.sqrt(tiles.variance * self.scale)
            map_rows = -self.waves.over(tiles) * (tiles.depth**self.power)[:, None]
            rows = np.hstack([tiles.jacobian[:, start.free], map_rows]) * weight[:, None]
            off = np.concatenate([(wall.state - start.prior_mean)[start.free], amplitudes])
            covariance = inverse_of(rows.T @ rows + np.diag(known))
            change = -covariance @ (rows.T @ (tiles.residual * weight) + known * off)
            step = np.zeros(SIZE)
            step[start.free] = change[: len(start.free)]
            wall, amplitudes = referred(wall.moved(step)), amplitudes + change[len(start.free) :]
        return Joint(wall, start.free, amplitudes, covariance)

    def corrected(self, one: SeenFrame, amplitudes: Vector) -> SeenFrame:
        """A frame without the map's error."""
        if not amplitudes.any():
            return one
        made = _grid_of(self.waves, amplitudes)
        depth = np.asarray(one.frame.depth, np.float32)
        depth = SensorMap(self.power, made, np.zeros_like(made), np.zeros((7, 7))).corrected(depth)
        return replace(one, frame=replace(one.frame, depth=depth))


def _nodes(waves: Waves) -> Vector:
    """(rows · columns, K) patterns at the stored map's nodes."""
    v, u = np.meshgrid(
        *(np.linspace(0.5 / size, 1.0 - 0.5 / size, n) for size, n in zip(waves.size[::-1], GRID, strict=True)),
        indexing="ij",
    )
    return waves.at(u.ravel(), v.ravel())


def _grid_of(waves: Waves, amplitudes: Vector) -> Vector:
    return np.asarray((_nodes(waves) @ amplitudes).reshape(GRID))


def process_of(frames: Sequence[SeenFrame], whole: Ideal, image: Score) -> Process | None:
    """Amplitude and length of the largest evidence, with the vessel marginalised; None where no map is likelier."""
    tiles, scale = whole.tiles, max(image.scale, 1.0)
    waves = waves_of(frames, tiles)
    best: tuple[float, Process | None] = (SURELY, None)
    weight = 1.0 / np.sqrt(tiles.variance * scale)
    rows, residual = tiles.jacobian[:, whole.free] * weight[:, None], tiles.residual * weight
    open_vessel = inverse_of(rows.T @ rows + np.diag(whole.prior_information[whole.free]))
    cosines = waves.over(tiles) * weight[:, None]
    for power in POWERS:
        own = cosines * (tiles.depth**power)[:, None]
        taken = own.T @ rows @ open_vessel
        information = own.T @ own - taken @ (rows.T @ own)
        towards = own.T @ residual - taken @ (rows.T @ residual)
        for amplitude, length in product(AMPLITUDES, LENGTHS):
            variance = waves.variances(amplitude, length)
            evidence = _evidence(information, towards, variance)
            if evidence > best[0]:
                best = evidence, Process(waves, power, variance, scale, evidence)
    return best[1]


def _evidence(information: Vector, towards: Vector, variance: Vector) -> float:
    """Logarithm of the evidence of a map over that of none."""
    root = np.sqrt(variance)
    scaled = np.eye(len(root)) + information * root * root[:, None]
    pull = towards * root
    return float(0.5 * pull @ np.linalg.solve(scaled, pull) - 0.5 * np.linalg.slogdet(scaled)[1])


def _held_out(frames: Sequence[SeenFrame], whole: Ideal, process: Process) -> tuple[Vector, Vector, int]:
    """Squares of held-out residuals by level, without and with the map of the other levels; and the number of tiles."""
    before, after, count = [], [], 0
    for numbers in by_level(frames):
        others = [one for i, one in enumerate(frames) if i not in numbers]
        own = [frames[i] for i in numbers]
        joint, plain = process.fit(others, whole), fitted(others, whole.wall)
        bare = against(own, plain.wall)
        mapped = against([process.corrected(one, joint.amplitudes) for one in own], joint.wall)
        before.append(float((bare.residual**2 / bare.variance).mean()) * len(bare))
        after.append(float((mapped.residual**2 / mapped.variance).mean()) * len(bare))
        count += len(bare)
    return np.array(before) / process.scale, np.array(after) / process.scale, count


def _stored(process: Process, joint: Joint, whole: Ideal) -> SensorMap:
    """The map on its grid, with its deviations and what it leaves open of the pose."""
    nodes, first = _nodes(process.waves), len(joint.free)
    own = joint.covariance[first:, first:]
    std = np.sqrt(np.maximum(np.einsum("nk,kl,nl->n", nodes, own, nodes), 0.0)).reshape(GRID)
    told = np.array([np.flatnonzero(joint.free == column).max(initial=-1) for column in LENGTHS_AND_POSE])
    seen = np.flatnonzero(told >= 0)
    at = np.ix_(told[seen], told[seen])
    added = joint.covariance[at] - whole.covariance[at]
    values, vectors = np.linalg.eigh(0.5 * (added + added.T))
    opens = np.zeros((len(told), len(told)))
    opens[np.ix_(seen, seen)] = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return SensorMap(process.power, _grid_of(process.waves, joint.amplitudes), std, opens)
