"""The Cramér-Rao bound against derivatives of the ray caster itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from siloscope import Camera, SiloPose
from siloscope.reproduction.bound import ORDER, cramer_rao
from siloscope.simulation import ASTRA_S, Scene, Silo
from siloscope.simulation.scenarios import scenario

SMALL = Camera(width=64, height=48, fx=57.03, fy=57.03, cx=31.5, cy=23.5)
STEP = 1e-6


def posed(name: str) -> Callable[[Scene, float], Scene]:
    return lambda scene, h: replace(scene, pose=replace(scene.pose, **{name: getattr(scene.pose, name) + h}))


def shaped(change: Callable[[Silo, float], Silo]) -> Callable[[Scene, float], Scene]:
    return lambda scene, h: replace(scene, silo=change(scene.silo, h))


def wider(silo: Silo, h: float) -> Silo:
    """A larger radius on the same cone: its upper end lies higher."""
    slope = silo.radius / silo.cone_height
    rise = h / slope
    return replace(
        silo, radius=silo.radius + h, cylinder_height=silo.cylinder_height - rise, cone_height=silo.cone_height + rise
    )


def flatter(silo: Silo, h: float) -> Silo:
    """Another cone slope about the same apex."""
    cone = silo.radius / (silo.radius / silo.cone_height + h)
    return replace(silo, cone_height=cone, cylinder_height=silo.cylinder_height + silo.cone_height - cone)


def deeper(silo: Silo, h: float) -> Silo:
    return replace(silo, cylinder_height=silo.cylinder_height + h)


CHANGES = {
    **{name: posed(name) for name in ORDER[:4]},
    "radius": shaped(wider),
    "cone_slope": shaped(flatter),
    "apex": shaped(deeper),
}


@pytest.mark.parametrize("name", ["silo1", "silo2", "silo3"])
def test_the_bound_is_that_of_the_ray_casters_own_derivatives(name: str) -> None:
    scene = replace(scenario(name), camera=SMALL, feed=None, sensor=ASTRA_S)
    frame = scene.render()
    columns, same = [], frame.labels > 0
    for parameter in ORDER:
        above, below = (CHANGES[parameter](scene, h).render() for h in (STEP, -STEP))
        columns.append((above.depth - below.depth) / (2.0 * STEP))
        same &= (above.labels == frame.labels) & (below.labels == frame.labels)
    slopes = np.stack(columns, axis=-1)[same]
    bias = 1.0 + ASTRA_S.bias[1] + 2.0 * ASTRA_S.bias[2] * frame.depth[same]
    scaled = slopes * (bias / ASTRA_S.sigma_at(frame.depth[same]))[:, None]
    scale = np.sqrt((scaled**2).sum(axis=0))
    numeric = np.sqrt(np.diag(np.linalg.inv((scaled / scale).T @ (scaled / scale)))) / scale
    np.testing.assert_allclose(np.sqrt(np.diag(cramer_rao(frame))), numeric, rtol=2e-3)


def test_less_wall_means_less_certainty_and_none_at_all_infinite() -> None:
    scene = replace(scenario("silo1"), camera=SMALL, sensor=ASTRA_S)
    empty = cramer_rao(replace(scene, feed=None).render())
    half = cramer_rao(replace(scene, feed=replace(scene.feed, level=0.5) if scene.feed else None).render())
    assert (np.diag(half) > np.diag(empty)).all()
    assert np.isinf(half[6, 6])


def test_a_quarter_turn_of_everything_swaps_the_axes() -> None:
    scene = replace(scenario("silo1"), camera=SMALL, feed=None, sensor=ASTRA_S, pose=SiloPose(0.0, 0.0, 0.3, 0.0))
    turned = replace(
        scene, pose=SiloPose(0.0, 0.0, 0.0, 0.3), camera=replace(SMALL, width=48, height=64, cx=23.5, cy=31.5)
    )
    first, second = (np.sqrt(np.diag(cramer_rao(s.render()))) for s in (scene, turned))
    np.testing.assert_allclose(second[[1, 0, 3, 2]], first[:4], rtol=1e-9)
    np.testing.assert_allclose(second[4:], first[4:], rtol=1e-9)
