"""A matplotlib figure without axes, margins or global state, and its PNG bytes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.patch import Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 200
MAX_PIXELS = 20_000
"""Largest width or height of a picture."""


def blank_figure(width_px: int, height_px: int, paper: str = "#ffffff") -> Figure:
    """A figure of that size in pixels.

    Raises:
        OrbiflowError: if a side is below 16 or above `MAX_PIXELS` pixels.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not (16 <= width_px <= MAX_PIXELS and 16 <= height_px <= MAX_PIXELS):
        raise OrbiflowError(
            f"a picture of {width_px} by {height_px} pixels cannot be made: sides go from 16 to "
            f"{MAX_PIXELS}; change the width or the window"
        )
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


def captioned_axes(
    rings: Sequence[Array], width_px: int, *, y_down: bool, text: str
) -> tuple[Figure, Axes, Axes]:
    """Axes that show all of `rings` (N, 2) with a margin, over a strip that `text` stands in.

    Returns:
        The figure, `width_px` wide; the picture's axes; and the strip's, from 0 to 1 both ways, free
        from x = 0.4 on, with the size of its text as the default.
    """
    low = np.min([ring.min(axis=0) for ring in rings], axis=0)
    high = np.max([ring.max(axis=0) for ring in rings], axis=0)
    margin = 0.03 * float((high - low).max())
    window = (*(low - margin).tolist(), *(high + margin).tolist())
    picture = round(width_px * (window[3] - window[1]) / (window[2] - window[0]))
    legend = round(0.075 * width_px)
    figure = blank_figure(width_px, picture + legend)
    share = legend / (picture + legend)
    axes = plane_axes(figure, window, y_down=y_down, box=(0.0, share, 1.0, 1.0 - share))
    strip = figure.add_axes((0.0, 0.0, 1.0, share))
    strip.set_axis_off()
    strip.set_xlim(0, 1)
    strip.set_ylim(0, 1)
    strip_text(strip, 0.03, text, weight="bold")
    return figure, axes, strip


def strip_text(strip: Axes, x: float, text: str, **style: Any) -> None:
    """Words in a strip of `captioned_axes`."""
    size = 10.5 * strip.figure.get_figwidth() / 8  # pyright: ignore[reportAttributeAccessIssue]
    strip.text(x, 0.5, text, va="center", fontsize=size, color="#1a1a1a", **style)


def fill_rings(axes: Axes, rings: list[Array], fill: str, outline: str, width: float) -> None:
    """Filled closed polygons; `width` of the outline in points."""
    from matplotlib.collections import PolyCollection

    axes.add_collection(
        PolyCollection(
            rings, facecolors=fill, edgecolors=outline, linewidths=width, joinstyle="round"
        ),
        autolim=False,
    )


def fill_geometry(axes: Axes, geometry: Any, fill: str) -> None:
    """Fill a shapely geometry, holes left open; lines and points in it are ignored."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    for part in getattr(geometry, "geoms", [geometry]):
        if part.geom_type == "Polygon" and not part.is_empty:
            rings = [np.asarray(ring.coords) for ring in (part.exterior, *part.interiors)]
            path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            axes.add_patch(PathPatch(path, facecolor=fill, edgecolor=fill, linewidth=0.2))
        elif hasattr(part, "geoms"):
            fill_geometry(axes, part, fill)


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
