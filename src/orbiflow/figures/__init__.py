"""Pictures of tiles, tilings, fields, classes and densities.

Palettes are here at once; what draws is looked up when it is first used, so that the names of palettes
cost no numerical library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from orbiflow.figures.palette import PALETTES, Palette, palette

if TYPE_CHECKING:
    from orbiflow.figures.bending import bending_picture, bending_png
    from orbiflow.figures.classes import classes_png
    from orbiflow.figures.density_corner import corner_picture
    from orbiflow.figures.density_flow import flow_picture
    from orbiflow.figures.density_map import map_picture
    from orbiflow.figures.density_page import density_page
    from orbiflow.figures.density_samples import samples_picture
    from orbiflow.figures.density_square import density_picture
    from orbiflow.figures.field import field_picture, field_png
    from orbiflow.figures.map_samples import map_samples_picture
    from orbiflow.figures.sheet import Picture, Sheet, pdf_pages
    from orbiflow.figures.tiling_sheet import tilings_png
    from orbiflow.figures.tilings import (
        overlay_picture,
        overlay_png,
        tiling_picture,
        tiling_png,
    )
    from orbiflow.figures.window import default_window

_FILES = {
    "bending": ("bending_picture", "bending_png"),
    "classes": ("classes_png",),
    "density_corner": ("corner_picture",),
    "density_flow": ("flow_picture",),
    "density_page": ("density_page",),
    "density_map": ("map_picture",),
    "density_samples": ("samples_picture",),
    "density_square": ("density_picture",),
    "field": ("field_picture", "field_png"),
    "map_samples": ("map_samples_picture",),
    "sheet": ("Picture", "Sheet", "pdf_pages"),
    "tiling_sheet": ("tilings_png",),
    "tilings": ("overlay_picture", "overlay_png", "tiling_picture", "tiling_png"),
    "window": ("default_window",),
}
_HOMES = {name: f"orbiflow.figures.{file}" for file, names in _FILES.items() for name in names}

__all__ = [
    "PALETTES",
    "Palette",
    "Picture",
    "Sheet",
    "bending_picture",
    "bending_png",
    "classes_png",
    "corner_picture",
    "default_window",
    "density_page",
    "density_picture",
    "field_picture",
    "field_png",
    "flow_picture",
    "map_picture",
    "map_samples_picture",
    "overlay_picture",
    "overlay_png",
    "palette",
    "pdf_pages",
    "samples_picture",
    "tiling_picture",
    "tiling_png",
    "tilings_png",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'orbiflow.figures' has no attribute {name!r}")
