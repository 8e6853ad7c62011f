"""The ablation of the maximum frequency: what more waves do to the tiles of each class."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from orbiflow.drawing import fill_rings
from orbiflow.fields import FourierField
from orbiflow.tiles import CLASSES, EscherTile
from reproduction.animal import animal_work
from reproduction.drawing import EDGE, GOAL, INK, TILE, Box, Canvas, panel, text_size, window_of
from reproduction.exhibit import Exhibit, Extent, Findings, Table, Work
from reproduction.published import animal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEFT, _HEAD = 0.06, 0.025


def _needs(extent: Extent) -> list[Work]:
    return [one for omega in extent.frequencies for one in animal_work(extent, omega)]


def _draw(canvas: Canvas, extent: Extent, values: list[Any]) -> Findings:
    omegas, names = extent.frequencies, list(CLASSES)
    table = dict(zip(((w, name) for w in omegas for name in names), values, strict=True))
    outline = animal().normal
    height = 0.097 * len(omegas) + 0.025
    figure = canvas.figure(height)
    for row, omega in enumerate(omegas):
        for column, name in enumerate(names):
            outcome, box = table[omega, name], _box(row, column, len(omegas), height)
            rings = [outcome.normal_tile.polygon] if isinstance(outcome, EscherTile) else []
            view = window_of([outline, *rings], box[2] / (box[3] * height), margin=0.04)
            axes = panel(figure, box, view)
            fill_rings(axes, rings, TILE, EDGE, 0.7)
            fill_rings(axes, [outline], "none", GOAL, 0.8)
    _label(figure, names, omegas, height)
    canvas.add(
        figure,
        "A grid of tiles, a column for each class and a row for each maximum frequency: polygons "
        "above, turtles below.",
        "Blue: the tile of each class and frequency, fitted to the animal in red. Same start, "
        "loss and number of iterations in every panel.",
    )
    ious = {w: [_iou(table[w, name]) for name in names] for w in omegas}
    means = {w: float(np.nanmean(ious[w])) for w in omegas}
    lengths = {w: float(np.nanmean([_length(table[w, name]) for name in names])) for w in omegas}
    free = {name: FourierField(kind.group(), 0).size for name, kind in CLASSES.items()}
    moving = ", ".join(f"{name} {n}" for name, n in free.items() if n)
    straight = max(_straightness(table[omegas[0], name], name) for name in names)
    rising = all(lengths[a] <= lengths[b] for a, b in pairwise(omegas))
    rows = (
        *((name, *(f"{_iou(table[w, name]):.3f}" for w in omegas)) for name in names),
        ("mean IoU", *(f"{means[w]:.3f}" for w in omegas)),
        ("mean length of the outline", *(f"{lengths[w]:.2f}" for w in omegas)),
    )
    return Findings(
        "agrees in part" if rising and straight < 1e-6 else "differs",
        "At Ω = 0 every tile is a polygon with the template's number of sides (to "
        f"{straight:.0e}); the mean length of the outline, of tiles of area 1, grows from "
        f"{lengths[omegas[0]]:.2f} to {lengths[omegas[-1]]:.2f}, and the mean IoU from "
        f"{means[omegas[0]]:.3f} to {means[omegas[-1]]:.3f}.",
        "Ω = 0 leaves translations in p1 alone, and along the glide in pg (free parameters: "
        f"{moving}); a constant field that commutes with a rotation is zero. And our tile at Ω = "
        "0 is not the regular template: pentagons have two shape parameters and lattices up to "
        "two, which the fit uses.",
        numbers={
            "mean_iou": {str(w): m for w, m in means.items()},
            "mean_length": {str(w): v for w, v in lengths.items()},
        },
        tables=[Table("IoU with the animal.", ("class", *(f"Ω = {w}" for w in omegas)), rows)],
    )


def _box(row: int, column: int, rows: int, height: float) -> Box:
    head = _HEAD / height
    wide, tall = (1 - _LEFT) / len(CLASSES), (1 - head) / rows
    return (
        _LEFT + column * wide + 0.002,
        1 - head - (row + 1) * tall + 0.004,
        wide - 0.004,
        tall - 0.008,
    )


def _label(figure: Figure, names: Sequence[str], omegas: Sequence[int], height: float) -> None:
    size = text_size(figure)
    for column, name in enumerate(names):
        box = _box(0, column, len(omegas), height)
        figure.text(
            box[0] + box[2] / 2, 1 - 0.6 * _HEAD / height, name, ha="center", va="center",
            fontsize=size, weight="bold", color=INK,
        )  # fmt: skip
    for row, omega in enumerate(omegas):
        box = _box(row, 0, len(omegas), height)
        figure.text(
            _LEFT / 2, box[1] + box[3] / 2, f"Ω = {omega}", ha="center", va="center", fontsize=size,
            color=INK,
        )  # fmt: skip


def _iou(outcome: Any) -> float:
    return outcome.metrics.iou if isinstance(outcome, EscherTile) else float("nan")


def _length(outcome: Any) -> float:
    if not isinstance(outcome, EscherTile):
        return float("nan")
    polygon = shapely.Polygon(outcome.normal_tile.polygon)
    return polygon.length / polygon.area**0.5


def _straightness(outcome: Any, name: str) -> float:
    """Return how far a tile is from the polygon through its corners."""
    if not isinstance(outcome, EscherTile):
        return 0.0
    tile = outcome.normal_tile
    corners = shapely.LinearRing(tile.polygon[list(tile.corners)])
    assert len(tile.corners) == len(CLASSES[name].template())
    return float(shapely.hausdorff_distance(corners, shapely.LinearRing(tile.polygon)))


EXHIBIT = Exhibit(
    "figure-8",
    "Figure 8",
    "The effect of the maximum frequency Ω",
    "For Ω = 0 there is no deformation in the shape of the tile, as the diffeomorphism only has "
    "translational effects. The higher the allowed frequency, the more complex the tile shape.",
    _draw,
    _needs,
)
