"""A picture of the choice between two aims: tiles by their deformation and their overlap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import Sheet
from orbiflow.errors import OrbiflowError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from orbiflow.tiles.tile import EscherTile

INK, PALE, GRID = "#1a1a1a", "#c4ccd4", "#eceff2"
COLOURS = {"likeness": "#1d4e79", "overlap": "#c8702a"}
NAMES = {"likeness": "found for likeness", "overlap": "found for overlap"}

# Height of a listed tile's silhouette, and of another tile's, as a share of the width
SIZE, SMALL = 0.075, 0.03
PUSHES = 400  # number of steps in which the silhouettes make room for each other


def front_png(
    chosen: Sequence[EscherTile], others: Sequence[EscherTile] = (), *, width_px: int = 1600
) -> bytes:
    """Return a PNG of tiles by deformation (to the right) and overlap (upwards), as silhouettes.

    Chosen tiles are large and coloured by what they were found for, with a line to their place if
    they had to make room; full colour means that no other chosen one beats them. Others are pale, and
    the dashed steps are the border of what chosen tiles beat. All have a deformation.
    """
    if not (chosen or others):
        raise OrbiflowError("a picture of a front needs at least one tile")
    sheet = Sheet.screen(width_px)
    figure = sheet.figure(round(0.7 * width_px) / sheet.dpi)
    axes = _axes(figure, chosen, others)
    _steps(axes, chosen or others)
    corner = axes.transAxes.transform((0, 0)), axes.transAxes.transform((1, 1))
    for tile, anchor in zip(others, axes.transData.transform(_values(others)), strict=True):
        _silhouette(axes, tile, anchor, SMALL * width_px, PALE, zorder=2)
    anchors = axes.transData.transform(_values(chosen))
    places = _apart(anchors, 1.25 * SIZE * width_px, corner)
    for tile, anchor, place in zip(chosen, anchors, places, strict=True):
        colour = COLOURS[tile.objective]
        if np.hypot(*(place - anchor)) > 2:
            axes.plot(*_in(axes, [anchor, place]), color=colour, linewidth=0.6, zorder=3)
        axes.plot(*_in(axes, [anchor]), "o", color=colour, markersize=3.2, zorder=6)
        alpha = 1.0 if tile.front else 0.55
        _silhouette(axes, tile, place, SIZE * width_px, colour, zorder=4, alpha=alpha)
        below = place - (0, 0.52 * SIZE * width_px)
        (x,), (y,) = _in(axes, [below])
        label = f"{tile.isohedral_class} {tile.rating or ''}"
        axes.text(x, y, label, ha="center", va="top", fontsize=6.5, color=INK, zorder=7)
    return sheet.file(figure)


def _values(tiles: Sequence[EscherTile]) -> Array:
    """Return deformation and IoU (n, 2) of tiles."""
    return np.array([(t.deformation, t.metrics.iou) for t in tiles], dtype=float).reshape(-1, 2)


def _axes(figure: object, chosen: Sequence[EscherTile], others: Sequence[EscherTile]) -> Axes:
    from matplotlib.lines import Line2D

    axes: Axes = figure.add_axes((0.075, 0.1, 0.9, 0.82))  # pyright: ignore[reportAttributeAccessIssue]
    # points far from all that are chosen would press the rest into a corner
    near = _values(chosen or others)
    low, high = near.min(axis=0), near.max(axis=0)
    room = np.maximum(0.18 * (high - low), (0.02, 0.01))
    axes.set_xlim(max(0.0, low[0] - room[0]), high[0] + 2 * room[0])
    axes.set_ylim(low[1] - 2 * room[1], min(1.0, high[1] + 1.2 * room[1]))
    axes.set_xlabel("deformation: what bending the silhouette costs", fontsize=8.5, color=INK)
    axes.set_ylabel("overlap with the silhouette as it is (IoU)", fontsize=8.5, color=INK)
    axes.tick_params(labelsize=7.5, colors=INK, length=2.5, width=0.6)
    axes.grid(color=GRID, linewidth=0.6, zorder=0)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color("#8a949e")
        spine.set_linewidth(0.7)
    kinds = [kind for kind in COLOURS if any(tile.objective == kind for tile in (*chosen, *others))]
    names = {COLOURS[kind]: NAMES[kind] for kind in kinds}
    names[PALE] = "left out: beaten, or much like one that is shown"
    marks = [
        Line2D([], [], marker="o", ls="", ms=5, color=colour, label=name)
        for colour, name in names.items()
    ]
    corner = {"loc": "lower left", "bbox_to_anchor": (0, 1)}
    axes.legend(handles=marks, fontsize=7.5, frameon=False, ncols=3, **corner)
    return axes


def _steps(axes: Axes, tiles: Sequence[EscherTile]) -> None:
    """Draw the border of what is beaten by others."""
    cost, overlap = np.array(sorted(_values(tiles).tolist())).T
    x = np.append(cost, axes.get_xlim()[1])
    y = np.maximum.accumulate(np.append(overlap, 0.0))
    axes.step(x, y, where="post", color="#8a949e", linewidth=0.8, linestyle="--", zorder=1)


def _silhouette(
    axes: Axes, tile: EscherTile, place: Array, size: float, colour: str, **style: Any
) -> None:
    """Draw a tile as a marker, `size` pixels long."""
    from matplotlib.path import Path

    ring = tile.tile.polygon * (1.0, -1.0 if tile.y_down else 1.0)
    marker = Path(ring - (ring.min(axis=0) + ring.max(axis=0)) / 2)
    points = size * 72 / axes.figure.dpi
    axes.plot(
        *_in(axes, [place]), marker=marker, markersize=points, color=colour,
        markeredgecolor="white", markeredgewidth=0.5, **style,
    )  # fmt: skip


def _in(axes: Axes, pixels: Sequence[Array]) -> tuple[Array, Array]:
    """Return x and y of pixels in the axes' own units."""
    values = axes.transData.inverted().transform(np.array(pixels))
    return values[:, 0], values[:, 1]


def _apart(anchors: Array, gap: float, corner: tuple[Array, Array]) -> Array:
    """Return places (n, 2) near the anchors, at least `gap` apart, inside the corners' box."""
    turns = 2.4 * np.arange(len(anchors))  # the golden angle: equal ones part in all directions
    places = anchors + np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    low, high = corner[0] + gap / 2, corner[1] - gap / 3
    for _ in range(PUSHES):
        ways = places[:, None] - places[None]
        far = np.linalg.norm(ways, axis=2) + np.eye(len(places)) * 2 * gap
        push = np.maximum(gap - far, 0)[..., None] * ways / far[..., None]
        places = np.clip(places + 0.4 * push.sum(axis=1) + 0.02 * (anchors - places), low, high)
    return places
