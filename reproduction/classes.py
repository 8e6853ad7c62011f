"""The nine classes: templates with identified edges and angles, symmetry groups, and tilings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.drawing import cell_ring, plane_axes
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    RotationCenter,
    rotation,
    symmetry_elements,
    transflection,
)
from orbiflow.tiles import (
    CLASSES,
    IsohedralClass,
    draw_key,
    draw_template,
    draw_tiling,
    signed_area,
)
from reproduction.drawing import (
    FAINT,
    INK,
    Canvas,
    around,
    caption,
    grid_box,
    same_orbit,
    text_size,
    tiny,
)
from reproduction.exhibit import Exhibit, Extent, Findings, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# the paper's table of symmetry groups, as printed
GROUPS = {
    "IH1": "p1", "IH2": "pg", "IH3": "pg", "IH4": "p2", "IH5": "pgg", "IH6": "pgg", "IH7": "p3",
    "IH21": "p6", "IH28": "p4",
}  # fmt: skip


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
        axes = plane_axes(figure, around(middle, half / 0.72, half), box=box)
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
    words = {name: "/".join(f"{a}°" for a in found.values()) for name, found in angles.items()}
    fixed = ", ".join(f"{name} {degrees}" for name, degrees in words.items() if degrees)
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
        edges = " ".join(pair.brief for pair in kind.identified_edges)
        rows.append((name, GROUPS[name], found, str(group.order), edges, tiny(closures[-1])))
    signs = "= translation, ~ glide, > rotation, o half-turn"
    headings = ("class", "paper", "found", "order", "edges", "order × area against |det B|")
    return Findings(
        "agrees" if all(same) and max(closures) < 1e-12 else "differs",
        "The groups are generated from the printed generators (Table 2), and their symbols are "
        "read off the rotation centres and glide lines that they turn out to have. All nine "
        "agree, and each closes: the group's order times the template's area is |det B| to "
        f"{tiny(max(closures))}.",
        numbers={"agree": sum(same), "closure": max(closures)},
        tables=[Table(f"The nine classes; edges: {signs}.", headings, rows)],
    )


TEMPLATES = Exhibit(
    "figure-2",
    "The nine isohedral classes and their identified edges",
    "The identification constraints of nine isohedral classes: hexagons and pentagons with edges "
    "colour-coded and oriented by arrowheads, in some cases with additional angular constraints.",
    _draw_templates,
)
GROUPS_TABLE = Exhibit(
    "table-1",
    "The classes' symmetry groups",
    "IH1 p1, IH2 and IH3 pg, IH4 p2, IH5 and IH6 pgg, IH7 p3, IH21 p6, IH28 p4.",
    _draw_groups,
)


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
        alike = [other.point for other in orbits if other.order == center.order]
        if not same_orbit(group, center.point, alike, 1e-6):
            orbits.append(center)
    return orbits


def _draw_tilings(canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
    figure = canvas.figure(0.94)
    rows, wrong = [], 0
    for number, kind in enumerate(CLASSES.values()):
        group = kind.group()
        box = grid_box(*divmod(number, 3), 3, 3, title=0.09, low=0.045)
        middle = (kind.template().min(axis=0) + kind.template().max(axis=0)) / 2
        middle = (middle + cell_ring(group, middle)[:4].mean(axis=0)) / 2
        aspect = box[2] / (box[3] * 0.94)
        window = around(middle, 4.1 * aspect, 4.1)
        draw_tiling(plane_axes(figure, window, box=box), kind, window)
        caption(figure, box, f"{kind.name}  ({kind.group_name})", size=1.0)
        wrong += sum(not group.contains(g) for g in drawn_elements(group))
        orders = [center.order for center in center_orbits(group)]
        lines = symmetry_elements(group).lines
        ways = len({tuple(np.abs(line.line.direction).round(6)) for line in lines})
        kinds = sorted(set(orders), reverse=True)
        shown = ", ".join(f"{orders.count(k)} of order {k}" for k in kinds)
        glides = ("none", "one way", "two ways")[ways]
        rows.append((kind.name, kind.group_name, shown or "none", glides))
    headings = ("class", "group", "orbits of centres", "glide lines")
    draw_key(figure)
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
            Table("Orbits of rotation centres, and directions of glide lines.", headings, rows)
        ],
    )


TILINGS = Exhibit(
    "figure-6",
    "The symmetries of each tiling",
    "The tiling pattern of each of the nine classes: its unit of periodicity as a black "
    "quadrilateral, lines of transflection in red, rotation centres of each order as coloured "
    "symbols.",
    _draw_tilings,
)
