"""What the API answers. Times are RFC 3339 in UTC, numbers in SI units with the unit in the name, deviations beside."""

from siloscope.monitor.api.models.alerts import Acknowledgement, Alert
from siloscope.monitor.api.models.base import Clock, Item, Model, Page, Problem
from siloscope.monitor.api.models.contents import (
    Attempt,
    Bucket,
    CameraState,
    Event,
    Forecast,
    Level,
    Now,
    Reading,
    Remark,
    State,
    Surface,
    Trend,
    Vessel,
)
from siloscope.monitor.api.models.frames import Frame, FrameTaken
from siloscope.monitor.api.models.things import Calibration, Camera, Change, Health, Place, Product, Silo, Site

__all__ = [
    "Acknowledgement",
    "Alert",
    "Attempt",
    "Bucket",
    "Calibration",
    "Camera",
    "CameraState",
    "Change",
    "Clock",
    "Event",
    "Forecast",
    "Frame",
    "FrameTaken",
    "Health",
    "Item",
    "Level",
    "Model",
    "Now",
    "Page",
    "Place",
    "Problem",
    "Product",
    "Reading",
    "Remark",
    "Silo",
    "Site",
    "State",
    "Surface",
    "Trend",
    "Vessel",
]
