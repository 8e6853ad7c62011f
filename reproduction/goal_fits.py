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
from reproduction.exhibit import Work
from reproduction.extent import Extent
from reproduction.published import goals

Objective = Literal["overlap", "squared", "likeness"]
"""Largest overlap with the goal; with the goal as the paper had it, stretched to a square; likeness."""

SECOND_LOOK = 2
"""Classes, the best of a quick search, that are searched again with all effort."""


class GoalTile(NamedTuple):
    """The best tile that was found for a goal.

    - `isohedral_class`: of it. `polygon`: (N, 2) in the goal's coordinates.
    - `iou`, `dice`, `pixel_accuracy`: with the goal. `certified`: whether it tiles.
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
    """The best tile of a goal, None if no class gives a certified one.

    A quick search of all classes; the best two again, if more effort is asked for.
    """
    goal = goals()[name]
    target = goal.squared() if objective == "squared" else goal.target()
    found = _tiles(target, objective, "fast", classes or tuple(CLASSES))
    if effort != "fast" and objective != "squared":
        found += _tiles(target, objective, effort, [one.name for one in found[:SECOND_LOOK]])
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
    """The best tiles of all nine goals."""
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
    """Certified tiles, best first."""
    kind = LikenessSearch if objective == "likeness" else OverlapSearch
    outcomes = [escherize_class(target, name, kind.for_effort(effort)) for name in classes]
    found = [one for one in outcomes if isinstance(one, EscherTile)]
    return sorted(found, key=lambda one: -_rank(one, objective))


def _rank(result: EscherTile, objective: Objective) -> float:
    return result.score if objective == "likeness" else result.metrics.iou
