"""The edges of a tiling and the isometries that identify them, found from polygons and group alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.aspects import Integers
from orbiflow.tilings.edge_identification import EdgeIdentification
from orbiflow.tilings.edge_matching import SegmentMatch, match_segments
from orbiflow.tilings.images import Surroundings, surroundings
from orbiflow.tilings.placed import Placed
from orbiflow.tilings.tile import Tiles, as_tiling
from orbiflow.tilings.tiling import Tiling

TOLERANCE = 1e-7
"""How far vertices of two copies may lie apart that count as one, in square roots of the area."""


@dataclass(frozen=True, eq=False)
class Edges:
    """How the boundaries of the prototiles fall into edges, each shared with one neighbour.

    Edges are numbered through, those of the first prototile first; each runs as its polygon does.

    - `tiling`: whose edges they are.
    - `owners`: for each edge, of which prototile it is.
    - `starts`: index into that prototile's polygon of the vertex in which it begins, increasing.
    - `across`: for each edge the group element whose tile lies beyond it, and of which prototile.
    - `partners`: for each edge, which edge of that tile it is.
    - `turned`: per prototile, (|S|, E) where each element of its stabiliser takes its edges; the other
      edges stay.
    """

    tiling: Tiling
    owners: tuple[int, ...]
    starts: tuple[int, ...]
    across: tuple[Placed, ...]
    partners: tuple[int, ...]
    turned: tuple[Integers, ...]

    def __len__(self) -> int:
        return len(self.owners)

    @cached_property
    def following(self) -> tuple[int, ...]:
        """For each edge the next one around its prototile."""
        first = [self.owners.index(k) for k in range(len(self.tiling.prototiles))]
        last = [*first[1:], len(self)]
        return tuple(e + 1 if e + 1 < last[k] else first[k] for e, k in enumerate(self.owners))

    def points(self, edge: int) -> Array:
        """(M, 2) vertices of an edge, both ends included."""
        polygon = self.tiling.prototiles[self.owners[edge]].polygon
        first, last = self.starts[edge], self.starts[self.following[edge]]
        length = (last - first - 1) % len(polygon) + 2
        return polygon[(first + np.arange(length)) % len(polygon)]

    @property
    def identifications(self) -> tuple[EdgeIdentification, ...]:
        """Each edge with its partner; where they are each other's, once, the lesser one first."""
        return tuple(
            EdgeIdentification(partner, edge, self.across[edge])
            for edge, partner in enumerate(self.partners)
            if partner <= edge or self.partners[partner] != edge
        )


def edges(tile: Tiles) -> Edges:
    """The edges of a tile or tiling: the longest runs of boundary along one neighbour.

    Args:
        tile: whose images match vertex by vertex, as those of every tile that orbiflow finds do;
            `edge_to_edge` makes others so.

    Raises:
        OrbiflowError: for a tile whose boundary does not match that of its images so.

    >>> from orbiflow.tilings import Tile
    >>> from orbiflow.tilings.classes import isohedral_class
    >>> ih4 = isohedral_class("IH4")
    >>> [found.brief for found in edges(Tile(ih4.template(), ih4.group())).identifications]
    ['0o', '2o', '3o', '1=4', '5o']
    """
    tiling = as_tiling(tile)
    numbers = range(len(tiling.prototiles))
    around = [surroundings(tiling, k, TOLERANCE) for k in numbers]
    matches = [match_segments(a, TOLERANCE) for a in around]
    _require_match(tiling, matches)
    begins = [_begins(tiling, a, match) for a, match in zip(around, matches, strict=True)]
    first = np.cumsum([0] + [len(b) for b in begins])
    owners: list[int] = []
    starts: list[int] = []
    across: list[Placed] = []
    partners: list[int] = []
    for k in numbers:
        match, near = matches[k], around[k].copies
        for segment in begins[k]:
            beyond = near.isometry(int(match.tile[segment]))
            there = beyond.prototile
            owners.append(k)
            starts.append(int(tiling.prototiles[k].kept[segment]))
            across.append(beyond)
            partner = _edge_of(begins[there], int(match.partner[segment]))
            partners.append(int(first[there]) + partner)
    turned = tuple(_turned(tiling, k, begins[k], first) for k in numbers)
    # each other's partners where that can be, and then by isometries that are each other's inverses
    own = Edges(tiling, tuple(owners), tuple(starts), tuple(across), tuple(partners), turned)
    return _mutual(own)


def _require_match(tiling: Tiling, matches: Sequence[SegmentMatch]) -> None:
    missing = sum(int((match.distance > TOLERANCE).sum()) for match in matches)
    if missing or any(order is None for own in tiling.stabilisers for order in own.orders):
        count = sum(len(match.distance) for match in matches)
        what = f"{missing} of the tile's {count} sides are no side of a neighbour"
        if not missing:
            what = "the tile's vertices are not as symmetric as its outline"
        raise OrbiflowError(
            f"{what}, so its edges are not known; certify(tile) says how its edges match, and "
            "edge_to_edge(tile) gives it the vertices that it lacks"
        )


def _begins(tiling: Tiling, around: Surroundings, match: SegmentMatch) -> Integers:
    """The segments of a prototile with which an edge begins."""
    sizes = np.array([len(p.ring) for p in tiling.prototiles])
    step = np.where(around.mirrored[match.tile], 1, -1)
    size = sizes[around.copies.prototiles[match.tile]]
    before = (np.roll(match.partner, 1) + step) % size
    continues = (match.tile == np.roll(match.tile, 1)) & (match.partner == before)
    starts = np.flatnonzero(~continues)
    if len(starts) < 2:
        raise OrbiflowError("the tile has fewer than two edges: it cannot tile the plane")
    return starts


def _edge_of(begins: Integers, segment: int) -> int:
    """The edge to which a segment belongs, by the segments with which edges begin."""
    return int(np.searchsorted(begins, segment, side="right") - 1) % len(begins)


def _turned(tiling: Tiling, k: int, begins: Integers, first: Integers) -> Integers:
    own = tiling.stabilisers[k]
    turned = np.tile(np.arange(int(first[-1])), (own.order, 1))
    for row, element, order in zip(turned, own.elements, own.orders, strict=True):
        assert order is not None
        # a segment read backwards begins where its end is taken
        image = order if element.determinant > 0 else np.roll(order, -1)
        for number, segment in enumerate(begins):
            row[first[k] + number] = first[k] + _edge_of(begins, int(image[segment]))
    return turned


def _mutual(own: Edges) -> Edges:
    """With partners chosen where a stabiliser leaves a choice: an edge itself, or each other."""
    across, partners = list(own.across), list(own.partners)
    done: NDArray[np.bool_] = np.zeros(len(own), dtype=bool)
    for edge in range(len(own)):
        if done[edge]:
            continue
        there = across[edge].prototile
        images = own.turned[there][:, partners[edge]]
        signs = [s.determinant for s in own.tiling.stabilisers[there].elements]
        choice = np.flatnonzero(images == edge)
        # a mirror rather than a half-turn: it says that the edge is straight
        choice = choice[
            np.argsort(np.array(signs)[choice] * across[edge].determinant, kind="stable")
        ]
        if not len(choice):
            choice = np.flatnonzero(~done[images])
        done[edge] = True
        if not len(choice):
            continue  # it has more images in its own tile than its partner has
        by = own.tiling.stabilisers[there].elements[int(choice[0])].inverse()
        element, partner = across[edge] @ by, int(images[choice[0]])
        across[edge] = Placed(element.linear, element.translation, there)
        partners[edge] = partner
        if partner != edge:
            back = element.inverse()
            across[partner] = Placed(back.linear, back.translation, own.owners[edge])
            partners[partner] = edge
            done[partner] = True
    return Edges(own.tiling, own.owners, own.starts, tuple(across), tuple(partners), own.turned)
