"""Symmetric vector fields: the figure of the three types, and the table of symmetrizations.

Do the table's rows close, and is what they make symmetric? Its nested sums, as printed, are compared
with the mean over the group.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.drawing import CENTER_COLOURS, LINE_COLOUR, center_sign, evaluate, plane_axes
from orbiflow.fields import (
    FourierField,
    VectorField,
    periodic_operator,
    summed_over_powers,
    symmetrize,
)
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    Line,
    identity,
    rotation,
    rotation_matrix,
    transflection,
    translation,
)
from orbiflow.tiles import CLASSES, IsohedralClass, signed_area
from reproduction.drawing import INK, Canvas, around, caption, grid_box, label, text_size, tiny
from reproduction.exhibit import Exhibit, Extent, Findings, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A generator g and the number K of terms: V -> sum over k < K of g^-k o V o g^k
Operator = tuple[Isometry, int]

OMEGA = 5
TURN = 0.5  # the angle in radians by which the affine map A turns
UNIT_CELL = CrystallographicGroup.generate(np.eye(2))


_CAPTION = (
    f"Each row of the table. Violations are relative to the field's root mean square, Ω = {OMEGA}."
)
_HEADINGS = (
    "class", "order × area = |det B|", "terms nested", "nested − mean", "parameters, paper",
    "parameters, here", "violation as printed", "violation with A V(A⁻¹ z)",
)  # fmt: skip


def random_field(
    group: CrystallographicGroup, max_frequency: int, size: float, *, smoothness: float, seed: int
) -> FourierField:
    """Return a smooth field of a group, with random parameters of standard deviation `size`."""
    field = FourierField(group, max_frequency, smoothness=smoothness)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        field.parameters_.normal_(generator=generator).mul_(size)
    return field


def unit_field(max_frequency: int = 3, seed: int = 0) -> FourierField:
    """Return the paper's F: periodic on the unit square, with random coefficients."""
    size = 1 / math.sqrt(FourierField(UNIT_CELL, max_frequency).size)
    return random_field(UNIT_CELL, max_frequency, size, smoothness=1.0, seed=seed)


def nested(field: VectorField, operators: Sequence[Operator]) -> VectorField:
    """Apply operators to a field, the first outermost: O_1(O_2(...(V)))."""
    for g, count in reversed(operators):
        field = summed_over_powers(field, g, count)
    return field


def terms(operators: Sequence[Operator]) -> int:
    """Return the number of the field's evaluations in the nested sums."""
    return math.prod(count for _, count in operators)


@torch.no_grad()
def nested_error(group: CrystallographicGroup, operators: Sequence[Operator]) -> float:
    """Return the largest difference of the nested sums, over their terms, from the group's mean.

    It is taken at random points, relative to the field's root mean square.
    """
    periodic = periodic_operator(unit_field(), group.lattice)
    points = _points()
    paper = nested(periodic, operators)(points) / terms(operators)
    mean = symmetrize(periodic, group, periodic=True)(points)
    return float((paper - mean).norm(dim=-1).max() / mean.square().sum(dim=-1).mean().sqrt())


@torch.no_grad()
def equivariance_error(
    field: VectorField, elements: Sequence[Isometry], count: int = 200, seed: int = 1
) -> float:
    """Return the largest |V(g p) - R_g V(p)| over elements and points, over V's root mean square."""
    points = _points(count, seed)
    values = field(points)
    worst = max(float((field(g(points)) - g.push(values)).norm(dim=-1).max()) for g in elements)
    return worst / float(values.square().sum(dim=-1).mean().sqrt())


def _points(count: int = 200, seed: int = 1) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return 4 * torch.rand(count, 2, generator=generator, dtype=torch.float64) - 2


def as_printed(kind: IsohedralClass, linear: Array) -> VectorField:
    """Return the paper's V(z) = V_sym(A^-1 z), for a map A without translation."""
    periodic = periodic_operator(unit_field(), kind.group().lattice)
    field = symmetrize(periodic, kind.group(), periodic=True)
    inverse = torch.tensor(np.linalg.inv(linear))
    return lambda points: field(points @ inverse.mT)


def pushed(kind: IsohedralClass, linear: Array) -> VectorField:
    """Return the same field pushed forward by A: A V_sym(A^-1 z)."""
    field = as_printed(kind, linear)
    matrix = torch.tensor(linear)
    return lambda points: field(points) @ matrix.mT


def _draw_table(_canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
    linear = 1.3 * rotation_matrix(TURN)
    rows, nestings, printed, mended = [], [], {}, []
    for name, kind in CLASSES.items():
        group, operators = kind.group(), kind.paper_operators()
        placed = group.conjugate(linear, np.zeros(2))
        nestings.append(nested_error(group, operators))
        printed[name] = equivariance_error(as_printed(kind, linear), placed.cosets)
        mended.append(equivariance_error(pushed(kind, linear), placed.cosets))
        area = abs(float(signed_area(kind.template())))
        closure = f"{group.order} × {area:.3f} = {group.cell_volume:.3f}"
        sizes = str(2 * 4 * (OMEGA + 1) ** 2), str(FourierField(group, OMEGA).size)
        violation = tiny(printed[name]) if printed[name] < 1e-9 else f"{printed[name]:.2f}"
        nesting = str(terms(operators)), tiny(nestings[-1])
        title = f"{name} ({kind.group_name})"
        rows.append((title, closure, *nesting, *sizes, violation, tiny(mended[-1])))
    broken = [name for name, error in printed.items() if error > 1e-9]
    right = max(nestings) < 1e-11 and max(mended) < 1e-11
    return Findings(
        "agrees in part" if right and broken else "agrees" if right else "differs",
        "All nine rows close as printed: order times area is |det B|. The nested sums are the "
        f"mean over the cosets times the number of their terms, to {tiny(max(nestings))}; the "
        "mean needs a term for each coset, and a Fourier field whose coefficients are "
        "symmetrized once needs one evaluation and has 1/|G| of the parameters.",
        "The last step of the printed equation, V(z) = V_sym(A⁻¹ z), is wrong for "
        f"{', '.join(broken)}. A vector field must be pushed forward, A V_sym(A⁻¹ z): without it "
        f"the glide reflections are lost as soon as A turns (here by {TURN:g} rad). Translations "
        "survive, and rotations, which commute with A. We compose D = A ∘ L ∘ flow instead, with "
        "the flow in the group's own frame and L the lattice's freedom.",
        numbers={
            "nested_error": max(nestings),
            "printed_error": printed,
            "pushed_error": max(mended),
        },
        tables=[Table(_CAPTION, _HEADINGS, rows)],
    )


TABLE = Exhibit(
    "table-2",
    "Symmetrization for the nine isohedral classes",
    "For each class the template, the basic translation unit B = [b1, b2], all its symmetries, "
    "and the symmetrized vector field: nested operators around P_B(F), composed with A⁻¹, the "
    "inverse of the affine transformation found in the first phase.",
    _draw_table,
)

HALF = 1.3  # half the side of a panel's window
_MARKED, _FIRST = "#c2410c", "#7a1f00"
_CELL = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])


class Kind(NamedTuple):
    """A type of symmetry, with the paper's title and equation.

    - `operators`: The operators that make the field symmetric, none for periodicity.
    - `point`, `images`: What is marked: a point under isometries, the identity first.
    """

    title: str
    equation: str
    lattice: Array
    operators: tuple[Operator, ...]
    point: tuple[float, float]
    images: tuple[Isometry, ...]

    def before(self) -> VectorField:
        """Return a periodic field without the symmetry; for periodicity itself, on another lattice."""
        lattice = self.lattice if self.operators else np.eye(2)
        return periodic_operator(unit_field(1, seed=7), lattice)

    def after(self) -> VectorField:
        """Return the field that the paper's operators make."""
        return nested(periodic_operator(unit_field(1, seed=7), self.lattice), self.operators)


def _kinds() -> tuple[Kind, ...]:
    oblique = np.array([[1.1, 0.35], [0.0, 0.95]])
    turn = rotation((0.0, 0.0), 4)
    glide = transflection(Line((0.0, 0.0), (0.0, 1.0)), 0.75)
    steps = ((0, 0), (1, 0), (0, 1), (1, 1), (-1, 0), (0, -1), (-1, -1))
    moves = tuple(translation(oblique @ np.array(step)) for step in steps)
    turns = (identity(2), turn, turn @ turn, turn.inverse())
    glides = (identity(2), glide, glide.inverse())
    return (
        Kind("B-periodic", "V(p + m b₁ + n b₂) = V(p)", oblique, (), (-0.35, -0.12), moves),
        Kind(
            "(c, 4)-rotation equivariant", "V(R_c p) = R_o V(p)", 1.6 * np.eye(2), ((turn, 4),),
            (0.62, 0.15), turns,
        ),
        Kind(
            "(ℓ, μ)-transflection equivariant", "V(T M p) = M_o V(p)", np.diag([1.6, 1.5]),
            ((glide, 2),), (0.42, -0.15), glides,
        ),
    )  # fmt: skip


KINDS = _kinds()


def _draw_figure(canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
    figure = canvas.figure(0.43)
    rows, after = [], []
    for k, kind in enumerate(KINDS):
        box = grid_box(0, k, 1, 3, title=0.10, low=0.10)
        axes = plane_axes(figure, around((0.0, 0.0), HALF, HALF), box=box)
        _draw_field(axes, kind)
        _draw_element(axes, kind, text_size(figure))
        caption(figure, box, kind.title, size=1.1)
        equation = re.sub(r"([A-Z])_(\w)", r"$\\mathrm{\1}_\\mathrm{\2}$", kind.equation)
        label(figure, box[0] + box[2] / 2, 0.055, equation, va="baseline")
        fields = kind.before(), kind.after()
        found = [equivariance_error(field, kind.images, 300, seed=2) for field in fields]
        after.append(found[1])
        rows.append((kind.title, kind.equation, f"{found[0]:.1f}", tiny(found[1])))
    canvas.add(
        figure,
        "Three fields of arrows. In the first the same vector stands at all translates of a "
        "point, in the second vectors turn with a point about a centre, in the third a vector is "
        "mirrored where the point is glided along a dashed line.",
        "Bold: the vector at one point, dark, and at its images. Grey outline: the lattice's "
        "cell. R_c turns by a quarter about c, R_o vectors by as much; M is the mirror in ℓ, T "
        "moves along it by μ, M_o mirrors vectors.",
    )
    title = "Largest violation of each equation, in root mean squares of the field."
    return Findings(
        "agrees" if max(after) < 1e-12 else "differs",
        "Each operator applied to a random Fourier field without the symmetry gives it to "
        f"rounding error: the equations hold to {tiny(max(after))} of the field's size at 300 "
        "points.",
        numbers={kind.title: value for kind, value in zip(KINDS, after, strict=True)},
        tables=[Table(title, ("symmetry", "equation", "before", "after"), rows)],
    )


def _draw_field(axes: Axes, kind: Kind) -> None:
    field = kind.after()
    # a grid that the symmetries map to itself: of the lattice, about its middle
    steps = (np.arange(-60, 60) + 0.5) / 10
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) @ kind.lattice.T
    grid = grid[(np.abs(grid) < HALF).all(axis=1)]
    _draw_arrows(axes, field, grid, 0.22, color="#9fb3c8", width=0.0045, pivot="mid", zorder=2)
    marked = np.stack([g(np.array(kind.point)) for g in kind.images])
    inks = [_FIRST, *[_MARKED] * (len(marked) - 1)]
    _draw_arrows(axes, field, marked, 0.42, color=inks, width=0.012, zorder=6)
    axes.plot(*marked.T, "o", color=_MARKED, markersize=7, zorder=7)
    axes.plot(*marked[0], "o", color=_FIRST, markersize=8, zorder=8)


def _draw_arrows(
    axes: Axes, field: VectorField, points: Array, longest: float, **style: Any
) -> None:
    vectors = evaluate(field, points)
    scale = float(np.linalg.norm(vectors, axis=1).max()) / longest
    axes.quiver(*points.T, *vectors.T, angles="xy", scale_units="xy", scale=scale, **style)


def _draw_element(axes: Axes, kind: Kind, size: float) -> None:
    corner = -kind.lattice.sum(axis=1) / 2
    ring = corner + _CELL @ kind.lattice.T
    axes.plot(*ring.T, color="#56626e", linewidth=1.3, zorder=3)
    style = {"fontsize": 1.1 * size, "color": INK, "zorder": 9}
    if not kind.operators:
        units = {"angles": "xy", "scale_units": "xy", "scale": 1}
        axes.quiver(*np.stack([corner] * 2).T, *kind.lattice, color=INK, zorder=5, **units)
        asides = ((0.02, -0.13), (-0.15, 0.02))
        for name, vector, aside in zip(("b₁", "b₂"), kind.lattice.T, asides, strict=True):
            x, y = corner + 0.55 * vector + aside
            axes.text(x, y, name, **style)
    elif kind.operators[0][1] == 4:
        axes.fill(*center_sign(4, 0.07).T, facecolor=CENTER_COLOURS[4], zorder=9)
        axes.text(0.09, 0.07, "c", **style)
    else:
        dashed = {"linewidth": 1.8, "linestyle": (0, (6, 3)), "zorder": 4}
        axes.plot([0, 0], [-HALF, HALF], color=LINE_COLOUR, **dashed)
        axes.text(0.05, HALF - 0.22, "ℓ", **{**style, "color": LINE_COLOUR})


FIGURE = Exhibit(
    "figure-4",
    "Three types of symmetry of a vector field",
    "Periodicity, rotation equivariance and transflection equivariance arise in the vector field "
    "of a diffeomorphism under identification constraints; each is illustrated with its equation "
    "(equations 3 to 5).",
    _draw_figure,
)
