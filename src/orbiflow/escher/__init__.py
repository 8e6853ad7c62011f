"""Escherization: starts, the descent, the paper's occupancy method, the search and its results."""

from orbiflow.escher.bending_settings import BendingSettings
from orbiflow.escher.carried import Bending, CarriedTile
from orbiflow.escher.descent_settings import DescentSettings
from orbiflow.escher.fit import Fit
from orbiflow.escher.fit_descent import fit_descent
from orbiflow.escher.fit_tile import certified_tiles, fit_tile
from orbiflow.escher.methods import BothSettings
from orbiflow.escher.model import TileModel
from orbiflow.escher.occupancy import (
    OccupancySamples,
    OccupancySettings,
    fit_occupancy,
    occupancy_loss,
)
from orbiflow.escher.result import ClassFailure, TileResult
from orbiflow.escher.search import Event, escherize, escherize_class
from orbiflow.escher.storage import SavedModel, load_model, load_saved

__all__ = [
    "Bending",
    "BendingSettings",
    "BothSettings",
    "CarriedTile",
    "ClassFailure",
    "DescentSettings",
    "Event",
    "Fit",
    "OccupancySamples",
    "OccupancySettings",
    "SavedModel",
    "TileModel",
    "TileResult",
    "certified_tiles",
    "escherize",
    "escherize_class",
    "fit_descent",
    "fit_occupancy",
    "fit_tile",
    "load_model",
    "load_saved",
    "occupancy_loss",
]
