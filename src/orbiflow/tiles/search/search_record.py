"""What a search has found so far, and the events that report it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from orbiflow.runtime import ClassFailed, Preview, Progress, Sink, TileFound
from orbiflow.tiles.likeness import diverse, mutual_iou
from orbiflow.tiles.search.finished_tiles import ClassFailure
from orbiflow.tiles.tile import EscherTile

TWIN_IOU = 0.9  # mutual IoU from which two tiles are one to the eye
INTERRUPTED = "interrupted"  # the reason given for a class that was left undone
Outcome = EscherTile | ClassFailure
OnTile = Callable[[EscherTile, str], object]
IsPromising = Callable[[EscherTile, EscherTile], bool]
"""Whether a class may give the best tile yet, from its own best and that of all."""
STAGE_WORDS = {
    "sketch": "sketching a tile of each kind",
    "better": "improving the tiles",
    "final": "finishing the tiles",
}
"""What is being done in each stage, for who watches."""


class Found(NamedTuple):
    """What a search has found."""

    tiles: Sequence[EscherTile]  # best first
    failures: Sequence[ClassFailure]
    interrupted: frozenset[str]  # the classes that were not finished


def outcome_event(result: Outcome) -> TileFound | ClassFailed:
    """Return the event that tells of an outcome."""
    if isinstance(result, ClassFailure):
        return ClassFailed(result.name, result.reason)
    iou, certified = result.worst.likeness.metrics.iou, result.certificate.valid
    return TileFound(result.isohedral_class, iou, result.score, certified)


def preview_event(tile: EscherTile, begin: float) -> Preview:
    """Return the event that tells of a first look, in a search that began at a time."""
    iou = tile.worst.likeness.metrics.iou
    return Preview(tile.isohedral_class, iou, time.perf_counter() - begin)


class Record:
    """What a search has found, and how far each class is, reported as events.

    Args:
        names: The classes.
        on_event: Called with each event.
        on_tile: Called with each tile and its stage.
        most: Maximum number of tiles that are kept of a class.
    """

    def __init__(
        self, names: Sequence[str], on_event: Sink, on_tile: OnTile | None = None, most: int = 1
    ) -> None:
        self.shares = dict.fromkeys(names, 0.0)
        self.looks: dict[str, EscherTile] = {}  # for who stops the search before there is better
        self.firsts: dict[str, Outcome] = {}  # what the search is going to improve on
        self.outcomes: dict[str, Outcome] = {}
        self.on_event, self.on_tile, self.most = on_event, on_tile, most
        self.begin = time.perf_counter()
        self.stage = "final"  # how good the tiles are that are found now
        self._begin, self._end = 0.0, 0.0  # shares of the whole between which the level is
        self._level = dict.fromkeys(names, 0.0)  # the share of it that each of its classes has done
        self._whole = 0.0
        on_event(Progress(0.0, "fitting"))

    def next_level(self, stage: str, begin: float, end: float, names: Sequence[str]) -> None:
        """Go on to a stage: work for some classes, between two shares of the whole."""
        self._begin, self._end, self.stage = begin, end, stage
        self._level = dict.fromkeys(names, 0.0)

    def first_look(self, tile: EscherTile) -> None:
        """Keep a tile that the search is going to improve on."""
        self.looks[tile.name] = tile
        self.on_event(preview_event(tile, self.begin))
        if self.on_tile is not None:
            self.level_outcome(tile)

    def progress(self, name: str, share: float, loss: float = math.nan) -> None:
        """Report how far a class is, which never falls."""
        if name in self._level:
            self._level[name] = max(self._level[name], share)
        share = max(self._of_whole(share), self.shares[name])
        self.shares[name] = share = min(1.0, share)
        # a class that is not in the level takes no time any more
        whole = self._of_whole(sum(self._level.values()) / max(1, len(self._level)))
        self._whole = whole = max(self._whole, whole)
        finite = loss if math.isfinite(loss) else None  # no NaN in JSON
        self.on_event(Progress(whole, self._what, name, share, finite))

    def _of_whole(self, share: float) -> float:
        """Return the share of the whole that is done with a share of the level."""
        return (1 - share) * self._begin + share * self._end

    @property
    def _what(self) -> str:
        return STAGE_WORDS[self.stage] if self.on_tile else "fitting"

    def level_outcome(self, result: Outcome) -> None:
        """Keep what a level of effort gave for a class, unless an earlier one gave better."""
        sketching = self.stage == "sketch"
        whole = best_of(self.firsts.get(result.name), result, 1 if sketching else self.most)
        self.firsts[result.name] = whole
        if self.stage == "final":
            self._finish(whole)
            return
        self.progress(result.name, 1.0)
        if whole is result:
            self._show(whole)

    def settled(self, names: Sequence[str], is_promising: IsPromising) -> list[str]:
        """Finish classes that are not promising, and return the others, if there are tiles at all."""
        tiles = {name: tile for name in names if isinstance(tile := self.firsts[name], EscherTile)}
        if not tiles:
            return list(names)
        best = max(tiles.values(), key=lambda tile: tile.score)
        kept = [name for name, tile in tiles.items() if is_promising(tile, best)]
        self.stage = "final"
        for name in names:
            if name not in kept:
                self._finish(self.firsts[name])
        return kept

    def _finish(self, result: Outcome) -> None:
        self.shares[result.name] = 1.0
        self.outcome(result)
        self._show(result)

    def _show(self, result: Outcome) -> None:
        if self.on_tile and isinstance(result, EscherTile):
            for tile in result.family():
                if tile.certificate.valid:
                    self.on_tile(tile, self.stage)

    def outcome(self, result: Outcome, share: float = 1.0) -> None:
        """Keep what a class gave, and report it."""
        self.outcomes[result.name] = result
        self.progress(result.name, share)
        self.on_event(outcome_event(result))

    def finish(self) -> Found:
        """Return what was found: of a class that was not finished, a first look is its tile."""
        names = list(self.shares)
        left = [name for name in names if name not in self.outcomes]
        for name in left:
            first = self.firsts.get(name) or self.looks.get(name)
            is_tile = isinstance(first, EscherTile)
            self.outcome(first if is_tile else ClassFailure(name, INTERRUPTED), 0.0)
        outcomes = self.outcomes.values()
        best = [outcome for outcome in outcomes if isinstance(outcome, EscherTile)]
        tiles = [tile for first in best for tile in first.family()]
        tiles.sort(key=lambda tile: (-tile.score, names.index(tile.name)))
        failures = [outcome for outcome in outcomes if isinstance(outcome, ClassFailure)]
        return Found(tiles, failures, frozenset(left))


def best_of(earlier: Outcome | None, later: Outcome, count: int) -> Outcome:
    """Return the best tiles of a class that two searches found, no two of them alike.

    Those of the silhouette as it is go before those of one that was rounded off.
    """
    if not isinstance(earlier, EscherTile):
        return later
    if isinstance(later, ClassFailure) or earlier.likeness.smoothed < later.likeness.smoothed:
        return earlier
    if later.likeness.smoothed < earlier.likeness.smoothed:
        return later
    tiles = [tile.changed(others=()) for tile in (*earlier.family(), *later.family())]
    tiles.sort(key=lambda tile: (not tile.certificate.valid, -tile.score))
    best, *others = (tiles[k] for k in without_twins(tiles, count))
    if best.tile is later.tile and len(others) == len(later.others):
        return later
    return best.changed(others=tuple(others))


def without_twins(tiles: Sequence[EscherTile], count: int) -> list[int]:
    """Return the indices of so many tiles of those given, best first, no two of them alike."""
    if count == 1 or len(tiles) == 1:
        return [0]
    simple = [k for k, tile in enumerate(tiles) if tile.certificate.simple]
    alike = mutual_iou([tiles[k].normal_tile.polygon for k in simple], TWIN_IOU)
    below = float(np.nextafter(TWIN_IOU, 0))
    chosen = diverse([tiles[k].score for k in simple], count, alike, twin=below)
    return [simple[k] for k in chosen] or [0]
