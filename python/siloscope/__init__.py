"""Finds a silo's axis, geometry and content from one depth camera."""

from siloscope import frames
from siloscope._core import __version__
from siloscope.calibrate import calibrate
from siloscope.calibration import Calibration
from siloscope.camera import Camera
from siloscope.content import Content, SurfaceMap, measure, surface_map, volume_between
from siloscope.errors import InputError, SiloscopeError, UsageError
from siloscope.estimate import Estimate, Ratios, SiloGeometry
from siloscope.frame import Frame
from siloscope.locate import locate
from siloscope.pose import SiloPose
from siloscope.track import track
from siloscope.tracking.story import Track

__all__ = [
    "Calibration",
    "Camera",
    "Content",
    "Estimate",
    "Frame",
    "InputError",
    "Ratios",
    "SiloGeometry",
    "SiloPose",
    "SiloscopeError",
    "SurfaceMap",
    "Track",
    "UsageError",
    "__version__",
    "calibrate",
    "frames",
    "locate",
    "measure",
    "surface_map",
    "track",
    "volume_between",
]
