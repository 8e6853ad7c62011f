"""Pictures of vector fields and the marks of symmetry, on Matplotlib axes without margins."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.drawing.sheet import Picture, Sheet
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, reduced_basis, symmetry_elements

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plane_axes(
    figure: Figure, window: Window, *, y_down: bool = False, box: Any = (0.0, 0.0, 1.0, 1.0)
) -> Axes:
    """Add invisible axes that show a window in the figure's `box`, undistorted."""
    axes = figure.add_axes(box)
    axes.set_axis_off()
    axes.set_xlim(window[0], window[2])
    axes.set_ylim(*((window[3], window[1]) if y_down else (window[1], window[3])))
    axes.set_aspect("equal")
    return axes


def fill_rings(axes: Axes, rings: list[Array], fill: str, outline: str, width: float) -> None:
    """Fill closed polygons, with an outline of `width` points."""
    from matplotlib.collections import PolyCollection

    made = PolyCollection(rings, facecolors=fill, edgecolors=outline, linewidths=width)
    made.set_joinstyle("round")
    axes.add_collection(made, autolim=False)


CENTER_COLOURS = {2: "#c2410c", 3: "#6d28d9", 4: "#0f766e", 6: "#b91c1c"}
LINE_COLOUR = "#b91c1c"


def center_sign(order: int, size: float) -> Array:
    """Return the outline (N, 2) of the sign of an n-fold centre, about `size` in radius."""
    if order != 2:
        angles = np.pi / 2 + 2 * np.pi * np.arange(order) / order
        if order == 4:
            angles += np.pi / 4
        scale = {3: 1.15, 4: 1.1, 6: 1.0}[order]
        return scale * size * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    arc = np.linspace(-1.0, 1.0, 17)  # two shallow arcs that meet in points
    upper = np.stack([arc, 0.5 * (1 - arc**2)], axis=1)
    return 1.15 * size * np.concatenate([upper, -upper])[:, ::-1]


def mark_symmetry(
    axes: Axes,
    group: CrystallographicGroup,
    window: Window,
    *,
    size: float,
    halo: str = "#ffffff",
    pen: Callable[[float], float] = float,
) -> None:
    """Mark all rotation centres and lines of a group in a window.

    Signs have the radius `size` in the group's units; `halo` is the colour of a thin rim that separates
    marks from the picture; `pen` makes widths of lines here, in points, from those on a screen.
    """
    low, high = np.array(window[:2]), np.array(window[2:])
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    elements = symmetry_elements(group, middle, reach)
    for line in elements.lines:
        ends = np.stack([line.line.point + s * reach * line.line.direction for s in (-1.0, 1.0)])
        style = "-" if line.is_mirror else (0, (5, 3))
        axes.plot(*ends.T, color=halo, linewidth=pen(2.2), alpha=0.5, zorder=4)
        axes.plot(*ends.T, color=LINE_COLOUR, linewidth=pen(1.2), linestyle=style, zorder=5)
    for center in elements.centers:
        sign = center.point + center_sign(center.order, size)
        axes.fill(
            *sign.T, facecolor=CENTER_COLOURS[center.order], edgecolor=halo, linewidth=pen(0.6),
            zorder=6,
        )  # fmt: skip


def outline_cell(
    axes: Axes,
    group: CrystallographicGroup,
    middle: Array,
    *,
    pen: Callable[[float], float] = float,
) -> None:
    """Outline the lattice cell `cell_ring(group, middle)`, with a pen as in `mark_symmetry`."""
    ring = cell_ring(group, middle)
    for ink, width, alpha in (("#ffffff", 3.2, 0.7), ("#111111", 1.7, 1.0)):
        axes.plot(
            *ring.T, color=ink, linewidth=pen(width), alpha=alpha, solid_joinstyle="miter", zorder=5
        )


def cell_ring(group: CrystallographicGroup, middle: Array) -> Array:
    """Return the closed ring (5, 2) of the reduced cell near `middle`.

    Its corners are rotation centres of the highest order.
    """
    basis = reduced_basis(group.lattice)
    reach = 2 * float(np.linalg.norm(basis, axis=0).max())
    centers = symmetry_elements(group, middle, reach).centers
    highest = max((center.order for center in centers), default=0)
    half = basis.sum(axis=1) / 2
    corners = [center.point for center in centers if center.order == highest] or [middle - half]
    corner = min(corners, key=lambda point: round(float(np.linalg.norm(point + half - middle)), 9))
    return corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) @ basis.T


_STEPS = 12


def symmetric_seeds(group: CrystallographicGroup, spacing: float, *, tries: int = 600) -> Array:
    """Return points (N, 2) in the cell, whole orbits, all about `spacing` apart, always the same.

    A random orbit is kept if all its points are `spacing` away from those kept before.
    """
    darts = np.random.default_rng(0).random((tries, 2)) @ group.lattice.T
    shifts: Array = (
        np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2) @ group.lattice.T
    )
    kept = np.empty((0, 2))
    for dart in darts:
        orbit = group.wrap(np.stack([g(dart) for g in group.cosets]))
        others = np.concatenate([kept, orbit[1:]])
        gaps = np.linalg.norm(others[:, None] + shifts - orbit[0], axis=-1)
        if gaps.size == 0 or gaps.min() >= spacing:
            kept = np.concatenate([kept, orbit])
    return kept


def flow_lines(velocity: Callable[[Array], Array], seeds: Array, length: float) -> Array:
    """Return flow lines (M, 13, 2) of at most this length, with the seed in the middle.

    They are integrated (midpoint rule) at a speed that is near one where the field is strong and goes
    to zero with the field, so that lines end in a sink and do not jitter around it. Seeds where the
    field vanishes are left out.
    """
    speeds = np.linalg.norm(velocity(seeds), axis=-1)
    strongest = float(speeds.max(initial=0.0))
    if strongest == 0.0:
        return np.empty((0, _STEPS + 1, 2))
    step = length / _STEPS

    def direction(points: Array) -> Array:
        vectors = velocity(points)
        return vectors / (np.linalg.norm(vectors, axis=-1, keepdims=True) + 0.05 * strongest)

    def walk(sign: float) -> list[Array]:
        points = [seeds]
        for _ in range(_STEPS // 2):
            half = points[-1] + 0.5 * sign * step * direction(points[-1])
            points.append(points[-1] + sign * step * direction(half))
        return points

    lines = np.stack([*walk(-1.0)[:0:-1], *walk(1.0)], axis=1)
    return lines[speeds > 1e-9 * strongest]


_SAMPLES = 400
"""Points along the longer side at which a magnitude is evaluated."""


def field_picture(
    velocity: Callable[[Any], Any],
    group: CrystallographicGroup,
    tile: Any = None,
    *,
    window: Window | None = None,
    sheet: Sheet | None = None,
) -> Picture:
    """Draw a vector field: its magnitude as colour, short flow lines over it.

    This is the paper's figure of results. The lines start at orbits of the group, so the picture has
    the symmetry that the field has, and shows where the field lacks it.

    Args:
        velocity: A function from points (..., 2) to vectors (..., 2), called with a torch tensor of
            float64 or of the module's dtype. For a NumPy field f give
            `lambda points: f(points.numpy())`.
        group: The group whose lattice cell is outlined, and whose centres and lines are marked.
        tile: A tile to draw on top: anything with a `polygon` (N, 2) and a `center` (2,).
        window: The window. Default: about four cells around the tile or the origin.
        sheet: The sheet. Default: a screen of 1200 pixels.

    Raises:
        OrbiflowError: If the field does not return finite vectors of the points' shape.
    """
    sheet = sheet or Sheet.screen(1200)
    middle = np.zeros(2) if tile is None else tile.center
    window = window or _about_four_cells(group, middle)
    figure = sheet.figure(sheet.width * (window[3] - window[1]) / (window[2] - window[0]))
    axes = plane_axes(figure, window)
    draw_magnitude(axes, velocity, window)
    draw_flow(axes, velocity, group, window, pen=sheet.pen)
    outline_cell(axes, group, middle, pen=sheet.pen)
    if tile is not None:
        ring = np.concatenate([tile.polygon, tile.polygon[:1]])
        axes.plot(*ring.T, color="#111111", linewidth=sheet.pen(2.6), zorder=5)
        axes.plot(*ring.T, color="#ffd166", linewidth=sheet.pen(1.5), zorder=5)
    size = 0.03 * np.sqrt(group.cell_volume)
    mark_symmetry(axes, group, window, size=size, pen=sheet.pen)
    return Picture(figure, sheet, "Vector field", "Colour is the field's magnitude.")


def draw_magnitude(axes: Axes, velocity: Callable[[Any], Any], window: Window) -> None:
    """Colour a window by a field's magnitude."""
    longer = max(window[2] - window[0], window[3] - window[1])
    counts = [max(2, round(_SAMPLES * (window[i + 2] - window[i]) / longer)) for i in (0, 1)]
    x, y = (np.linspace(window[i], window[i + 2], counts[i]) for i in (0, 1))
    points = np.stack(np.meshgrid(x, y), axis=-1)
    vectors = evaluate(velocity, points)
    limits = axes.get_ylim()
    axes.imshow(
        np.linalg.norm(vectors, axis=-1), extent=(window[0], window[2], window[1], window[3]),
        origin="lower", cmap="viridis", interpolation="bicubic", aspect="auto",
    )  # fmt: skip
    axes.set_xlim(window[0], window[2])  # imshow moves the limits
    axes.set_ylim(*limits)
    axes.set_aspect("equal")


def draw_flow(
    axes: Axes,
    velocity: Callable[[Any], Any],
    group: CrystallographicGroup,
    window: Window,
    *,
    pen: Callable[[float], float] = float,
) -> None:
    """Draw lines with heads and fading tails from orbits of a group, with a pen as `mark_symmetry`."""
    from matplotlib.collections import LineCollection, PolyCollection

    scale = np.sqrt((window[2] - window[0]) * (window[3] - window[1]))
    seeds = _in_window(symmetric_seeds(group, 0.028 * scale), group, window, 0.05 * scale)
    lines = flow_lines(lambda points: evaluate(velocity, points), seeds, 0.075 * scale)
    # fading tails say which way the flow goes
    segments = np.stack([lines[:, :-1], lines[:, 1:]], axis=2).reshape(-1, 2, 2)
    alpha = np.tile(np.linspace(0.05, 0.9, lines.shape[1] - 1), len(lines))
    colours = np.concatenate([np.ones((len(segments), 3)), alpha[:, None]], axis=1)
    tails = LineCollection(list(segments), colors=colours, linewidths=pen(0.9), zorder=2)
    axes.add_collection(tails)
    # heads are at the seeds, which keep their distance; at the ends they would pile up in sinks
    middle = lines.shape[1] // 2
    along = lines[:, middle + 1] - lines[:, middle - 1]
    along = 0.009 * scale * along / np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    across = 0.4 * along[:, ::-1] * (-1.0, 1.0)
    seeds = lines[:, middle]
    heads: Array = np.stack([seeds + along, seeds + across, seeds - across], axis=1)
    axes.add_collection(
        PolyCollection(list(heads), facecolors="#ffffff", edgecolors="none", zorder=3)
    )


def _in_window(seeds: Array, group: CrystallographicGroup, window: Window, margin: float) -> Array:
    """Return all translates of the seeds by lattice vectors that lie in the window or near it."""
    low, high = np.array(window[:2]) - margin, np.array(window[2:]) + margin
    corners = np.array([low, high, (low[0], high[1]), (high[0], low[1])]) @ group.inverse_lattice.T
    ranges: list[Array] = [
        np.arange(np.floor(c.min()) - 1, np.ceil(c.max()) + 1) for c in corners.T
    ]
    shifts: Array = np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 1, 2) @ group.lattice.T
    points = (seeds + shifts).reshape(-1, 2)
    return points[((points >= low) & (points <= high)).all(axis=1)]


def evaluate(velocity: Callable[[Any], Any], points: Array) -> Array:
    """Return a field that is written in torch at NumPy points (..., 2)."""
    import torch

    dtype = torch.float64
    if isinstance(velocity, torch.nn.Module):
        dtype = next((p.dtype for p in velocity.parameters()), dtype)
    with torch.no_grad():
        vectors = velocity(torch.as_tensor(points, dtype=dtype))
    values = np.asarray(vectors, dtype=float)
    if values.shape != points.shape or not np.isfinite(values).all():
        raise OrbiflowError(
            f"the field has to return finite vectors of shape {points.shape}, got {values.shape}"
        )
    return values


def _about_four_cells(group: CrystallographicGroup, middle: Array) -> Window:
    """Return a window with the area of four cells or so, and roughly their proportions."""
    sides = np.abs(reduced_basis(group.lattice)).sum(axis=1)
    aspect = float(np.clip(sides[0] / sides[1], 2 / 3, 3 / 2))
    area = 4.6 * group.cell_volume
    half = np.sqrt(area * np.array([aspect, 1 / aspect])) / 2
    return (*(middle - half).tolist(), *(middle + half).tolist())
