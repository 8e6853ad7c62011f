"""The search for likeness: its settings, its levels of effort, and how it searches."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from math import lcm
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.runtime import NEVER, Cancel
from orbiflow.settings import Count, Range, Seed, Settings
from orbiflow.tiles.likeness import least_neck
from orbiflow.tiles.search.bending import fit_bending
from orbiflow.tiles.search.candidates import ClassFinalists, OnProgress, silent
from orbiflow.tiles.search.co_deformation import Orientation, orientations
from orbiflow.tiles.search.search_method import Goal, SearchMethod
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import IsohedralClass

Body = Literal["soft", "firm", "stiff"]

# Settings of the preview; a soft body crosses itself least often, and one takes half as long as two
SKETCH: dict[str, Any] = {
    "phases": 1,
    "placements": 60,
    "held": 6,
    "starts": 2,
    "share": 0.1,
    "finalists": 2,
    "carved": 0,
    "bodies": ("soft",),
}
# The number of phases of each level of effort: the first in all classes, more in the promising ones
EFFORTS = {"fast": 1, "normal": 2}
PROMISING = 0.5  # marks behind the best class up to which a class is searched in more phases
GOLDEN = (5**0.5 - 1) / 2  # successive multiples, modulo 1, lie far from each other
# Widths, in lengths of the silhouette, below which parts are rounded off in classes without a tile
ROUNDED_SHARES = (0.02, 0.04)
HALVED_SETTINGS = ("placements", "held", "starts")  # in a search for symmetric tiles


@lru_cache(maxsize=4)  # targets hash by identity; one serves all classes
def rounded_off(target: Target, share: float) -> Target:
    """Return a silhouette without what is narrower than a share of its length, or as it is."""
    try:
        return target.smoothed(share)
    except OrbiflowError:  # nothing would be left
        return target


def rounded_goals(goals: Sequence[Goal]) -> Iterator[tuple[float, list[Goal]]]:
    """Yield silhouettes and, without emphasis and pins, them with ever more rounded off.

    Each comes after the share of their lengths below which parts are rounded off.
    """
    yield 0.0, list(goals)
    if all(goal.emphasis is None and goal.pins is None for goal in goals):
        for share in ROUNDED_SHARES:
            yield share, [replace(goal, target=rounded_off(goal.target, share)) for goal in goals]


class LikenessSearch(Settings, SearchMethod):
    """The search for likeness; the defaults are effort "normal".

    - `phases`: how often the outline's points are laid along it anew, shifted by a part of their
      distance; each time gives other tiles, so that more effort never finds less.
    - `passed`: of these, the first that are left out, as they have been searched.
    - `placements`: ways to lay the outline along the template's edges that are tried, in a class, for
      each orientation and body.
    - `held`: of these, the best after the springs, whose energy is minimised among tiles.
    - `starts`: of all together, those of the best marks, whose corners are moved along the outline,
      step by step.
    - `share`: of all such steps that are worked out, those that look best.
    - `finalists`: of what comes of it, the best marks that are worked out with all of the outline's
      detail.
    - `rounds`: steps of the minimisation for finalists.
    - `carved`: of these, the best that are moved to the highest mark among the tiles of their
      placements; none where a user says which parts matter.
    - `bodies`: how stiff the silhouette is, from soft to stiff; each is searched.
    - `multiples`: points of a tile for each point of the search, the first that holds the corners.
    - `min_neck`: width of necks below which a tile's score falls, in square roots of the area; if
      above 0, a part of the silhouette's own narrowest if more, see `likeness.thinnest.least_neck`.
    - `seed`: moves the outline's points.
    """

    objective: ClassVar[str] = "likeness"
    takes_pins: ClassVar[bool] = True
    takes_symmetric: ClassVar[bool] = True
    efforts: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        effort: {"phases": phases} for effort, phases in EFFORTS.items()
    }

    phases: Count = EFFORTS["normal"]
    passed: Annotated[int, Range(0)] = 0
    placements: Count = 80
    held: Count = 10
    starts: Count = 6
    share: Annotated[float, Range(above=0, most=1)] = 0.15
    finalists: Count = 2
    rounds: Count = 10
    carved: Annotated[int, Range(0)] = 2
    bodies: tuple[Body, ...] = ("soft", "firm", "stiff")
    multiples: tuple[Count, ...] = (4, 6)
    min_neck: Annotated[float, Range(0, 0.2)] = 0.01
    seed: Seed = 0

    def check(self) -> None:
        super().check()
        if self.passed >= self.phases:
            raise SettingError(
                f"passed {self.passed} of {self.phases} phases leaves none to search; choose fewer"
            )

    def fit(
        self, goal: Goal, kind: IsohedralClass, per_class: int, progress: OnProgress, cancel: Cancel
    ) -> ClassFinalists:
        """Let the silhouette bend into tiles of the class."""
        phases = range(self.passed, self.phases)
        both = (self.orientations(goal, kind.divisor, phase) for phase in phases)
        return fit_bending(goal, kind, self, both, len(phases), per_class, progress, cancel)

    def sketch(self, goal: Goal, kind: IsohedralClass, cancel: Cancel = NEVER) -> ClassFinalists:
        """Let the silhouette bend in haste."""
        plain_goal = replace(goal, has_rounder=False)  # of few shapes, most may cross
        return replace(self, passed=0, **SKETCH).fit(plain_goal, kind, 1, silent, cancel)

    def goals(self, goal: Goal) -> Sequence[tuple[float, Goal]]:
        """Return the silhouette and, without emphasis and pins, it with thin parts rounded off."""
        goals = [(share, rounded) for share, (rounded,) in rounded_goals([goal])]
        return [(share, replace(goal, has_rounder=True)) for share, goal in goals[:-1]] + goals[-1:]

    def prepare(self, goal: Goal) -> None:
        """Triangulate the silhouette and its mirror image, as the first phase has them."""
        self.orientations(goal, phase=self.passed)

    def orientations(
        self, goal: Goal, divisor: int = 1, phase: int = 0
    ) -> tuple[Orientation, Orientation]:
        """Return the silhouette and its mirror image, with a multiple of `divisor` points."""
        first = float(np.random.default_rng(self.seed).random()) if self.seed else 0.0
        return orientations(
            goal.target,
            self.multiples,
            (first + phase * GOLDEN) % 1.0,
            emphasis=goal.emphasis,
            pins=goal.pins,
            step=lcm(divisor, 6),
        )

    def least_neck(self, goal: Goal) -> float:
        """Return `min_neck`, or a part of the silhouette's own narrowest neck."""
        return least_neck(goal.target.normal, self.min_neck)

    def of_class(self, wanted: int = 1, *, symmetric: bool = False) -> LikenessSearch:
        """Return the search in a class of which so many tiles are `wanted`.

        It has twice as many starts as finalists at least, where more are wanted. For symmetric tiles,
        which have half the freedom, half as much is tried.

        >>> LikenessSearch(starts=8).of_class(symmetric=True).starts
        4
        """
        search = self
        if symmetric:
            search = replace(
                search, **{name: -(-getattr(search, name) // 2) for name in HALVED_SETTINGS}
            )
        if search.finalists < wanted:
            search = replace(search, finalists=wanted, starts=max(search.starts, 2 * wanted))
        return replace(search, carved=max(search.carved, wanted)) if search.carved else search

    def levels(self) -> Sequence[tuple[float, SearchMethod]]:
        """Return the phases of each level of effort that this one holds, and how many they are."""
        ends = sorted({*(level for level in EFFORTS.values() if level < self.phases), self.phases})
        parts = [level for level in pairwise([0, *ends]) if level[1] > self.passed]
        methods = [replace(self, passed=max(a, self.passed), phases=b) for a, b in parts]
        return [(float(level.phases - level.passed), level) for level in methods]

    def is_promising(self, tile: EscherTile, best: EscherTile) -> bool:
        """Return whether the tile is at most `PROMISING` marks behind the best one."""
        fidelity, other = tile.likeness.fidelity, best.likeness.fidelity
        return fidelity is None or other is None or fidelity.mark >= other.mark - PROMISING
