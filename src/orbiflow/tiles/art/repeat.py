"""The rectangle that repeats: two lattice vectors at a right angle, or nearly so."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError

REACH = 14
"""Multiples of the basis vectors that are looked at."""

LARGEST = 60
"""Most lattice cells in a rectangle."""

EXACT = 1e-6
"""Strain below which a rectangle counts as exact: what rounding leaves."""

LARGEST_EXACT = 8
"""Lattice cells up to which an exact rectangle goes before a smaller one that is not."""

SLENDER = 4.0
"""Ratio of its sides beyond which a rectangle counts as larger than it is."""

LEEWAY = 0.02
"""How far the size that is asked for may be changed so that the cell is whole pixels."""


class Rectangle(NamedTuple):
    """A cell of whole pixels.

    - `linear`: (2, 2) from the lattice's units to pixels: a similarity, but for `strain`.
    - `width`, `height`: in pixels.
    - `cells`: how many lattice cells it holds.
    - `strain`: how much longer one direction became than another, from 0.
    - `turn`: of the lattice, in degrees, -45 to 45.
    - `exact`: whether the lattice has the rectangle: then whole pixels alone make the strain.
    """

    linear: Array
    width: int
    height: int
    cells: int
    strain: float
    turn: float
    exact: bool


def rectangle(lattice: Array, scale: float, tolerance: float, *, flipped: bool) -> Rectangle:
    """The smallest rectangle of lattice vectors, as pixels.

    Where the lattice has an exact one that is not much larger, that one.

    Args:
        lattice: (2, 2), basis vectors as columns.
        scale: pixels a unit, about.
        tolerance: strain allowed to make the rectangle exact.
        flipped: whether y points up in the lattice's units, so that it is turned over.

    Raises:
        OrbiflowError: if there is none.

    >>> found = rectangle(np.array([[1.0, 0.5], [0.0, 0.75**0.5]]), 100, 0.02, flipped=False)
    >>> found.width, found.height, found.cells, abs(found.turn) < 1e-9, found.strain < 4e-4
    (101, 175, 2, True, True)
    """
    upright = np.diag([1.0, -1.0 if flipped else 1.0]) @ lattice
    best = _best_pair(upright, tolerance)
    if best is None:
        raise OrbiflowError(
            f"no rectangle of up to {LARGEST} cells repeats within a strain of {tolerance:.3g}; "
            "allow a larger tolerance"
        )
    pair, cells = best
    along, up = pair[:, 0], pair[:, 1]
    width, height = _whole(float(np.hypot(*along)), float(np.hypot(*up)), scale)
    linear = np.diag([float(width), float(height)]) @ np.linalg.inv(pair)
    exact = _strain(_squared(pair)) <= EXACT
    turn = math.degrees(math.atan2(along[1], along[0]))
    flip = np.diag([1.0, -1.0 if flipped else 1.0])
    return Rectangle(linear @ flip, width, height, cells, _strain(linear), -turn, exact)


def _best_pair(lattice: Array, tolerance: float) -> tuple[Array, int] | None:
    """Two vectors nearly at a right angle, the first nearest to x; and their cells."""
    steps = np.arange(-REACH, REACH + 1)
    combos = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    combos = combos[np.gcd(combos[:, 0], combos[:, 1]) == 1]
    vectors = combos @ lattice.T
    length = np.hypot(*vectors.T)
    # the first vector within 45 degrees of x
    first = np.flatnonzero((vectors[:, 0] > 0) & (abs(vectors[:, 1]) <= vectors[:, 0] * (1 + 1e-9)))
    first = first[np.argsort(length[first], kind="stable")][:200]
    cross = vectors[first, 0][:, None] * vectors[:, 1] - vectors[first, 1][:, None] * vectors[:, 0]
    dot = vectors[first] @ vectors.T
    cells = np.rint(cross / abs(np.linalg.det(lattice))).astype(int)
    sine = abs(dot) / (length[first][:, None] * length)
    # a shear by the angle's cotangent stretches one direction by about as much
    fits = (cells >= 1) & (cells <= LARGEST) & (sine <= min(2 * tolerance + EXACT, 0.5))
    found = np.argwhere(fits)
    if not len(found):
        return None
    options = []
    for i, j in found:
        pair = np.stack([vectors[first[i]], vectors[j]], axis=1)
        strain = _strain(_squared(pair))
        if strain <= tolerance + EXACT:
            exact = strain <= EXACT and cells[i, j] <= LARGEST_EXACT
            turn = abs(math.atan2(pair[1, 0], pair[0, 0]))
            long = max(ratio := length[j] / length[first[i]], 1 / ratio) / SLENDER
            weight = round(float(cells[i, j] * max(1.0, long)), 9)
            options.append((not exact, weight, round(turn, 9), strain, i, j))
    if not options:
        return None
    *_, i, j = min(options)
    return np.stack([vectors[first[i]], vectors[j]], axis=1), int(cells[i, j])


def _squared(pair: Array) -> Array:
    """The map that makes the pair a rectangle of its own lengths."""
    return np.diag(np.hypot(*pair)) @ np.linalg.inv(pair)


def _strain(linear: Array) -> float:
    values = np.linalg.svd(linear, compute_uv=False)
    return float(values[0] / values[1] - 1)


def _whole(along: float, up: float, scale: float) -> tuple[int, int]:
    """Whole sides near the size that is asked for whose ratio is nearest to the true one."""
    ideal = max(1, round(along * scale))
    reach = max(1, int(LEEWAY * ideal))
    widths = np.arange(max(1, ideal - reach), ideal + reach + 1)
    exact = widths * up / along
    heights = np.maximum(1, np.rint(exact))
    # a hair's better ratio is not worth another size
    error = np.round(abs(heights / exact - 1), 5)
    best = np.lexsort((abs(widths - ideal), error))[0]
    return int(widths[best]), int(heights[best])
