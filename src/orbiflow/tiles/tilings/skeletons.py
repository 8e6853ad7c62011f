"""The skeleton of a tiling: the edges of a set of tiles, shared edges only once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from orbiflow.arrays import Integers
from orbiflow.tiles.tilings.tile_copies import Copies, CopiesAcross
from orbiflow.tiles.tilings.tile_edges import Edges


@dataclass(frozen=True, eq=False)
class Skeleton:
    """S edges of copies of prototiles.

    - `edges`, `copies`: The tiling's edges, and the copies.
    - `copy`, `edge`: Edge `edge` of copy `copy`, (S,), in the direction of that copy's boundary.
    - `other`: The copy (S,) across it, -1 if it is not in the set.
    - `ends`: The numbers (S, 2) of its first and last vertex: edges that meet within the set share
      them. A vertex where copies only touch may have several numbers.
    """

    edges: Edges
    copies: Copies
    copy: Integers
    edge: Integers
    other: Integers
    ends: Integers

    def __len__(self) -> int:
        return len(self.copy)


def skeleton(own: Edges, copies: Copies) -> Skeleton:
    """Return each edge of each copy once.

    Edge k of the copy g is edge partner(k) of g @ across(k).

    The search uses only aspects and cells, no positions, so that no edge is drawn twice or lost,
    however close edges come to each other.

    Args:
        own: The edges of the copies' tiling.
        copies: Any of its tiles.

    >>> from orbiflow.tiles import CLASSES, Tile, copies_inside, edges
    >>> tile = Tile(CLASSES["IH1"].template(), CLASSES["IH1"].group())
    >>> both = copies_inside(tile, (-1.01, -1, 2.6, 2))
    >>> len(both), len(skeleton(edges(tile), both))
    (2, 11)
    """
    beyond = copies.beyond(own.across, own.owners)
    mine = copies.prototiles[:, None] == np.array(own.owners)
    numbers = np.arange(len(copies))[:, None]
    copy, edge = np.nonzero(mine & ((beyond.copy < 0) | (beyond.copy > numbers)))
    vertices = _vertices(own, beyond)
    ends = np.stack([vertices[copy, edge], vertices[copy, np.array(own.following)[edge]]], axis=1)
    return Skeleton(own, copies, copy, edge, beyond.copy[copy, edge], ends)


def _vertices(own: Edges, beyond: CopiesAcross) -> Integers:
    """Return (M, E) number of the vertex in which edge k of each copy starts."""
    count, sides = beyond.copy.shape
    following = np.array(own.following)
    links: list[Integers] = []
    for k, (partner, element) in enumerate(zip(own.partners, own.across, strict=True)):
        copy = np.flatnonzero(beyond.copy[:, k] >= 0)
        there, turn = beyond.copy[copy, k], beyond.turn[copy, k]
        # the copy beyond is its own image by an element of its stabiliser: so are its edges
        mate = own.turned[element.prototile][turn, partner]
        symmetries = own.tiling.stabilisers[element.prototile].elements
        signs = np.array([s.determinant for s in symmetries])[turn] * element.determinant
        begin: Integers = there * sides + mate
        end: Integers = there * sides + following[mate]
        start = np.where(signs > 0, end, begin)
        stop = np.where(signs > 0, begin, end)
        links.append(np.stack([copy * sides + k, start]))
        links.append(np.stack([copy * sides + following[k], stop]))
    first, second = np.concatenate(links, axis=1)
    size = count * sides
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(size, size))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.int64).reshape(count, sides)
