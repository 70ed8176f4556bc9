"""A calibration that learns its floor: from frames of the empty vessel, or from a discharge and a refill."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from siloscope.content.floor_learning import Layer, learned_map, tare_map
from siloscope.errors import InputError
from siloscope.measure import measure
from siloscope.types.calibration import Calibration
from siloscope.types.floor import Floor
from siloscope.types.frame import Frame

FEWEST_LEARNED = 3
"""Before, covered, after."""


def tare(calibration: Calibration, frames: Iterable[Frame], **settings: Any) -> Calibration:
    """The calibration with the floor as frames of the empty vessel show it, whatever its shape.

    The floor and a later surface are seen by one camera in one pose, so what both have in common drops out of the
    volume. What no frame shows is completed by the kind of bottom that fits the rest, and says so.

    Parameters
    ----------
    calibration : Calibration
        Pose and radius.
    frames : iterable of Frame
        Of the empty vessel.
    **settings
        As for `siloscope.measure`: sensor, vessel, ...

    Raises
    ------
    InputError
        Where the frames show too little of the floor.
    """
    layers, radius = _layers(calibration, frames, settings)
    found = None if radius is None or not layers else tare_map(layers, radius)
    if found is None:
        raise InputError(
            "the frames of the empty vessel show less than a quarter of its floor; take some that look at its middle"
        )
    return replace(calibration, floor=Floor("map", "tare", map=found))


def learn_floor(calibration: Calibration, frames: Iterable[Frame], **settings: Any) -> Calibration:
    """The calibration with the floor that a discharge showed, a refill covered, and a later discharge showed again.

    Without such a refill the calibration is given back as it is: a surface that was seen once may be feed.
    """
    layers, radius = _layers(calibration, frames, settings)
    found = None if radius is None or len(layers) < FEWEST_LEARNED else learned_map(layers, radius)
    if found is None:
        return calibration
    return replace(calibration, floor=Floor("map", "discharge", map=found))


def _layers(
    calibration: Calibration, frames: Iterable[Frame], settings: dict[str, Any]
) -> tuple[list[Layer], float | None]:
    """The surfaces of frames, with no bottom assumed, and the vessel's radius."""
    layers, radius = [], None
    for frame in frames:
        content = measure(frame, calibration, **{**settings, "bottom": "unknown"})
        layer = Layer.of(content)
        if layer is not None and content.lengths is not None:
            layers.append(layer)
            radius = content.lengths.geometry.radius
    return layers, radius
