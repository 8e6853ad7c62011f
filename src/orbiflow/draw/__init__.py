"""Pictures of tiles, tilings, fields and classes, and writing them to files."""

from orbiflow.draw.classes import classes_png
from orbiflow.draw.field import field_png
from orbiflow.draw.files import write_atomic
from orbiflow.draw.palette import PALETTES, Palette, palette
from orbiflow.draw.raster import overlay_png, tiling_png
from orbiflow.draw.svg import tile_svg, tiling_svg
from orbiflow.draw.window import default_window

__all__ = [
    "PALETTES",
    "Palette",
    "classes_png",
    "default_window",
    "field_png",
    "overlay_png",
    "palette",
    "tile_svg",
    "tiling_png",
    "tiling_svg",
    "write_atomic",
]
