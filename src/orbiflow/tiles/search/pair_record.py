"""What a search for two figures has found, and its events, from a first look to finished tiles."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from orbiflow.errors import SettingError
from orbiflow.runtime import NEVER, Cancel, Sink, Team, ignore
from orbiflow.tiles.search.finished_tiles import ClassFailure, rated
from orbiflow.tiles.search.likeness_search import rounded_goals
from orbiflow.tiles.search.pair_search import PairSearch, first_pair, search_pair
from orbiflow.tiles.search.pair_tiles import finished_pair
from orbiflow.tiles.search.pairs import BentPair
from orbiflow.tiles.search.search_method import Goal
from orbiflow.tiles.search.search_record import (
    INTERRUPTED,
    Found,
    OnTile,
    outcome_event,
    preview_event,
    without_twins,
)
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile, SearchFacts

NOTHING = "no tile of both figures is certified"


class PairRecord:
    """Searches for two figures, and keeps and reports the tiles of each stage."""

    def __init__(
        self, goals: tuple[Goal, Goal], settings: PairSearch, on_tile: OnTile | None, on_event: Sink
    ) -> None:
        self.goals, self.method, self.on_tile, self.on_event = goals, settings, on_tile, on_event
        self.begin, self.workers = time.perf_counter(), settings.workers
        self.notes = [note for goal in goals for note in goal.notes]
        self._pairs: list[BentPair] = []
        self._is_done = False
        self._rounded, self._share = _thick_enough(goals, settings)

    def look_first(self, cancel: Cancel) -> None:
        """Show a certified tile in some seconds, if there is one."""
        for tile in self._show("sketch", first_pair(self._rounded, self.method, cancel)[:1]):
            self.on_event(preview_event(tile, self.begin))

    def search(self, cancel: Cancel) -> None:
        """Search for the best pairs."""
        self._pairs = search_pair(
            self._rounded, self.method, on_pairs=self._show, on_event=self.on_event, cancel=cancel
        )
        self._is_done = True

    def _show(self, stage: str, pairs: list[BentPair]) -> list[EscherTile]:
        """Keep the pairs of a stage, and return them as tiles if somebody sees them."""
        self._pairs = pairs or self._pairs
        if self.on_tile is None and stage != "sketch":
            return []
        tiles = self._finished(pairs)
        if self.on_tile is not None:
            for tile in tiles:
                self.on_tile(tile, stage)
        return tiles

    def _finished(self, pairs: Sequence[BentPair]) -> list[EscherTile]:
        """Return pairs as tiles with their ratings, best first, no two of them alike."""
        targets, originals = ([goal.target for goal in two] for two in (self._rounded, self.goals))
        facts = SearchFacts(self.method.objective, starts=self.method.placed)
        finish = partial(_finished, targets, originals, self._share)
        finished = Team(__name__, self.method.workers, ignore, NEVER).each(
            finish, pairs, "finishing", 1.0
        )
        likely = [goal.target for goal in self.goals if not goal.is_background]
        tiles = rated([tile.changed(search=facts) for tile in finished], *likely)
        tiles.sort(key=lambda tile: -tile.score)
        kept = without_twins(tiles, self.method.finalists) if tiles else []
        return [tiles[k] for k in sorted(kept)]

    def finish(self) -> Found:
        """Return what was found; each class has its share of the seconds that it took."""
        tiles = self._finished(self._pairs)
        seconds = (time.perf_counter() - self.begin) * self.workers
        share = seconds / max(1, len({tile.isohedral_class for tile in tiles}))
        tiles = [tile.changed(search=replace(tile.search, seconds=share)) for tile in tiles]
        names = [kind.name for kind in self.method.kinds]
        reason = NOTHING if self._is_done else INTERRUPTED
        failures = [] if tiles else [ClassFailure(name, reason) for name in names]
        for tile in tiles:
            self.on_event(outcome_event(tile))
            if self.on_tile is not None and self._is_done:
                self.on_tile(tile, "final")
        for failure in failures:
            self.on_event(outcome_event(failure))
        left = [tile.isohedral_class for tile in tiles] or names
        return Found(tiles, failures, frozenset(() if self._is_done else left))


def _finished(
    targets: list[Target], originals: list[Target], share: float, pair: BentPair
) -> EscherTile:
    return finished_pair(targets, pair, originals, share)


def _thick_enough(goals: Sequence[Goal], settings: PairSearch) -> tuple[list[Goal], float]:
    """Return silhouettes that can be followed, and the first share at which they can.

    That is the share of their lengths below which parts are rounded off. Raises `SettingError` if
    nothing helps.
    """
    reasons: list[SettingError] = []
    for share, rounded in rounded_goals(goals):
        try:
            settings.couples(rounded)
        except SettingError as error:
            reasons.append(error)
        else:
            return rounded, share
    raise reasons[0]
