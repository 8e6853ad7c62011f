"""Patches: the tiles that meet a window, and the aspects in which a tile occurs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arguments import instance, numbers
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import Isometry
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.images import expected_area
from orbiflow.tilings.tile import Tile

MAX_TILES = 20_000
"""Largest number of tiles in a patch."""

Window: TypeAlias = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax, in the tile's units."""

Cell: TypeAlias = tuple[int, int]
"""Coordinates of a lattice vector over the basis of the group's lattice."""


def patch(tile: Tile, window: Sequence[float]) -> list[Isometry]:
    """The group elements whose image of `tile` meets the rectangle, nearest the middle first.

    Args:
        tile: certified or not.
        window: (xmin, ymin, xmax, ymax) in the tile's units.

    Raises:
        OrbiflowError: for an empty window, or one of more than `MAX_TILES` tiles.

    >>> from orbiflow.tilings.classes import isohedral_class
    >>> ih1 = isohedral_class("IH1")
    >>> len(patch(Tile(ih1.template(), ih1.group()), (-0.1, -0.1, 0.1, 0.1)))
    1
    """
    instance(tile, Tile, "the tile", "Tile(polygon, group) makes one")
    xmin, ymin, xmax, ymax = checked_window(window)
    low, high = np.array([xmin, ymin]), np.array([xmax, ymax])
    reach = float(np.linalg.norm(high - low)) / 2 + tile.radius
    _refuse_too_many(tile, high - low, reach)
    candidates = tile.group.elements_near((low + high) / 2, reach, source=tile.center)
    images = np.stack([g(tile.polygon) for g in candidates])
    near = (images.min(axis=1) <= high).all(axis=1) & (images.max(axis=1) >= low).all(axis=1)
    rings = shapely.linearrings(images[near])
    box = shapely.box(xmin, ymin, xmax, ymax)
    shapely.prepare(box)
    meets = np.zeros(len(candidates), dtype=bool)
    # linear rings with box, not polygons: an image that holds the whole box has to count as well,
    # and a tile that crosses itself must not stop the picture that shows it
    meets[near] = shapely.intersects(box, rings) | _holds(images[near], (low + high) / 2)
    return [g for g, kept in zip(candidates, meets, strict=True) if kept]


def aspects(tile: Tile, elements: Sequence[Isometry]) -> list[int]:
    """For each element the index of its coset: tiles of one aspect are translates of each other.

    Raises:
        OrbiflowError: for an isometry that is not in the tile's group.
    """
    return [coset_and_cell(tile, element)[0] for element in elements]


def coset_and_cell(tile: Tile, element: Isometry) -> tuple[int, Cell]:
    """(i, n) with element = translation by B n after the i-th coset representative.

    Raises:
        OrbiflowError: for an isometry that is not in the tile's group.
    """
    group = tile.group
    instance(element, Isometry, "an element of the group")
    steps = (element.translation - group.translations) @ group.inverse_lattice.T
    error = np.abs(steps - np.round(steps)).max(axis=1)
    error += np.abs(group.linear_parts - element.linear).max(axis=(1, 2))
    coset = int(error.argmin())
    if error[coset] > 1e-6:
        raise OrbiflowError(f"{element!r} is not an element of {group!r}")
    first, second = np.round(steps[coset]).astype(int)
    return coset, (int(first), int(second))


def checked_window(window: Sequence[float]) -> Window:
    """`window` as four numbers.

    Raises:
        OrbiflowError: unless xmin < xmax and ymin < ymax.
    """
    try:
        values = numbers(window, "window", (4,)).tolist()
    except OrbiflowError:
        values = [0.0] * 4
    if not (values[0] < values[2] and values[1] < values[3]):
        raise OrbiflowError(
            f"a window is (xmin, ymin, xmax, ymax) with xmin < xmax and ymin < ymax, got {window!r}"
        )
    return values[0], values[1], values[2], values[3]


def _refuse_too_many(tile: Tile, sides: Array, reach: float) -> None:
    size = expected_area(tile)
    expected = float(np.prod(sides + 2 * tile.radius)) / size
    # the disc of candidates may be far larger than a thin window
    if max(expected, math.pi * reach**2 / size / 20) > MAX_TILES:
        raise OrbiflowError(
            f"the window of {sides[0]:.4g} by {sides[1]:.4g} would hold about {expected:.0f} tiles; "
            f"the most is {MAX_TILES}: choose a smaller window"
        )


def _holds(rings: Array, point: Array) -> NDArray[np.bool_]:
    """(M,) whether each ring (M, N, 2) winds around `point`, by the crossing rule."""
    ahead = np.roll(rings, -1, axis=1)
    straddles = (rings[..., 1] > point[1]) != (ahead[..., 1] > point[1])
    rise = np.where(straddles, ahead[..., 1] - rings[..., 1], 1.0)
    share = (point[1] - rings[..., 1]) / rise
    crossing = rings[..., 0] + share * (ahead[..., 0] - rings[..., 0])
    return (straddles & (crossing > point[0])).sum(axis=1) % 2 == 1
