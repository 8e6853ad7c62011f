"""Tiles of a tiling, each by its aspect and its lattice cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers, Window
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup, Isometry
from orbiflow.tiles.geometry import checked_window
from orbiflow.tiles.tilings.tiling import Tiles, Tiling, as_tiling


@dataclass(frozen=True, eq=False, repr=False)
class Placed(Isometry):
    """An isometry with the number of the prototile that it moves.

    A product keeps the prototile: `g @ placed` is where g takes that tile.

    >>> import numpy as np
    >>> from orbiflow.symmetry import translation
    >>> second = Placed(np.eye(2), np.zeros(2), 1)
    >>> (translation([3.0, 0.0]) @ second).prototile
    1
    """

    prototile: int = 0

    def __matmul__(self, other: Isometry) -> Isometry:
        """Compose two isometries; the product moves the prototile of `other`, if it has one."""
        product = Isometry.__matmul__(self, other)
        if isinstance(other, Placed) and product is not NotImplemented:
            return Placed(product.linear, product.translation, other.prototile)
        return product

    def __rmatmul__(self, other: Isometry) -> Placed:
        product = Isometry.__matmul__(other, self)
        return Placed(product.linear, product.translation, self.prototile)

    def __repr__(self) -> str:
        return f"Placed{Isometry.__repr__(self)[8:-1]}, prototile={self.prototile})"


def prototile_of(element: Isometry) -> int:
    """Return the number of the prototile that an isometry moves, by default 0."""
    return element.prototile if isinstance(element, Placed) else 0


MAX_TILES = 20_000  # the largest number of tiles in a patch


class CopiesAcross(NamedTuple):
    """The copies that E elements lead to from each of M copies.

    Copy m followed by element e is that copy after the element `turn` of its prototile's stabiliser.
    """

    copy: Integers  # the index (M, E) of the copy, -1 if it is not among the copies
    turn: Integers  # the index (M, E) of the element


@dataclass(frozen=True, eq=False)
class Copies:
    """M tiles of a tiling.

    - `tiling`: The tiling; its first prototile is the copy of aspect 0 in cell (0, 0).
    - `aspects`: The indices (M,) of the tiling's aspects.
    - `cells`: The coordinates (M, 2) in the lattice basis.
    """

    tiling: Tiling
    aspects: Integers
    cells: Integers

    def __len__(self) -> int:
        return len(self.aspects)

    @property
    def group(self) -> CrystallographicGroup:
        """The tiling's group."""
        return self.tiling.group

    @cached_property
    def cosets(self) -> Integers:
        """The indices (M,) of coset representatives."""
        return self.tiling.aspects.cosets[self.aspects]

    @cached_property
    def prototiles(self) -> Integers:
        """The prototile (M,) of each copy."""
        return self.tiling.aspects.prototiles[self.aspects]

    @cached_property
    def translations(self) -> Array:
        """The translation (M, 2) of each copy's isometry."""
        return self.group.translations[self.cosets] + self.cells @ self.group.lattice.T

    def isometry(self, index: int) -> Placed:
        """Return the group element of a copy."""
        linear = self.group.linear_parts[self.cosets[index]]
        return Placed(linear, self.translations[index], int(self.prototiles[index]))

    def elements(self) -> tuple[Placed, ...]:
        """Return the group element of each copy."""
        return tuple(self.isometry(k) for k in range(len(self)))

    def images(self, points: Array) -> Array:
        """Return (M, N, 2) images of points (N, 2), one set a copy."""
        turned = np.einsum("gij,nj->gni", self.group.linear_parts, points)
        return turned[self.cosets] + self.translations[:, None, :]

    def rings(self, of: Sequence[Array] | None = None) -> list[Array]:
        """Return each copy's polygon, or the image of what is given for its prototile."""
        rings: list[Array] = [np.empty((0, 2))] * len(self)
        for k, points in enumerate(of or [p.polygon for p in self.tiling.prototiles]):
            members = np.flatnonzero(self.prototiles == k)
            for index, ring in zip(members, self.select(members).images(points), strict=True):
                rings[index] = ring
        return rings

    def centers(self) -> Array:
        """Return (M, 2) where the centre of each copy's prototile comes to lie."""
        centers = np.stack([p.center for p in self.tiling.prototiles])
        turned = np.einsum(
            "mij,mj->mi", self.group.linear_parts[self.cosets], centers[self.prototiles]
        )
        return turned + self.translations

    def boxes(self) -> tuple[Array, Array]:
        """Return (M, 2) lower left and upper right corners of the copies' bounding boxes."""
        low, high = aspect_boxes(self.tiling)
        shifts = self.cells @ self.group.lattice.T
        return low[self.aspects] + shifts, high[self.aspects] + shifts

    def select(self, keep: NDArray[np.bool_] | Integers) -> Copies:
        """Return the copies where `keep` is true, or of these indices."""
        return Copies(self.tiling, self.aspects[keep], self.cells[keep])

    def neighbours(
        self, elements: Sequence[Isometry], of: Sequence[int] | None = None
    ) -> CopiesAcross:
        """Return the copies across elements, by arithmetic of aspects and cells.

        The copy across an element of the copy g is g @ element; a plain isometry moves prototile 0.
        Each element leads from copies of the prototile `of` (E,), by default 0; others have none.
        """
        table = self.tiling.aspects
        copy = np.full((len(self), len(elements)), -1, dtype=np.int64)
        turn = np.zeros_like(copy)
        for number, element in enumerate(elements):
            source = 0 if of is None else of[number]
            mine = np.flatnonzero(self.prototiles == source)
            source_aspects = np.flatnonzero(table.prototiles == source)
            links = [
                table.find(self.group, self.group.cosets[int(c)] @ element, prototile_of(element))
                for c in table.cosets[source_aspects]
            ]
            place = np.searchsorted(source_aspects, self.aspects[mine])
            aspects, steps, by = (np.array(part)[place] for part in zip(*links, strict=True))
            keys = zip(aspects.tolist(), *(self.cells[mine] + steps).T.tolist(), strict=True)
            copy[mine, number] = [self._numbers.get(key, -1) for key in keys]
            turn[mine, number] = by
        return CopiesAcross(copy, turn)

    @cached_property
    def _numbers(self) -> dict[tuple[int, int, int], int]:
        """The index of each copy by its aspect and cell."""
        keys = zip(self.aspects.tolist(), *self.cells.T.tolist(), strict=True)
        return {key: number for number, key in enumerate(keys)}


def copies_inside(tile: Tiles, window: Sequence[float]) -> Copies:
    """Return the tiles that lie wholly in a rectangle, row by row.

    Args:
        tile: A tile or a tiling, which need not be certified.
        window: A rectangle (xmin, ymin, xmax, ymax) in the tile's units.

    Raises `OrbiflowError` for an empty window, or one of more than `MAX_TILES` tiles.
    """
    tiling, box = as_tiling(tile), checked_window(window)
    _refuse_too_many(tiling, box)
    return _by_rows(copies_near(tiling, box, whole=True))


def copies_meeting(tile: Tiles, window: Sequence[float]) -> Copies:
    """Return the tiles that meet a rectangle; arguments and errors are those of `copies_inside`.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> eighth = Tiling(wallpaper_group("p4m"), [[[0, 0], [0.5, 0], [0.5, 0.5]]])
    >>> len(copies_meeting(eighth, (-0.01, -0.01, 0.01, 0.01)))
    8
    """
    tiling, box = as_tiling(tile), checked_window(window)
    _refuse_too_many(tiling, box)
    near = copies_near(tiling, box, whole=False)
    low, high = near.boxes()
    meets = np.asarray(((low >= box[:2]) & (high <= box[2:])).all(axis=1))
    page = shapely.box(*box)
    shapely.prepare(page)
    middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    for k, prototile in enumerate(tiling.prototiles):
        unsure = np.flatnonzero(~meets & (near.prototiles == k))
        rings = near.select(unsure).images(prototile.polygon)
        # rings, not polygons: a tile that crosses itself can still be drawn
        touched = shapely.intersects(page, shapely.linearrings(rings))
        meets[unsure] = touched | shapely.contains_xy(shapely.polygons(rings), *middle)
    return _by_rows(near.select(meets))


def copies_near(tiling: Tiling, window: Window, *, whole: bool) -> Copies:
    """Return the tiles whose bounding box lies in the window, or meets it, in any order."""
    low, high = aspect_boxes(tiling)
    least, most = window[:2] - (low if whole else high), window[2:] - (high if whole else low)
    aspects, cells = _cells_within(tiling.group.lattice, least, most)
    return Copies(tiling, aspects, cells)


def expected_near(tiling: Tiling, width: float, height: float) -> float:
    """Return about how many tiles have a bounding box that meets a window of this size."""
    low, high = aspect_boxes(tiling)
    return float(((high - low) + (width, height)).prod(axis=1).sum() / tiling.group.cell_volume)


def aspect_boxes(tiling: Tiling) -> tuple[Array, Array]:
    """Return the lower left and upper right corners (A, 2) of the boxes of the tiles of a cell."""
    table, group = tiling.aspects, tiling.group
    low, high = np.empty((len(table), 2)), np.empty((len(table), 2))
    for k, prototile in enumerate(tiling.prototiles):
        members = table.prototiles == k
        images = group.images(prototile.polygon)[table.cosets[members]]
        low[members], high[members] = images.min(axis=1), images.max(axis=1)
    return low, high


def _cells_within(lattice: Array, least: Array, most: Array) -> tuple[Integers, Integers]:
    """Return all integer n (M, 2) with least <= lattice @ n <= most, and of which of A boxes (M,)."""
    inverse = np.linalg.inv(lattice)[1]
    # the range of the second coordinate over a box; its rows; and the range of the first in a row
    middle, half = (least + most) @ inverse / 2, (most - least) @ abs(inverse) / 2
    half[(least > most).any(axis=1)] = -1.0
    box, second = _ranges(middle - half, middle + half)
    low, high = np.full(len(box), -np.inf), np.full(len(box), np.inf)
    for axis, (step, across) in enumerate(lattice.tolist()):
        if abs(step) < 1e-12 * abs(inverse).max() * abs(np.linalg.det(lattice)):
            continue
        start, other = ((ends[box, axis] - across * second) / step for ends in (least, most))
        low = np.maximum(low, np.minimum(start, other))
        high = np.minimum(high, np.maximum(start, other))
    row, first = _ranges(low, high)
    cells = np.stack([first, second[row]], axis=1)
    box = box[row]
    shifts = cells @ lattice.T
    kept = ((shifts >= least[box]) & (shifts <= most[box])).all(axis=1)
    return box[kept], cells[kept].astype(np.int64)


def _ranges(low: Array, high: Array) -> tuple[Integers, Array]:
    """Return all whole numbers in some intervals, and one more at either end for rounding."""
    first = np.ceil(low - 1e-9)
    counts = np.maximum(np.floor(high + 1e-9) + 1 - first, 0).astype(np.int64)
    which = np.repeat(np.arange(len(counts)), counts)
    return which, first[which] + np.arange(len(which)) - (np.cumsum(counts) - counts)[which]


def _by_rows(copies: Copies) -> Copies:
    rows = np.round(copies.centers() / (0.01 * copies.tiling.radius))
    return copies.select(np.lexsort((copies.aspects, rows[:, 0], rows[:, 1])))


def _refuse_too_many(tiling: Tiling, window: Window) -> None:
    width, height = window[2] - window[0], window[3] - window[1]
    count = width * height / tiling.tile_area
    if expected_near(tiling, width, height) > 2 * MAX_TILES or count > MAX_TILES:
        raise OrbiflowError(
            f"the window of {width:.4g} by {height:.4g} would hold about {count:.0f} "
            f"tiles; the most is {MAX_TILES}: choose larger tiles "
            "or a smaller window"
        )


ASPECT = 1.5
"""Width over height of the default window."""


def default_window(tile: Tiles) -> Window:
    """Return a landscape window around the tile or prototiles, some four to five tiles across."""
    tiling = as_tiling(tile)
    width, height = tiling.box[1] - tiling.box[0]
    # by area, but so that a long tile with its limbs among its neighbours shows whole
    across = max(5.5 * math.sqrt(tiling.tile_area), 1.8 * width, 1.4 * ASPECT * height)
    x, y = tiling.center
    half, high = across / 2, across / 2 / ASPECT
    return float(x - half), float(y - high), float(x + half), float(y + high)
