"""Populations by kind and seed."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from . import seen, silos
from .drawing import Draw, Plan, View
from .no_silos import NO_SILO
from .scenes import Scene
from .sensors import AZURE, D455
from .solids import BOTTOM, CYLINDER, FEED

LOOK = 40
"""Pixels across of the small frame on which a view is judged."""

CLEAR_OF_FEED, CLEAR_OF_THINGS = 0.3, 0.15
"""Least distances of the camera, metres."""

SILOS = (
    silos.control, silos.clutter, silos.opening, silos.oval, silos.dent, silos.corrugated, silos.build_up_on_wall,
    silos.build_up_on_cone, silos.near_wall, silos.level, silos.flat_empty, silos.flat_ring, silos.flat_ring_auger,
    silos.crater, silos.oblique, silos.oblique_small, silos.oblique_cone_mostly, silos.two_stage, silos.pyramid,
    silos.bent, silos.courses, silos.feed_as_cone, silos.funnel, silos.funnel_aside, silos.cake, silos.farm,
)  # fmt: skip
SEEN = (
    seen.multipath, seen.stereo_warp, seen.centre_off, seen.centre_far_off, seen.focal_off, seen.focal_x_off,
    seen.distortion, seen.aligned, seen.dust, seen.invalid, seen.narrow, seen.tilted, seen.horizon, seen.tall,
    seen.large,
)  # fmt: skip

KINDS: dict[str, Callable[[Draw], Plan]] = {
    **{plan.__name__: plan for plan in (*SILOS, *SEEN)},
    "d455": seen.sensor_of(D455),
    "azure": seen.sensor_of(AZURE),
}
"""Kinds of silos by name."""


def draw(kind: str, seed: int, width: int = 640) -> Scene:
    """The scene of a kind and seed: plans and cameras are drawn until the frame shows what its kind asks for.

    Raises
    ------
    RuntimeError
        Where 40 plans with 25 cameras each did not.
    """
    make, number = (KINDS | NO_SILO)[kind], zlib.crc32(kind.encode())
    d = Draw((number, seed))
    for _ in range(40):
        plan = make(d)
        true, told = d.intrinsics(plan.sensor, width, plan.off)
        for _ in range(25 if plan.vessel else 1):
            pose = d.place(plan.vessel, plan.view) if plan.vessel else plan.poses[0]
            scene = Scene(
                pose, true, told, plan.vessel, plan.feed, plan.things, plan.sensor, plan.faults, (number, seed, 1), seed
            )
            if plan.vessel is None or _shows(scene, plan.view):
                return scene
    raise RuntimeError(f"no scene of kind {kind} and seed {seed} shows what it should")


def _shows(scene: Scene, view: View) -> bool:
    """Whether camera and view are possible, judged on a small frame without losses and dust."""
    place = tuple(np.array([value]) for value in scene.pose.origin)
    if scene.feed is not None and float(scene.feed.air(*place)[0]) < CLEAR_OF_FEED:
        return False
    if any(float(thing.air(*place)[0]) < CLEAR_OF_THINGS for thing in scene.things):
        return False
    faults = replace(scene.faults, dropout=0.0, dust=0.0, flying=0.0)
    shot = replace(scene, faults=faults).shrunk(max(scene.camera.width // LOOK, 1)).shoot()
    if float((shot.reading > 0.0).mean()) < view.valid:
        return False
    shown = shot.share(BOTTOM) >= view.bottom and shot.share(FEED) >= view.feed
    return shown and view.wall[0] <= shot.share(CYLINDER) <= view.wall[1] and view.arc[0] <= shot.arc <= view.arc[1]
