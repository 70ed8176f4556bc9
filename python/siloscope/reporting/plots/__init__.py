"""Pictures of frames, fits and discharges; each function returns a matplotlib Figure and touches no global state."""

from siloscope.reporting.plots.clouds import candidates, clouds, overview
from siloscope.reporting.plots.depth import depth_map
from siloscope.reporting.plots.directions import directions
from siloscope.reporting.plots.discharge import errors, ratios
from siloscope.reporting.plots.profile import profile
from siloscope.reporting.plots.style import png, save

__all__ = ["candidates", "clouds", "depth_map", "directions", "errors", "overview", "png", "profile", "ratios", "save"]
