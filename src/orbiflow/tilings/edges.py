"""The edges of a tile and the isometries that identify them, found from polygon and group alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import Isometry
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.images import expected_area
from orbiflow.tilings.neighbours import neighbours
from orbiflow.tilings.tile import Tile

Integers = NDArray[np.int64]

TOLERANCE = 1e-7
"""How far vertices of two copies may lie apart that count as one, in square roots of the area."""


class EdgeIdentification(NamedTuple):
    """`isometry` takes edge `first` of a tile onto its edge `second`, `first <= second`.

    So across its edge `second` the tile T meets the copy isometry(T), along that copy's `first`.
    """

    first: int
    second: int
    isometry: Isometry

    @property
    def folded(self) -> bool:
        """Whether the edge is its own partner."""
        return self.first == self.second

    @property
    def reversed(self) -> bool:
        """Whether the start of `first` goes to the end of `second`: unless orientation is reversed."""
        return self.isometry.determinant > 0


@dataclass(frozen=True, eq=False)
class Edges:
    """How the boundary of a tile falls into edges, each shared with one neighbour.

    Edge k runs from vertex `starts[k]` of the polygon to `starts[k + 1]`.

    - `tile`: whose edges they are.
    - `starts`: indices into its polygon, increasing.
    - `across`: for each edge the group element whose copy of the tile lies beyond it.
    - `partners`: for each edge, which edge of that copy it is.
    """

    tile: Tile
    starts: tuple[int, ...]
    across: tuple[Isometry, ...]
    partners: tuple[int, ...]

    def points(self, edge: int) -> Array:
        """(M, 2) vertices of an edge, both ends included."""
        first = self.starts[edge]
        last = self.starts[(edge + 1) % len(self.starts)]
        count = len(self.tile.polygon)
        length = (last - first - 1) % count + 2
        return self.tile.polygon[(first + np.arange(length)) % count]

    @property
    def identifications(self) -> tuple[EdgeIdentification, ...]:
        """Each pair of partners once."""
        return tuple(
            EdgeIdentification(partner, edge, self.across[edge])
            for edge, partner in enumerate(self.partners)
            if partner <= edge
        )


def edges(tile: Tile) -> Edges:
    """The edges of a tile: the longest runs of its boundary along one neighbour.

    Args:
        tile: whose images match vertex by vertex, as those of every tile that orbiflow finds do.

    Raises:
        OrbiflowError: for a tile whose boundary does not match that of its images so.

    >>> from orbiflow.tilings.classes import isohedral_class
    >>> ih4 = isohedral_class("IH4")
    >>> [(e.first, e.second) for e in edges(Tile(ih4.template(), ih4.group())).identifications]
    [(0, 0), (2, 2), (3, 3), (1, 4), (5, 5)]
    """
    near = neighbours(tile, tolerance=TOLERANCE).edge
    owner, partner = _segments(tile, near)
    missing = int((owner < 0).sum())
    if missing:
        raise OrbiflowError(
            f"{missing} of the tile's {len(owner)} sides are no side of a neighbour, so its edges "
            "are not known; certify(tile) says how its edges match"
        )
    step = np.where([g.determinant > 0 for g in near], -1, 1)[owner]
    count = len(owner)
    continues = (owner == np.roll(owner, 1)) & (partner == (np.roll(partner, 1) + step) % count)
    starts = np.flatnonzero(~continues)
    if len(starts) < 2:
        raise OrbiflowError("the tile has fewer than two edges: it cannot tile the plane")
    own = (np.searchsorted(starts, np.arange(count), side="right") - 1) % len(starts)
    return Edges(
        tile,
        tuple(int(k) for k in starts),
        tuple(near[owner[k]] for k in starts),
        tuple(int(own[partner[k]]) for k in starts),
    )


def _segments(tile: Tile, near: tuple[Isometry, ...]) -> tuple[Integers, Integers]:
    """For each side of the tile which neighbour has it as well, and as which side; -1 for none.

    Side i runs from vertex i to the next.
    """
    ring, count = tile.polygon, len(tile.polygon)
    tree = KDTree(ring)
    owner, partner = np.full(count, -1), np.full(count, -1)
    reach = TOLERANCE * math.sqrt(expected_area(tile))
    for number, element in enumerate(near):
        _, start = tree.query(element(ring), distance_upper_bound=reach)
        start = np.asarray(start)
        end = np.roll(start, -1)
        both = (start < count) & (end < count)
        if element.determinant > 0:  # seen from the tile, its neighbour's boundary runs backwards
            sides = np.flatnonzero(both & (start == (end + 1) % count))
            own = end[sides]
        else:
            sides = np.flatnonzero(both & (end == (start + 1) % count))
            own = start[sides]
        owner[own], partner[own] = number, sides
    return owner, partner
