"""Finds a silo's axis, geometry and content from one depth camera.

Names load with their first use, so that ``import siloscope`` and ``siloscope --help`` need no numpy.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from siloscope._core import __version__
    from siloscope.calibrate import calibrate
    from siloscope.content.surface_map import surface_map, volume_between
    from siloscope.errors import InputError, SiloscopeError, UsageError
    from siloscope.floors import learn_floor, tare
    from siloscope.io import open
    from siloscope.locate import locate
    from siloscope.measure import measure
    from siloscope.track import track
    from siloscope.types.calibration import Calibration
    from siloscope.types.camera import Camera
    from siloscope.types.content import Content
    from siloscope.types.estimate import Estimate, Ratios
    from siloscope.types.frame import Frame
    from siloscope.types.pose import SiloPose
    from siloscope.types.surface_map import SurfaceMap
    from siloscope.types.track import Track
    from siloscope.types.vessel import SiloGeometry
    from siloscope.validation.mapping import sensor_map
    from siloscope.validation.validate import Validation, validate

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
    "Validation",
    "__version__",
    "calibrate",
    "learn_floor",
    "locate",
    "measure",
    "open",
    "sensor_map",
    "surface_map",
    "tare",
    "track",
    "validate",
    "volume_between",
]

_VERBS = ("calibrate", "locate", "measure", "track")
"""Functions of the same name as their module."""

_HOMES = {
    "_core": ("__version__",),
    "content.surface_map": ("surface_map", "volume_between"),
    "errors": ("InputError", "SiloscopeError", "UsageError"),
    "floors": ("learn_floor", "tare"),
    "io": ("open",),
    "types.calibration": ("Calibration",),
    "types.camera": ("Camera",),
    "types.content": ("Content",),
    "types.estimate": ("Estimate", "Ratios"),
    "types.frame": ("Frame",),
    "types.pose": ("SiloPose",),
    "types.surface_map": ("SurfaceMap",),
    "types.track": ("Track",),
    "types.vessel": ("SiloGeometry",),
    "validation.mapping": ("sensor_map",),
    "validation.validate": ("Validation", "validate"),
    **{verb: (verb,) for verb in _VERBS},
}
"""Modules and the names that users have from them here."""


class _Face(ModuleType):
    """The package as users see it: names load with their first use, and a verb is its function, not its module."""

    def __getattr__(self, name: str) -> Any:
        home = next((module for module, names in _HOMES.items() if name in names), None)
        if home is not None:
            value = getattr(import_module(f"{__name__}.{home}"), name)
        elif not name.startswith("__") and find_spec(f"{__name__}.{name}") is not None:
            value = import_module(f"{__name__}.{name}")
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        setattr(self, name, value)
        return value

    def __setattr__(self, name: str, value: Any) -> None:
        """The import system binds a submodule to its name here as soon as it is loaded."""
        function = name in _VERBS and isinstance(value, ModuleType)
        super().__setattr__(name, getattr(value, name) if function else value)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *__all__})


sys.modules[__name__].__class__ = _Face
