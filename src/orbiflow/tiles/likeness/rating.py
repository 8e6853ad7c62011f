"""Stars: what people would say of a tile."""

from __future__ import annotations

import math
from dataclasses import dataclass

from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_number
from orbiflow.tiles.likeness.faithful import GOOD_MARK, STEEPNESS

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

    def of_share(self, share: float) -> Rating:
        """Return the rating of a tile that is like so much of the silhouette alone.

        >>> [str(Rating(5).of_share(share)) for share in (0.98, 0.6, 0.1)]
        ['★★★★★', '★★★', '★']
        """
        return Rating(max(1.0, round(2 * self.stars * share) / 2))

    @property
    def word(self) -> str:
        """The same in a word: excellent, good, fair or poor."""
        return next(word for least, word in STAR_WORDS.items() if self.stars >= least)

    def __str__(self) -> str:
        return "★" * int(self.stars) + "½" * (self.stars % 1 > 0)
