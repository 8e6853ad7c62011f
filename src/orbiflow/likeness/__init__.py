"""How much a tile is like a silhouette: overlap, recognisability, and the order of a list."""

from orbiflow.likeness.metrics import (
    Region,
    Shape,
    ShapeMetrics,
    as_region,
    compare,
    dice,
    hausdorff,
    iou,
    pixel_accuracy,
)
from orbiflow.likeness.overlap import Overlap, region_of
from orbiflow.likeness.ranking import diverse, rank_score, tile_similarity
from orbiflow.likeness.recognition import Recognisability, Recogniser, recognisability

__all__ = [
    "Overlap",
    "Recognisability",
    "Recogniser",
    "Region",
    "Shape",
    "ShapeMetrics",
    "as_region",
    "compare",
    "dice",
    "diverse",
    "hausdorff",
    "iou",
    "pixel_accuracy",
    "rank_score",
    "recognisability",
    "region_of",
    "tile_similarity",
]
