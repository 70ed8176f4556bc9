"""Synthetic silos with exact truth (section 2.4): the walls, the feed, the sensor, and the frames it takes."""

from siloscope.simulation.content import Content, content_of
from siloscope.simulation.defects import ALL, DEFECTS, Defects, defects
from siloscope.simulation.feed import BASES, EXTRAS, Feed
from siloscope.simulation.intrinsics import PRIORS, true_camera
from siloscope.simulation.scene import ASTRA, WORLDS, Scene, SimulatedFrame, discharge
from siloscope.simulation.sensor_model import ASTRA_S, PERFECT, SensorModel, sensor_model
from siloscope.simulation.silo import Silo
from siloscope.simulation.vessels import defects_of, silo_of, ullage

__all__ = [
    "ALL",
    "ASTRA",
    "ASTRA_S",
    "BASES",
    "DEFECTS",
    "EXTRAS",
    "PERFECT",
    "PRIORS",
    "WORLDS",
    "Content",
    "Defects",
    "Feed",
    "Scene",
    "SensorModel",
    "Silo",
    "SimulatedFrame",
    "content_of",
    "defects",
    "defects_of",
    "discharge",
    "sensor_model",
    "silo_of",
    "true_camera",
    "ullage",
]
