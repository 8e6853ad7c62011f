"""The cell of a tiling that repeats side by side: a rectangle of whole pixels."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import Place
from orbiflow.tiles.make.art_settings import ArtSettings, check_size
from orbiflow.tiles.page import Box, Page
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import colouring


def repeating_page(tile: EscherTile, settings: ArtSettings, scale: float) -> tuple[Page, str]:
    """Return the cell that repeats as a page, at about `scale` mm per unit, and what to know of it."""
    tiling, pixels = tile.tiling, settings.pixels
    lattice = tiling.group.lattice
    if settings.colour == "neighbour":  # the translations that keep the colours
        a, b, c = colouring(tiling).sublattice
        lattice = lattice @ np.array([[a, b], [0.0, c]])
    how = {"flipped": not tile.y_down, "repeat": settings.repeat or "basic"}
    cell = rectangle(lattice, scale * pixels, settings.stretch, **how)
    try:
        check_size(cell.width, cell.height)
    except OrbiflowError as error:
        raise OrbiflowError(f"the cell that repeats is too large: {error}") from error
    linear = cell.linear / pixels
    size = cell.width / pixels, cell.height / pixels
    # the nearest similarity, by the polar decomposition, and what is stretched beyond it
    left, values, right = np.linalg.svd(linear)
    similar = float(np.sqrt(values.prod())) * left @ right
    stretch = linear @ np.linalg.inv(similar)
    place = Place(similar, np.linalg.inv(stretch) @ size / 2 - similar @ tiling.center)
    box = Box(0.0, 0.0, *size)
    page = Page(
        size, box, tiling.transformed(*place), place, colour=settings.colour, stretch=stretch
    )
    return page, _told(cell, cell.width * cell.height / (pixels**2 * page.tiling.tile_area))


def _told(cell: Rectangle, tiles: float) -> str:
    note = (
        f"the cell that repeats is {cell.width} x {cell.height} pixels and holds {tiles:.0f} tiles"
    )
    if abs(cell.turn) > 0.05:
        note += f"; the tiling is turned by {cell.turn:.1f} degrees"
    share = f"{100 * cell.strain:.2g} %" if cell.strain >= 5e-5 else "less than 0.01 %"
    if cell.strain < 1e-9:
        return note + "; nothing is stretched"
    if cell.exact:
        return note + f"; whole pixels stretch it by {share}"
    return note + f"; it is stretched by {share} to be a rectangle"


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
