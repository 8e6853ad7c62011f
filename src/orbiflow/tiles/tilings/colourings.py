"""Colourings in which tiles that share an edge differ: periodic, with few colours."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, TypeAlias

import numpy as np

from orbiflow.arrays import Integers
from orbiflow.symmetry import Isometry
from orbiflow.tiles.tilings.surroundings import neighbours
from orbiflow.tiles.tilings.tile_copies import Copies, prototile_of
from orbiflow.tiles.tilings.tiling import Cell, Tiles, Tiling, as_tiling

Graph: TypeAlias = list[set[int]]  # the neighbours of each vertex, symmetric and without loops


MAX_STEPS = 4000
"""Number of assignments after which a graph counts as one that cannot be coloured."""


def colour_graph(graph: Graph, count: int) -> list[int] | None:
    """Return a proper colouring with colours 0 ... count - 1, or None.

    Backtracking in the order of saturation (Brélaz, "New methods to color the vertices of a graph",
    CACM 22, 1979). None means that there is none, or that none was found in `MAX_STEPS`
    assignments; with more colours than the largest degree it is always found, without backtracking.

    >>> colour_graph([{1, 2}, {0, 2}, {0, 1}], 3)
    [0, 1, 2]
    >>> colour_graph([{1, 2}, {0, 2}, {0, 1}], 2)
    """
    colours = [-1] * len(graph)
    trail: list[tuple[int, list[int]]] = []  # vertex and the colours still to try there
    for _ in range(max(MAX_STEPS, len(graph))):
        free = [v for v in range(len(graph)) if colours[v] < 0]
        if not free:
            return colours
        # most colours around it, ties to the larger degree
        around = {v: {colours[n] for n in graph[v]} - {-1} for v in free}
        vertex = max(free, key=lambda v: (len(around[v]), len(graph[v]), -v))
        highest = max(colours)  # colours not used yet are interchangeable: try only the first
        options = [c for c in range(min(count, highest + 2)) if c not in around[vertex]]
        trail.append((vertex, options))
        while trail and not trail[-1][1]:  # back to where another colour can be tried
            colours[trail.pop()[0]] = -1
        if not trail:
            return None
        vertex, options = trail[-1]
        colours[vertex] = options.pop(0)
    return colours if min(colours) >= 0 else None


# (a, b, c): spanned by a B_1 and b B_1 + c B_2, with 0 <= b < a; its index is a c
Sublattice: TypeAlias = tuple[int, int, int]

_INDICES = range(1, 10)


@dataclass(frozen=True, eq=False)
class Colouring:
    """A colour for each tile, the same for tiles that differ by a vector of a sublattice.

    Args:
        tiling: The tiling.
        count: The number of colours.
        sublattice: The sublattice in Hermite normal form, in the basis of the group's lattice.
        table: The colour (A, a, c) by aspect and by cell modulo the sublattice.
        shares: How many of the colours each prototile has, in order.
    """

    tiling: Tiling
    count: int
    sublattice: Sublattice
    table: Integers
    shares: tuple[int, ...]

    def colour(self, element: Isometry) -> int:
        """Return the colour, 0 ... count - 1, of the tile that `element` makes of its prototile.

        Raises `OrbiflowError` for an isometry that is not in the tile's group.
        """
        tiling = self.tiling
        aspect, cell, _ = tiling.aspects.find(tiling.group, element, prototile_of(element))
        first, second = reduce_cell(cell, self.sublattice)
        return int(self.table[aspect, first, second])

    def colours(self, copies: Copies) -> Integers:
        """Return the colour (M,) of each copy, in `tiling` or one with the same group and aspects."""
        first, second = reduce_cell(copies.cells.T, self.sublattice)
        return self.table[copies.aspects, first, second]


def colouring(tile: Tiles) -> Colouring:
    """Return a proper colouring with the fewest colours that a small sublattice allows.

    Each of several prototiles has colours of its own. The search is exact on the quotient of the tiling
    by each sublattice of index up to 9, for 1, 2, 3 ... colours in turn. It is deterministic: of equals
    the smallest index wins, so that colours follow the aspects where possible. Of a prototile's colours
    the first is the most frequent, and so on. Extremely skew lattices, whose tiles meet their own
    translates modulo all those sublattices, get a larger one.

    Raises `OrbiflowError` if polygon and group are of very different size.

    >>> from orbiflow.tiles import Tile, isohedral_class
    >>> hexagons = isohedral_class("IH1")
    >>> colouring(Tile(hexagons.template(), hexagons.group())).count
    3
    """
    tiling = as_tiling(tile)
    links, table = _links(tiling), tiling.aspects
    kinds = [np.flatnonzero(table.prototiles == k) for k in range(len(tiling.prototiles))]
    among = [_among(links, kind.tolist()) for kind in kinds]
    least = [_least_colours(links) for links in among]
    coloured = cache(partial(_coloured, among))  # few are needed

    def fewest(sublattice: Sublattice, most: int) -> list[list[int]]:
        """Return each prototile's colours, if together they are at most so many; else nothing."""
        chosen: list[list[int]] = []
        for k in range(len(kinds)):
            room = most - sum(max(used) + 1 for used in chosen) - sum(least[k + 1 :])
            options = (coloured(k, sublattice, count) for count in range(least[k], room + 1))
            option = next((option for option in options if option is not None), None)
            if option is None:
                return []
            chosen.append(option)
        return chosen

    def is_loop_free(sublattice: Sublattice) -> bool:
        quotients = (_quotient(links, sublattice) for links in among)
        return all(node not in near for graph in quotients for node, near in enumerate(graph))

    sublattices, size = [h for index in _INDICES for h in _sublattices(index)], max(_INDICES)
    while not (free := [sublattice for sublattice in sublattices if is_loop_free(sublattice)]):
        size *= 2
        sublattices = [(size, 0, size)]
    sublattice, colours = next(
        (sublattice, proper)
        for count in itertools.count(sum(least))  # one more than neighbours is enough
        for sublattice in free
        if (proper := fewest(sublattice, count))
    )
    a, _, c = sublattice
    numbers, shares = np.zeros((len(table), a, c), dtype=np.int64), list[int]()
    for kind, used in zip(kinds, colours, strict=True):
        order = np.argsort(-np.bincount(used), kind="stable")  # the most frequent colour first
        numbers[kind] = sum(shares) + np.argsort(order)[np.array(used)].reshape(len(kind), a, c)
        shares.append(len(order))
    return Colouring(tiling, sum(shares), sublattice, numbers, tuple(shares))


def reduce_cell(cell: Any, sublattice: Sublattice) -> tuple[Any, Any]:
    """Return the representatives (0 <= m < a, 0 <= n < c) of cells modulo the sublattice."""
    a, b, c = sublattice
    wraps, second = divmod(cell[1], c)
    return (cell[0] - wraps * b) % a, second


_Links: TypeAlias = list[list[tuple[int, Cell]]]


def _links(tiling: Tiling) -> _Links:
    """Return, for each aspect, (aspect, offset) of the neighbours of its tile in cell (0, 0)."""
    table, group = tiling.aspects, tiling.group
    shared = [neighbours(tiling, k).edge for k in range(len(tiling.prototiles))]
    links: _Links = []
    for k, coset in zip(table.prototiles, table.cosets, strict=True):
        g = group.cosets[int(coset)]
        places = [table.find(group, g @ near, near.prototile) for near in shared[int(k)]]
        links.append([(aspect, cell) for aspect, cell, _ in places])
    return links


def _among(links: _Links, aspects: list[int]) -> _Links:
    """Return the links among some aspects, which are numbered anew."""
    number = {aspect: k for k, aspect in enumerate(aspects)}
    return [[(number[k], cell) for k, cell in links[aspect] if k in number] for aspect in aspects]


def _coloured(
    among: Sequence[_Links], kind: int, sublattice: Sublattice, count: int
) -> list[int] | None:
    """Return a proper colouring of one prototile's tiles modulo a sublattice, or None."""
    return colour_graph(_quotient(among[kind], sublattice), count)


def _least_colours(links: _Links) -> int:
    """Return 1 without neighbours, 3 where three tiles are neighbours of each other, else 2."""
    near = [set(linked) for linked in links]
    triangle = any(
        (other, (u - a, v - b)) in near[aspect]
        for linked in links
        for (aspect, (a, b)), (other, (u, v)) in itertools.combinations(linked, 2)
    )
    return 3 if triangle else 2 if any(links) else 1


def _sublattices(index: int) -> Iterator[Sublattice]:
    # square-like ones first, so that a tie does not go to a long thin period
    divisors = [a for a in range(1, index + 1) if index % a == 0]
    for a in sorted(divisors, key=lambda a: abs(a * a - index)):
        for b in range(a):
            yield a, b, index // a


def _quotient(links: _Links, sublattice: Sublattice) -> Graph:
    """Return adjacency of tiles modulo the sublattice; node (i, m, n) is number (i a + m) c + n."""
    a, _, c = sublattice
    graph: Graph = []
    for near in links:
        for m in range(a):
            for n in range(c):
                cells = [(k, reduce_cell((m + u, n + v), sublattice)) for k, (u, v) in near]
                graph.append({(k * a + p) * c + q for k, (p, q) in cells})
    return graph
