"""Finds a silo's axis, geometry and content from one depth camera."""

from siloscope._core import __version__
from siloscope.calibrate import calibrate
from siloscope.content import Content, SurfaceMap, surface_map, volume_between
from siloscope.errors import InputError, SiloscopeError, UsageError
from siloscope.floors import learn_floor, tare
from siloscope.io import open
from siloscope.locate import locate
from siloscope.measure import measure
from siloscope.track import track
from siloscope.types.calibration import Calibration
from siloscope.types.camera import Camera
from siloscope.types.estimate import Estimate, Ratios
from siloscope.types.frame import Frame
from siloscope.types.pose import SiloPose
from siloscope.types.track import Track
from siloscope.types.vessel import SiloGeometry

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
    "learn_floor",
    "locate",
    "measure",
    "open",
    "surface_map",
    "tare",
    "track",
    "volume_between",
]
