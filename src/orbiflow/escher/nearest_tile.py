"""The tiles of a class that are nearest to an outline, in closed form, thousands at a time.

With the corners placed and the glide axes' turn given, the polygons that tile form a linear space:
a vertex is free or the image of a free one, and the images depend linearly on the lattice and the
position of the group. The nearest of them in the sum of squared distances is found by means over the
orbits and one system of at most six equations (the idea of EST: Koizumi and Sugihara, Maximum
Eigenvalue Problem for Escherization, 2011; Nagata and Imahori, 2020).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.escher.placements import Complex, Integers, Placements
from orbiflow.symmetry import Isometry
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import IsohedralClass


class NearestTiles(NamedTuple):
    """C tiles, each the nearest to the outline under its placement.

    - `vertices`: (C, n) x + iy, vertex i near point `start + i` of the outline.
    - `linear`, `offset`: (C, 2, 2) and (C, 2), the map from the group's own frame.
    - `corners`: (C, K) vertices at the template's corners.
    - `distance`: (C,) sum of squared distances.

    A tile may cross itself, and `linear` may reverse orientation: then it is of no use.
    """

    vertices: Complex
    linear: Array
    offset: Array
    corners: Integers
    distance: Array

    def take(self, index: Integers) -> NearestTiles:
        """Those at `index`."""
        return NearestTiles(
            self.vertices[index],
            self.linear[index],
            self.offset[index],
            self.corners[index],
            self.distance[index],
        )


class _Element(NamedTuple):
    """z -> factor z + shift, or factor conj(z) + shift."""

    factor: complex
    flips: bool
    shift: complex

    @classmethod
    def of(cls, isometry: Isometry) -> _Element:
        linear = isometry.linear
        return cls(
            complex(linear[0, 0], linear[1, 0]),
            bool(np.linalg.det(linear) < 0),
            complex(*isometry.translation),
        )


class _Layout(NamedTuple):
    """What a class identifies, in complex numbers: of each edge pair and of each corner."""

    edges: tuple[_Element, ...]
    corners: tuple[tuple[int, _Element], ...]  # first corner of the orbit; -1: a fixed point


@lru_cache(maxsize=16)
def _layout(kind: IsohedralClass) -> _Layout:
    group, vertices = kind.group(), kind.template()
    corners: list[tuple[int, _Element]] = []
    for k, vertex in enumerate(vertices):
        if len(list(group.elements_near(vertex, 1e-6, source=vertex))) > 1:
            corners.append((-1, _Element(1, False, complex(*vertex))))
            continue
        for first in range(k + 1):
            images = list(group.elements_near(vertex, 1e-6, source=vertices[first]))
            if images:
                corners.append((first, _Element.of(images[0])))
                break
    edges = tuple(_Element.of(kind.edge_isometry(pair)) for pair in kind.identified_edges)
    return _Layout(edges, tuple(corners))


class _Orbits:
    """For each vertex: the free vertex that it is an image of, and by which element; or fixed."""

    def __init__(self, kind: IsohedralClass, lengths: Integers) -> None:
        count, n = len(lengths), int(lengths[0].sum())
        layout = _layout(kind)
        self.corners = np.cumsum(lengths, axis=1) - lengths
        self.source = np.tile(np.arange(n), (count, 1))
        self.factor = np.ones((count, n), dtype=complex)
        self.flips = np.zeros((count, n), dtype=bool)
        self.shift = np.zeros((count, n), dtype=complex)
        self.fixed = np.zeros((count, n), dtype=bool)
        vertices = kind.template() @ [1, 1j]
        for pair, element in zip(kind.identified_edges, layout.edges, strict=True):
            middle = (vertices[pair.first] + vertices[(pair.first + 1) % len(vertices)]) / 2
            own = self.corners[:, [pair.first]]
            other = self.corners[:, [pair.second]]
            length = lengths[:, [pair.first]]
            j = np.arange(1, int(length.max(initial=1)))
            if pair.folded:
                self._map((j < length) & (2 * j > length), own + j, own + length - j, element)
                rows = np.flatnonzero(length[:, 0] % 2 == 0)
                self._fix(rows, (own + length // 2)[rows, 0], middle)
            else:
                mate = other + (length - j if pair.reversed else j)
                self._map(j < length, mate, own + j, element)
        rows = np.arange(count)
        for k, (first, element) in enumerate(layout.corners):
            if first < 0:
                self._fix(rows, self.corners[:, k], element.shift)
            else:
                live = np.ones((count, 1), dtype=bool)
                self._map(live, self.corners[:, [k]], self.corners[:, [first]], element)

    def _map(self, live: NDArray[np.bool_], vertex: Array, source: Array, by: _Element) -> None:
        rows, columns = np.nonzero(live)
        at = rows, np.broadcast_to(vertex, live.shape)[rows, columns]
        self.source[at] = np.broadcast_to(source, live.shape)[rows, columns]
        self.factor[at], self.flips[at], self.shift[at] = by

    def _fix(self, rows: Integers, vertex: Integers, where: complex) -> None:
        self.fixed[rows, vertex] = True
        self.shift[rows, vertex] = where


CHUNK = 4000
"""Placements worked on at a time: bounds the memory at some hundred MB."""


def nearest_tiles(
    kind: IsohedralClass,
    outline: Complex,
    placements: Placements,
    weights: Array | None = None,
) -> NearestTiles:
    """Project an outline onto the tiles of a class, for every placement.

    Args:
        kind: the isohedral class.
        outline: (n,) points x + iy, counter-clockwise.
        placements: C of them, of this class and n.
        weights: (n,) positive weights of the points; default 1.
    """
    chunks = [
        _nearest_tiles(kind, outline, placements.take(index), weights)
        for index in np.array_split(
            np.arange(len(placements.starts)), max(1, -(-len(placements.starts) // CHUNK))
        )
    ]
    return NearestTiles(*(np.concatenate(parts) for parts in zip(*chunks, strict=True)))


def _nearest_tiles(
    kind: IsohedralClass, outline: Complex, placements: Placements, weights: Array | None
) -> NearestTiles:
    count, n = len(placements.starts), len(outline)
    orbits = _Orbits(kind, placements.lengths)
    order = (np.arange(n) + placements.starts[:, None]) % n
    weight = np.ones((count, n)) if weights is None else np.asarray(weights)[order]
    turn = np.exp(1j * placements.turns)[:, None]
    # the group's linear parts in the placed frame
    factor = np.where(orbits.flips, orbits.factor * turn**2, orbits.factor)
    columns = _columns(kind, orbits, factor, turn)
    goal = outline[order]
    # pull all back to the free vertices and take out what these can do
    everything = np.concatenate([columns, goal[..., None]], axis=-1)
    pulled = _unturn(factor, orbits.flips, everything)
    mean = _orbit_means(orbits.source, pulled, weight)
    at_source = np.take_along_axis(mean, orbits.source[..., None], axis=1)
    residual = np.where(orbits.fixed[..., None], pulled, pulled - at_source)
    basis, rest = residual[..., :-1], residual[..., -1]
    weighted = weight[..., None] * np.conj(basis)
    matrix = np.real(np.einsum("cni,cnj->cij", weighted, basis))
    right = np.real(np.einsum("cni,cn->ci", weighted, rest))
    # IH1 does not care about the offset: the least solution
    ridge = 1e-10 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] * np.eye(matrix.shape[-1])
    solution = np.linalg.solve(matrix + ridge, right[..., None])[..., 0]
    distance = (weight * abs(rest - np.einsum("cni,ci->cn", basis, solution)) ** 2).sum(axis=1)
    free = mean[..., -1] - np.einsum("cni,ci->cn", mean[..., :-1], solution)
    image = _turn(factor, orbits.flips, np.take_along_axis(free, orbits.source, axis=1))
    vertices = np.where(orbits.fixed, 0, image) + np.einsum("cni,ci->cn", columns, solution)
    linear = _linear(kind, solution[:, 2:], placements.turns)
    return NearestTiles(vertices, linear, solution[:, :2], orbits.corners, distance)


def _columns(kind: IsohedralClass, orbits: _Orbits, factor: Complex, turn: Complex) -> Complex:
    """(C, n, 2 + m): how offset and linear part move each vertex, its free vertex held."""
    shift, one = orbits.shift, np.ones_like(factor)
    columns = [
        np.where(orbits.fixed, z * one, z * one - _turn(factor, orbits.flips, z * one))
        for z in (1, 1j)
    ]
    match kind.stretch_dim:
        case 2:
            columns += [shift, 1j * shift, np.conj(shift), 1j * np.conj(shift)]
        case 1:  # along the glides, which are the axes of the group's own frame
            columns += [turn * np.real(shift), 1j * turn * np.imag(shift)]
        case _:
            columns += [shift, 1j * shift]
    return np.stack(columns, axis=-1)


def _linear(kind: IsohedralClass, solution: Array, turns: Array) -> Array:
    """(C, 2, 2) from the coefficients of `_columns`."""
    cos, sin = np.cos(turns), np.sin(turns)
    match kind.stretch_dim:
        case 2:
            a, b, c, d = solution.T
            rows = [a + c, d - b, b + d, a - c]
        case 1:  # along the glides, which are the axes of the group's own frame
            p, q = solution.T
            rows = [cos * p, -sin * q, sin * p, cos * q]
        case _:
            a, b = solution.T
            rows = [a, -b, b, a]
    return np.stack(rows, axis=-1).reshape(-1, 2, 2)


def _turn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    return factor * np.where(flips, np.conj(z), z)


def _unturn(factor: Complex, flips: NDArray[np.bool_], z: Complex) -> Complex:
    """The inverse of `_turn` on (C, n, m)."""
    return np.where(
        flips[..., None], factor[..., None] * np.conj(z), np.conj(factor)[..., None] * z
    )


def _orbit_means(source: Integers, values: Complex, weight: Array) -> Complex:
    """Weighted means of values (C, n, m) over each orbit, at its free vertex."""
    count, n, m = values.shape
    flat = (source + np.arange(count)[:, None] * n).ravel()
    total = np.bincount(flat, weight.ravel(), minlength=count * n)
    total[total == 0] = 1.0
    means: Complex = np.empty((count * n, m), dtype=complex)
    for column in range(m):
        weighted = (values[..., column] * weight).ravel()
        means.real[:, column] = np.bincount(flat, weighted.real, minlength=count * n) / total
        means.imag[:, column] = np.bincount(flat, weighted.imag, minlength=count * n) / total
    return means.reshape(count, n, m)
