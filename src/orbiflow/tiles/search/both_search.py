"""The search for both: a short list of tiles that no other beats in deformation and overlap together.

The front of Pareto: a tile is on it if no other has at most its deformation and at least its IoU,
and one of them better. The list is chosen from the front of all tiles; what is said of each tile in the
list holds among these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import NEVER, Cancel
from orbiflow.tiles.geometry import orient
from orbiflow.tiles.likeness import bent_onto, mutual_iou
from orbiflow.tiles.search.candidates import Fit
from orbiflow.tiles.search.co_deformation import Hand
from orbiflow.tiles.search.likeness_search import LikenessSearch
from orbiflow.tiles.search.overlap_search import OverlapSearch
from orbiflow.tiles.search.search_method import Goal, SearchMethod
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import IsohedralClass

MOST = 12  # tiles in the list
ALIKE = 0.9  # mutual IoU from which two tiles are one to the eye
NEAR = 0.15  # how far behind the front a tile may be that fills up the list
WORTH = 0.2  # IoU that is worth as much as all of the deformation, behind the front


CANDIDATES = 3  # tiles of each class, of either search, that the list is chosen from at least


@dataclass(frozen=True)
class BothSearch(SearchMethod):
    """A search for likeness and one for overlap, each with its own settings, and one short list."""

    objective: ClassVar[str] = "both"
    takes_pins: ClassVar[bool] = True
    modules: ClassVar[tuple[str, ...]] = LikenessSearch.modules + OverlapSearch.modules

    likeness: LikenessSearch = field(default_factory=LikenessSearch)
    overlap: OverlapSearch = field(default_factory=OverlapSearch)

    @property
    def seed(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The seed of both."""
        return self.likeness.seed

    def parts(self) -> Sequence[tuple[float, SearchMethod]]:
        """Return the two searches."""
        return [(0.3, self.likeness), (0.7, self.overlap)]

    def fit(self, goal: Goal, kind: IsohedralClass, *_: Any, **__: Any) -> Fit:  # noqa: ARG002
        """Refuse: each of the `parts` has candidates of its own."""
        raise OrbiflowError("a search for both fits twice: take its likeness or its overlap")

    def sketch(self, goal: Goal, kind: IsohedralClass, cancel: Cancel = NEVER) -> Fit:
        """Return the sketch of the search for likeness."""
        return self.likeness.sketch(goal, kind, cancel)

    def prepare(self, goal: Goal) -> None:
        """Prepare both."""
        self.likeness.prepare(goal)
        self.overlap.prepare(goal)

    def shown(self, per_class: int) -> int:
        """Return how many tiles of a class each search gives to choose from."""
        return max(CANDIDATES, per_class)

    def finish(self, tiles: Sequence[EscherTile], goal: Goal) -> Sequence[EscherTile]:
        """Return the tiles with their deformation measured."""
        hand, _ = self.likeness.hands(goal)
        return [measured(tile, hand) for tile in tiles]

    def short_list(self, tiles: Sequence[EscherTile]) -> list[EscherTile]:
        """Return the front; see `front_list`."""
        return front_list(tiles)


def front_list(results: Sequence[EscherTile]) -> list[EscherTile]:
    """Return at most twelve tiles: those on the front, no two of them alike, then some behind it.

    The tile of least deformation and that of largest IoU are always listed, however alike, then the
    others on the front, from each search in turn. While there is room, the first of each search
    follows, which it would show alone, and tiles that one on the front beats by at most 15% of their
    deformation and .03 of IoU, nearest first. Tiles without a deformation (forced ones that cross
    themselves) come last. `front` says of each whether no other that is listed beats it.
    """
    measured = [k for k, result in enumerate(results) if result.deformation is not None]
    odd = [k for k, result in enumerate(results) if result.deformation is None]
    cost = np.array([results[k].deformation for k in measured], dtype=np.float64)
    overlap = np.array([results[k].metrics.iou for k in measured])
    objectives = [results[k].objective for k in measured]
    late = behind(cost, overlap)
    ends = [*np.lexsort((-overlap, cost))[:1], *np.lexsort((cost, -overlap))[:1]]
    # in turn from each search: one must not crowd the other out
    own = [objectives[:k].count(objectives[k]) for k in range(len(objectives))]
    order = [int(k) for k in np.argsort(own, kind="stable") if late[k] == 0]
    order += [objectives.index(objective) for objective in dict.fromkeys(objectives)]
    order += [int(k) for k in np.argsort(late, kind="stable") if 0 < late[k] <= NEAR]
    alike = mutual_iou([results[k].normal_tile.polygon for k in measured], ALIKE)
    chosen = list(dict.fromkeys(map(int, ends)))
    for k in order:
        if len(chosen) < MOST and all(k != c and alike(k, c) < ALIKE for c in chosen):
            chosen.append(k)
    shown = behind(cost[chosen], overlap[chosen]) == 0
    on_front = {measured[k] for k, unbeaten in zip(chosen, shown, strict=True) if unbeaten}
    kept = sorted([measured[k] for k in chosen] + odd[: MOST - len(chosen)])
    return [results[k].changed(front=k in on_front) for k in kept]


def behind(cost: Array, overlap: Array) -> Array:
    """Return (n,) how far each point is behind the nearest on the front that beats it; 0 on the front.

    The larger of the share of its cost which the other saves, and that of `WORTH` in overlap.
    """
    # row k: what beats point k
    beats = (cost <= cost[:, None]) & (overlap >= overlap[:, None])
    beats &= (cost < cost[:, None]) | (overlap > overlap[:, None])
    on_front = ~beats.any(axis=1)
    saved = (cost[:, None] - cost) / np.maximum(cost[:, None], 1e-12)
    late = np.maximum(saved, (overlap - overlap[:, None]) / WORTH)
    late = np.where(beats & on_front, late, np.inf).min(axis=1, initial=np.inf)
    return np.where(on_front, 0.0, late)


def deformation(hand: Hand, ring: Array) -> float:
    """Return what it costs to bend a silhouette until its outline is a simple ring (M, 2) over it.

    At the best result of `bent_onto`: an upper bound of the least cost, as the search's own is.
    """
    body = hand.fine
    z = bent_onto(body, orient(ring, counter_clockwise=True))
    return float(body.cost(z[:, None])[0])


def measured(result: EscherTile, hand: Hand) -> EscherTile:
    """A tile with its deformation, the least that is known; without one if it crosses itself."""
    if not result.certificate.simple:
        return result
    found = deformation(hand, result.normal_tile.polygon)
    known = result.deformation
    return result.changed(deformation=found if known is None else min(found, known))
