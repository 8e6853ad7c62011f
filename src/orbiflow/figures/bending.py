"""Picture of a silhouette that was bent into a tile: what moved, and where to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from orbiflow.figures.canvas import captioned_axes, fill_rings, png_bytes, strip_text
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import Tile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

TILE, GHOST, ARROW = "#d7dee6", "#9a8c7a", "#b0413e"
STILL = 0.06
"""Distance, in square roots of the area, up to which no arrow is drawn."""


def bending_png(
    tile: Tile,
    rest: Array,
    bent: Array,
    *,
    width_px: int = 1600,
    y_down: bool = False,
    label: str = "",
) -> bytes:
    """PNG of a tile with the bent silhouette's outline, coloured by how far each point went.

    The silhouette as it was is a faint dashed line; arrows lead from it to the tile where it bent.

    Args:
        tile: filled, in the input's coordinates.
        rest, bent: (n, 2) outlines of the silhouette as it was and bent, point by point.
        width_px: the height follows.
        y_down: whether the y axis points down, as in images.
        label: in front of the legend, default the class.
    """
    text = label or tile.isohedral_class or ""
    figure, axes, strip = captioned_axes(
        [rest, bent, tile.polygon], width_px, y_down=y_down, text=text
    )
    fill_rings(axes, [tile.polygon], TILE, "none", 0)
    size = float(np.sqrt(abs(tile.signed_area)))
    moved = np.linalg.norm(bent - rest, axis=1) / size
    closed = np.concatenate([rest, rest[:1]])
    axes.plot(*closed.T, color=GHOST, linewidth=1.3, linestyle=(0, (4, 3)), zorder=2)
    colours = _outline(axes, bent, moved)
    _arrows(axes, rest, bent, moved, size)
    _legend(strip, colours)
    return png_bytes(figure)


def _outline(axes: Axes, bent: Array, moved: Array) -> Colormap:
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("moved", ["#1d4e79", "#d98a2b", ARROW])
    segments = np.stack([bent, np.roll(bent, -1, axis=0)], axis=1)
    values = np.clip((moved + np.roll(moved, -1)) / 2 / 0.3, 0, 1)
    lines = LineCollection(
        list(segments), colors=colours(values), linewidths=2.6, capstyle="round", zorder=4
    )
    axes.add_collection(lines)
    return colours


def _arrows(axes: Axes, rest: Array, bent: Array, moved: Array, size: float) -> None:
    """Where the outline went, at points some way apart that went far."""
    taken: list[int] = []
    for k in np.argsort(-moved):
        if moved[k] < STILL or len(taken) == 24:
            break
        near = [np.linalg.norm(rest[k] - rest[other]) < 0.16 * size for other in taken]
        if not any(near):
            taken.append(int(k))
    for k in taken:
        axes.annotate(
            "",
            xy=tuple(bent[k]),
            xytext=tuple(rest[k]),
            arrowprops={"arrowstyle": "-|>", "color": GHOST, "lw": 1.2, "shrinkA": 0, "shrinkB": 2},
            zorder=3,
        )


def _legend(strip: Axes, colours: Colormap) -> None:
    strip.plot([0.47, 0.52], [0.5, 0.5], color=GHOST, linewidth=1.3, linestyle=(0, (4, 3)))
    strip_text(strip, 0.53, "as it was")
    extent = (0.70, 0.80, 0.38, 0.62)
    strip.imshow(np.linspace(0, 1, 64)[None], extent=extent, aspect="auto", cmap=colours)
    strip_text(strip, 0.81, "moved, little to far")
    strip.set_xlim(0, 1)  # imshow moves the limits
    strip.set_ylim(0, 1)
