"""How much a tile is like a silhouette: overlap, fidelity, recognisability, and the order of a list."""

from orbiflow.likeness.faithfulness import faithfulness
from orbiflow.likeness.fidelity import Fidelity, fidelity
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
from orbiflow.likeness.overlap import Overlap, prepared_region
from orbiflow.likeness.ranking import diverse, rank_score, tile_similarity
from orbiflow.likeness.recognition import Recognisability, Recogniser, recognisability
from orbiflow.likeness.thinnest import (
    Thinnest,
    hair_share,
    narrowest_neck,
    narrowest_slit,
    slit_share,
)

__all__ = [
    "Fidelity",
    "Overlap",
    "Recognisability",
    "Recogniser",
    "Region",
    "Shape",
    "ShapeMetrics",
    "Thinnest",
    "as_region",
    "compare",
    "dice",
    "diverse",
    "faithfulness",
    "fidelity",
    "hair_share",
    "hausdorff",
    "iou",
    "narrowest_neck",
    "narrowest_slit",
    "pixel_accuracy",
    "prepared_region",
    "rank_score",
    "recognisability",
    "slit_share",
    "tile_similarity",
]
