"""Pictures of frames, fits and discharges; each function returns a matplotlib Figure and touches no global state."""

from siloscope.plots.clouds import candidates, clouds, overview
from siloscope.plots.depth import depth_map
from siloscope.plots.directions import directions
from siloscope.plots.discharge import errors, ratios
from siloscope.plots.profile import profile
from siloscope.plots.style import png, save

__all__ = ["candidates", "clouds", "depth_map", "directions", "errors", "overview", "png", "profile", "ratios", "save"]
