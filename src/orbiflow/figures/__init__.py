"""Pictures of tiles, tilings, fields, classes and densities."""

from orbiflow.figures.classes import classes_png
from orbiflow.figures.field import field_png
from orbiflow.figures.palette import PALETTES, Palette, palette
from orbiflow.figures.tilings import overlay_png, tiling_png
from orbiflow.figures.window import default_window

__all__ = [
    "PALETTES",
    "Palette",
    "classes_png",
    "default_window",
    "field_png",
    "overlay_png",
    "palette",
    "tiling_png",
]
