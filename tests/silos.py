"""Simulated silos with what is known about them, for the tests of the content."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import siloscope
from siloscope import sensors
from siloscope.simulation import ASTRA_S, PERFECT, Feed, Scene, SensorModel, Silo
from siloscope.simulation.scenarios import looking_at
from siloscope.types.camera import Camera
from siloscope.types.floor import Floor

SMALL = Camera(width=320, height=240, fx=285.15, fy=285.15, cx=159.5, cy=119.5)
"""The Astra at half its resolution: quicker to render."""

STOUT = Silo(radius=1.25, cylinder_height=2.5, cone_height=1.2)


def scene(
    feed: Feed | None,
    silo: Silo = STOUT,
    place: tuple[float, float] = (0.3, 0.1),
    sensor: SensorModel = PERFECT,
    **more: Any,
) -> Scene:
    """A silo with its camera at a place of the top, looking at the cone's vertex."""
    return Scene(silo, looking_at(silo, *place), SMALL, feed, sensor, **more)


def known(scene: Scene, std: float = 0.0) -> siloscope.Calibration:
    """A calibration with the scene's true pose, slope and lengths, and a standard deviation for all of them.

    It was told that its cone is the bottom: most cones of these tests lie no steeper than feed may.
    """
    g, pose = scene.silo.geometry, scene.pose
    slope = g.radius / (g.apex - g.cylinder_bottom)
    values = [pose.r_x, pose.r_y, pose.t_x, pose.t_y, g.radius, slope, slope * g.apex, *scene.sensor.bias, 0.0, 0.0]
    name = "orbbec-astra-s" if scene.sensor.bias == ASTRA_S.bias else None
    by_vertex = np.eye(12)
    by_vertex[6, 5:7] = g.apex, slope
    covariance = by_vertex @ np.diag([std**2] * 7 + [0.0] * 5) @ by_vertex.T
    return siloscope.Calibration(
        "ok",
        pose=pose,
        covariance=covariance[:4, :4],
        silo=g,
        parameters=np.array(values),
        parameter_covariance=covariance,
        config={"sensor": quiet() if name is None else sensors.load(name).to_dict()},
        floor=Floor("cone", "told"),
    )


def quiet() -> dict[str, Any]:
    """A sensor profile without bias and with next to no noise."""
    noise = (5e-4, 0.0, 0.0, 0.0, 0.0, 1.0)
    return sensors.SensorProfile("perfect", noise=noise).to_dict()


def measured(scene: Scene, **settings: Any) -> tuple[siloscope.Content, Any]:
    """A scene's content as measured with its true calibration, and the frame with its truth."""
    frame = scene.render()
    return siloscope.measure(frame.frame(), known(scene), **settings), frame


def percent(content: siloscope.Content, frame: Any) -> float:
    """Error of the volume in % of the silo's capacity."""
    assert content.volume is not None, (content.reason, content.message)
    return float(100.0 * (content.volume - frame.true_volume) / frame.scene.silo.capacity)


def noisy(made: Scene, seed: int = 1) -> Scene:
    """The scene through the paper's sensor."""
    return replace(made, sensor=ASTRA_S, seed=seed)
