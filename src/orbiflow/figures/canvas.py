"""A matplotlib figure without axes, margins or global state, and its PNG bytes."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.window import Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 200
MAX_PIXELS = 20_000
"""Largest width or height of a picture."""


def check_size(width_px: int, height_px: int) -> None:
    """Nothing, if a picture can have this size.

    Raises:
        OrbiflowError: if a side is below 16 or above `MAX_PIXELS` pixels.
    """
    if not (16 <= width_px <= MAX_PIXELS and 16 <= height_px <= MAX_PIXELS):
        raise OrbiflowError(
            f"a picture of {width_px} by {height_px} pixels cannot be made: sides go from 16 to "
            f"{MAX_PIXELS}; change the width or the window"
        )


def blank_figure(width_px: int, height_px: int, paper: str = "#ffffff") -> Figure:
    """A figure of that size in pixels.

    Raises:
        OrbiflowError: if a side is below 16 or above `MAX_PIXELS` pixels.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    check_size(width_px, height_px)
    figure = Figure(figsize=(width_px / DPI, height_px / DPI), dpi=DPI, facecolor=paper)
    FigureCanvasAgg(figure)
    return figure


def plane_axes(
    figure: Figure, window: Window, *, y_down: bool = False, box: Any = (0.0, 0.0, 1.0, 1.0)
) -> Axes:
    """Invisible axes that show `window` in the figure's `box`, undistorted."""
    axes = figure.add_axes(box)
    axes.set_axis_off()
    axes.set_xlim(window[0], window[2])
    axes.set_ylim(*((window[3], window[1]) if y_down else (window[1], window[3])))
    axes.set_aspect("equal")
    return axes


def fill_rings(axes: Axes, rings: list[Array], fill: str, outline: str, width: float) -> None:
    """Filled closed polygons; `width` of the outline in points."""
    from matplotlib.collections import PolyCollection

    axes.add_collection(
        PolyCollection(
            rings, facecolors=fill, edgecolors=outline, linewidths=width, joinstyle="round"
        ),
        autolim=False,
    )


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG, at exactly its size."""
    buffer = io.BytesIO()
    figure.savefig(
        buffer,
        format="png",
        pil_kwargs={"compress_level": 3},
        dpi=DPI,
        facecolor=figure.get_facecolor(),
    )
    return buffer.getvalue()
