"""Pictures of tiles, tilings, fields, classes and densities.

Palettes are here at once; what draws is looked up when it is first used, so that the names of palettes
cost no numerical library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from orbiflow.figures.palette import PALETTES, Palette, palette

if TYPE_CHECKING:
    from orbiflow.figures.classes import classes_png
    from orbiflow.figures.field import field_png
    from orbiflow.figures.tilings import overlay_png, tiling_png
    from orbiflow.figures.window import default_window

_FILES = {
    "classes": ("classes_png",),
    "field": ("field_png",),
    "tilings": ("overlay_png", "tiling_png"),
    "window": ("default_window",),
}
_HOMES = {name: f"orbiflow.figures.{file}" for file, names in _FILES.items() for name in names}

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


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'orbiflow.figures' has no attribute {name!r}")
