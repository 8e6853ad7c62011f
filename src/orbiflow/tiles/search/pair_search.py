"""The search for two silhouettes in one tiling: glue them, then search as for one (design point 21)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Annotated, Any, ClassVar

import numpy as np

from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.runtime import NEVER, Cancel, Sink, Team, ignore
from orbiflow.settings import Count, Range, Seed, Settings, as_choice
from orbiflow.tiles.likeness import least_neck
from orbiflow.tiles.search.bending import unlike
from orbiflow.tiles.search.glued_body import MULTIPLES, Couple, Stiff, glued_body
from orbiflow.tiles.search.gluing import Placement, glues, placements
from orbiflow.tiles.search.pairs import BentPair, bent, carved_pair, finer, moved
from orbiflow.tiles.search.search_method import Goal
from orbiflow.tiles.tilings import CLASSES, IsohedralClass, isohedral_class

FIRST_STEPS, LAST_STEPS = 25, 60  # of carving, with half of the points and with all
PINNED_STIFFNESS = 30.0  # how much stiffer than the rest are parts that a user pins
MORE_POINTS = (1.0, 1.25, 1.5, 2.0)  # times as many, until outlines do not cross themselves

# Settings of the first look
LOOK: dict[str, Any] = {
    "ratios": 1,
    "glues": 40,
    "placed": 300,
    "per_glue": 6,
    "held": 25,
    "starts": 12,
    "carved": 6,
}
PairSink = Callable[[str, list[BentPair]], object]
"""Is called with each stage's name and its certified pairs, best first."""


class PairSearch(Settings):
    """The search for pairs; the defaults are effort "normal".

    - `ratio`: the least and largest area of the second figure over the first, as they are before both
      bend.
    - `ratios`: how many such ratios are tried.
    - `points`: points of both outlines together, on the first of three levels; more if they would cross
      themselves.
    - `glues`: paths that both outlines may share that are placed, for each ratio and with the second
      figure as it is and mirrored.
    - `placed`: placements of the union's corners, of all these together, that springs draw to tiles.
    - `per_glue`: of these, the most of one glue.
    - `held`: those of each ratio and hand that are held among tiles.
    - `starts`: of all together, those that get twice the points.
    - `carved`: of these, those that are carved.
    - `ranked`: of these, the best that move their corners.
    - `finalists`: of these, the best that are carved with all points.
    - `classes`: classes of what both figures cover together.
    - `min_neck`: width of necks below which a tile's score falls, in square roots of the area.
    - `seed`: moves the outlines' points.
    - `force`: keep pairs that are not certified, too.
    - `workers`: processes that share the work; 1 stays in this one.
    """

    objective: ClassVar[str] = "likeness"
    method_name: ClassVar[str] = "pairs"
    efforts: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "fast": {
            **{"ratios": 3, "glues": 50, "placed": 1000, "per_glue": 10},
            **{"held": 36, "starts": 70, "carved": 30, "ranked": 8, "finalists": 6},
        },
        "normal": {},
    }

    ratio: tuple[Annotated[float, Range(0.1, 10)], Annotated[float, Range(0.1, 10)]] = (0.6, 1.7)
    ratios: Count = 6
    points: Annotated[int, Range(30, 200)] = 64
    glues: Count = 60
    placed: Count = 3200
    per_glue: Count = 16
    held: Count = 40
    starts: Count = 160
    carved: Count = 60
    ranked: Count = 20
    finalists: Count = 10
    classes: tuple[str, ...] = tuple(CLASSES)
    min_neck: Annotated[float, Range(0, 0.2)] = 0.01
    seed: Seed = 0
    force: bool = False
    workers: Count = 1

    @classmethod
    def for_effort(cls, effort: str, **changes: Any) -> PairSearch:
        """Return the settings of a level of effort, "fast" or "normal", with changes by name."""
        return cls(**{**cls.efforts[as_choice(effort, tuple(cls.efforts), "effort")], **changes})

    @property
    def kinds(self) -> list[IsohedralClass]:
        """The classes, of tiles without a symmetry of their own.

        Raises:
            SettingError: For others.
        """
        every = [name.strip().lower() for name in self.classes] == ["all"]
        kinds = [isohedral_class(name) for name in (CLASSES if every else self.classes)]
        if others := [other.name for other in kinds if other.name not in CLASSES]:
            raise SettingError(
                f"two figures share tiles of the nine classes {', '.join(CLASSES)}; leave "
                f"{', '.join(others)} out of {{classes}}"
            )
        return kinds

    def couples(self, goals: Sequence[Goal]) -> list[Couple]:
        """Return both silhouettes at all sizes, the second one as it is and mirrored."""
        left, right = (np.asarray(goal.target.normal) for goal in goals)
        first = float(np.random.default_rng(self.seed).random()) if self.seed else 0.0
        shared = {
            "stiff": tuple(map(_stiff, goals)),
            "phase": MULTIPLES[-1] * first,
            "min_neck": min(least_neck(goal.target.normal, self.min_neck) for goal in goals),
            "background": goals[1].is_background,
        }
        low, high = self.ratio
        ratios = _between(low, high, self.ratios)
        hands = (False,) if goals[1].is_background else (False, True)
        for more in MORE_POINTS:
            count = round(more * self.points)
            couples = [
                Couple.of(left, right, ratio=float(ratio), mirrored=hand, count=count, **shared)
                for ratio, hand in product(ratios, hands)
            ]
            with contextlib.suppress(OrbiflowError):
                for couple, level in product(couples, (0, 1, 2)):
                    couple.bodies(level)
                return couples
        raise SettingError(
            "parts of a silhouette are too thin to be followed: draw them thicker, or round them off "
            "with {smooth} 0.01"
        )


def _between(low: float, high: float, count: int) -> list[float]:
    """Return so many ratios, evenly on a scale of logarithms; of one, the middle."""
    if count == 1 or low == high:
        return [float(np.sqrt(low * high))]
    return np.geomspace(low, high, count).tolist()


def _stiff(goal: Goal) -> Stiff | None:
    """Return how stiff a silhouette is where a user says what matters."""
    emphasis, pins = goal.emphasis, goal.pins
    if pins is None:
        return None if emphasis is None else emphasis.weight
    return partial(_stiff_where_pinned, goal)


def _stiff_where_pinned(goal: Goal, points: np.ndarray) -> np.ndarray:
    factor = np.ones(len(points)) if goal.emphasis is None else goal.emphasis.weight(points)
    return factor * np.where(goal.pins is not None and goal.pins.holds(points), PINNED_STIFFNESS, 1)


def first_pair(
    goals: Sequence[Goal], settings: PairSearch, cancel: Cancel = NEVER
) -> list[BentPair]:
    """Return certified pairs of two silhouettes in some seconds, best first, if there are any."""
    few = settings.replace(**LOOK)
    return _certified(
        _rough(few, few.couples(goals), Team(__name__, few.workers, ignore, cancel))[1]
    )


def search_pair(
    goals: Sequence[Goal],
    settings: PairSearch | None = None,
    *,
    on_pairs: PairSink = lambda _stage, _pairs: None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> list[BentPair]:
    """Search for tilings of two silhouettes, of which the second may be mirrored.

    What is returned is certified, and comes by the score of the worse figure, best first. The figures
    have a mean area of 1.

    Args:
        goals: The silhouettes, and what matters in them.
        settings: How much is tried.
        on_pairs: Called with pairs that are not yet worked out, too: the stage "better".
        on_event: Called with `Progress`.
        cancel: Checked before each step.

    Raises:
        OrbiflowError: If a silhouette is too thin to be followed.
        Cancelled: If the token was cancelled.
    """
    search = settings or PairSearch()
    team = Team(__name__, search.workers, on_event, cancel)
    starts, carved = _rough(search, search.couples(goals), team)
    on_pairs("better", _certified(_ranked(carved)[: search.finalists]))
    before = dict(zip(map(id, carved), starts, strict=True))
    ranked = unlike(_ranked(carved), search.ranked, BentPair.is_twin)
    nearby = team.each(_moved, [before[id(pair)] for pair in ranked], "trying other corners", 0.9)
    last = unlike(_ranked([*ranked, *nearby]), search.finalists, BentPair.is_twin)
    done = team.each(_detailed, last, "working out all detail", 1.0)
    return [pair for pair in _ranked(done) if (search.force and pair.is_whole) or pair.certified]


def _certified(pairs: Sequence[BentPair]) -> list[BentPair]:
    return [pair for pair in _ranked(pairs) if pair.certified]


def _rough(
    settings: PairSearch, couples: Sequence[Couple], team: Team
) -> tuple[list[BentPair], list[BentPair]]:
    """Return pairs with half of the points, before they are carved and after it."""
    options = team.each(partial(_placed, settings), couples, "laying both side by side", 0.3)
    kept = sorted(placement.residual for placed in options for placement in placed)[
        : settings.placed
    ]
    best = [[p for p in placed if p.residual <= kept[-1]] for placed in options]
    jobs = list(zip(couples, best, strict=True))
    bending = team.each(partial(_bent, settings), jobs, "bending", 0.5)
    pairs = [pair for some in bending for pair in some]
    pairs.sort(key=lambda pair: pair.cost)
    middle = team.each(
        partial(finer, level=1), unlike(pairs, settings.starts, BentPair.is_twin), "refining", 0.55
    )
    middle.sort(key=lambda pair: -pair.promise)
    starts = unlike(middle, settings.carved, BentPair.is_twin)
    return starts, team.each(
        partial(carved_pair, steps=FIRST_STEPS), starts, "making both look alike", 0.75
    )


def _placed(settings: PairSearch, couple: Couple) -> list[Placement]:
    """Return placements of the best glues."""
    first, second = (body.rest[: body.size] for body in couple.bodies(0))
    steps = np.concatenate([np.roll(outline, -1) - outline for outline in (first, second)])
    unit = float((abs(steps) ** 2).mean())
    placed: list[Placement] = []
    for glued in glues(first, second, settings.glues):
        body = glued_body(couple, 0, glued.glue)
        placed += placements(body.rest[: body.size], glued, settings.kinds, unit, settings.per_glue)
    return placed


def _bent(settings: PairSearch, job: tuple[Couple, list[Placement]]) -> list[BentPair]:
    return bent(*job, settings.held)


def _moved(pair: BentPair) -> BentPair:
    return carved_pair(moved(pair), FIRST_STEPS)


def _detailed(pair: BentPair) -> BentPair:
    return carved_pair(finer(pair, 2, rounds=0), LAST_STEPS)


def _ranked(pairs: Sequence[BentPair]) -> list[BentPair]:
    """Return pairs by the worse of their scores, then by the better."""
    return sorted(pairs, key=lambda pair: pair.scores, reverse=True)
