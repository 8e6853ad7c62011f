"""A picture's page: which copies of the tile it shows, in which colours, and the cell that repeats."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.art.settings import ArtSettings, check_size
from orbiflow.tiles.exporting import edge_margin, longer_side, place_on_page
from orbiflow.tiles.scene import INCH, Box
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Copies, Tile, colouring, copies_meeting

HIDDEN = -1  # the colour of copies that are not painted
USUAL_TILES = 25  # number of tiles on a page if no size of a tile is given


@dataclass(frozen=True, eq=False)
class ArtPage:
    """The tiles of a picture."""

    size: tuple[float, float]  # the picture's size in pixels, not whole where it is a length
    tile: Tile  # the tile in its own units
    copies: Copies  # all copies that the picture shows, and some beyond
    linear: Array  # with `offset`: the map from the tile's units to pixels, y down
    offset: Array
    colours: NDArray[np.int64]  # the number (M,) of each copy's colour, or `HIDDEN`
    count: int  # the number of colours
    notes: tuple[str, ...] = ()  # what the user should know

    @property
    def width(self) -> int:
        """The number of pixels in a row."""
        return round(self.size[0])

    @property
    def height(self) -> int:
        """The number of rows."""
        return round(self.size[1])

    @property
    def scale(self) -> float:
        """Pixels per unit."""
        return float(np.sqrt(abs(np.linalg.det(self.linear))))

    @property
    def tile_size(self) -> float:
        """The size of a tile in pixels."""
        return self.scale * longer_side(self.tile.polygon)

    @property
    def shown(self) -> float:
        """The number of tiles that the picture shows or, where it cuts some, has room for by area."""
        if (self.colours == HIDDEN).any():
            return float((self.colours != HIDDEN).sum())
        return math.prod(self.size) / (self.scale**2 * abs(self.tile.signed_area))

    def whole(self, margin: float) -> ArtPage:
        """Return the page with tiles hidden unless they keep a distance in pixels from its edge."""
        rings = self.rings()
        low, high = rings.min(axis=1), rings.max(axis=1)
        kept = ((low >= margin) & (high <= np.array(self.size) - margin)).all(axis=1)
        if not kept.any():
            raise OrbiflowError(
                f"no tile is whole on a page of {self.width} x {self.height} pixels; choose a larger "
                "page or smaller tiles"
            )
        return replace(self, colours=np.where(kept, self.colours, HIDDEN))

    def rings(self) -> Array:
        """Return the copies (M, N, 2) in pixels."""
        return self.copies.images(self.tile.polygon) @ self.linear.T + self.offset


def art_page(given: EscherTile, settings: ArtSettings) -> ArtPage:
    """Put the tile on a page of the settings' size, the same way up; or make the repeating cell."""
    tile = given.tile
    lattice = tile.group.lattice
    if settings.colour == "neighbour":  # the translations that keep the colours
        a, b, c = colouring(tile).sublattice
        lattice = lattice @ np.array([[a, b], [0.0, c]])
    size = longer_side(tile.polygon)
    width, height = settings.size
    scale = float(np.sqrt(width * height / USUAL_TILES / abs(tile.signed_area)))
    if settings.tile_size is not None:
        scale = settings.tile_size / size
    repeat = settings.repeat
    if repeat is None:
        page, pixels = Box(0.0, 0.0, width, height), settings.dpi / INCH
        margin = None if settings.clip else pixels * edge_margin(scale * size / pixels)
        place = place_on_page(
            tile, scale, page, given.y_down, rotate=settings.rotate, margin=margin
        )
        made = _page(tile, settings.colour, *place, (width, height), ())
        return made if margin is None else made.whole(margin)
    flipped = not given.y_down
    found = rectangle(lattice, scale, settings.tolerance, flipped=flipped, repeat=repeat)
    try:
        check_size(found.width, found.height)
    except OrbiflowError as error:
        raise OrbiflowError(f"the cell that repeats is too large: {error}") from error
    offset = np.array([found.width, found.height]) / 2 - found.linear @ tile.center
    tiles = found.width * found.height / (abs(tile.signed_area) * abs(np.linalg.det(found.linear)))
    note = f"the cell that repeats is {found.width} x {found.height} pixels and holds {tiles:.0f} tiles"
    if abs(found.turn) > 0.05:
        note += f"; the tiling is turned by {found.turn:.1f} degrees"
    share = f"{100 * found.strain:.2g} %" if found.strain >= 5e-5 else "less than 0.01 %"
    if found.strain < 1e-9:
        note += "; nothing is stretched"
    elif found.exact:
        note += f"; whole pixels stretch it by {share}"
    else:
        note += f"; it is stretched by {share} to be a rectangle"
    return _page(tile, settings.colour, found.linear, offset, (found.width, found.height), (note,))


def _page(
    tile: Tile,
    colour: str,
    linear: Array,
    offset: Array,
    size: tuple[float, float],
    notes: tuple[str, ...],
) -> ArtPage:
    width, height = size
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    # a margin, for outlines of tiles just beyond the edge reach in
    corners += np.sign(corners - 1) * 2.0
    there = (corners - offset) @ np.linalg.inv(linear).T
    copies = copies_meeting(tile, (*there.min(axis=0), *there.max(axis=0)))
    colours, count = np.zeros(len(copies), dtype=np.int64), 1
    if colour == "aspect":
        colours, count = copies.cosets, tile.group.order
    elif colour == "neighbour":
        own = colouring(tile)
        colours, count = own.colours(copies), own.count
    return ArtPage(size, tile, copies, linear, offset, colours, count, notes)


REACH = 14  # greatest multiple of a basis vector that is tried
LARGEST = 60  # greatest number of lattice cells in a rectangle
EXACT = 1e-6  # strain up to which a rectangle counts as exact: that of rounding
# Number of lattice cells up to which an exact rectangle is preferred to a smaller inexact one
LARGEST_EXACT = 8
SLENDER = 4.0  # ratio of its sides beyond which a rectangle counts as larger than it is
SIZE_TOLERANCE = 0.02  # greatest relative change of the size so that the cell is whole pixels


class Rectangle(NamedTuple):
    """A rectangular cell of whole pixels that repeats."""

    linear: (
        Array  # the map (2, 2) from the lattice's units to pixels, a similarity but for `strain`
    )
    width: int  # with `height`: the size in pixels
    height: int
    cells: int  # the number of lattice cells in it
    strain: float  # how much longer one direction became than another; 0 for a similarity
    turn: float  # the angle in degrees, -45 to 45, by which the lattice is turned
    exact: bool  # whether it is a rectangle of the lattice: then only whole pixels strain it


SWAP = np.array([[0.0, 1.0], [1.0, 0.0]])


def rectangle(
    lattice: Array,
    scale: float,
    tolerance: float,
    *,
    flipped: bool,
    repeat: Literal["basic", "brick", "half-drop"] = "basic",
) -> Rectangle:
    """Find the smallest rectangle that repeats in a lattice with the basis (2, 2), in pixels.

    Copies of it lie side by side and row on row; of a brick, each row is moved along by half a width,
    and of a half-drop each column by half a height, which is then an even number of pixels.

    There are about `scale` pixels per unit. An exact rectangle is preferred if it is not much
    larger; others are strained by at most `tolerance`. The picture is `flipped` if y points up in
    the lattice.

    >>> found = rectangle(np.array([[1.0, 0.5], [0.0, 0.75**0.5]]), 100, 0.02, flipped=False)
    >>> found.width, found.height, found.cells, abs(found.turn) < 1e-9, found.strain < 4e-4
    (101, 175, 2, True, True)
    """
    upright = np.diag([1.0, -1.0 if flipped else 1.0]) @ lattice
    # columns that drop are rows that move, seen in a mirror
    seen = SWAP if repeat == "half-drop" else np.eye(2)
    best = _best_pair(seen @ upright, tolerance, 0.0 if repeat == "basic" else 0.5)
    if best is None:
        raise OrbiflowError(
            f"no rectangle of up to {LARGEST} cells repeats within a strain of {tolerance:.3g}; "
            "allow a larger tolerance"
        )
    pair, cells = seen @ best[0] @ seen, best[1]
    along, up = pair[:, 0], pair[:, 1]
    even = repeat == "brick", repeat == "half-drop"
    width, height = _whole(float(np.hypot(*along)), float(np.hypot(*up)), scale, *even)
    linear = np.diag([float(width), float(height)]) @ np.linalg.inv(pair)
    exact = _strain(_squared(pair)) <= EXACT
    turn = math.degrees(math.atan2(along[1], along[0]))
    flip = np.diag([1.0, -1.0 if flipped else 1.0])
    return Rectangle(linear @ flip, width, height, cells, _strain(linear), -turn, exact)


def _best_pair(lattice: Array, tolerance: float, shift: float) -> tuple[Array, int] | None:
    """Return two vectors nearly at a right angle, the first nearest to x, and their number of cells.

    The first is one of the lattice; so is the second, moved along by a share `shift` of the first.
    """
    steps = np.arange(-REACH, REACH + 1)
    combos = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    combos = combos[np.gcd(combos[:, 0], combos[:, 1]) == 1]
    vectors = combos @ lattice.T
    length = np.hypot(*vectors.T)
    # the first vector within 45 degrees of x
    first = np.flatnonzero((vectors[:, 0] > 0) & (abs(vectors[:, 1]) <= vectors[:, 0] * (1 + 1e-9)))
    first = first[np.argsort(length[first], kind="stable")][:200]
    ups = vectors - shift * vectors[first][:, None]
    heights = np.hypot(ups[..., 0], ups[..., 1])
    cross = vectors[first, 0][:, None] * vectors[:, 1] - vectors[first, 1][:, None] * vectors[:, 0]
    dot = np.einsum("ik,ijk->ij", vectors[first], ups)
    cells = np.rint(cross / abs(np.linalg.det(lattice))).astype(int)
    sine = abs(dot) / (length[first][:, None] * heights)
    # a shear by the angle's cotangent stretches one direction by about as much
    fits = (cells >= 1) & (cells <= LARGEST) & (sine <= min(2 * tolerance + EXACT, 0.5))
    options = []
    for i, j in np.argwhere(fits):
        pair = np.stack([vectors[first[i]], ups[i, j]], axis=1)
        strain = _strain(_squared(pair))
        if strain <= tolerance + EXACT:
            exact = strain <= EXACT and cells[i, j] <= LARGEST_EXACT
            turn = abs(math.atan2(pair[1, 0], pair[0, 0]))
            long = max(ratio := heights[i, j] / length[first[i]], 1 / ratio) / SLENDER
            weight = round(float(cells[i, j] * max(1.0, long)), 9)
            options.append((not exact, weight, round(turn, 9), strain, i, j))
    if not options:
        return None
    *_, i, j = min(options)
    return np.stack([vectors[first[i]], ups[i, j]], axis=1), int(cells[i, j])


def _squared(pair: Array) -> Array:
    """Return the map that makes a pair of vectors a rectangle of their lengths."""
    return np.diag(np.hypot(*pair)) @ np.linalg.inv(pair)


def _strain(linear: Array) -> float:
    values = np.linalg.svd(linear, compute_uv=False)
    return float(values[0] / values[1] - 1)


def _whole(
    along: float, up: float, scale: float, even_width: bool, even_height: bool
) -> tuple[int, int]:
    """Return whole sides, even if need be, near the given size with the ratio nearest to theirs."""
    ideal = max(1, round(along * scale))
    reach = max(1 + even_width, int(SIZE_TOLERANCE * ideal))
    widths = np.arange(max(1, ideal - reach), ideal + reach + 1)
    widths = widths[widths % 2 == 0] if even_width else widths
    exact = widths * up / along
    step = 1 + even_height
    heights = np.maximum(step, step * np.rint(exact / step))
    # a slightly better ratio is not worth another size
    error = np.round(abs(heights / exact - 1), 5)
    best = np.lexsort((abs(widths - ideal), error))[0]
    return int(widths[best]), int(heights[best])
