"""Knobs of the search for likeness, and its levels of effort."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from orbiflow.errors import OrbiflowError
from orbiflow.escher.efforts import settings_for


@dataclass(frozen=True)
class BendingSettings:
    """Knobs of the search by co-deformation; the defaults are effort "normal" without what is below.

    - `placements`: ways to lay the outline along the template's edges that are tried, a class.
    - `held`: of these, the best after the springs, whose energy is minimised among tiles.
    - `starts`: of these, the best whose corners are moved along the outline, step by step.
    - `share`: of all such steps that are worked out, those that look best.
    - `finalists`: of what comes of it, the best that are worked out with all of the outline's detail,
      a class and hand.
    - `rounds`: steps of the minimisation for finalists.
    - `below`: levels of effort below that are searched, too, so that more effort never finds less.
    - `multiples`: points of a tile for each point of the search, the first that holds the corners.
    - `min_neck`: width of necks below which a tile's score falls, in square roots of the area; if
      above 0, a part of the silhouette's own narrowest if more, see `likeness.thinnest.least_neck`.
    - `seed`: moves the outline's points.
    """

    placements: int = 300
    held: int = 80
    starts: int = 32
    share: float = 0.3
    finalists: int = 5
    rounds: int = 20
    below: int = 0
    multiples: tuple[int, ...] = (4, 6)
    min_neck: float = 0.01
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("placements", "held", "starts", "finalists", "rounds"):
            if getattr(self, name) < 1:
                raise OrbiflowError(f"{name} must be at least 1, got {getattr(self, name)}")
        if not 0 < self.share <= 1:
            raise OrbiflowError(f"share must be above 0, at most 1, got {self.share}")
        if not 0 <= self.below <= 2:
            raise OrbiflowError(f"below must be 0, 1 or 2, got {self.below}")
        if not self.multiples or min(self.multiples) < 1:
            raise OrbiflowError(f"multiples must be at least 1, got {self.multiples}")
        if not 0 <= self.min_neck <= 0.2:
            raise OrbiflowError(f"min_neck must be from 0 to 0.2, got {self.min_neck}")
        if not 0 <= self.seed < 2**32:
            raise OrbiflowError(f"seed must be from 0 to 2^32 - 1, got {self.seed}")

    @classmethod
    def for_effort(cls, effort: str, **changes: Any) -> BendingSettings:
        """The settings of a level of effort: "fast", "normal" or "best".

        >>> BendingSettings.for_effort("fast", seed=3).seed
        3
        """
        return settings_for(cls, EFFORTS, effort, changes)

    def searches(self, wanted: int = 1) -> tuple[BendingSettings, ...]:
        """Those of the levels below, least first, and these: none with levels below.

        Args:
            wanted: finalists at least, for which each gets twice as many starts at least.

        >>> [own.starts for own in BendingSettings.for_effort("best").searches()]
        [8, 32, 128]
        """
        below = (FAST, NORMAL)[: self.below]
        each = [replace(self, below=0, **changes) for changes in (*below, {})]
        return tuple(own if own.finalists >= wanted else own._with(wanted) for own in each)

    def _with(self, finalists: int) -> BendingSettings:
        return replace(self, finalists=finalists, starts=max(self.starts, 2 * finalists))


FAST = {
    "placements": 80,
    "held": 20,
    "starts": 8,
    "share": 0.15,
    "finalists": 2,
    "rounds": 12,
}
NORMAL = {name: getattr(BendingSettings(), name) for name in FAST}
BEST = {
    "placements": 1500,
    "held": 300,
    "starts": 128,
    "share": 1.0,
    "finalists": 12,
    "rounds": 40,
}

EFFORTS: dict[str, dict[str, Any]] = {
    "fast": FAST,
    "normal": {**NORMAL, "below": 1},
    "best": {**BEST, "below": 2},
}
"""What each level changes."""
