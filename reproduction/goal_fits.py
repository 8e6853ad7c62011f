"""Tiles of our own searches for the paper's nine goals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

from orbiflow.arrays import Array
from orbiflow.tiles import (
    CLASSES,
    EscherTile,
    LikenessSearch,
    OverlapSearch,
    Target,
    escherize_class,
)
from reproduction.exhibit import Extent, Work
from reproduction.published import goals

# largest overlap with the goal, or with the goal stretched to a square as in the paper; likeness
Objective = Literal["overlap", "squared", "likeness"]

# number of best classes of a quick search that are searched again with full effort
SEARCHED_AGAIN = 2


class GoalTile(NamedTuple):
    """The best tile that was found for a goal.

    - `isohedral_class`: The tile's class.
    - `polygon`: The polygon (N, 2) in the goal's coordinates.
    - `iou`, `dice`, `pixel_accuracy`: The overlap with the goal.
    - `certified`: Whether it is proved to tile.
    """

    isohedral_class: str
    polygon: Array
    iou: float
    dice: float
    pixel_accuracy: float
    certified: bool


def goal_tile(
    name: str, objective: Objective, effort: str, classes: tuple[str, ...] | None
) -> GoalTile | None:
    """Return the best tile for a goal, or None if no class gives a certified one.

    A quick search tries all classes; the best two are searched again if more effort is asked for.
    """
    goal = goals()[name]
    target = goal.squared() if objective == "squared" else goal.target()
    found = _tiles(target, objective, "fast", classes or tuple(CLASSES))
    if effort != "fast" and objective != "squared":
        found += _tiles(target, objective, effort, [one.name for one in found[:SEARCHED_AGAIN]])
        found.sort(key=lambda one: -_rank(one, objective))
    if not found:
        return None
    best = found[0]
    metrics = best.metrics
    return GoalTile(
        best.name,
        best.tile.polygon,
        metrics.iou,
        metrics.dice,
        metrics.pixel_accuracy,
        best.certificate.valid,
    )


def goal_work(extent: Extent, objective: Objective) -> list[Work]:
    """Return the search for the best tiles of all nine goals, as work."""
    costs = {"octopus": 3.0, "spider": 5.0}
    share = 1.0 if extent.effort == "fast" else 4.0
    return [
        Work(
            goal_tile,
            (name, objective, extent.effort, extent.classes),
            2 * share * costs.get(name, 1.0),
        )
        for name in goals()
    ]


def _tiles(
    target: Target, objective: Objective, effort: str, classes: Sequence[str]
) -> list[EscherTile]:
    """Return certified tiles, best first."""
    kind = LikenessSearch if objective == "likeness" else OverlapSearch
    outcomes = [escherize_class(target, name, kind.for_effort(effort)) for name in classes]
    found = [one for one in outcomes if isinstance(one, EscherTile)]
    return sorted(found, key=lambda one: -_rank(one, objective))


def _rank(result: EscherTile, objective: Objective) -> float:
    return result.score if objective == "likeness" else result.metrics.iou
