"""What a search for two figures has found, and its events, from a first look to finished tiles."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from orbiflow.errors import SettingError
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Cancelled,
    ClassFailed,
    Note,
    Preview,
    Sink,
    Team,
    TileFound,
    ignore,
)
from orbiflow.tiles.search.finished_tiles import ClassFailure, rated
from orbiflow.tiles.search.likeness_search import ROUNDED_SHARES, rounded_off
from orbiflow.tiles.search.pair_carving import CarvedPair
from orbiflow.tiles.search.pair_search import PairSearch, first_pair, search_pair
from orbiflow.tiles.search.pair_tiles import finished_pair
from orbiflow.tiles.search.search_method import Goal
from orbiflow.tiles.search.search_record import INTERRUPTED, OnTile, without_twins
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile, SearchFacts

NOTHING = "no tile of both figures is certified"


class Found(NamedTuple):
    """What was found."""

    tiles: Sequence[EscherTile]  # best first
    failures: Sequence[ClassFailure]
    interrupted: frozenset[str]  # the classes that were not finished


class PairRecord:
    """Searches for two figures, and keeps and reports the tiles of each stage."""

    def __init__(
        self, goals: tuple[Goal, Goal], settings: PairSearch, on_tile: OnTile | None, on_event: Sink
    ) -> None:
        self.goals, self.settings, self.on_tile, self.on_event = goals, settings, on_tile, on_event
        self.names = [kind.name for kind in settings.kinds]
        self._pairs: list[CarvedPair] = []
        self._is_done = False
        plain = all(goal.emphasis is None and goal.pins is None for goal in goals)
        shares = (0.0, *ROUNDED_SHARES) if plain else (0.0,)
        self._rounded, self._share = _thick_enough(goals, settings, shares)

    def search(self, on_checked: Callable[[], object] | None, cancel: Cancel) -> Found:
        """Search, with a first look before `on_checked` is called."""
        begin, on_event = time.perf_counter(), self.on_event
        with contextlib.suppress(Cancelled):
            if first := self._show("sketch", first_pair(self._rounded, self.settings, cancel)[:1]):
                name, iou = first[0].isohedral_class, first[0].worst.likeness.metrics.iou
                on_event(Preview(name, iou, time.perf_counter() - begin))
            if on_checked is not None:
                on_checked()
            for note in (*self.goals[0].notes, *self.goals[1].notes):
                on_event(Note(note))
            self._pairs = search_pair(
                self._rounded, self.settings, on_pairs=self._show, on_event=on_event, cancel=cancel
            )
            self._is_done = True
        tiles = self._finished(self._pairs)
        return self._told(tiles, time.perf_counter() - begin)

    def _show(self, stage: str, pairs: list[CarvedPair]) -> list[EscherTile]:
        """Keep the pairs of a stage, and return them as tiles if somebody sees them."""
        self._pairs = pairs or self._pairs
        if self.on_tile is None and stage != "sketch":
            return []
        tiles = self._finished(pairs)
        if self.on_tile is not None:
            for tile in tiles:
                self.on_tile(tile, stage)
        return tiles

    def _finished(self, pairs: Sequence[CarvedPair]) -> list[EscherTile]:
        """Return pairs as tiles with their ratings, best first, no two of them alike."""
        targets, originals = ([goal.target for goal in own] for own in (self._rounded, self.goals))
        facts = SearchFacts(self.settings.objective, starts=self.settings.placed)
        finish = partial(_finished, targets, originals, self._share)
        found = Team(__name__, self.settings.workers, ignore, NEVER).each(
            finish, pairs, "finishing", 1.0
        )
        likely = [goal.target for goal in self.goals if not goal.is_background]
        tiles = rated([tile.changed(search=facts) for tile in found], *likely)
        tiles.sort(key=lambda tile: -tile.score)
        kept = without_twins(tiles, self.settings.finalists) if tiles else []
        return [tiles[k] for k in sorted(kept)]

    def _told(self, tiles: list[EscherTile], seconds: float) -> Found:
        """Report the tiles of a search that took so many seconds; each class has its share of them."""
        reason, kinds = NOTHING if self._is_done else INTERRUPTED, len({t.name for t in tiles})
        share = seconds * self.settings.workers / max(1, kinds)
        tiles = [t.changed(search=replace(t.search, seconds=share)) for t in tiles]
        failures = [] if tiles else [ClassFailure(name, reason) for name in self.names]
        for tile in tiles:
            iou, certified = tile.worst.likeness.metrics.iou, tile.certificate.valid
            self.on_event(TileFound(tile.isohedral_class, iou, tile.score, certified))
            if self.on_tile is not None and self._is_done:
                self.on_tile(tile, "final")
        for failure in failures:
            self.on_event(ClassFailed(failure.name, failure.reason))
        left = [tile.isohedral_class for tile in tiles] if tiles else self.names
        return Found(tiles, failures, frozenset() if self._is_done else frozenset(left))


def _finished(
    targets: list[Target], originals: list[Target], share: float, pair: CarvedPair
) -> EscherTile:
    return finished_pair(targets, pair, originals, share)


def _thick_enough(
    goals: tuple[Goal, Goal], settings: PairSearch, shares: Sequence[float]
) -> tuple[tuple[Goal, Goal], float]:
    """Return silhouettes that can be followed, and the first of the shares at which they can.

    That is the share of their lengths below which parts are rounded off. Raises `SettingError` if
    nothing helps.
    """
    share, *rest = shares
    one, two = (Goal(rounded_off(goal.target, share)) if share else goal for goal in goals)
    try:
        settings.figures((one, two))
    except SettingError:
        if not rest:
            raise
        return _thick_enough(goals, settings, rest)
    return (one, two), share
