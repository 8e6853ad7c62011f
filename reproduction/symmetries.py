"""The three types of symmetry of a vector field, each drawn at a point and its images."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import CENTER_COLOURS, LINE_COLOUR, center_sign, evaluate, plane_axes
from orbiflow.fields import VectorField, periodic_operator
from orbiflow.symmetry import Isometry, Line, identity, rotation, transflection, translation
from reproduction.drawing import INK, Canvas, around, caption, grid_box, label, text_size, tiny
from reproduction.exhibit import Exhibit, Extent, Findings, Table
from reproduction.symmetrization import Operator, equivariance_error, nested, unit_field

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HALF = 1.3  # half the side of a panel's window
_MARKED, _FIRST = "#c2410c", "#7a1f00"
_CELL = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])


class Kind(NamedTuple):
    """A type of symmetry.

    - `title`, `equation`: The paper's title and equation, in one line each.
    - `lattice`: The field's lattice.
    - `operators`: The operators that make the field symmetric, none for periodicity.
    - `point`: The point that is marked.
    - `images`: The isometries under which it is marked, the identity first.
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


def _draw(canvas: Canvas, _extent: Extent, _values: list[Any]) -> Findings:
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
    vectors = evaluate(field, grid)
    top = float(np.linalg.norm(vectors, axis=1).max())
    axes.quiver(
        *grid.T, *vectors.T, color="#9fb3c8", angles="xy", scale_units="xy", scale=top / 0.22,
        width=0.0045, pivot="mid", zorder=2,
    )  # fmt: skip
    marked = np.stack([g(np.array(kind.point)) for g in kind.images])
    arrows = evaluate(field, marked)
    longest = float(np.linalg.norm(arrows, axis=1).max())
    axes.quiver(
        *marked.T, *arrows.T, color=[_FIRST, *[_MARKED] * (len(marked) - 1)], angles="xy",
        scale_units="xy", scale=longest / 0.42, width=0.012, zorder=6,
    )  # fmt: skip
    axes.plot(*marked.T, "o", color=_MARKED, markersize=7, zorder=7)
    axes.plot(*marked[0], "o", color=_FIRST, markersize=8, zorder=8)


def _draw_element(axes: Axes, kind: Kind, size: float) -> None:
    corner = -kind.lattice.sum(axis=1) / 2
    ring = corner + _CELL @ kind.lattice.T
    axes.plot(*ring.T, color="#56626e", linewidth=1.3, zorder=3)
    if not kind.operators:
        for k in (0, 1):
            style = {
                "arrowstyle": "-|>",
                "color": INK,
                "linewidth": 2.0,
                "shrinkA": 0,
                "shrinkB": 0,
            }
            axes.annotate("", corner + kind.lattice[:, k], corner, zorder=5, arrowprops=style)
            x, y = corner + kind.lattice[:, k] * 0.55 + ((0.02, -0.13), (-0.15, 0.02))[k]
            axes.text(x, y, ("b₁", "b₂")[k], fontsize=1.1 * size, color=INK, zorder=9)
    elif kind.operators[0][1] == 4:
        axes.fill(*center_sign(4, 0.07).T, facecolor=CENTER_COLOURS[4], zorder=9)
        axes.text(0.09, 0.07, "c", fontsize=1.1 * size, color=INK, zorder=9)
    else:
        axes.plot(
            [0, 0], [-HALF, HALF], color=LINE_COLOUR, linewidth=1.8, linestyle=(0, (6, 3)), zorder=4
        )
        axes.text(0.05, HALF - 0.22, "ℓ", fontsize=1.3 * size, color=LINE_COLOUR, zorder=9)


EXHIBIT = Exhibit(
    "figure-4",
    "Three types of symmetry of a vector field",
    "Periodicity, rotation equivariance and transflection equivariance arise in the vector field "
    "of a diffeomorphism under identification constraints; each is illustrated with its equation "
    "(equations 3 to 5).",
    _draw,
)
