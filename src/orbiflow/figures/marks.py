"""Marks of symmetry on a picture, in the crystallographers' signs.

Lens, triangle, square and hexagon for 2-, 3-, 4- and 6-fold centres; dashed glide lines, solid
mirrors (International Tables for Crystallography, volume A, section 1.4).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.elements import symmetry_elements
from orbiflow.symmetry.isometry import Array
from orbiflow.symmetry.lattices import reduced_basis
from orbiflow.tilings.window import Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CENTER_COLOURS = {2: "#c2410c", 3: "#6d28d9", 4: "#0f766e", 6: "#b91c1c"}
LINE_COLOUR = "#b91c1c"


def center_sign(order: int, size: float) -> Array:
    """(N, 2) outline of the sign of an n-fold centre at the origin, about `size` in radius."""
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
    """Mark all rotation centres and lines of `group` in `window`.

    Args:
        size: radius of the signs, in the group's units.
        halo: colour of the thin rim that sets the marks off the picture.
        pen: from widths of lines on a screen to those here, in points.
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
    colour: str = "#111111",
    pen: Callable[[float], float] = float,
) -> None:
    """Outline the lattice cell `cell_ring(group, middle)`; `pen` as in `mark_symmetry`."""
    ring = cell_ring(group, middle)
    for ink, width, alpha in (("#ffffff", 3.2, 0.7), (colour, 1.7, 1.0)):
        axes.plot(
            *ring.T, color=ink, linewidth=pen(width), alpha=alpha, solid_joinstyle="miter", zorder=5
        )


def cell_ring(group: CrystallographicGroup, middle: Array) -> Array:
    """(5, 2) closed ring: the reduced cell near `middle`, rotation centres of highest order at its
    corners.
    """
    basis = reduced_basis(group.lattice)
    reach = 2 * float(np.linalg.norm(basis, axis=0).max())
    found = symmetry_elements(group, middle, reach).centers
    highest = max((center.order for center in found), default=0)
    half = basis.sum(axis=1) / 2
    corners = [center.point for center in found if center.order == highest] or [middle - half]
    corner = min(corners, key=lambda point: round(float(np.linalg.norm(point + half - middle)), 9))
    return corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) @ basis.T
