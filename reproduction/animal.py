"""One animal as tiles of all nine classes, by the paper's method: tile, tiling, field, flow lines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import draw_flow, draw_magnitude, mark_symmetry, outline_cell
from orbiflow.tiles import (
    CLASSES,
    ClassFailure,
    EscherTile,
    OccupancySearch,
    escherize_class,
    placed_field,
)
from reproduction.drawing import (
    INK,
    SAMPLES,
    Box,
    Canvas,
    around,
    caption,
    draw_over,
    draw_tiling,
    panel,
    text_size,
    tiny,
    window_of,
)
from reproduction.exhibit import Exhibit, Extent, Findings, Table, Work
from reproduction.nested import equivariance_error
from reproduction.published import animal

OMEGA = 5  # the paper's maximum frequency for its figure of one animal


def animal_tile(name: str, omega: int, affine: int, iterations: int) -> EscherTile | ClassFailure:
    """Search the tile of one class: an affine phase, then the flow of a field, with occupancy loss."""
    settings = OccupancySearch(max_frequency=omega, affine_iterations=affine, iterations=iterations)
    return escherize_class(animal(), name, settings)


def animal_work(extent: Extent, omega: int) -> list[Work]:
    """Return the search for tiles of all nine classes at one frequency, as work."""
    cost = 1 + extent.iterations / 200 * (1.5 + omega / 2)
    return [
        Work(animal_tile, (name, omega, extent.affine, extent.iterations), cost) for name in CLASSES
    ]


if TYPE_CHECKING:
    from matplotlib.figure import Figure

# three pictures of three rows each
PARTS = (("a", ("IH1", "IH2", "IH3")), ("b", ("IH4", "IH5", "IH6")), ("c", ("IH7", "IH21", "IH28")))
COLUMNS = (
    "(a) tile, and the animal in red",
    "(b) tiling",
    "(c) magnitude of the field",
    "(d) flow lines",
)
HEIGHT = 0.70
_HEAD, _LEFT = 0.075, 0.07


def _draw(canvas: Canvas, extent: Extent, values: list[Any]) -> Findings:
    outcomes = dict(zip(CLASSES, values, strict=True))
    outline = animal().normal
    for part, names in PARTS:
        figure = canvas.figure(HEIGHT)
        for row, name in enumerate(names):
            _draw_row(figure, row, outcomes[name], outline)
        for column, title in enumerate(COLUMNS):
            box = _box(0, column)
            caption(figure, (box[0], box[1], box[2], box[3] + 0.004), title, size=0.95)
        canvas.add(
            figure,
            f"Three rows, of {', '.join(names)}: a tile like a turtle, its tiling, and the field "
            "of its flow as colours and as white flow lines, both with the symmetry of the "
            "tiling.",
            f"{', '.join(names)}. The field is pushed forward to where the tile lies. Yellow: the "
            "tile; black: a lattice cell; signs: rotation centres; dashed: glide lines.",
            part=part,
        )
    good = {name: one for name, one in outcomes.items() if isinstance(one, EscherTile)}
    symmetry = {name: _symmetry_error(one) for name, one in good.items()}
    rows = tuple(_row(name, one, symmetry.get(name)) for name, one in outcomes.items())
    worst = max(symmetry.values(), default=float("inf"))
    certified = sum(one.certificate.valid for one in good.values())
    return Findings(
        "agrees" if certified == len(CLASSES) and worst < 1e-9 else "agrees in part",
        f"The paper's own method, from the template, with one stationary field and Ω = {OMEGA} "
        f"({extent.iterations} iterations): {certified} of nine tiles are certified, with edges "
        f"that match to rounding. The field has its group's symmetry to {tiny(worst)} of its "
        "size. The animal is a turtle in the public domain: the paper's rabbit does not come "
        "with it.",
        numbers={
            name: {
                "iou": one.metrics.iou,
                "edge_mismatch": one.certificate.edge_mismatch,
                "symmetry_error": symmetry[name],
            }
            for name, one in good.items()
        },
        tables=[
            Table(
                f"The tiles of Ω = {OMEGA}.",
                ("class", "IoU", "edges match to", "field symmetric to", "certified"),
                rows,
            )
        ],
    )


def _box(row: int, column: int) -> Box:
    width, height = (1 - _LEFT) / 4, (1 - _HEAD) / 3
    return _LEFT + column * width + 0.004, (2 - row) * height + 0.006, width - 0.008, height - 0.012


def _draw_row(figure: Figure, row: int, outcome: Any, outline: Array) -> None:
    size = text_size(figure)
    middle = _box(row, 0)[1] + _box(row, 0)[3] / 2
    figure.text(
        _LEFT / 2,
        middle,
        outcome.name,
        ha="center",
        va="center",
        fontsize=size,
        weight="bold",
        color=INK,
    )
    if not isinstance(outcome, EscherTile):
        figure.text(
            0.5, middle, f"no certified tile: {outcome.reason}", ha="center", fontsize=0.8 * size
        )
        return
    tile = outcome.normal_tile
    boxes = [_box(row, column) for column in range(4)]
    aspect = boxes[0][2] / (boxes[0][3] * HEIGHT)
    axes = panel(figure, boxes[0], window_of([tile.polygon, outline], aspect))
    draw_over(axes, tile.polygon, outline, width=1.4)
    high = 1.75
    window = around(tile.center, high * aspect, high)
    draw_tiling(panel(figure, boxes[1], window), tile, window)
    field = placed_field(outcome.model())
    ring = np.concatenate([tile.polygon, tile.polygon[:1]])
    for box in boxes[2:]:
        axes = panel(figure, box, window)
        if box is boxes[2]:
            draw_magnitude(axes, field, window, samples=SAMPLES)
        else:
            axes.fill(
                *np.array(window)[[[0, 2, 2, 0], [1, 1, 3, 3]]], facecolor="#1d2b3a", zorder=0
            )
            draw_flow(axes, field, tile.group, window)
        outline_cell(axes, tile.group, tile.center)
        axes.plot(*ring.T, color="#111111", linewidth=2.2, zorder=5)
        axes.plot(*ring.T, color="#ffd166", linewidth=1.2, zorder=5)
        halo = "#ffffff" if box is boxes[2] else "#1d2b3a"
        mark_symmetry(axes, tile.group, window, size=0.075, halo=halo)


def _symmetry_error(result: EscherTile) -> float:
    return equivariance_error(placed_field(result.model()), result.normal_tile.group)


def _row(name: str, outcome: Any, error: float | None) -> tuple[str, ...]:
    if not isinstance(outcome, EscherTile):
        return name, "–", "–", "–", outcome.reason
    certificate = outcome.certificate
    return (
        f"{name} ({outcome.group_name})",
        f"{outcome.metrics.iou:.3f}",
        tiny(certificate.edge_mismatch),
        tiny(error or 0.0),
        "yes" if certificate.valid else "no",
    )


EXHIBIT = Exhibit(
    "figure-7",
    "Figure 7",
    "One animal in all nine classes",
    "Given the target image of a rabbit, Escherization for the nine classes: the tile, the "
    "tiling it admits, the magnitude of the vector field and its flow lines. The field has the "
    "symmetry inherent in the class's group. Computed for Ω = 5.",
    _draw,
    lambda extent: animal_work(extent, OMEGA),
)
