"""What exhibits draw with: a canvas for pictures as PNG and PDF, panels, tiles, tilings, surfaces."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from PIL import Image

from orbiflow.arrays import Array, Window
from orbiflow.density import Space
from orbiflow.density.pictures import immersion
from orbiflow.drawing import PALETTES, Sheet, fill_rings, plane_axes
from orbiflow.runtime import write_atomic
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import Tile, colouring, copies_meeting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHEET = Sheet.screen(1800)


class Picture(NamedTuple):
    """A PNG of the page, its size in pixels, and the kind and name of each other file that shows it."""

    file: str
    alt: str
    caption: str
    width: int
    height: int
    others: tuple[tuple[str, str], ...] = ()


class Canvas:
    """A writer of an exhibit's figures into a folder, in files whose names begin with `name`."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name = folder, name
        self.pictures: list[Picture] = []

    def figure(self, height: float) -> Figure:
        """Return an empty figure `height` times as high as it is wide."""
        return SHEET.figure(height * SHEET.width)

    def add(
        self,
        figure: Figure,
        alt: str,
        caption: str = "",
        *,
        part: str = "",
        pages: dict[str, str] | None = None,
        exact: bool = False,
    ) -> None:
        """Write a figure as PNG and PDF, with its `Picture`; `part` sets apart several of an exhibit.

        `pages` are texts of further files by their names. Unless it must be `exact`, the PNG has 256
        colours and a third of the bytes.
        """
        stem = f"{self.name}-{part}" if part else self.name
        image = Image.open(io.BytesIO(SHEET.file(figure))).convert("RGB")
        if not exact:  # no dither: it would triple the bytes
            image = image.quantize(256, dither=Image.Dither.NONE)
        png = io.BytesIO()
        image.save(png, "PNG", optimize=True)
        write_atomic(self.folder / f"{stem}.png", png.getvalue())
        write_atomic(self.folder / f"{stem}.pdf", replace(SHEET, format="pdf").file(figure))
        others = [("PDF", f"{stem}.pdf")]
        for file, text in (pages or {}).items():
            write_atomic(self.folder / f"{self.name}-{file}.html", text)
            others.append((file.replace("-", " "), f"{self.name}-{file}.html"))
        self.pictures.append(Picture(f"{stem}.png", alt, caption, *image.size, tuple(others)))


INK, FAINT = "#16202a", "#56626e"

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
    """Return the box of a panel in an even grid, counted from the upper left.

    Kept free are the share `title` of the cell's height above the panel, the share `gap` of the
    figure's width between panels, and the shares `low`, `left` and `top` of the figure at its sides.
    """
    width, height = (1 - left) / columns, (1 - low - top) / rows
    bottom = low + (rows - 1 - row) * height
    x, y = left + column * width + gap / 2, bottom + 0.03 * height
    return x, y, width - gap, (0.97 - title) * height


def text_size(figure: Figure) -> float:
    """Return the size in points of a figure's texts, legible at the page's width."""
    return 1.05 * figure.get_figwidth()


def panel_of(
    figure: Figure, box: Box, rings: list[Array], margin: float = 0.05, *, y_down: bool = False
) -> Axes:
    """Return axes that show all `rings`, with a margin as a share of their size."""
    points = np.concatenate(rings)
    low, high = points.min(axis=0), points.max(axis=0)
    aspect = aspect_of(figure, box)
    half = (0.5 + margin) * (high - low)
    half = np.maximum(half, half[::-1] * (aspect, 1 / aspect))
    window = around((low + high) / 2, *half)
    return plane_axes(figure, window, box=box, y_down=y_down)


def aspect_of(figure: Figure, box: Box) -> float:
    """Return a box's width over its height."""
    return box[2] * figure.get_figwidth() / (box[3] * figure.get_figheight())


def caption(figure: Figure, box: Box, title: str, **style: Any) -> None:
    """Write a title above a box, in a style as `label`."""
    label(figure, box[0] + box[2] / 2, box[1] + box[3] + 0.006, title, va="bottom", **style)


def label(
    figure: Figure, x: float, y: float, text: str, *, size: float = 1.0, **style: Any
) -> None:
    """Write a text about a place of the figure."""
    style = {"ha": "center", "va": "center", "color": INK, **style}
    figure.text(x, y, text, fontsize=size * text_size(figure), **style)


def around(middle: ArrayLike, half_width: float, half_height: float) -> Window:
    """Return the window around a point (2,)."""
    x, y = (float(value) for value in np.asarray(middle))
    return x - half_width, y - half_height, x + half_width, y + half_height


def same_orbit(
    group: CrystallographicGroup, point: Array, others: list[Array], tolerance: float
) -> bool:
    """Return whether a point (2,) is an image of one of the others."""
    steps = [(group.images(point) - other) @ group.inverse_lattice.T for other in others]
    return any((np.abs(s - s.round()).max(axis=-1) < tolerance).any() for s in steps)


def tiny(value: float) -> str:
    """Return a residue in one digit.

    >>> tiny(3.14e-16), tiny(0.0)
    ('3e-16', '0')
    """
    return "0" if value == 0 else f"{value:.0e}"


# A tile's fill, a goal's outline over it, a tile's outline
TILE, GOAL, EDGE = "#8ab6d9", "#c2410c", "#16202a"


def draw_over(axes: Axes, tiles: list[Array], goal: Array, width: float) -> None:
    """Draw a filled tile (N, 2), if there is one, and the outline (M, 2) of what it is to look like."""
    fill_rings(axes, tiles, TILE, EDGE, 0.7 * width)
    fill_rings(axes, [goal], "none", GOAL, width)


def draw_tiling(axes: Axes, tile: Tile, window: Window) -> None:
    """Draw all copies of a tile that meet a window, neighbours in different colours."""
    palette = PALETTES["delft"]
    copies = copies_meeting(tile, window)
    rings, own = copies.images(tile.polygon), colouring(tile).colours(copies)
    for number in np.unique(own):
        fill = palette.fill(int(number))
        fill_rings(axes, list(rings[own == number]), fill, palette.outline, 0.5)


def draw_heads(axes: Axes, side: Array, colour: str, count: int) -> None:
    """Draw arrowheads in the middle of a polyline (N, 2), by its length."""
    steps = np.linalg.norm(np.diff(side, axis=0), axis=1)
    at = np.concatenate([[0], np.cumsum(steps)])
    for k in range(count):
        tip, back = (
            np.array([np.interp(at[-1] / 2 + s, at, side[:, i]) for i in (0, 1)])
            for s in (0.045 + 0.07 * k, -0.045 + 0.07 * k)
        )
        across = 0.5 * np.array([back[1] - tip[1], tip[0] - back[0]])
        head = np.stack([tip, back + across, back - across])
        axes.fill(*head.T, facecolor=colour, edgecolor="#ffffff", linewidth=0.6, zorder=6)


LIGHT = np.array([-0.45, 0.55, 0.70])  # the direction of the light, from the left above the eye
EYE = 6.0  # the distance of the eye, in radii of the surface


def draw_surface(axes: Axes, space: Space, colours: Array, turn: tuple[float, float]) -> None:
    """Draw a space's surface into axes without a frame: small faces, from the back to the front.

    The RGB `colours` (n, n, 3), 0 to 1, are those of the faces of the square's even grid, x first.
    `turn` is the yaw and pitch of the eye in radians.
    """
    from matplotlib.collections import PolyCollection

    n = len(colours)
    t = torch.linspace(0.0, 1.0, n + 1, dtype=torch.float64)
    grid = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)
    points = immersion(space)(grid)
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points, axis=1).max())
    yaw, pitch = turn
    toward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    seen = (points / radius) @ np.stack([right, np.cross(toward, right), toward]).T
    corners = seen.reshape(n + 1, n + 1, 3)
    around_face = corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]
    faces = np.stack(around_face, axis=2).reshape(-1, 4, 3)
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    sight = np.array([0, 0, EYE]) - faces.mean(axis=1)
    normals *= np.sign((normals * sight).sum(axis=1, keepdims=True))  # surfaces have two sides
    shade = 0.62 + 0.38 * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    order = np.argsort(faces[..., 2].mean(axis=1))
    flat = faces[..., :2] * (EYE / (EYE - faces[..., 2:]))
    fills = np.clip(colours.reshape(-1, 3) * shade[:, None], 0, 1)
    inks = {"facecolors": fills[order], "edgecolors": fills[order]}
    axes.add_collection(PolyCollection(list(flat[order]), linewidths=0.35, rasterized=True, **inks))
    axes.set(xlim=(-1.12, 1.12), ylim=(-1.12, 1.12), aspect="equal")
    axes.set_axis_off()
