"""The silhouette that a tile is to look like: reading it, its frame, what matters in it."""

from orbiflow.silhouette.emphasis import Emphasis
from orbiflow.silhouette.frame import Frame
from orbiflow.silhouette.pins import Pins
from orbiflow.silhouette.readers import Reading, read_outline
from orbiflow.silhouette.signed_distance import signed_distance
from orbiflow.silhouette.soft_target import SoftTarget
from orbiflow.silhouette.target import Target

__all__ = [
    "Emphasis",
    "Frame",
    "Pins",
    "Reading",
    "SoftTarget",
    "Target",
    "read_outline",
    "signed_distance",
]
