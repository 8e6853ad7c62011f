"""Matplotlib figures without margins or global state, and the marks of symmetry on them."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.drawing.sheet import Sheet
from orbiflow.symmetry import CrystallographicGroup, reduced_basis, symmetry_elements

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 200


def blank_figure(width_px: int, height_px: int) -> Figure:
    """Return an empty figure of this size in pixels."""
    return Sheet.screen(width_px).figure(height_px / DPI)


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

    axes.add_collection(
        PolyCollection(
            rings, facecolors=fill, edgecolors=outline, linewidths=width, joinstyle="round"
        ),
        autolim=False,
    )


def png_bytes(figure: Figure) -> bytes:
    """Return the figure as PNG, at exactly its size."""
    buffer = io.BytesIO()
    figure.savefig(
        buffer,
        format="png",
        pil_kwargs={"compress_level": 3},
        dpi=DPI,
        facecolor=figure.get_facecolor(),
    )
    return buffer.getvalue()


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
    found = symmetry_elements(group, middle, reach)
    for line in found.lines:
        ends = np.stack([line.line.point + s * reach * line.line.direction for s in (-1.0, 1.0)])
        style = "-" if line.is_mirror else (0, (5, 3))
        axes.plot(*ends.T, color=halo, linewidth=pen(2.2), alpha=0.5, zorder=4)
        axes.plot(*ends.T, color=LINE_COLOUR, linewidth=pen(1.2), linestyle=style, zorder=5)
    for center in found.centers:
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
    found = symmetry_elements(group, middle, reach).centers
    highest = max((center.order for center in found), default=0)
    half = basis.sum(axis=1) / 2
    corners = [center.point for center in found if center.order == highest] or [middle - half]
    corner = min(corners, key=lambda point: round(float(np.linalg.norm(point + half - middle)), 9))
    return corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) @ basis.T
