"""The skeleton of a tiling: the edges of a set of copies, each that two of them share only once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from orbiflow.tilings.copies import Copies
from orbiflow.tilings.edges import Edges

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """S edges of copies of a tile.

    - `edges`, `copies`: of the tile, and which copies.
    - `copy`, `edge`: (S,) edge `edge` of copy `copy`, run as that copy's boundary runs.
    - `other`: (S,) the copy beyond it, -1 where none of the set is.
    - `ends`: (S, 2) start and end as numbers of vertices: edges that meet within the set have the
      same. A vertex where copies only touch may have several numbers.
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
    """Each edge of each copy, once: edge k of the copy g is edge partner(k) of g @ across(k).

    That is arithmetic of cosets and cells; no places are compared, so that nothing is drawn twice or
    lost however close edges come to each other.

    Args:
        own: edges of the copies' tile.
        copies: any of the tile's copies.

    >>> from orbiflow.tilings import CLASSES, Tile, copies_inside, edges
    >>> tile = Tile(CLASSES["IH1"].template(), CLASSES["IH1"].group())
    >>> both = copies_inside(tile, (-1.01, -1, 2.6, 2))
    >>> len(both), len(skeleton(edges(tile), both))
    (2, 11)
    """
    beyond = copies.neighbours(own.across)
    numbers = np.arange(len(copies))[:, None]
    copy, edge = np.nonzero((beyond < 0) | (beyond > numbers))
    vertices = _vertices(own, beyond)
    ends = np.stack([vertices[copy, edge], vertices[copy, (edge + 1) % len(own.starts)]], axis=1)
    return Skeleton(own, copies, copy, edge, beyond[copy, edge], ends)


def _vertices(own: Edges, beyond: Integers) -> Integers:
    """(M, K) number of the vertex in which edge k of each copy starts."""
    count, sides = beyond.shape
    links = []
    for k, partner in enumerate(own.partners):
        copy = np.flatnonzero(beyond[:, k] >= 0)
        there = beyond[copy, k] * sides
        start, end = partner, (partner + 1) % sides
        if own.across[k].determinant > 0:
            start, end = end, start
        links.append(np.stack([copy * sides + k, there + start]))
        links.append(np.stack([copy * sides + (k + 1) % sides, there + end]))
    first, second = np.concatenate(links, axis=1)
    size = count * sides
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(size, size))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.int64).reshape(count, sides)
