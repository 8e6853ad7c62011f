"""The ranking of tiles, and a short list of the best tiles without repeats."""

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike

from orbiflow.arguments import number, whole
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.likeness.metrics import Shape, as_region

IOU_WEIGHT = 0.25
OTHER_CLASS_FACTOR = 0.5  # how alike two equal tiles of different classes are
TWIN_SIMILARITY = 0.97
VARIETY_WEIGHT = 0.1

Similarity = Callable[[int, int], float]
"""A symmetric function of two candidates' indices: how alike they are, 0 to 1."""


def rank_score(iou: float, recognisability: float) -> float:
    """Return the score of a tile, 0 to 1: the geometric mean of both, IoU with weight 1/4.

    A geometric mean compares ratios, so it does not matter that IoU varies little between tiles (a
    blob without limbs has nine tenths of the best tile's) and recognisability much; and a tile
    needs some of both. With more weight on IoU blobs win; with none, a tile may lie beside its
    target. docs/recognisability.md has the numbers.

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
    twin: float = TWIN_SIMILARITY,
    variety: float = VARIETY_WEIGHT,
) -> list[int]:
    """Choose up to `count` good candidates that differ from each other, the best first.

    This is maximal marginal relevance (Carbonell, Goldstein, 1998): the first candidate has the
    largest score, each next one the largest score minus `variety` times its largest similarity to a
    chosen one. Candidates with a similarity above `twin` to a chosen one are left out, so there may
    be fewer than `count`.

    Args:
        scores: The scores (n,), larger is better; of equal ones the earlier comes first.
        count: The largest number of candidates, at least 1.
        similarity: The similarity of a candidate and a chosen one, called once for each pair.
        twin: The largest similarity, 0 to 1; with 1 nothing is left out.
        variety: The weight of similarity, at least 0, in the unit of the scores.

    Returns:
        Indices of `scores`, in the order of choice.

    Raises:
        OrbiflowError: for scores that are not finite numbers, and for arguments out of range.

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
    """Return the similarity of tiles, for `diverse`: their IoU, halved if the classes differ.

    So tiles are twins only within a class, and a new class is preferred to an equally good second
    tile of a class in the list.

    Args:
        tiles: The tiles (n,), rings (N, 2) or shapely polygons, in one frame.
        classes: The tiles' isohedral classes (n,).

    Raises:
        OrbiflowError: for a tile that is not a valid polygon, or if the numbers of both differ.

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
        return float(iou if classes[i] == classes[j] else OTHER_CLASS_FACTOR * iou)

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
