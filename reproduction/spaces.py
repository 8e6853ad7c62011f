"""Squares with identified sides: as they flow, and the four spaces that they make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
import torch

from orbiflow.arrays import Array, Window
from orbiflow.density import SPACES, Space, make_space
from orbiflow.density.pictures import edge_pairs
from orbiflow.drawing import fill_rings, mark_symmetry, plane_axes, rgb
from orbiflow.fields import FourierField, VectorField, symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import IDENTIFICATION_SPACES, CrystallographicGroup, identification_group
from reproduction.drawing import (
    INK,
    Canvas,
    around,
    aspect_of,
    caption,
    draw_heads,
    draw_surface,
    grid_box,
    same_orbit,
    tiny,
)
from reproduction.exhibit import Exhibit, Extent, Findings, Table
from reproduction.symmetrization import nested_error, random_field, terms

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TWICE, BARE = "#d33f49", "#2b3440"  # what copies cover twice, and what they leave bare
POINTS = 120  # along each side
SHIFTS = [np.array([i, j]) for i in range(-2, 3) for j in range(-2, 3)]
_LARGER = CrystallographicGroup.generate(np.diag([2.7, 2.7]))


class Deformed(NamedTuple):
    """The square after a flow.

    - `sides`: Its sides (4, N, 2): bottom, right, top, left, each from its lower end.
    - `ring`: The boundary (M, 2), counter-clockwise.
    - `mismatch`: The largest distance of a side from its partner moved by the lattice vector.
    - `overlap`, `gap`: The areas, in squares, that the square's copies cover twice, and not at all.
    """

    sides: Array
    ring: Array
    mismatch: float
    overlap: float
    gap: float


def unconstrained_field(seed: int = 56) -> FourierField:
    """Return a smooth field of period 2.7, which has no symmetry of the unit square."""
    return random_field(_LARGER, 5, 0.35, smoothness=2.0, seed=seed)


def deformed(field: VectorField) -> Deformed:
    """Return the unit square after the time-one flow of a field, and how its sides fit."""
    t = np.linspace(0.0, 1.0, POINTS + 1)
    zero, one = np.zeros_like(t), np.ones_like(t)
    square = np.array([[t, zero], [one, t], [t, one], [zero, t]]).transpose(0, 2, 1)
    with torch.no_grad():
        sides = Flow(field, steps=32)(torch.tensor(square)).numpy()
    bottom, right, top, left = sides
    pairs = np.concatenate([right - left - [1, 0], top - bottom - [0, 1]])
    ring = np.concatenate([bottom[:-1], right[:-1], top[:0:-1], left[:0:-1]])
    copies = _shifted(shapely.make_valid(shapely.Polygon(ring)))
    cell = shapely.box(0, 0, 1, 1)  # in the middle of copies enough
    gap = 1.0 - shapely.union_all(copies).intersection(cell).area
    twice = sum(copy.intersection(cell).area for copy in copies) - (1.0 - gap)
    mismatch = float(np.linalg.norm(pairs, axis=1).max())
    return Deformed(sides, ring, mismatch, max(0.0, twice), max(0.0, gap))


def _shifted(geometry: Any) -> list[Any]:
    """Return the copies by the vectors of the lattice near the geometry."""
    return [shapely.transform(geometry, lambda p, s=shift: p + s) for shift in SHIFTS]


def _draw_flows(canvas: Canvas, _extent: Extent, _values: list[object]) -> Findings:
    field = unconstrained_field()
    free = deformed(field)
    bound = deformed(symmetrize(field, identification_group("torus")))
    still = deformed(lambda points: torch.zeros_like(points))
    figure = canvas.figure(0.345)
    panels = (
        (still, "(a) template: opposite sides are one"),
        (free, "(b) unconstrained flow"),
        (bound, "(c) the same field, symmetrized"),
    )
    for k, (one, title) in enumerate(panels):
        box = grid_box(0, k, 1, 3, title=0.09)
        axes = plane_axes(figure, around(one.ring.mean(axis=0), 1.04, 0.95), box=box)
        caption(figure, box, title)
        _draw_deformed(axes, one, copies=k > 0)
    canvas.add(
        figure,
        "Three squares. The first straight, its opposite sides in one colour. The second "
        "deformed: its opposite sides differ, and its copies overlap (red) and leave gaps "
        "(dark). The third deformed so that opposite sides are translates, and its copies fit "
        "without gap or overlap.",
        "Faint: copies by the lattice vectors. Red: covered twice. Dark: not covered. Both flows "
        "come from one field, integrated by 32 steps of RK4.",
    )
    worst = max(bound.mismatch, bound.overlap, bound.gap)
    return Findings(
        "agrees" if worst < 1e-9 < free.mismatch else "differs",
        "Flowed along a field without symmetry, opposite sides come apart by up to "
        f"{free.mismatch:.2f} of the side; copies of the shape overlap on "
        f"{100 * free.overlap:.0f} % of the plane and leave {100 * free.gap:.0f} % of it bare. "
        f"The very same field, symmetrized, moves opposite sides alike to {tiny(bound.mismatch)} "
        f"(rounding), and copies overlap on {tiny(bound.overlap)} of the plane.",
        numbers={
            "mismatch_unconstrained": free.mismatch,
            "mismatch_symmetrized": bound.mismatch,
            "overlap_unconstrained": free.overlap,
            "gap_unconstrained": free.gap,
            "overlap_symmetrized": bound.overlap,
        },
    )


def _draw_deformed(axes: Axes, found: Deformed, *, copies: bool) -> None:
    ring = found.ring
    if copies:
        fill_rings(axes, [ring + shift for shift in SHIFTS], "#e9eef3", "#9aa7b4", 0.8)
    fill_rings(axes, [ring], "#f4ecdc", "none", 0.0)
    if copies:
        own = shapely.make_valid(shapely.Polygon(ring))
        others = _shifted(own)
        window = shapely.box(-1.5, -1.5, 2.5, 2.5)
        _fill(axes, window - shapely.union_all(others), BARE)
        twice = shapely.union_all([own & other for other in others if other != own])
        _fill(axes, shapely.union_all(_shifted(twice)), TWICE)
    for number, side in enumerate(found.sides):
        upright = number % 2
        colour = EDGES[upright]
        axes.plot(*side.T, color=colour, linewidth=3.2, solid_capstyle="round", zorder=5)
        draw_heads(axes, side, colour, 1 if upright else 2)
    axes.plot(*found.sides[::2, [0, -1]].reshape(4, 2).T, "o", color=INK, markersize=4, zorder=7)


def _fill(axes: Axes, geometry: Any, colour: str) -> None:
    from shapely.plotting import plot_polygon

    areas = [part for part in getattr(geometry, "geoms", [geometry]) if part.area > 0]
    style = {"facecolor": colour, "edgecolor": "none", "zorder": 3}
    if areas:
        plot_polygon(shapely.MultiPolygon(areas), axes, add_points=False, **style)


SQUARE = Exhibit(
    "figure-1",
    "Constrained against unconstrained deformation",
    "A template square has its opposite sides identified: they must deform identically. An "
    "unconstrained diffeomorphism violates the constraint; flow symmetrization deforms the "
    "template while satisfying it.",
    _draw_flows,
)

TITLES: dict[str, str] = dict(
    zip(SPACES, ("torus", "sphere", "Klein bottle", "projective plane"), strict=True)
)
EDGES = ("#c2410c", "#1d4e79")
FILLS = ("#f4ecdc", "#c9dcec", "#f2cfa5", "#cfe3d4")  # of cells, by coset
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
LETTER = np.array(
    [[0, 0], [0, 5], [3, 5], [3, 4], [1, 4], [1, 3], [2.4, 3], [2.4, 2], [1, 2], [1, 0]]
)
# from where the surfaces are seen: yaw and pitch
TURNS: dict[str, tuple[float, float]] = dict(
    zip(SPACES, ((0.5, 0.75), (0.6, 0.35), (0.3, 0.75), (0.4, 0.5)), strict=True)
)


def euler_characteristic(group: CrystallographicGroup) -> int:
    """Return vertices minus edges plus one face of the unit square with the group's identified edges.

    >>> from orbiflow.symmetry import identification_group
    >>> [euler_characteristic(identification_group(s)) for s in ("torus", "projective-plane")]
    [0, 1]
    """
    orbits: list[Array] = []
    for corner in CORNERS:
        if not same_orbit(group, corner, orbits, 1e-9):
            orbits.append(corner)
    return len(orbits) - len(edge_pairs(group)) + 1


def orientable(group: CrystallographicGroup) -> bool:
    """Return whether no element of the group reverses orientation."""
    return all(g.determinant > 0 for g in group.cosets)


def _draw_spaces(canvas: Canvas, extent: Extent, _values: list[Any]) -> Findings:
    figure = canvas.figure(0.80)
    rows, found = [], {}
    for column, name in enumerate(SPACES):
        space = make_space(name)
        box = grid_box(0, column, 3, 4, title=0.10, gap=0.02)
        caption(figure, box, TITLES[name], weight="bold", size=1.1)
        _draw_square(plane_axes(figure, around((0.5, 0.5), 0.72, 0.72), box=box), space.group)
        box = grid_box(1, column, 3, 4, gap=0.02)
        window = around((1.0, 1.0), 2.0, 2.0 / aspect_of(figure, box))
        _draw_cells(plane_axes(figure, window, box=box), space.group, window)
        axes = figure.add_axes(grid_box(2, column, 3, 4, gap=0.0))
        draw_surface(axes, space, _checked(space, extent.resolution), TURNS[name])
        found[name] = chi, sided = euler_characteristic(space.group), orientable(space.group)
        rows.append((TITLES[name], space.group.name, str(chi), "yes" if sided else "no"))
    canvas.add(
        figure,
        "Four columns: torus, sphere, Klein bottle, projective plane. Above the square with "
        "identified edges, in the middle its tiling with a letter F in every cell, below the "
        "surface.",
        "Edges of one colour are one edge, in the sense of the arrows. In the tilings one fill "
        "for each aspect. Klein bottle (figure eight) and projective plane (Boy's surface) pass "
        "through themselves, as they must in space. They carry the square's chequerboard of 8 by "
        "8 fields, and its edges.",
        exact=True,
    )
    headings = ("space", "group", "Euler characteristic", "orientable")
    wanted = dict(zip(SPACES, ((0, True), (2, True), (0, False), (1, False)), strict=True))
    return Findings(
        "agrees" if found == wanted else "differs",
        "Each group identifies the square's edges in pairs, and counting vertices, edges and the "
        "face that are left gives the Euler characteristic: with orientability it proves which "
        "surface each is.",
        "The topology agrees, the geometry is more: on the sphere and the projective plane the "
        "plane's group has rotation centres at the square's corners. There the square's flat "
        "metric has cone points, of a quarter or half turn, that no symmetric flow can move; a "
        "density must be taken with respect to the round area to be one on the round sphere.",
        numbers={name: chi for name, (chi, _) in found.items()},
        tables=[Table("What the identifications make.", headings, rows)],
    )


def _draw_square(axes: Axes, group: CrystallographicGroup) -> None:
    axes.fill(*CORNERS.T, facecolor=FILLS[0])
    for number, pair in enumerate(edge_pairs(group)):
        for edge in pair:
            axes.plot(*edge.T, color=EDGES[number], linewidth=3.2, solid_capstyle="round", zorder=4)
            draw_heads(axes, edge, EDGES[number], number + 1)
    axes.fill(*(0.39 + 0.05 * LETTER).T, facecolor=INK)


def _draw_cells(axes: Axes, group: CrystallographicGroup, window: Window) -> None:
    for g in group.elements_near(np.ones(2), 4.5, source=np.full(2, 0.5)):
        aspect = next(i for i, c in enumerate(group.cosets) if np.allclose(c.linear, g.linear))
        axes.fill(*g(CORNERS).T, facecolor=FILLS[aspect], edgecolor="none", zorder=1)
        axes.fill(*g(0.12 + 0.055 * LETTER).T, facecolor=INK, zorder=3)
        for number, pair in enumerate(edge_pairs(group)):
            for edge in pair:
                axes.plot(*g(edge).T, color=EDGES[number], linewidth=1.4, zorder=2)
    mark_symmetry(axes, group, window, size=0.11)


def _checked(space: Space, n: int) -> Array:
    """Return a chequered square (n, n, 3) with its edges in their colours."""
    t = (np.arange(n) + 0.5) / n
    x, y = np.meshgrid(t, t, indexing="ij")
    odd = ((8 * x).astype(int) + (8 * y).astype(int)) % 2 == 1
    colours = np.where(odd[..., None], rgb(FILLS[1]), rgb(FILLS[0]))
    for number, pair in enumerate(edge_pairs(space.group)):
        for edge in pair:
            axis = int(abs(edge[1] - edge[0])[1] < 0.5)  # which coordinate is constant
            near = np.abs((y if axis else x) - edge[0][axis]) < 0.016
            colours[near] = rgb(EDGES[number])
    return colours / 255


def _draw_symmetrization(_canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
    rows, errors = [], []
    for name in SPACES:
        row = IDENTIFICATION_SPACES[name]
        space = make_space(name)
        operators = [(g, 4 if g.determinant > 0 else 2) for g in row.generators]
        errors.append(nested_error(space.group, operators))
        words = {4: "(c, 4)-rotation", 2: "(ℓ, μ)-transflection"}
        listed = ", ".join(words[k] for _, k in operators) or "B-periodic alone"
        closure = abs(space.group.order - space.group.cell_volume)
        size = f"{row.lattice[0][0]:g} × {row.lattice[1][1]:g}"
        rows.append(
            (TITLES[name], size, listed, space.group.name, str(space.group.order),
             str(terms(operators)), tiny(errors[-1]), tiny(closure))
        )  # fmt: skip
    closed = all(row[-1] == "0" for row in rows)
    title = "The paper's operators against the mean over the group (Reynolds operator)."
    headings = (
        "space", "cell", "generators", "group", "order", "terms of the nested sums", "difference",
        "order against |det B|",
    )  # fmt: skip
    return Findings(
        "agrees in part" if max(errors) < 1e-12 and closed else "differs",
        "The printed lattices and generators close: each group's order is the number of squares "
        "in its cell. The nested operators equal the mean over the cosets times the number of "
        f"their terms, to {tiny(max(errors))}.",
        "The method built on the table needs two corrections. A base that is not invariant under "
        "the group (the paper's von Mises distribution on the square) makes no density on the "
        "space: here it is summed over the group. And symmetric fields vanish at the corners of "
        "sphere and projective plane, so that a flow can never correct a density there: the base "
        "for these is the round area.",
        numbers={"nested_error": max(errors)},
        tables=[Table(title, headings, rows)],
    )


SPACES_FIGURE = Exhibit(
    "figure-3",
    "Four identifications of a square, and their tilings",
    "Different ways of identification in a template square result in torus, sphere, Klein bottle "
    "and projective plane. Copies of the square joined by the identification rule result in "
    "specific tiling patterns.",
    _draw_spaces,
)
SYMMETRIZATION = Exhibit(
    "table-4",
    "Symmetrization for identification spaces",
    "For each space the template, the translational unit B, its symmetries, and the symmetrized "
    "vector field as nested operators: V = P_B(F) for the torus, R_c(P_B(F)) for the sphere, "
    "G(P_B(F)) for the Klein bottle, G(G(P_B(F))) for the projective plane.",
    _draw_symmetrization,
)
