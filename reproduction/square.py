"""Constrained against unconstrained: the square whose opposite sides must deform alike."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
import torch

from orbiflow.arrays import Array
from orbiflow.drawing import fill_rings
from orbiflow.fields import FourierField, VectorField, symmetrize
from orbiflow.flows import Flow
from orbiflow.symmetry import CrystallographicGroup, identification_group
from reproduction.drawing import INK, Canvas, around, draw_heads, grid_box, panel, tiny
from reproduction.exhibit import Exhibit, Extent, Findings
from reproduction.symmetrization import random_field

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIDES = ("#1d4e79", "#c2410c")  # of the pair left and right, and of the pair bottom and top
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


def _draw(canvas: Canvas, _extent: Extent, _values: list[object]) -> Findings:
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
        axes = panel(figure, box, around(one.ring.mean(axis=0), 1.04, 0.95), title)
        _draw_square(axes, one, copies=k > 0)
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


def _draw_square(axes: Axes, found: Deformed, *, copies: bool) -> None:
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
        colour = SIDES[0] if upright else SIDES[1]
        axes.plot(*side.T, color=colour, linewidth=3.2, solid_capstyle="round", zorder=5)
        draw_heads(axes, side, colour, 1 if upright else 2)
    axes.plot(*found.sides[::2, [0, -1]].reshape(4, 2).T, "o", color=INK, markersize=4, zorder=7)


def _fill(axes: Axes, geometry: Any, colour: str) -> None:
    from shapely.plotting import plot_polygon

    areas = [part for part in getattr(geometry, "geoms", [geometry]) if part.area > 0]
    style = {"facecolor": colour, "edgecolor": "none", "zorder": 3}
    if areas:
        plot_polygon(shapely.MultiPolygon(areas), axes, add_points=False, **style)


EXHIBIT = Exhibit(
    "figure-1",
    "Constrained against unconstrained deformation",
    "A template square has its opposite sides identified: they must deform identically. An "
    "unconstrained diffeomorphism violates the constraint; flow symmetrization deforms the "
    "template while satisfying it.",
    _draw,
)
