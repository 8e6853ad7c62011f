"""Diffeomorphisms that commute with a crystallographic group.

What most people want is named here; each room names the rest of its own. Importing this package alone
loads no numerical library: a name is looked up when it is first used.

>>> import orbiflow
>>> orbiflow.isohedral_class("IH4").group_name
'p2'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from orbiflow.density import DensityEstimator, read_density
    from orbiflow.escher import (
        BendingSettings,
        DescentSettings,
        certified_tiles,
        escherize,
        fit_tile,
        load_saved,
    )
    from orbiflow.export import draw_art, load
    from orbiflow.fields import FourierField, symmetrize
    from orbiflow.flows import Flow
    from orbiflow.silhouette import Target
    from orbiflow.symmetry import CrystallographicGroup, assert_equivariant, wallpaper_group
    from orbiflow.tilings import Tile, certify, isohedral_class

__version__ = "0.1.0"

_ROOMS = {
    "density": ("DensityEstimator", "read_density"),
    "escher": (
        "BendingSettings",
        "DescentSettings",
        "certified_tiles",
        "escherize",
        "fit_tile",
        "load_saved",
    ),
    "export": ("draw_art", "load"),
    "fields": ("FourierField", "symmetrize"),
    "flows": ("Flow",),
    "silhouette": ("Target",),
    "symmetry": ("CrystallographicGroup", "assert_equivariant", "wallpaper_group"),
    "tilings": ("Tile", "certify", "isohedral_class"),
}
_HOMES = {name: f"orbiflow.{room}" for room, names in _ROOMS.items() for name in names}

__all__ = [
    "BendingSettings",
    "CrystallographicGroup",
    "DensityEstimator",
    "DescentSettings",
    "Flow",
    "FourierField",
    "Target",
    "Tile",
    "assert_equivariant",
    "certified_tiles",
    "certify",
    "draw_art",
    "escherize",
    "fit_tile",
    "isohedral_class",
    "load",
    "load_saved",
    "read_density",
    "symmetrize",
    "wallpaper_group",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'orbiflow' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
