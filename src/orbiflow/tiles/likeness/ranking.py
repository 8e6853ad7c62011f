"""The order in which tiles are shown, and a short list of the best without repeats."""

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike

from orbiflow.arguments import number, whole
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.likeness.metrics import Shape, as_region

IOU_WEIGHT = 0.25
OTHER_CLASS = 0.5  # how alike two equal tiles of different classes are
TWIN = 0.97
VARIETY = 0.1

Similarity = Callable[[int, int], float]
"""How alike two candidates are, from their indices: 0 to 1, the same in both orders."""


def rank_score(iou: float, recognisability: float) -> float:
    """Return what tiles are ranked by, 0 to 1: the geometric mean of both, IoU with weight 1/4.

    A geometric mean compares ratios, so it does not matter that IoU moves little from tile to tile
    (a blob without limbs has nine tenths of the best tile's) and recognisability much; and what has
    nothing of one of them has nothing. With more weight, IoU brings the blobs back; with none, a
    tile may lie beside its target. docs/recognisability.md has the numbers.

    Raises `OrbiflowError` for a value outside [0, 1].

    >>> rank_score(0.72, 0.55) < rank_score(0.65, 0.74)
    True
    """
    for name, value in (("iou", iou), ("recognisability", recognisability)):
        number(value, name, 0, 1)
    return float(iou**IOU_WEIGHT * recognisability ** (1 - IOU_WEIGHT))


def diverse(
    scores: ArrayLike,
    count: int,
    similarity: Similarity,
    *,
    twin: float = TWIN,
    variety: float = VARIETY,
) -> list[int]:
    """Choose up to `count` good candidates that differ from each other, the best first.

    Maximal marginal relevance (Carbonell, Goldstein, 1998): first the candidate with the largest
    score, then again and again the one with the largest score minus `variety` times its similarity
    to the most alike of those already chosen. Candidates whose similarity to a chosen one is above
    `twin` are left out, so there may be fewer than `count`.

    Args:
        scores: (n,), larger is better; of equal ones the earlier comes first.
        count: at least 1.
        similarity: asked only about a candidate and a chosen one, once for each such pair.
        twin: 0 to 1; at 1 nothing is left out.
        variety: at least 0, in the unit of the scores; at 0 only twins matter.

    Returns:
        Indices into `scores`, in the order of choice.

    Raises:
        OrbiflowError: for scores that are not finite numbers and for arguments out of range.

    >>> position = [0.0, 0.01, 0.5, 1.0]
    >>> diverse([0.9, 0.89, 0.8, 0.81], 3, lambda i, j: 1 - abs(position[i] - position[j]))
    [0, 3, 2]
    """
    values = _check(scores, count, twin, variety)
    nearest = np.zeros(len(values))
    left = np.ones(len(values), dtype=bool)
    chosen: list[int] = []
    while left.any() and len(chosen) < count:
        best = int(np.argmax(np.where(left, values - variety * nearest, -np.inf)))
        chosen.append(best)
        left[best] = False
        for other in np.flatnonzero(left):
            nearest[other] = max(nearest[other], similarity(int(other), best))
        left &= nearest <= twin
    return chosen


def tile_similarity(tiles: Sequence[Shape], classes: Sequence[str]) -> Similarity:
    """Return how alike tiles are, for `diverse`: their mutual IoU, half of it if the classes differ.

    So tiles are twins only within a class, and a class that is not yet in the list has the better
    of an equally good second tile of one that is.

    Args:
        tiles: (n,) rings (N, 2) or shapely polygons, in one frame.
        classes: (n,), the tiles' isohedral classes.

    Raises:
        OrbiflowError: for a tile that is not a valid polygon, or numbers of both that differ.

    >>> square, flat = [[0, 0], [2, 0], [2, 2], [0, 2]], [[0, 0], [2, 0], [2, 1], [0, 1]]
    >>> alike = tile_similarity([square, flat, flat], ["IH1", "IH1", "IH4"])
    >>> alike(0, 1), alike(0, 2), alike(1, 2)
    (0.5, 0.25, 0.5)
    """
    if len(tiles) != len(classes):
        raise OrbiflowError(f"{len(tiles)} tiles but {len(classes)} classes: one class for each")
    regions = [as_region(tile, f"tile {k}") for k, tile in enumerate(tiles)]
    areas = [region.area for region in regions]

    def alike(i: int, j: int) -> float:
        shared = shapely.intersection(regions[i], regions[j]).area
        iou = min(shared / (areas[i] + areas[j] - shared), 1.0)
        return float(iou if classes[i] == classes[j] else OTHER_CLASS * iou)

    return alike


def _check(scores: ArrayLike, count: int, twin: float, variety: float) -> Array:
    try:
        values = np.asarray(scores, dtype=np.float64)
    except (TypeError, ValueError) as exc:
        raise OrbiflowError("scores: give a list of numbers") from exc
    if values.ndim != 1 or not np.isfinite(values).all():
        raise OrbiflowError(f"scores: needs (n,) finite numbers, got shape {values.shape}")
    whole(count, "count", 1)
    number(twin, "twin", 0, 1)
    number(variety, "variety", 0)
    return values
