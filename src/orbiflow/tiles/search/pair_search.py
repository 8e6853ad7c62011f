"""The search for two silhouettes in one tiling: glue them, then search as for one (design point 21)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import Annotated, Any

import numpy as np

from orbiflow.runtime import (
    NEVER,
    Cancel,
    Progress,
    Sink,
    ignore,
    one_blas_thread,
    one_thread,
    process_context,
    work,
)
from orbiflow.settings import Count, Range, Settings
from orbiflow.tiles.search.gluing import Placement, glues, placements
from orbiflow.tiles.search.pair_bending import (
    BentPair,
    Figures,
    bent,
    finer,
    glued_body,
    moved,
    unlike,
)
from orbiflow.tiles.search.pair_carving import CarvedPair, carved_pair, finer_slides
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tilings import CLASSES, certify, isohedral_class

FIRST_STEPS, LAST_STEPS = 25, 60  # of carving, with half of the points and with all


class PairSearch(Settings):
    """The search for pairs.

    - `ratios`: areas of the second figure over the first, as they are before both bend.
    - `points`: points of both outlines together, on the first of three levels.
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
    - `workers`: processes that share the work; 1 stays in this one.
    """

    ratios: tuple[Annotated[float, Range(0.1, 10)], ...] = (0.7, 1.0, 1.4)
    points: Annotated[int, Range(30, 200)] = 64
    glues: Count = 125
    placed: Count = 3200
    per_glue: Count = 16
    held: Count = 80
    starts: Count = 160
    carved: Count = 60
    ranked: Count = 20
    finalists: Count = 10
    classes: tuple[str, ...] = tuple(CLASSES)
    workers: Count = 1


def search_pair(
    one: Target,
    two: Target,
    settings: PairSearch | None = None,
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> list[CarvedPair]:
    """Search for tilings of two silhouettes, of which the second may be mirrored.

    What is returned is certified, and comes by the score of the worse figure, best first. The figures
    have a mean area of 1.

    Args:
        one, two: The silhouettes.
        settings: How much is tried.
        on_event: Called with `Progress`.
        cancel: Checked before each step.
    """
    own = settings or PairSearch()
    figures = [
        Figures.of(
            np.asarray(one.normal), np.asarray(two.normal), ratio, mirrored=hand, count=own.points
        )
        for ratio, hand in product(own.ratios, (False, True))
    ]
    team = _Team(own.workers, on_event, cancel)
    found = team.each(partial(_placed, own), figures, "gluing", 0.3)
    kept = sorted(placement.residual for placed in found for placement in placed)[: own.placed]
    best = [[p for p in placed if p.residual <= kept[-1]] for placed in found]
    jobs = list(zip(figures, best, strict=True))
    pairs = [pair for some in team.each(partial(_bent, own), jobs, "bending", 0.5) for pair in some]
    pairs.sort(key=lambda pair: pair.cost)
    middle = team.each(partial(finer, level=1), unlike(pairs, own.starts), "refining", 0.55)
    middle.sort(key=lambda pair: pair.cost)
    starts = unlike(middle, own.carved)
    carved = team.each(partial(carved_pair, steps=FIRST_STEPS), starts, "carving", 0.75)
    before = dict(zip(map(id, carved), starts, strict=True))
    ranked = unlike(_ranked(carved), own.ranked)
    nearby = team.each(_moved, [before[id(pair)] for pair in ranked], "moving corners", 0.9)
    last = unlike(_ranked([*ranked, *nearby]), own.finalists)
    done = team.each(_detailed, last, "carving with all detail", 1.0)
    return [pair for pair in _ranked(done) if pair.sound and certify(pair.tiling).valid]


class _Team:
    """Does one kind of work after another, in some processes, and tells how far it is."""

    def __init__(self, workers: int, on_event: Sink, cancel: Cancel) -> None:
        self.workers, self.on_event, self.cancel, self.share = workers, on_event, cancel, 0.0
        self.context = process_context((__name__,)) if workers > 1 else None

    def each(
        self, do: Callable[[Any], Any], items: Sequence[Any], what: str, share: float
    ) -> list[Any]:
        """Return what is done of each item, up to a share of the whole work."""
        found: list[Any] = [None] * len(items)
        begin, self.share = self.share, share

        def ended(count: int) -> None:
            self.on_event(Progress(begin + (share - begin) * count / max(1, len(items)), what))

        ended(0)
        if self.context is None or len(items) < 2:
            with one_thread(), one_blas_thread():
                for k, item in enumerate(items):
                    self.cancel.check()
                    found[k] = do(item)
                    ended(k + 1)
            return found
        job, count = partial(_job, do), 0
        own = work(job, items, self.workers, context=self.context, cancel=self.cancel)
        with contextlib.closing(own) as news:
            for one in news:
                if one.done:
                    count += 1
                    found[one.index] = one.value
                    ended(count)
        self.cancel.check()
        return found


def _job(do: Callable[[Any], Any], item: Any, _tell: object, _cancel: object) -> Any:
    with one_thread(), one_blas_thread():
        return do(item)


def _placed(settings: PairSearch, figures: Figures) -> list[Placement]:
    """Return placements of the best glues."""
    one, two = (part.rest[: part.size] for part in figures.parts(0))
    steps = np.concatenate([np.roll(own, -1) - own for own in (one, two)])
    unit = float((abs(steps) ** 2).mean())
    kinds = [isohedral_class(name) for name in settings.classes]
    found: list[Placement] = []
    for own in glues(one, two, settings.glues):
        body = glued_body(figures, 0, own.glue)
        found += placements(body.rest[: body.size], own, kinds, unit, settings.per_glue)
    return found


def _bent(settings: PairSearch, job: tuple[Figures, list[Placement]]) -> list[BentPair]:
    return bent(*job, settings.held)


def _moved(pair: BentPair) -> CarvedPair:
    return carved_pair(moved(pair), FIRST_STEPS)


def _detailed(pair: CarvedPair) -> CarvedPair:
    return carved_pair(finer_slides(pair, finer(pair, 2, rounds=0)), LAST_STEPS)


def _ranked(pairs: Sequence[CarvedPair]) -> list[CarvedPair]:
    """Return pairs by the worse of their scores, then by the better."""
    return sorted(pairs, key=lambda own: own.scores, reverse=True)
