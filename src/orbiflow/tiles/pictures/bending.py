"""Pictures of a silhouette that was bent into a tile, and the silhouettes on the way there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from orbiflow.arrays import Array
from orbiflow.drawing import (
    Picture,
    Raster,
    Sheet,
    arrow,
    caption,
    captioned,
    dashes,
    rgb,
    strip_middle,
    vector_picture,
)
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.silhouette import Bending
from orbiflow.tiles.tilings import Tile

TILE, GHOST, ARROW = "#d7dee6", "#9a8c7a", "#b0413e"
STILL = 0.06
"""Distance, in square roots of the area, up to which no arrow is drawn."""

FAR = 0.3
"""Distance, in square roots of the area, at which the outline has the ramp's last colour."""

_STEPS = 11
_LINE, _GHOST = 0.0042, 0.0022  # widths of lines, as shares of the picture's


def bending_png(
    tile: Tile,
    rest: Array,
    bent: Array,
    *,
    width_px: int = 1200,
    y_down: bool = False,
    label: str = "",
) -> bytes:
    """Return a PNG of a tile with the bent silhouette's outline, coloured by how far points moved.

    The silhouette as it was is a faint dashed line; arrows lead from it to the tile where it bent.

    Args:
        tile: The tile in the input's coordinates, which is filled.
        rest, bent: The outlines (n, 2) of the silhouette as it was and bent, point by point.
        width_px: The width in pixels; the height follows.
        y_down: Whether the y axis points down, as in images.
        label: The words in front of the legend. Default: the class.
    """
    text = label or tile.isohedral_class or " "
    raster = bending_raster(tile, rest, bent, width_px=width_px, y_down=y_down, text=text)
    _legend(raster)
    return raster.png()


def bending_picture(
    tile: Tile, rest: Array, bent: Array, *, y_down: bool = False, sheet: Sheet | None = None
) -> Picture:
    """Return the picture of `bending_png` for print, in curves; the caption has its legend.

    Args:
        tile, rest, bent, y_down: As for `bending_png`.
        sheet: The sheet it is drawn on. Default: a journal's single column, as PDF.
    """
    raster = bending_raster(tile, rest, bent, width_px=1600, y_down=y_down)
    title = f"Silhouette bent into a tile {tile.isohedral_class}".strip()
    caption = (
        "Dashed: the silhouette as it was, with arrows to where it went. The tile's outline is "
        "coloured by how far each point moved, from blue, little, to red, far."
    )
    return vector_picture(raster, sheet or Sheet.column(), title=title, caption=caption)


def bending_raster(
    tile: Tile,
    rest: Array,
    bent: Array,
    *,
    width_px: int,
    y_down: bool = False,
    text: str = "",
    thick: float = 1.0,
) -> Raster:
    """Return the picture of `bending_png` without its legend, and without a strip if `text` is empty.

    Args:
        tile, rest, bent, width_px, y_down: As for `bending_png`.
        text: The words in the strip.
        thick: A factor of all lines' widths, for small pictures.
    """
    raster = captioned([rest, bent, tile.polygon], width_px, y_down=y_down, text=text)
    raster.fill([tile.polygon], TILE)
    size = float(np.sqrt(abs(tile.signed_area)))
    moved = np.linalg.norm(bent - rest, axis=1) / size
    unit = thick * width_px
    _ghost(raster, np.concatenate([rest, rest[:1]]), unit)
    _arrows(raster, rest, bent, moved, size, _GHOST * unit)
    values = np.clip((moved + np.roll(moved, -1)) / 2 / FAR, 0, 1)
    steps = np.rint(values * (_STEPS - 1)).astype(int)
    for step, run in sorted(_runs(bent, steps), key=lambda item: item[0]):
        raster.line(run, RAMP[step], _LINE * unit)
    return raster


def _ramp(stops: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Return so many colours, evenly spaced from the first stop to the last."""
    values = np.array([rgb(stop) for stop in stops], dtype=float)
    places = np.linspace(0, len(stops) - 1, count)
    mixed = [np.interp(places, np.arange(len(stops)), values[:, k]) for k in range(3)]
    return tuple(
        f"#{red:02x}{green:02x}{blue:02x}"
        for red, green, blue in np.rint(mixed).astype(int).T.tolist()
    )


RAMP = _ramp(("#1d4e79", "#d98a2b", ARROW), _STEPS)
"""Colours of the outline, from where it stayed to where it moved far."""


def _runs(ring: Array, steps: Array) -> Iterator[tuple[int, Array]]:
    """Yield the runs of a ring's sides (n, 2) that have the same step (n,) of the ramp."""
    starts = np.flatnonzero(steps != np.roll(steps, 1))
    if not len(starts):
        yield int(steps[0]), np.concatenate([ring, ring[:1]])
        return
    for first, last in zip(starts, np.roll(starts, -1), strict=True):
        count = (last - first - 1) % len(ring) + 2
        yield int(steps[first]), ring[(first + np.arange(count)) % len(ring)]


def _ghost(raster: Raster, points: Array, unit: float) -> None:
    for piece in dashes(raster.to_pixels(points), 0.009 * unit, 0.006 * unit):
        raster.line(piece, GHOST, _GHOST * unit, pixels=True)


def _arrows(
    raster: Raster, rest: Array, bent: Array, moved: Array, size: float, width: float
) -> None:
    """Draw arrows to where the outline went, at points some way apart that moved far."""
    taken: list[int] = []
    for k in np.argsort(-moved):
        if moved[k] < STILL or len(taken) == 24:
            break
        near = [np.linalg.norm(rest[k] - rest[other]) < 0.16 * size for other in taken]
        if not any(near):
            taken.append(int(k))
    for k in taken:
        arrow(raster, rest[k], bent[k], GHOST, width)


def _legend(raster: Raster) -> None:
    y, wide = strip_middle(raster), raster.width
    sample = np.array([[0.47 * wide, y], [0.52 * wide, y]])
    for piece in dashes(sample, 0.009 * wide, 0.006 * wide):
        raster.line(piece, GHOST, _GHOST * wide, pixels=True)
    caption(raster, 0.53, "as it was")
    edges, high = np.linspace(0.68, 0.78, _STEPS + 1) * wide, 0.009 * wide
    for k, colour in enumerate(RAMP):
        left, right = edges[k], edges[k + 1]
        ring = [[left, y - high], [right, y - high], [right, y + high], [left, y + high]]
        raster.fill_pixels(np.array(ring), colour)
    caption(raster, 0.79, "moved, little to far")


class BendingWay:
    """The silhouettes on the way from the one at rest to the tile.

    Args:
        bending: The map between the two.

    Raises:
        OrbiflowError: If its triangles have no single outline.
    """

    def __init__(self, bending: Bending) -> None:
        self.rest, self.images = bending.rest, bending.images
        triangles = bending.triangles
        self.ring = _outline(triangles)
        corners, images = self.rest[triangles], self.images[triangles]
        sides, moved = (
            np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]], axis=2) for c in (corners, images)
        )
        inverse = np.linalg.inv(sides)
        linear = moved @ inverse
        # polar decomposition of 2 x 2 matrices that turn nothing over
        self._angle = np.arctan2(
            linear[:, 1, 0] - linear[:, 0, 1], linear[:, 0, 0] + linear[:, 1, 1]
        )
        self._angle = _continuous(self._angle)
        self._stretch = _rotations(-self._angle) @ linear
        # rows of a triangle's gradient: J = P @ gradient, P the three corners as columns
        gradient = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        area = np.abs(np.linalg.det(sides))[:, None, None]
        self._gradient, self._triangles = area * gradient, triangles
        blocks = area * gradient @ np.swapaxes(gradient, 1, 2)
        rows = np.repeat(triangles[:, :, None], 3, axis=2)
        columns = np.swapaxes(rows, 1, 2)
        count = len(self.rest)
        matrix = coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
        # the solution is free up to a shift: hold one point, and shift all afterwards
        anchor = coo_array(([area.mean()], ([0], [0])), shape=(count, count))
        self._solver = splu(csc_array(matrix + anchor))

    def at(self, share: float) -> Array:
        """Return the outline (n, 2) at 0 (as it is) to 1 (the tile), in the target's normal form."""
        turned = _rotations(share * self._angle)
        linear = turned @ ((1 - share) * np.eye(2) + share * self._stretch)
        pull = self._gradient @ np.swapaxes(linear, 1, 2)
        right = np.zeros_like(self.rest)
        np.add.at(right, self._triangles, pull)
        points = self._solver.solve(right)
        middle = (1 - share) * self.rest.mean(axis=0) + share * self.images.mean(axis=0)
        return (points - points.mean(axis=0) + middle)[self.ring]


def _rotations(angles: Array) -> Array:
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


def _continuous(angles: Array) -> Array:
    """Return the angles within half a turn of their mean: beyond it a limb has turned the other way."""
    mean = float(np.angle(np.exp(1j * angles).sum()))
    return mean + np.angle(np.exp(1j * (angles - mean)))


def _outline(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the points of the sides that belong to one triangle alone, in order."""
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    known = {(int(a), int(b)) for a, b in ends}
    after = {a: b for a, b in known if (b, a) not in known}
    ring = [min(after)]
    while len(ring) <= len(after) and (follower := after[ring[-1]]) != ring[0]:
        ring.append(follower)
    if len(ring) != len(after):
        raise OrbiflowError("the bending's triangles do not fill one outline")
    return np.array(ring)
