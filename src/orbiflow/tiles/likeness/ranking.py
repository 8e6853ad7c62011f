"""The score by which overlaps are listed, short lists without repeats, and stars."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import shapely
from numpy.typing import ArrayLike

from orbiflow.arguments import as_array, as_number, as_whole
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import centroid, complex_points, orient, signed_area
from orbiflow.tiles.likeness.faithful import GOOD_MARK, STEEPNESS
from orbiflow.tiles.likeness.metrics import Overlap, best_overlay

STAR_WORDS = {4.5: "excellent", 3.5: "good", 2.5: "fair", 1.0: "poor"}
"""The words, each with the least number of stars that has it."""

MOST_STARS = 5
LOWEST_MARK, HIGHEST_MARK = 3.0, 8.5  # one star, and five
OVERLAP_MARKS = (12.5, -4.8)  # the predicted mark of a tile for overlap: a line in its score


@dataclass(frozen=True)
class Rating:
    """What people would say of a tile: `stars`, 1 to 5 in halves.

    Raises `OrbiflowError` for another number.

    >>> Rating(3.5).word, str(Rating(3.5))
    ('good', '★★★½')
    """

    stars: float

    def __post_init__(self) -> None:
        as_number(self.stars, "stars", 1, MOST_STARS)
        if self.stars * 2 % 1:
            raise OrbiflowError(f"stars come in halves, got {self.stars}")

    @classmethod
    def of_mark(cls, mark: float) -> Rating:
        """Return the rating of a mark, from 0 to 10."""
        share = (mark - LOWEST_MARK) / (HIGHEST_MARK - LOWEST_MARK)
        return cls(max(1.0, min(5.0, round(2 * (1 + 4 * share)) / 2)))

    @classmethod
    def of_likeness(cls, score: float) -> Rating:
        """Return the rating of a tile by its score after a search for likeness.

        >>> [str(Rating.of_likeness(score)) for score in (0.9, 0.5, 0.1)]
        ['★★★★½', '★★★½', '★★½']
        """
        likely = min(max(score, 1e-9), 1 - 1e-9)
        return cls.of_mark(GOOD_MARK + math.log(likely / (1 - likely)) / STEEPNESS)

    @classmethod
    def of_overlap(cls, score: float) -> Rating:
        """Return the rating of a tile by its `rank_score`.

        >>> [str(Rating.of_overlap(score)) for score in (0.9, 0.8, 0.7)]
        ['★★★½', '★★½', '★½']
        """
        slope, base = OVERLAP_MARKS
        return cls.of_mark(slope * score + base)

    @property
    def word(self) -> str:
        """The same in a word: excellent, good, fair or poor."""
        return next(word for least, word in STAR_WORDS.items() if self.stars >= least)

    def __str__(self) -> str:
        return "★" * int(self.stars) + "½" * (self.stars % 1 > 0)


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
