"""What is in the silo: surface, level, volume, fill and mass."""

from siloscope.content.capacity import Strapping
from siloscope.content.density import Density, products
from siloscope.content.surface_map import surface_map, volume_between
from siloscope.types.content import Content, Level, Parts
from siloscope.types.remark import Remark
from siloscope.types.surface_map import Shape, SurfaceMap
from siloscope.vessel.datasheet import Datasheet

__all__ = [
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
