"""The nine classes: templates with identified edges and angles, and their symmetry groups."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.symmetry import CrystallographicGroup, symmetry_elements
from orbiflow.tiles import CLASSES, IsohedralClass, draw_template, signed_area
from reproduction.drawing import (
    FAINT,
    INK,
    Canvas,
    around,
    caption,
    grid_box,
    panel,
    text_size,
    tiny,
)
from reproduction.exhibit import Exhibit, Extent, Findings, Table
from reproduction.published import GROUPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def identification_error(kind: IsohedralClass) -> float:
    """Return how far the template's identified edges are from being images of each other."""
    vertices = kind.template()
    errors = []
    for pair in kind.identified_edges:
        first, second = (vertices[[e, (e + 1) % len(vertices)]] for e in (pair.first, pair.second))
        image = pair.isometry(first)
        errors.append(np.abs((image[::-1] if pair.reversed else image) - second).max())
    return float(max(errors))


def constrained_angles(kind: IsohedralClass) -> dict[int, int]:
    """Return the angles in degrees that the class fixes, by vertex: identified edges meet there."""
    count = len(kind.template())
    found = {}
    for pair in kind.identified_edges:
        if pair.kind == "rotation" and not pair.folded:
            g = pair.isometry
            vertex = pair.second if (pair.second - pair.first) % count == 1 else pair.first
            turn = np.degrees(np.arctan2(g.linear[1, 0], g.linear[0, 0]))
            found[vertex] = round(abs(float(turn)))
    return found


def symbol(group: CrystallographicGroup) -> str:
    """Return the symbol of a group without mirrors, from its rotation centres and lines.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> symbol(wallpaper_group("pgg"))
    'pgg'
    """
    elements = symmetry_elements(group)
    order = max((center.order for center in elements.centers), default=1)
    if any(line.is_mirror for line in elements.lines):
        return "with mirrors"
    if not elements.lines:
        return f"p{order}"
    return {1: "pg", 2: "pgg"}.get(order, f"p{order}g")


def _draw_templates(canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
    figure = canvas.figure(0.72)
    for number, kind in enumerate(CLASSES.values()):
        box = grid_box(*divmod(number, 3), 3, 3, title=0.11, low=0.0)
        middle = (kind.template().min(axis=0) + kind.template().max(axis=0)) / 2
        half = 1.2
        axes = panel(figure, box, around(middle, half / 0.72, half))
        draw_template(axes, kind)
        _draw_angles(axes, kind, text_size(figure))
        caption(figure, box, kind.name, weight="bold", size=1.1)
    canvas.add(
        figure,
        "Nine templates: hexagons for IH1 to IH7, pentagons for IH21 and IH28. Identified edges "
        "share a colour and carry arrows; some vertices carry their angle.",
        "Identified edges share a colour, and their arrows are images of each other; an arrow "
        "with one barb belongs to a glide reflection, a lens to an edge that is turned onto "
        "itself. Degrees: angles that the class fixes.",
    )
    worst = max(identification_error(kind) for kind in CLASSES.values())
    angles = {name: constrained_angles(kind) for name, kind in CLASSES.items()}
    fixed = ", ".join(
        f"{name} {'/'.join(f'{a}°' for a in found.values())}"
        for name, found in angles.items()
        if found
    )
    return Findings(
        "agrees" if worst < 1e-12 else "differs",
        "Drawn from the table of groups alone: each edge's partner is found by the group, and "
        f"agrees to {tiny(worst)}. Angles are fixed where two identified edges meet in a rotation "
        f"centre: {fixed}.",
        numbers={"identification_error": worst, "angles": angles},
    )


def _draw_angles(axes: Axes, kind: IsohedralClass, size: float) -> None:
    vertices = kind.template()
    for vertex, degrees in constrained_angles(kind).items():
        corner = vertices[vertex]
        ends = vertices[[vertex - 1, (vertex + 1) % len(vertices)]] - corner
        angles = np.unwrap(np.arctan2(ends[::-1, 1], ends[::-1, 0]))
        arc = np.linspace(angles[0], angles[1], 40)
        points = corner + 0.17 * np.stack([np.cos(arc), np.sin(arc)], axis=1)
        axes.plot(*points.T, color=FAINT, linewidth=1.2)
        middle = arc.mean()
        x, y = corner + 0.36 * np.array([np.cos(middle), np.sin(middle)])
        axes.text(x, y, f"{degrees}°", ha="center", va="center", fontsize=0.8 * size, color=INK)


def _draw_groups(_canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
    rows, same, closures = [], [], []
    for name, kind in CLASSES.items():
        group = kind.group()
        closure = abs(group.order * abs(float(signed_area(kind.template()))) - group.cell_volume)
        found = symbol(group)
        same.append(found == GROUPS[name])
        closures.append(closure / group.cell_volume)
        rows.append(
            (
                name,
                GROUPS[name],
                found,
                str(group.order),
                " ".join(pair.brief for pair in kind.identified_edges),
                tiny(closures[-1]),
            )
        )
    headings = ("class", "paper", "found", "order", "edges", "order × area against |det B|")
    return Findings(
        "agrees" if all(same) and max(closures) < 1e-12 else "differs",
        "The groups are generated from the printed generators (Table 2), and their symbols are "
        "read off the rotation centres and glide lines that they turn out to have. All nine "
        "agree, and each closes: the group's order times the template's area is |det B| to "
        f"{tiny(max(closures))}.",
        numbers={"agree": sum(same), "closure": max(closures)},
        tables=[
            Table(
                "The nine classes; edges: = translation, ~ glide, > rotation, o half-turn.",
                headings,
                tuple(rows),
            )
        ],
    )


TEMPLATES = Exhibit(
    "figure-2",
    "Figure 2",
    "The nine isohedral classes and their identified edges",
    "The identification constraints of nine isohedral classes: hexagons and pentagons with edges "
    "colour-coded and oriented by arrowheads, in some cases with additional angular constraints.",
    _draw_templates,
)
GROUPS_TABLE = Exhibit(
    "table-1",
    "Table 1",
    "The classes' symmetry groups",
    "IH1 p1, IH2 and IH3 pg, IH4 p2, IH5 and IH6 pgg, IH7 p3, IH21 p6, IH28 p4.",
    _draw_groups,
)
