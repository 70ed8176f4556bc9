"""Synthetic silos with exact truth (section 2.4): the walls, the feed, the sensor, and the frames it takes."""

from siloscope.simulation.content import Content, content_of
from siloscope.simulation.defects import DEFECTS, Defects, defects
from siloscope.simulation.feed import BASES, EXTRAS, Feed
from siloscope.simulation.scene import ASTRA, WORLDS, Scene, SimulatedFrame, discharge
from siloscope.simulation.sensor_model import ASTRA_S, PERFECT, SensorModel, sensor_model
from siloscope.simulation.silo import Silo

__all__ = [
    "ASTRA",
    "ASTRA_S",
    "BASES",
    "DEFECTS",
    "EXTRAS",
    "PERFECT",
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
    "discharge",
    "sensor_model",
]
