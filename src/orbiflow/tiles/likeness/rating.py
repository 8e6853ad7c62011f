"""Stars and a word for the tiles of a run: what people would say of them.

Scores order a silhouette's tiles, but the same score means more for a spider than for a fish. So a
tile's mark is foretold, as judges gave it who saw a silhouette's tiles side by side: from the score of
the run's best tile, from how far a tile falls behind it, and from how long the silhouette's outline is.
docs/likeness.md has the evidence.
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
LOWEST_MARK, HIGHEST_MARK = 1.5, 8.5  # the extremes that judges gave: one star, and five
# Marks for the best score's log odds, for each unit of these that a tile falls behind it, and for the
# logarithm of the outline's length in square roots of the area
BEST_WEIGHT, BEHIND_WEIGHT, LENGTH_WEIGHT = 0.6, 1.4, 3.0
SHORTEST, LONGEST = 5.8, 13.1  # lengths that were marked: rougher outlines look no better


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

    @property
    def word(self) -> str:
        """The same in a word: excellent, good, fair or poor."""
        return next(word for least, word in WORDS.items() if self.stars >= least)

    def __str__(self) -> str:
        return "★" * int(self.stars) + "½" * (self.stars % 1 > 0)


def likeness_ratings(scores: Sequence[float], length: float) -> list[Rating]:
    """Return the ratings of a run's tiles by their scores after a search for likeness.

    A larger score never has fewer stars. `length` is that of the silhouette's outline, in square roots
    of its area.

    >>> [str(found) for found in likeness_ratings([0.18, 0.08, 0.03], length=11)]
    ['★★★½', '★★★', '★★']
    """
    odds = [math.log(s / (1 - s)) for s in (min(max(s, 1e-9), 1 - 1e-9) for s in scores)]
    best = max(odds, default=0.0)
    top = LENGTH_WEIGHT * math.log(min(max(length, SHORTEST), LONGEST)) + BEST_WEIGHT * best
    return [Rating.of_mark(top - BEHIND_WEIGHT * (best - own)) for own in odds]
