"""Panels of a figure: axes in a grid, their titles, and numbers as texts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Window
from orbiflow.drawing import plane_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, FAINT = "#16202a", "#56626e"

SAMPLES = 200
"""Of a field's magnitude, along a panel's side."""

Box = tuple[float, float, float, float]
"""Left, bottom, width and height in shares of the figure."""


def grid_box(
    row: int,
    column: int,
    rows: int,
    columns: int,
    *,
    title: float = 0.0,
    gap: float = 0.012,
    low: float = 0.0,
    left: float = 0.0,
    top: float = 0.0,
) -> Box:
    """The box of a panel in an even grid.

    Args:
        title: share of the cell's height kept free above.
        gap: left free around it, in shares of the figure's width.
        low, left, top: shares of the figure kept free at its foot, its left and its head.
    """
    width, height = (1 - left) / columns, (1 - low - top) / rows
    bottom = low + (rows - 1 - row) * height
    return (
        left + column * width + gap / 2,
        bottom + 0.03 * height,
        width - gap,
        (0.97 - title) * height,
    )


def text_size(figure: Figure) -> float:
    """Of a figure's texts, in points: they can be read at the page's width."""
    return 1.05 * figure.get_figwidth()


def panel(
    figure: Figure, box: Box, window: Window, title: str = "", *, y_down: bool = False
) -> Axes:
    """Axes that show a window of the plane, with a title above."""
    axes = plane_axes(figure, window, box=box, y_down=y_down)
    if title:
        caption(figure, box, title)
    return axes


def caption(
    figure: Figure, box: Box, title: str, *, weight: str = "normal", size: float = 1.0
) -> None:
    """A title above a box."""
    figure.text(
        box[0] + box[2] / 2, box[1] + box[3] + 0.006, title, ha="center", va="bottom",
        fontsize=size * text_size(figure), color=INK, weight=weight,
    )  # fmt: skip


def around(middle: ArrayLike, half_width: float, half_height: float) -> Window:
    """The window about a point (2,)."""
    x, y = (float(value) for value in np.asarray(middle))
    return x - half_width, y - half_height, x + half_width, y + half_height


def tiny(value: float) -> str:
    """A residue in one digit.

    >>> tiny(3.14e-16), tiny(0.0)
    ('3e-16', '0')
    """
    return "0" if value == 0 else f"{value:.0e}"
