"""Synthetic silos with exact truth (section 2.4): the walls, the feed, the sensor, and the frames it takes."""

from siloscope.scene.content import Content, content_of
from siloscope.scene.defects import DEFECTS, Defects, defects
from siloscope.scene.feed import BASES, EXTRAS, Feed
from siloscope.scene.scene import ASTRA, WORLDS, Scene, SimulatedFrame, discharge
from siloscope.scene.sensor_model import ASTRA_S, PERFECT, SensorModel, sensor_model
from siloscope.scene.silo import Silo

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
