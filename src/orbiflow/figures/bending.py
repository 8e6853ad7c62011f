"""Picture of a silhouette that was bent into a tile: what moved, and where to."""

from __future__ import annotations

import numpy as np
import shapely

from orbiflow.figures.canvas import blank_figure, fill_rings, plane_axes, png_bytes
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import Tile

TILE, GHOST, ARROW = "#d7dee6", "#9a8c7a", "#b0413e"
STILL = 0.03
"""Distance, in square roots of the area, up to which a point counts as not moved."""


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
    low = np.min([ring.min(axis=0) for ring in (rest, bent, tile.polygon)], axis=0)
    high = np.max([ring.max(axis=0) for ring in (rest, bent, tile.polygon)], axis=0)
    margin = 0.03 * float((high - low).max())
    window = (*(low - margin).tolist(), *(high + margin).tolist())
    picture = round(width_px * (window[3] - window[1]) / (window[2] - window[0]))
    legend = round(0.075 * width_px)
    figure = blank_figure(width_px, picture + legend)
    share = legend / (picture + legend)
    axes = plane_axes(figure, window, y_down=y_down, box=(0.0, share, 1.0, 1.0 - share))
    fill_rings(axes, [tile.polygon], TILE, "none", 0)
    size = float(np.sqrt(shapely.Polygon(tile.polygon).area))
    moved = np.linalg.norm(bent - rest, axis=1) / size
    closed = np.concatenate([rest, rest[:1]])
    axes.plot(*closed.T, color=GHOST, linewidth=1.3, linestyle=(0, (4, 3)), zorder=2)
    colours = _outline(axes, bent, moved)
    _arrows(axes, rest, bent, moved, size)
    _legend(figure, share, label or tile.isohedral_class or "", colours)
    return png_bytes(figure)


def _outline(axes, bent: Array, moved: Array):
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


def _arrows(axes, rest: Array, bent: Array, moved: Array, size: float) -> None:
    """Where the outline went, at points some way apart that went far."""
    taken: list[int] = []
    for k in np.argsort(-moved):
        if moved[k] < 2 * STILL or len(taken) == 24:
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


def _legend(figure, share: float, text: str, colours) -> None:
    strip = figure.add_axes((0.0, 0.0, 1.0, share))
    strip.set_axis_off()
    strip.set_xlim(0, 1)
    strip.set_ylim(0, 1)
    size = 10.5 * figure.get_figwidth() / 8
    style = {"va": "center", "fontsize": size, "color": "#1a1a1a"}
    strip.text(0.03, 0.5, text, weight="bold", **style)
    strip.plot([0.47, 0.52], [0.5, 0.5], color=GHOST, linewidth=1.3, linestyle=(0, (4, 3)))
    strip.text(0.53, 0.5, "as it was", **style)
    strip.imshow(
        np.linspace(0, 1, 64)[None], extent=(0.70, 0.80, 0.38, 0.62), aspect="auto", cmap=colours
    )
    strip.text(0.81, 0.5, "moved, little to far", **style)
    strip.set_xlim(0, 1)
    strip.set_ylim(0, 1)
