"""Colouring the vertices of a small graph with a given number of colours."""

from __future__ import annotations

from typing import TypeAlias

Graph: TypeAlias = list[set[int]]
"""Neighbours of each vertex; symmetric, without loops."""


def colour_graph(graph: Graph, count: int, *, max_steps: int = 4000) -> list[int] | None:
    """A proper colouring with colours 0 ... count - 1, or None.

    Backtracking in the order of saturation (Brélaz, "New methods to color the vertices of a graph",
    CACM 22, 1979). None means there is none, or that none was found in `max_steps` assignments;
    with more colours than the largest degree there always is one, found without going back.

    >>> colour_graph([{1, 2}, {0, 2}, {0, 1}], 3)
    [0, 1, 2]
    >>> colour_graph([{1, 2}, {0, 2}, {0, 1}], 2)
    """
    colours = [-1] * len(graph)
    trail: list[tuple[int, list[int]]] = []  # vertex and the colours still to try there
    for _ in range(max(max_steps, len(graph))):
        vertex = _most_constrained(graph, colours)
        if vertex is None:
            return colours
        taken = {colours[n] for n in graph[vertex]}
        highest = max(colours)  # colours not used yet are interchangeable: try only the first
        options = [c for c in range(min(count, highest + 2)) if c not in taken]
        trail.append((vertex, options))
        if not _advance(trail, colours):
            return None
    return colours if min(colours) >= 0 else None


def _most_constrained(graph: Graph, colours: list[int]) -> int | None:
    """The uncoloured vertex with most colours around it, ties to the larger degree."""
    free = [v for v in range(len(graph)) if colours[v] < 0]
    if not free:
        return None
    return max(free, key=lambda v: (len({colours[n] for n in graph[v]} - {-1}), len(graph[v]), -v))


def _advance(trail: list[tuple[int, list[int]]], colours: list[int]) -> bool:
    """Colour the last vertex of the trail with its next option, going back while there is none."""
    while trail:
        vertex, options = trail[-1]
        if options:
            colours[vertex] = options.pop(0)
            return True
        colours[vertex] = -1
        trail.pop()
        # the next vertex back gets its next option in the next round of this loop
    return False
