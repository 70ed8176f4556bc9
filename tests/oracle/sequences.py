"""Many frames of one camera in one silo: what lasts stays, the feed falls or stands, the camera may be moved once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .cameras import Pose
from .feed import Feed
from .kinds import CLEAR_OF_FEED, draw
from .scenes import Scene

STANDING = ("flat_ring", "flat_ring_auger", "feed_as_cone", "funnel", "funnel_aside", "crater")
"""Kinds whose feed makes the kind, and stands."""


def sequence(kind: str, seed: int, frames: int = 20, width: int = 640, moved: bool = False) -> list[Scene]:
    """Scenes of one silo. With `moved` the camera is turned and shifted before one of the middle frames."""
    first = draw(kind, seed, width)
    draws = np.random.default_rng((seed, 20))
    feeds = _feeds(first, kind, frames, draws)
    change = int(draws.integers(2 * frames // 5, 3 * frames // 5 + 1)) if moved else frames
    after = _moved(first.pose, draws)
    return [
        replace(first, feed=feed, pose=first.pose if i < change else after, seed=(*first.seed, 100 + i))
        for i, feed in enumerate(feeds)
    ]


def _feeds(scene: Scene, kind: str, frames: int, draws: np.random.Generator) -> list[Feed | None]:
    """The feed of every frame. It falls in two sequences of three, and in the third it stands."""
    if scene.vessel is None or kind in STANDING or draws.uniform() < 1 / 3:
        return [scene.feed] * frames
    vessel, origin = scene.vessel, scene.pose.origin
    feed = scene.feed or Feed(vessel.bottom.rim)
    start = min(0.5 * vessel.bottom.rim, feed.z)
    falls = np.linspace(start - feed.z, vessel.bottom.lowest - feed.z, frames)
    room = float(feed.air(*origin[:, None])[0]) - CLEAR_OF_FEED
    return [_lowered(feed, max(float(fall), -room), draws) for fall in falls]


def _lowered(feed: Feed, fall: float, draws: np.random.Generator) -> Feed:
    """The feed farther down, with other waves."""
    tip = None if feed.tip is None else replace(feed.tip, z=feed.tip.z + fall)
    waves = tuple((h, kx, ky, float(draws.uniform(0.0, 6.28))) for h, kx, ky, _ in feed.waves)
    return replace(feed, z=feed.z + fall, tip=tip, waves=waves)


def _moved(pose: Pose, draws: np.random.Generator) -> Pose:
    """The pose after somebody bumped into the camera: 5 to 30 mrad and 10 to 60 mm."""
    turn, shift = draws.uniform(0.005, 0.03), draws.uniform(0.01, 0.06)
    azimuths = draws.uniform(0.0, 2.0 * np.pi, 2)
    return Pose(
        pose.r_x + turn * float(np.cos(azimuths[0])),
        pose.r_y + turn * float(np.sin(azimuths[0])),
        pose.t_x + shift * float(np.cos(azimuths[1])),
        pose.t_y + shift * float(np.sin(azimuths[1])),
    )
