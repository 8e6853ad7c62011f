"""The angles that kernels are products of, on any lattice."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.symmetry import CrystallographicGroup, Isometry, translation

FARTHEST = 2
"""The largest multiple of a basis vector in the vectors that a frame is chosen from."""

MOST_CELLS = 6
"""The most lattice cells that a rectangular frame may have."""


class LatticeFrame(NamedTuple):
    """A group written on a sublattice whose basis is as nearly rectangular as can be.

    The sublattice need not be one that the group preserves: `group.cosets` represent the right cosets
    L g of its translations L. A function with the period L, summed over the images of a point under
    them, is invariant under the whole group.

    - `group`: The group on the sublattice.
    - `own`: How many of the cosets, the first ones, take a product of functions of one coordinate each
      to another such product. All others are these after every `own`-th one.
    """

    group: CrystallographicGroup
    own: int

    @property
    def is_rectangular(self) -> bool:
        """Whether the basis vectors are orthogonal."""
        return is_rectangular(self.group.lattice)


def is_rectangular(basis: Array) -> bool:
    """Return whether basis vectors (columns) are orthogonal."""
    unit = basis / np.linalg.norm(basis, axis=0)
    return bool(np.allclose(unit.T @ unit, np.eye(len(basis)), rtol=0, atol=1e-9))


def frame_of(group: CrystallographicGroup) -> LatticeFrame:
    """Return the frame of a group; with a diagonal lattice, the group itself, if it turns no axes.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> found = frame_of(wallpaper_group("p3"))
    >>> found.group.lattice.round(3).tolist(), found.group.order, found.own
    ([[1.0, 0.0], [0.0, 1.732]], 6, 2)
    """
    basis = straight_basis(group)
    if basis is group.lattice and _keeps_axes(basis, group.linear_parts).all():
        return LatticeFrame(group, group.order)
    finer = CrystallographicGroup.generate(basis, [translation(v) for v in group.lattice.T])
    every = [
        Isometry(g.linear, finer.wrap(g.translation + shift))
        for g in group.cosets
        for shift in finer.translations
    ]
    keeping = [g for g in every if _keeps_axes(basis, g.linear)]
    framed = CrystallographicGroup(basis, tuple(keeping), group.name)
    for g in every:
        if not framed.contains(g):
            images = [Isometry((s @ g).linear, finer.wrap((s @ g).translation)) for s in keeping]
            framed = CrystallographicGroup(basis, (*framed.cosets, *images), group.name)
    return LatticeFrame(framed, len(keeping))


def _keeps_axes(bases: Array, linear: Array) -> NDArray[np.bool_]:
    """Return whether isometries (..., d, d) permute and flip the coordinates in bases (..., d, d)."""
    moved = np.abs(np.linalg.solve(bases, linear @ bases))
    near = (np.abs(moved - moved.round()) < 1e-9).all(axis=(-2, -1))
    return near & (moved.round().sum(axis=-2) == 1).all(axis=-1)


def straight_basis(group: CrystallographicGroup) -> Array:
    """Return short orthogonal vectors of a group's lattice, or else its shortest basis, as columns.

    A diagonal basis is returned as it is, and so is one of more than three dimensions. Orthogonal
    vectors may be those of a sublattice: the one whose axes most of the group keeps, then the one of
    the least volume, then the one nearest to the axes of space.
    """
    lattice, d = group.lattice, group.dim
    if d > 3 or np.allclose(lattice, np.diag(np.diag(lattice))):
        return lattice
    box = itertools.product(range(-FARTHEST, FARTHEST + 1), repeat=d)
    steps = np.array([k for k in box if math.gcd(*k) == 1 and k > (0,) * d])
    vectors = steps @ lattice.T
    chosen = np.array(list(itertools.combinations(range(len(steps)), d)))
    cells = np.abs(np.linalg.det(steps[chosen])).round()
    product = np.prod(np.linalg.norm(vectors, axis=1)[chosen], axis=1)
    volume = cells * abs(np.linalg.det(lattice))
    straight = (product < volume * (1 + 1e-9)) & (cells > 0) & (cells <= MOST_CELLS)
    allowed = np.flatnonzero(straight if straight.any() else cells == 1)
    bases = vectors[chosen[allowed]].swapaxes(1, 2)
    kept = _keeps_axes(bases[:, None], group.linear_parts).sum(axis=1)
    along = np.abs(bases).max(axis=1).sum(axis=1)
    order = np.lexsort((-along.round(9), product[allowed].round(9), -kept))
    return _facing_axes(bases[order[0]])


def _facing_axes(basis: Array) -> Array:
    """Return basis vectors in the order, and with the signs, that are nearest to those of the axes."""
    orders = map(list, itertools.permutations(range(len(basis))))
    nearest = max(orders, key=lambda order: float(np.abs(np.diag(basis[:, order])).sum()))
    turned = basis[:, nearest]
    return turned * np.where(np.diag(turned) < 0, -1.0, 1.0)
