"""Copies of a tile in a window, as integers: which coset representative, which lattice cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import Isometry
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.images import expected_area
from orbiflow.tilings.patch import MAX_TILES, Window, checked_window, coset_and_cell
from orbiflow.tilings.tile import Tile

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Copies:
    """M copies of a tile: copy m is moved by `cosets[m]`, then by the lattice vector of `cells[m]`.

    - `tile`: the tile itself is the copy of coset 0 in cell (0, 0).
    - `cosets`: (M,) indices of coset representatives: the copies' aspects.
    - `cells`: (M, 2) coordinates over the lattice basis.
    """

    tile: Tile
    cosets: Integers
    cells: Integers

    def __len__(self) -> int:
        return len(self.cosets)

    @cached_property
    def translations(self) -> Array:
        """(M, 2) translation of each copy's isometry."""
        group = self.tile.group
        return group.translations[self.cosets] + self.cells @ group.lattice.T

    def isometry(self, index: int) -> Isometry:
        """The group element of a copy."""
        return Isometry(self.tile.group.linear_parts[self.cosets[index]], self.translations[index])

    def images(self, points: Array) -> Array:
        """(M, N, 2) images of points (N, 2), one set a copy."""
        turned = np.einsum("gij,nj->gni", self.tile.group.linear_parts, points)
        return turned[self.cosets] + self.translations[:, None, :]

    def select(self, keep: NDArray[np.bool_] | Integers) -> Copies:
        """The copies where `keep` is true, or of these indices."""
        return Copies(self.tile, self.cosets[keep], self.cells[keep])

    def neighbours(self, elements: Sequence[Isometry]) -> Integers:
        """(M, E) index of the copy beyond each copy g, g @ element; -1 if it is not among them.

        Integer arithmetic on cosets and cells: nothing is compared by its place.
        """
        group = self.tile.group
        found = np.empty((len(self), len(elements)), dtype=np.int64)
        codes = _Codes(self)
        for number, element in enumerate(elements):
            moved = [coset_and_cell(self.tile, g @ element) for g in group.cosets]
            cosets = np.array([coset for coset, _ in moved])
            steps = np.array([cell for _, cell in moved])
            found[:, number] = codes.find(cosets[self.cosets], self.cells + steps[self.cosets])
        return found


class _Codes:
    """Finds copies by coset and cell."""

    def __init__(self, copies: Copies) -> None:
        self.low = copies.cells.min(axis=0, initial=0)
        self.sizes = copies.cells.max(axis=0, initial=0) - self.low + 1
        codes = self._codes(copies.cosets, copies.cells)
        self.order = np.argsort(codes)
        self.sorted = codes[self.order]

    def _codes(self, cosets: Integers, cells: Integers) -> Integers:
        steps = cells - self.low
        return (cosets * self.sizes[0] + steps[:, 0]) * self.sizes[1] + steps[:, 1]

    def find(self, cosets: Integers, cells: Integers) -> Integers:
        steps = cells - self.low
        known = ((steps >= 0) & (steps < self.sizes)).all(axis=1)
        codes = np.where(known, self._codes(cosets, cells), -1)
        place = np.minimum(np.searchsorted(self.sorted, codes), len(self.sorted) - 1)
        return np.where(self.sorted[place] == codes, self.order[place], -1)


def copies_inside(tile: Tile, window: Sequence[float]) -> Copies:
    """The copies of `tile` that lie in a rectangle whole, row by row.

    Args:
        tile: certified or not.
        window: (xmin, ymin, xmax, ymax) in the tile's units.

    Raises:
        OrbiflowError: for an empty window, or one of more than `MAX_TILES` tiles.
    """
    found, _, _ = _candidates(tile, checked_window(window), whole=True)
    return _by_rows(found)


def copies_meeting(tile: Tile, window: Sequence[float]) -> Copies:
    """The copies of `tile` that meet a rectangle, as `copies_inside`."""
    box = checked_window(window)
    found, low, high = _candidates(tile, box, whole=False)
    page = shapely.box(*box)
    shapely.prepare(page)
    meets = np.asarray(((low >= box[:2]) & (high <= box[2:])).all(axis=1))
    unsure = np.flatnonzero(~meets)
    rings = found.select(unsure).images(tile.polygon)
    # rings, not polygons: a tile that crosses itself must not stop the picture that shows it
    touched = shapely.intersects(page, shapely.linearrings(rings))
    middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    meets[unsure] = touched | shapely.contains_xy(shapely.polygons(rings), *middle)
    return _by_rows(found.select(meets))


def _candidates(tile: Tile, window: Window, *, whole: bool) -> tuple[Copies, Array, Array]:
    """Copies whose bounding box lies in the window, or meets it; and the boxes' corners."""
    _refuse_too_many(tile, window)
    group = tile.group
    low, high = np.array(window[:2]), np.array(window[2:])
    cosets, cells, lows, highs = [], [], [], []
    for number, coset in enumerate(group.cosets):
        ring = coset(tile.polygon)
        bottom, top = ring.min(axis=0), ring.max(axis=0)
        least, most = (low - bottom, high - top) if whole else (low - top, high - bottom)
        if (least > most).any():
            continue
        corners = np.array([[x, y] for x in (least[0], most[0]) for y in (least[1], most[1])])
        steps = corners @ group.inverse_lattice.T
        ranges = [
            np.arange(np.ceil(steps[:, k].min()), np.floor(steps[:, k].max()) + 1).astype(int)
            for k in (0, 1)
        ]
        grid = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 2)
        shifts = grid @ group.lattice.T
        kept = ((shifts >= least) & (shifts <= most)).all(axis=1)
        cells.append(grid[kept])
        cosets.append(np.full(int(kept.sum()), number))
        lows.append(bottom + shifts[kept])
        highs.append(top + shifts[kept])
    if not cells:
        none = np.zeros((0, 2))
        return Copies(tile, np.zeros(0, dtype=np.int64), none.astype(np.int64)), none, none
    found = Copies(tile, np.concatenate(cosets), np.concatenate(cells))
    return found, np.concatenate(lows), np.concatenate(highs)


def _by_rows(copies: Copies) -> Copies:
    center = copies.tile.group.images(copies.tile.center)[copies.cosets]
    place = center + copies.cells @ copies.tile.group.lattice.T
    rows = np.round(place / (0.01 * copies.tile.radius))
    return copies.select(np.lexsort((copies.cosets, rows[:, 0], rows[:, 1])))


def _refuse_too_many(tile: Tile, window: Window) -> None:
    width, height = window[2] - window[0], window[3] - window[1]
    size = expected_area(tile)
    expected = (width + 2 * tile.radius) * (height + 2 * tile.radius) / size
    if expected > 2 * MAX_TILES or width * height / size > MAX_TILES:
        raise OrbiflowError(
            f"the window of {width:.4g} by {height:.4g} would hold about "
            f"{width * height / size:.0f} tiles; the most is {MAX_TILES}: choose larger tiles or a "
            "smaller window"
        )
