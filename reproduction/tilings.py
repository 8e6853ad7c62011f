"""The tilings of the nine classes with their symmetries: cell, rotation centres, glide lines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.drawing import CENTER_COLOURS, LINE_COLOUR, cell_ring, center_sign
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    RotationCenter,
    rotation,
    symmetry_elements,
    transflection,
)
from orbiflow.tiles import CLASSES, draw_tiling
from reproduction.drawing import INK, Canvas, around, caption, grid_box, panel, text_size
from reproduction.exhibit import Exhibit, Extent, Findings, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def drawn_elements(group: CrystallographicGroup) -> list[Isometry]:
    """Return the isometry of every centre and line that is marked in and around a cell."""
    found = symmetry_elements(group)
    turns = [rotation(center.point, center.order) for center in found.centers]
    return turns + [transflection(line.line, line.shift) for line in found.lines]


def center_orbits(group: CrystallographicGroup) -> list[RotationCenter]:
    """Return one rotation centre of each orbit, the highest order first.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> [center.order for center in center_orbits(wallpaper_group("p6"))]
    [6, 3, 2]
    """
    orbits: list[RotationCenter] = []
    for center in sorted(symmetry_elements(group).centers, key=lambda c: -c.order):
        if not any(_same_orbit(group, center, other) for other in orbits):
            orbits.append(center)
    return orbits


def _same_orbit(group: CrystallographicGroup, one: RotationCenter, other: RotationCenter) -> bool:
    steps = (group.images(one.point) - other.point) @ group.inverse_lattice.T
    return one.order == other.order and bool(
        (np.abs(steps - steps.round()).max(axis=-1) < 1e-6).any()
    )


def _draw(canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
    figure = canvas.figure(0.94)
    rows, wrong = [], 0
    for number, kind in enumerate(CLASSES.values()):
        group = kind.group()
        box = grid_box(*divmod(number, 3), 3, 3, title=0.09, low=0.045)
        middle = (kind.template().min(axis=0) + kind.template().max(axis=0)) / 2
        middle = (middle + cell_ring(group, middle)[:4].mean(axis=0)) / 2
        aspect = box[2] / (box[3] * 0.94)
        window = around(middle, 4.1 * aspect, 4.1)
        draw_tiling(panel(figure, box, window), kind, window)
        caption(figure, box, f"{kind.name}  ({kind.group_name})", size=1.0)
        wrong += sum(not group.contains(g) for g in drawn_elements(group))
        orders = [center.order for center in center_orbits(group)]
        lines = symmetry_elements(group).lines
        ways = len({tuple(np.abs(line.line.direction).round(6)) for line in lines})
        shown = ", ".join(
            f"{orders.count(k)} of order {k}" for k in sorted(set(orders), reverse=True)
        )
        rows.append(
            (
                kind.name,
                kind.group_name,
                shown or "none",
                {0: "none", 1: "one way", 2: "two ways"}[ways],
            )
        )
    _key(figure)
    canvas.add(
        figure,
        "Nine tilings by hexagons or pentagons, one for each class, with a lattice cell in "
        "black, glide lines dashed in red, and signs on all rotation centres.",
        "One fill for each aspect (coset of the lattice). All centres and lines are found from "
        "the group; the classes have no mirrors.",
    )
    return Findings(
        "agrees" if not wrong else "differs",
        "All symmetries are there, not only the generators that the paper lists: every mark "
        f"drawn belongs to an element of the group ({wrong} do not). The cells are the shortest, "
        "with centres of the highest order at their corners; the paper's Table 2 names longer "
        "ones of the same lattice for some classes.",
        numbers={"marks_outside_the_group": wrong},
        tables=[
            Table(
                "Orbits of rotation centres, and directions of glide lines.",
                ("class", "group", "orbits of centres", "glide lines"),
                tuple(rows),
            )
        ],
    )


def _key(figure: Figure) -> None:
    height = 0.035
    aspect = figure.get_figwidth() / (figure.get_figheight() * height)
    axes = panel(figure, (0, 0, 1, height), (0, 0, aspect, 1))
    size, x = 0.95 * text_size(figure), 0.5
    for order, colour in CENTER_COLOURS.items():
        axes.fill(*(np.array([x, 0.5]) + center_sign(order, 0.27)).T, facecolor=colour)
        axes.text(x + 0.5, 0.5, f"{order}-fold centre", va="center", fontsize=size, color=INK)
        x += 5.0
    axes.plot([x, x + 1.3], [0.5, 0.5], color=LINE_COLOUR, linewidth=1.4, linestyle=(0, (5, 3)))
    axes.text(x + 1.6, 0.5, "glide line", va="center", fontsize=size, color=INK)
    axes.plot([x + 5.2, x + 6.5], [0.5, 0.5], color="#111111", linewidth=1.8)
    axes.text(x + 6.8, 0.5, "cell", va="center", fontsize=size, color=INK)


EXHIBIT = Exhibit(
    "figure-6",
    "Figure 6",
    "The symmetries of each tiling",
    "The tiling pattern of each of the nine classes: its unit of periodicity as a black "
    "quadrilateral, lines of transflection in red, rotation centres of each order as coloured "
    "symbols.",
    _draw,
)
