"""Stars and a word for the tiles of a run: what people would say of them.

Scores order a silhouette's tiles, but the same score means more for a spider than for a fish. So a
tile's mark is foretold, as judges who saw a silhouette's tiles side by side would give it. The mark of
the best tile comes from its score and from how long the silhouette's outline is, the marks of the
others from how far they fall behind it. docs/likeness.md has the evidence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from orbiflow.arguments import as_number
from orbiflow.errors import OrbiflowError

WORDS = {4.5: "excellent", 3.5: "good", 2.5: "fair", 1.0: "poor"}
"""The words, each with the least number of stars that has it."""

MOST_STARS = 5
# The lowest and the highest mark that a tile was given: one star and five
LOWEST_MARK, HIGHEST_MARK = 1.5, 8.5
# Marks for the log odds of the best score, and for each unit of these that a tile falls behind it
BEST_WEIGHT, BEHIND_WEIGHT = 0.6, 1.4
# Marks for the logarithm of the outline's length in square roots of the area, and the lengths that
# were marked: rough outlines are longer and do not look better
LENGTH_WEIGHT, SHORTEST, LONGEST = 3.0, 5.8, 13.1


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

    @property
    def word(self) -> str:
        """The same in a word: excellent, good, fair or poor."""
        return next(word for least, word in WORDS.items() if self.stars >= least)

    def __str__(self) -> str:
        return "★" * int(self.stars) + "½" * (self.stars % 1 > 0)


def rating_of_mark(mark: float) -> Rating:
    """Return the rating of a mark, from 0 to 10.

    >>> [rating_of_mark(mark).stars for mark in (0, 1.5, 5, 8.5, 10)]
    [1.0, 1.0, 3.0, 5.0, 5.0]
    """
    share = (mark - LOWEST_MARK) / (HIGHEST_MARK - LOWEST_MARK)
    return Rating(max(1.0, min(5.0, round(2 * (1 + 4 * share)) / 2)))


def likeness_ratings(scores: Sequence[float], length: float) -> list[Rating]:
    """Return the ratings of a run's tiles by their scores after a search for likeness, 0 to 1.

    A larger score never has fewer stars. `length` is that of the silhouette's outline, in square roots
    of its area.

    >>> [str(found) for found in likeness_ratings([0.18, 0.08, 0.03], length=11)]
    ['★★★½', '★★★', '★★']
    """
    odds = [math.log(s / (1 - s)) for s in (min(max(s, 1e-9), 1 - 1e-9) for s in scores)]
    best = max(odds, default=0.0)
    limbs = LENGTH_WEIGHT * math.log(min(max(length, SHORTEST), LONGEST))
    marks = [limbs + BEST_WEIGHT * best - BEHIND_WEIGHT * (best - own) for own in odds]
    return [rating_of_mark(mark) for mark in marks]


def overlap_ratings(scores: Sequence[float]) -> list[Rating]:
    """Return the ratings of tiles by their scores after a search for overlap, 0 to 1."""
    return [rating_of_mark(10 * score - 1) for score in scores]
