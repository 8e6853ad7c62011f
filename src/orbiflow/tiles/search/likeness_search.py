"""The search for likeness: its settings, its levels of effort, and how it searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from math import lcm
from typing import Annotated, Any, ClassVar, Literal

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import NEVER, Cancel
from orbiflow.settings import Count, Range, Seed, Settings
from orbiflow.tiles.likeness import least_neck
from orbiflow.tiles.search.bending import fit_bending
from orbiflow.tiles.search.candidates import Fit, OnProgress, silent
from orbiflow.tiles.search.co_deformation import Orientation, orientations
from orbiflow.tiles.search.search_method import Goal, SearchMethod, Sketches
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tilings import IsohedralClass

Body = Literal["soft", "firm", "stiff", "rigid"]
ALL_BODIES: tuple[Body, ...] = ("soft", "firm", "stiff")

# Settings of the preview; a soft body crosses itself least often, and one takes half as long as two
SKETCH = {
    "placements": 60,
    "held": 6,
    "starts": 2,
    "share": 0.1,
    "finalists": 2,
    "rounds": 10,
    "carved": 0,
    "bodies": ("soft",),
    "judged": False,
}

FAST = {
    "placements": 80,
    "held": 10,
    "starts": 4,
    "share": 0.15,
    "finalists": 2,
    "rounds": 10,
    "bodies": ALL_BODIES,
}
BEST = {
    "placements": 400,
    "held": 80,
    "starts": 40,
    "share": 0.4,
    "finalists": 8,
    "carved": 6,
    "bodies": (*ALL_BODIES, "rigid"),
    "judged": True,
}
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


class LikenessSearch(Settings, SearchMethod):
    """The search for likeness; the defaults are effort "normal" without the levels below.

    - `placements`: ways to lay the outline along the template's edges that are tried, a class.
    - `held`: of these, the best after the springs, whose energy is minimised among tiles.
    - `starts`: of these, the best whose corners are moved along the outline, step by step.
    - `share`: of all such steps that are worked out, those that look best.
    - `finalists`: of what comes of it, the best that are worked out with all of the outline's detail,
      a class and orientation.
    - `rounds`: steps of the minimisation for finalists.
    - `carved`: of these, the best of a class that are moved to the highest mark among the tiles of
      their placements; none where a user says which parts matter.
    - `judged`: whether finalists are chosen, and their corners moved, by the mark that people would
      give rather than by what bending costs; not where hairs need all of the outline's points.
    - `bodies`: how stiff the silhouette is, from soft to rigid; each is searched.
    - `below`: levels of effort below that are searched, too, so that more effort never finds less.
    - `multiples`: points of a tile for each point of the search, the first that holds the corners.
    - `min_neck`: width of necks below which a tile's score falls, in square roots of the area; if
      above 0, a part of the silhouette's own narrowest if more, see `likeness.thinnest.least_neck`.
    - `seed`: moves the outline's points.
    """

    objective: ClassVar[str] = "likeness"
    takes_pins: ClassVar[bool] = True
    takes_symmetric: ClassVar[bool] = True
    efforts: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "fast": FAST,
        "normal": {"below": 1},
        "best": {**BEST, "below": 2},
    }

    placements: Count = 200
    held: Count = 32
    starts: Count = 12
    share: Annotated[float, Range(above=0, most=1)] = 0.2
    finalists: Count = 4
    rounds: Count = 20
    carved: Annotated[int, Range(0)] = 1
    judged: bool = False
    bodies: tuple[Body, ...] = ("firm", "stiff")
    below: Annotated[int, Range(0, 2)] = 0
    multiples: tuple[Count, ...] = (4, 6)
    min_neck: Annotated[float, Range(0, 0.2)] = 0.01
    seed: Seed = 0

    def fit(
        self, goal: Goal, kind: IsohedralClass, per_class: int, progress: OnProgress, cancel: Cancel
    ) -> Fit:
        """Let the silhouette bend into tiles of the class."""
        both = self.orientations(goal, kind.divisor)
        return fit_bending(goal.target, kind, self, both, per_class, progress, cancel)

    def sketch(self, goal: Goal, kind: IsohedralClass, cancel: Cancel = NEVER) -> Fit:
        """Let the silhouette bend in haste."""
        quick = replace(self, below=0, **SKETCH)
        both = self.orientations(goal, kind.divisor)
        return fit_bending(goal.target, kind, quick, both, 1, silent, cancel)

    def goals(self, goal: Goal) -> Sequence[tuple[float, Goal]]:
        """Return the silhouette and, without emphasis and pins, it with thin parts rounded off."""
        if goal.emphasis is not None or goal.pins is not None:
            return [(0.0, goal)]
        rounded = [(share, Goal(rounded_off(goal.target, share))) for share in ROUNDED_SHARES]
        return [(0.0, goal), *rounded]

    def prepare(self, goal: Goal) -> None:
        """Triangulate the silhouette and its mirror image."""
        self.orientations(goal)

    def orientations(self, goal: Goal, divisor: int = 1) -> tuple[Orientation, Orientation]:
        """Return the silhouette and its mirror image, with a multiple of `divisor` points."""
        step = lcm(divisor, 6)
        return orientations(goal.target, self, emphasis=goal.emphasis, pins=goal.pins, step=step)

    def least_neck(self, goal: Goal) -> float:
        """Return `min_neck`, or a part of the silhouette's own narrowest neck."""
        return least_neck(goal.target.normal, self.min_neck)

    def searches(self, wanted: int = 1, *, symmetric: bool = False) -> tuple[LikenessSearch, ...]:
        """Return the levels below, least first, and this one, with so many finalists `wanted`.

        Each has twice as many starts as finalists at least, where more are wanted. For symmetric tiles,
        which have half the freedom, half as much is tried.

        >>> [own.starts for own in LikenessSearch.for_effort("best").searches()]
        [4, 12, 40]
        >>> [own.starts for own in LikenessSearch.for_effort("best").searches(symmetric=True)]
        [2, 6, 20]
        """
        found: list[LikenessSearch] = []
        for own in self._alone():
            if symmetric:
                fewer = {name: -(-getattr(own, name) // 2) for name in HALVED_SETTINGS}
                own = replace(own, **fewer)
            if own.finalists < wanted:
                own = replace(own, finalists=wanted, starts=max(own.starts, 2 * wanted))
            found.append(own)
        return tuple(found)

    def _alone(self) -> list[LikenessSearch]:
        """Return the levels below, least first, and this one, each without those below it."""
        normal = {name: getattr(LikenessSearch, name) for name in {**FAST, **BEST}}
        below: list[dict[str, Any]] = [{**normal, **FAST}, normal][: self.below]
        return [replace(self, below=0, **own) for own in (*below, {})]

    def levels(self) -> Sequence[tuple[float, SearchMethod]]:
        """Return the sketch, the levels of effort below, and what this one has beyond them."""
        alone = self._alone()
        work = [float(own.starts * len(own.bodies)) for own in alone]
        shares = [0.9 * own / sum(work) for own in work]
        return [(0.1, Sketches(self)), *zip(shares, alone, strict=True)]
