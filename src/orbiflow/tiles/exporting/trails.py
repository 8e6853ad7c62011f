"""Arcs joined into few long trails, in an order that saves a tool's way between them."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from orbiflow.arrays import Array
from orbiflow.tiles.exporting.curves import Curve

Trail = list[tuple[int, bool]]
"""Arcs end to end: which one, and whether it is run from its start to its end."""


def trails(ends: NDArray[np.int64]) -> list[Trail]:
    """Every arc once, in as few trails as there can be.

    A connected part with 2k odd vertices (where an odd number of arcs meet) falls into k trails, one
    without odd vertices is a single closed one (Euler; the method is Hierholzer's).

    Args:
        ends: (S, 2) numbers of the vertices that each arc leads from and to.

    >>> trails(np.array([[0, 1], [1, 2], [2, 0]]))
    [[(0, True), (1, True), (2, True)]]
    """
    # joining the odd vertices in pairs makes all even; the joints come out again
    joints = _joints(ends)
    both = np.concatenate([ends, joints]) if len(joints) else ends
    arcs: dict[int, list[tuple[int, int, bool]]] = defaultdict(list)
    for number, (start, end) in reversed(list(enumerate(both.tolist()))):
        arcs[start].append((number, end, True))
        arcs[end].append((number, start, False))
    used = np.zeros(len(both), dtype=bool)
    found: list[Trail] = []
    for start in both[:, 0].tolist():
        circuit = _circuit(start, arcs, used)
        if circuit:
            found += _parted(circuit, len(ends))
    return found


def _joints(ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """(J, 2) pairs of the odd vertices of each connected part."""
    parent: dict[int, int] = {}

    def root(vertex: int) -> int:
        while parent.setdefault(vertex, vertex) != vertex:
            parent[vertex] = parent[parent[vertex]]
            vertex = parent[vertex]
        return vertex

    for start, end in ends.tolist():
        parent[root(start)] = root(end)
    odd: dict[int, list[int]] = defaultdict(list)
    vertices, counts = np.unique(ends, return_counts=True)
    for vertex in vertices[counts % 2 == 1].tolist():
        odd[root(vertex)].append(vertex)
    pairs = [part[k : k + 2] for part in odd.values() for k in range(0, len(part), 2)]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _circuit(
    start: int, arcs: dict[int, list[tuple[int, int, bool]]], used: NDArray[np.bool_]
) -> Trail:
    """A closed trail through all unused arcs that hang together with `start`."""
    path: list[tuple[int, int, bool]] = [(start, -1, True)]
    circuit: Trail = []
    while path:
        vertex, arc, forward = path[-1]
        near = arcs[vertex]
        while near and used[near[-1][0]]:
            near.pop()
        if near:
            number, other, along = near.pop()
            used[number] = True
            path.append((other, number, along))
        else:
            path.pop()
            if arc >= 0:
                circuit.append((arc, forward))
    return circuit[::-1]


def _parted(circuit: Trail, count: int) -> list[Trail]:
    """The circuit without the arcs from number `count` on."""
    breaks = [k for k, (arc, _) in enumerate(circuit) if arc >= count]
    if not breaks:
        return [circuit]
    turned = circuit[breaks[0] + 1 :] + circuit[: breaks[0] + 1]
    parts: list[Trail] = [[]]
    for arc, forward in turned:
        if arc >= count:
            parts.append([])
        else:
            parts[-1].append((arc, forward))
    return [part for part in parts if part]


def in_short_order(curves: list[Curve]) -> list[Curve]:
    """The curves in an order, and run in a direction, that makes the way between them short.

    From each end to the nearest end of one not yet run, from the upper left corner on.
    """
    if not curves:
        return []
    nearest = _Nearest(np.array([[curve.start, curve.end] for curve in curves]))
    place, ordered = np.zeros(2), []
    for _ in curves:
        number, side = nearest.take(place)
        ordered.append(curves[number].reversed() if side else curves[number])
        place = nearest.ends[number, 1 - side]
    return ordered


class _Nearest:
    """Ends (n, 2, 2) of curves, the nearest of those that are left found by a tree."""

    def __init__(self, ends: Array) -> None:
        self.ends = ends
        self.left = np.ones(len(ends), dtype=bool)
        self._plant()

    def _plant(self) -> None:
        self.numbers = np.flatnonzero(self.left)
        self.tree = KDTree(self.ends[self.numbers].reshape(-1, 2))
        self.taken = 0

    def take(self, place: Array) -> tuple[int, int]:
        """The curve with an end nearest to `place`, and which of its ends; it is left no more."""
        if 2 * self.taken > len(self.numbers):
            self._plant()
        size = 2 * len(self.numbers)
        count = min(8, size)
        while True:
            _, found = self.tree.query(place, k=count)
            for hit in np.atleast_1d(found).tolist():
                number, side = int(self.numbers[hit // 2]), hit % 2
                if self.left[number]:
                    self.left[number] = False
                    self.taken += 1
                    return number, side
            count = min(4 * count, size)
