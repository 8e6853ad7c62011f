"""The score by which overlaps are listed, and short lists without repeats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import shapely
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.settings import as_array, as_number, as_whole
from orbiflow.tiles.geometry import centroid, complex_points, orient, signed_area
from orbiflow.tiles.likeness.metrics import Overlap, best_overlay

IOU_WEIGHT = 0.25
TWIN_SIMILARITY = 0.97
VARIETY_WEIGHT = 0.1

# A symmetric function of two candidates' indices: how alike they are, 0 to 1
Similarity = Callable[[int, int], float]

MAX_IOU_GAIN = 0.15  # the largest gain in IoU that is expected from a better overlay of two tiles


def mutual_iou(tiles: Sequence[Array], decisive: float = 0.9) -> Similarity:
    """Return the mutual IoU of tiles (N, 2) over one silhouette by their indices, for `diverse`.

    A better overlay is searched only where it can matter: for pairs whose IoU, with equal areas and
    centroids, is at most `MAX_IOU_GAIN` below `decisive`, with which it is compared.
    """
    rings: list[Array] = []
    for tile in tiles:
        ring = orient(np.asarray(tile, dtype=np.float64))
        rings.append((ring - centroid(ring)) / np.sqrt(signed_area(ring)))

    @cache
    def region(index: int) -> Overlap:
        return Overlap(rings[index])

    @cache
    def alike(i: int, j: int) -> float:
        shared = shapely.Polygon(rings[i]).intersection(shapely.Polygon(rings[j])).area
        plain = float(min(shared / (2 - shared), 1.0))
        if not decisive - MAX_IOU_GAIN <= plain < decisive:
            return plain
        return max(plain, best_overlay(complex_points(rings[i]), region(j))[2])

    return lambda i, j: alike(min(i, j), max(i, j))


ENOUGH_MIXED, UNMIXED_COST = 0.6, 0.2


def mixing_factor(mixed: float) -> float:
    """Return what is left of the score of several figures where `mixed` of all boundaries part them.

    It falls where copies of one figure lie side by side in bands, which the eye takes for one.

    >>> mixing_factor(0.8), mixing_factor(0.0)
    (1.0, 0.8)
    """
    return 1 - UNMIXED_COST * max(0.0, 1 - mixed / ENOUGH_MIXED)


def rank_score(iou: float, recognisability: float) -> float:
    """Return the score of a tile, 0 to 1: the geometric mean of both, IoU with weight 1/4.

    A geometric mean compares ratios, so it does not matter that IoU varies little between tiles (a
    blob without limbs has nine tenths of the best tile's) and recognisability much; and a tile needs
    some of both. With more weight on IoU blobs win; with none, a tile may lie beside its target.
    docs/recognisability.md has the numbers.

    Raises `OrbiflowError` for a value outside [0, 1].

    >>> rank_score(0.72, 0.55) < rank_score(0.65, 0.74)
    True
    """
    for name, value in (("iou", iou), ("recognisability", recognisability)):
        as_number(value, name, 0, 1)
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
    chosen one. Candidates with a similarity above `twin` to a chosen one are left out. Returns
    indices of `scores` (n,), in the order of choice; of equal ones the earlier comes first.

    >>> position = [0.0, 0.01, 0.5, 1.0]
    >>> diverse([0.9, 0.89, 0.8, 0.81], 3, lambda i, j: 1 - abs(position[i] - position[j]))
    [0, 3, 2]
    """
    values = as_array(scores, "scores", ("n",))
    as_whole(count, "count", 1)
    as_number(twin, "twin", 0, 1)
    as_number(variety, "variety", 0)
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
