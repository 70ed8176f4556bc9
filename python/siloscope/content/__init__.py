"""What is in the silo: surface, level, volume, fill and mass."""

from siloscope.content.capacity import Datasheet, Strapping
from siloscope.content.density import Density, products
from siloscope.content.quality import QUALITY, Remark
from siloscope.content.result import Content, Level, Parts
from siloscope.content.surface_map import Shape, SurfaceMap, surface_map, volume_between

__all__ = [
    "QUALITY",
    "Content",
    "Datasheet",
    "Density",
    "Level",
    "Parts",
    "Remark",
    "Shape",
    "Strapping",
    "SurfaceMap",
    "products",
    "surface_map",
    "volume_between",
]
