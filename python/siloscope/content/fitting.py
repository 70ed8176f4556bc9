"""The core's fit of the content's surface to a prepared frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from siloscope import _core
from siloscope.content.knowledge import Knowledge, narrowed
from siloscope.content.setup import ContentSetup, CoreFloor, CoreVessel
from siloscope.errors import InputError, UsageError
from siloscope.estimation.decimation import STEP, decimated_camera
from siloscope.estimation.inputs import Prepared, PreparedPoints
from siloscope.types.calibration import Calibration
from siloscope.types.depth_frame import DepthFrame
from siloscope.vessel.datasheet import Datasheet

BEHIND = 1.5
"""Cells behind the farthest one that shows the bare cone at which a cone without an end is cut off."""


def _data(prepared: Prepared) -> DepthFrame | NDArray[np.float32]:
    """A frame as the core takes it."""
    if isinstance(prepared, PreparedPoints):
        return np.asarray(prepared.points, np.float32)
    return DepthFrame.of(prepared.depth, prepared.camera)


def fitted(prepared: Prepared, known: Knowledge, sheet: Datasheet) -> _core.ContentMeasure:
    """The core's answer."""
    try:
        setup = ContentSetup(known, lengths_for_core(known, sheet), CoreFloor.of(known.floor.map))
        return _core.content_measure(_data(prepared), setup)
    except ValueError as error:
        raise UsageError(str(error)) from None


def cut_behind_bare_wall(prepared: Prepared, known: Knowledge, sheet: Datasheet, calibration: Calibration) -> Knowledge:
    """A cone of which nobody knows where it ends, cut off behind the farthest bare wall, so that the map fits it."""
    radius = known.lengths.geometry.radius
    try:
        setup = ContentSetup(known, lengths_for_core(known, sheet))
        bare = _core.content_bare_reach(_data(_every_other(prepared)), setup)
    except ValueError as error:
        raise UsageError(str(error)) from None
    if bare is None or radius is None:
        return known
    return narrowed(known, calibration, min(bare.farthest + BEHIND * bare.cell, radius))


def _every_other(prepared: Prepared) -> Prepared:
    """Every other row and column of a depth image: enough to see how far the bare wall reaches."""
    if isinstance(prepared, PreparedPoints):
        return prepared
    return replace(prepared, depth=prepared.depth[::STEP, ::STEP], camera=decimated_camera(prepared.camera))


BOTTOMLESS = 100.0
"""How far below the camera the floor is put while nobody knows it, m: everything seen then is content."""


def lengths_for_core(known: Knowledge, sheet: Datasheet) -> CoreVessel:
    """Lengths as the core takes them; a floor that nobody knows, or that is a map, is put out of sight."""
    geometry = known.lengths.geometry
    if geometry.radius is None:
        raise InputError(
            "the calibration has not seen the cylinder, so the silo's radius is not known; give --diameter, or "
            "calibrate with frames of a lower level"
        )
    bottom, apex = geometry.cylinder_bottom, geometry.apex
    if bottom is None or apex is None:
        bottom = apex = BOTTOMLESS
    if sheet.outlet_diameter >= 2.0 * geometry.radius:
        raise UsageError(
            f"an outlet of {sheet.outlet_diameter:g} m does not fit a silo of {2.0 * geometry.radius:.3f} m; "
            "give --outlet-diameter in metres"
        )
    if known.lengths.top >= apex:
        raise UsageError(
            f"the upper edge at {known.lengths.top:g} m below the camera lies under the cone's vertex at {apex:.3f} m; "
            "--top is negative above the camera"
        )
    outlet = sheet.outlet_diameter / 2.0
    return CoreVessel(geometry.radius, bottom, apex, known.lengths.top, outlet, sheet.outlet_length, *known.ovality)
