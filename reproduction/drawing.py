"""What exhibits draw with: a canvas for pictures as PNG and PDF, panels, tiles, tilings, surfaces."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from PIL import Image

from orbiflow.arrays import Array, Window
from orbiflow.density import Space, immersion, viewpoint
from orbiflow.drawing import DPI, PALETTES, blank_figure, fill_rings, plane_axes, png_bytes
from orbiflow.runtime import write_atomic
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import Tile, colouring, copies_meeting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 1800  # the usual width of a picture in pixels


class Picture(NamedTuple):
    """A picture of the page.

    - `file`: The PNG.
    - `alt`: What one sees, in words.
    - `caption`: What it means.
    - `width`, `height`: The size of the PNG in pixels.
    - `others`: The kind and name of each further file that shows the same.
    """

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

    def figure(self, height: float, width: int = WIDTH) -> Figure:
        """Return an empty figure `width` pixels wide and `height` times as high."""
        return blank_figure(width, round(height * width))

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
        picture = png_bytes(figure)
        write_atomic(self.folder / f"{stem}.png", picture if exact else _fewer_colours(picture))
        write_atomic(self.folder / f"{stem}.pdf", pdf_bytes(figure))
        others = [("PDF", f"{stem}.pdf")]
        for file, text in (pages or {}).items():
            write_atomic(self.folder / f"{self.name}-{file}.html", text)
            others.append((file.replace("-", " "), f"{self.name}-{file}.html"))
        size = (figure.get_size_inches() * DPI).round().astype(int)
        self.pictures.append(
            Picture(f"{stem}.png", alt, caption, int(size[0]), int(size[1]), tuple(others))
        )


def _fewer_colours(png: bytes) -> bytes:
    image = Image.open(io.BytesIO(png)).convert("RGB")
    buffer = io.BytesIO()
    # no dither: it would triple the bytes
    image.quantize(256, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def pdf_bytes(figure: Figure) -> bytes:
    """Return the figure as PDF in curves, with fonts that journals accept; always the same bytes."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"pdf.fonttype": 42}):
        figure.savefig(
            buffer,
            format="pdf",
            dpi=DPI,
            facecolor=figure.get_facecolor(),
            metadata={"CreationDate": None, "Creator": "orbiflow"},
        )
    return buffer.getvalue()


INK, FAINT = "#16202a", "#56626e"
SAMPLES = 200  # number of samples of a field's magnitude along a panel's side

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


def panel(
    figure: Figure, box: Box, window: Window, title: str = "", *, y_down: bool = False
) -> Axes:
    """Return axes that show a window of the plane, with a title above."""
    axes = plane_axes(figure, window, box=box, y_down=y_down)
    if title:
        caption(figure, box, title)
    return axes


def caption(
    figure: Figure, box: Box, title: str, *, weight: str = "normal", size: float = 1.0
) -> None:
    """Write a title above a box."""
    x, y = box[0] + box[2] / 2, box[1] + box[3] + 0.006
    label(figure, x, y, title, size=size, va="bottom", weight=weight)


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


def draw_over(axes: Axes, ring: Array, goal: Array, *, width: float = 1.0) -> None:
    """Draw a filled tile (N, 2) and the outline (M, 2) of what it is to look like."""
    fill_rings(axes, [ring], TILE, EDGE, 0.7 * width)
    fill_rings(axes, [goal], "none", GOAL, width)


def draw_tiling(axes: Axes, tile: Tile, window: Window) -> None:
    """Draw all copies of a tile that meet a window, neighbours in different colours."""
    palette = PALETTES["delft"]
    copies = copies_meeting(tile, window)
    rings, own = copies.images(tile.polygon), colouring(tile).colours(copies)
    for number in np.unique(own):
        fill = palette.fill(int(number))
        fill_rings(axes, list(rings[own == number]), fill, palette.outline, 0.5)


def window_of(rings: list[Array], aspect: float, margin: float = 0.05) -> Window:
    """Return the window with this width over height around all points of `rings`."""
    points = np.concatenate(rings)
    low, high = points.min(axis=0), points.max(axis=0)
    half = (0.5 + margin) * (high - low)
    half = np.maximum(half, half[::-1] * (aspect, 1 / aspect))
    return around((low + high) / 2, float(half[0]), float(half[1]))


LIGHT = np.array([-0.45, 0.55, 0.70])  # the direction of the light, from the left above the eye
EYE = 6.0  # the distance of the eye, in radii of the surface


def draw_surface(
    axes: Axes,
    space: Space,
    colours: Array,
    *,
    turn: tuple[float, float] | None = None,
    front: tuple[float, float] = (0.5, 0.5),
) -> None:
    """Draw a space's surface into axes without a frame: small faces, from the back to the front.

    The RGB `colours` (n, n, 3), 0 to 1, are those of the faces of the square's even grid, x first.
    `turn` is the yaw and pitch of the eye in radians. By default the place `front` of the square is
    seen.
    """
    from matplotlib.collections import PolyCollection

    n = len(colours)
    t = torch.linspace(0.0, 1.0, n + 1, dtype=torch.float64)
    grid = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)
    points = immersion(space)(grid)
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points, axis=1).max())
    if turn is None:
        seen = viewpoint(space, torch.tensor(front, dtype=torch.float64))
        turn = (seen.yaw, seen.pitch)
    seen_points = (points / radius) @ _camera(*turn).T
    corners = seen_points.reshape(n + 1, n + 1, 3)
    faces = np.stack(
        [corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]], axis=2
    )
    faces = faces.reshape(-1, 4, 3)
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    sight = np.array([0, 0, EYE]) - faces.mean(axis=1)
    normals *= np.sign((normals * sight).sum(axis=1, keepdims=True))  # surfaces have two sides
    shade = 0.62 + 0.38 * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    order = np.argsort(faces[..., 2].mean(axis=1))
    flat = faces[..., :2] * (EYE / (EYE - faces[..., 2:]))
    fills = np.clip(colours.reshape(-1, 3) * shade[:, None], 0, 1)
    axes.add_collection(
        PolyCollection(
            list(flat[order]), facecolors=fills[order], edgecolors=fills[order], linewidths=0.35,
            rasterized=True,
        )
    )  # fmt: skip
    axes.set_xlim(-1.12, 1.12)
    axes.set_ylim(-1.12, 1.12)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _camera(yaw: float, pitch: float) -> Array:
    """Return the directions right, up and towards the eye, as rows (3, 3)."""
    toward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    return np.stack([right, np.cross(toward, right), toward])
