"""Escherization: targets, the occupancy method, metrics and results."""

from orbiflow.escher.descent_settings import DescentSettings
from orbiflow.escher.emphasis import Emphasis
from orbiflow.escher.fit import Fit
from orbiflow.escher.fit_descent import fit_descent
from orbiflow.escher.metrics import ShapeMetrics, compare, dice, hausdorff, iou, pixel_accuracy
from orbiflow.escher.model import TileModel
from orbiflow.escher.occupancy import (
    OccupancySamples,
    OccupancySettings,
    fit_occupancy,
    occupancy_loss,
)
from orbiflow.escher.result import ClassFailure, TileResult
from orbiflow.escher.search import Event, escherize, escherize_class
from orbiflow.escher.signed_distance import signed_distance
from orbiflow.escher.storage import SavedModel, load_model
from orbiflow.escher.target import Target

__all__ = [
    "ClassFailure",
    "DescentSettings",
    "Emphasis",
    "Event",
    "Fit",
    "OccupancySamples",
    "OccupancySettings",
    "SavedModel",
    "ShapeMetrics",
    "Target",
    "TileModel",
    "TileResult",
    "compare",
    "dice",
    "escherize",
    "escherize_class",
    "fit_descent",
    "fit_occupancy",
    "hausdorff",
    "iou",
    "load_model",
    "occupancy_loss",
    "pixel_accuracy",
    "signed_distance",
]
