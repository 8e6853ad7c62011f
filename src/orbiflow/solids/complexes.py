"""Partitions of space into small cells that a group maps to one another."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array, Integers
from orbiflow.errors import GroupError
from orbiflow.solids.cell_shapes import CellShape, cubes, tetrahedra, triangular_prisms
from orbiflow.symmetry import CrystallographicGroup, Isometry

FINEST_TRANSLATION = 48
"""Translations are taken for multiples of this fraction of the conventional cell's axes."""

REACH = 6
"""Steps along each basis vector among which short lattice vectors are looked for."""


def conventional_group(group: CrystallographicGroup) -> CrystallographicGroup:
    """Return the same group on a lattice along its axes of rotation, right-handed.

    The lattice may be coarser than that of all translations; those between are cosets then. With
    three-fold axes along one direction, the axes are hexagonal; otherwise all elements permute the
    axes, up to signs.

    Raises `GroupError` if the group is not one of space.
    """
    if group.dim != 3:
        raise GroupError(f"solids need a group of space, got dimension {group.dim}")
    primitive = group.primitive()
    steps = _conventional_steps(primitive)
    lattice = primitive.lattice @ steps
    if np.linalg.det(lattice) < 0:
        lattice = lattice * (1, 1, -1)
    between = _points_between(np.linalg.solve(lattice, primitive.lattice))
    cosets: list[Isometry] = []
    for shift, coset in itertools.product(between, primitive.cosets):
        fractional = np.linalg.solve(lattice, coset.translation) + shift
        fractional = fractional - np.floor(fractional + 1e-9)
        cosets.append(Isometry(coset.linear, lattice @ fractional))
    return CrystallographicGroup(lattice, tuple(cosets), group.name)


@dataclass(frozen=True, eq=False)
class Complex:
    """A partition of space into small cells that a group maps to one another; none to itself.

    A cell is four integers: its block of the grid and its kind in there. Points of the finer grid,
    `shape.denominator` times finer than the blocks, are three integers.

    - `group`: The group, on its conventional lattice.
    - `counts`: The number of blocks along each axis of the cell of the lattice.
    - `shape`: How each block is cut into cells.
    """

    group: CrystallographicGroup
    counts: Integers
    shape: CellShape

    @property
    def cells_per_tile(self) -> int:
        """The number of orbits of cells."""
        return int(np.prod(self.counts)) * self.shape.kinds // self.group.order

    @property
    def steps(self) -> Array:
        """The edges of a block, as columns (3, 3)."""
        return self.group.lattice / self.counts

    @property
    def spacing(self) -> float:
        """The edge of a cube that is as large as a cell."""
        return float(np.linalg.det(self.steps) / self.shape.kinds) ** (1 / 3)

    @property
    def grid(self) -> Integers:
        """The numbers (3,) of points of the finer grid along the cell of the lattice."""
        return self.shape.denominator * self.counts

    def places(self, points: ArrayLike) -> Array:
        """Return where points (n, 3) of the finer grid are in space."""
        return np.asarray(points, float) @ (self.group.lattice / self.grid).T

    def centers(self, cells: Integers) -> Array:
        """Return the centres (n, 3) in space of cells (n, 4)."""
        return self.places(self.fine_centers(cells))

    def fine_centers(self, cells: Integers) -> Integers:
        """Return the centres (n, 3) of cells (n, 4) on the finer grid."""
        return self.shape.denominator * cells[:, :3] + self.shape.centers[cells[:, 3]]

    @cached_property
    def actions(self) -> tuple[Integers, Integers]:
        """What the cosets do to the finer grid: matrices (|G|, 3, 3) and shifts (|G|, 3)."""
        ratio = self.grid[:, None] / self.grid
        shifts = self.group.translations @ self.group.inverse_lattice.T * self.grid
        return (
            np.round(self.group.integral_parts * ratio).astype(np.int64),
            np.round(shifts).astype(np.int64),
        )

    @cached_property
    def orbits(self) -> Array:
        """The number of the orbit of each cell of the lattice's cell, (*counts, kinds) int32.

        Raises `GroupError` if an element maps a cell to itself.
        """
        shape = (*self.counts.tolist(), self.shape.kinds)
        index = np.arange(np.prod(shape), dtype=np.int32).reshape(shape)
        first = index.copy()
        for coset in range(1, self.group.order):
            for kind in range(self.shape.kinds):
                image = self._image_numbers(coset, kind)
                if np.any(image == index[..., kind]):
                    raise GroupError(_fixed_cell_message(self.group))
                np.minimum(first[..., kind], image, out=first[..., kind])
        numbers = np.cumsum((first == index).ravel(), dtype=np.int32) - 1
        return numbers[first.ravel()].reshape(shape)

    def orbit_of(self, cells: Integers) -> Integers:
        """Return the numbers (n,) of the orbits of cells (n, 4)."""
        x, y, z = np.mod(cells[:, :3], self.counts).T
        return self.orbits[x, y, z, cells[:, 3]].astype(np.int64)

    def elements_between(self, sources: Integers, targets: Integers) -> tuple[Integers, Integers]:
        """Return the elements that take cells (n, 4) to others (n, 4) of their orbits.

        Returns the numbers (n,) of their cosets and their shifts (n, 3) along the lattice: an element
        takes x to R x + t + B shift.
        """
        start, end = self.fine_centers(sources), self.fine_centers(targets)
        cosets, shifts = np.full(len(start), -1), np.zeros((len(start), 3), np.int64)
        for coset, (matrix, shift) in enumerate(zip(*self.actions, strict=True)):
            rest = end - start @ matrix.T - shift
            carried = ~np.any(rest % self.grid, axis=1)
            cosets[carried], shifts[carried] = coset, rest[carried] // self.grid
        if np.any(cosets < 0):
            raise GroupError("two cells are not of one orbit")
        return cosets, shifts

    def images(self, points: Integers, cosets: Integers, shifts: Integers) -> Integers:
        """Return points (n, 3) of the finer grid, each moved by its own element."""
        matrices, translations = self.actions
        return (
            np.einsum("nij,nj->ni", matrices[cosets], points)
            + translations[cosets]
            + shifts * self.grid
        )

    def preimages(self, points: Integers, cosets: Integers, shifts: Integers) -> Integers:
        """Return points (n, 3) of the finer grid, each moved by the inverse of its own element."""
        matrices, translations = self.actions
        inverse = np.round(np.linalg.inv(matrices)).astype(np.int64)
        rest = points - translations[cosets] - shifts * self.grid
        return np.einsum("nij,nj->ni", inverse[cosets], rest)

    def _image_numbers(self, coset: int, kind: int) -> Array:
        """Return where a coset takes the cells of one kind, as numbers in the lattice's cell."""
        matrices, shifts = self.actions
        matrix, d = matrices[coset], self.shape.denominator
        center = matrix @ self.shape.centers[kind] + shifts[coset]
        image = np.flatnonzero((self.shape.centers == center % d).all(axis=1))
        if len(image) != 1:
            raise GroupError(f"{self.shape.name} are not mapped to one another by {self.group!r}")
        axes = np.ogrid[tuple(slice(n) for n in self.counts)]
        numbers = np.zeros((1, 1, 1), np.int32)
        for axis, count in enumerate(self.counts):
            # the sum over one or two axes only is a small array, whence a fast remainder
            moved = sum(int(m) * a for m, a in zip(matrix[axis], axes, strict=True) if m)
            place = np.mod(moved + center[axis] // d, count).astype(np.int32)
            numbers = numbers * np.int32(count) + place
        return numbers * np.int32(self.shape.kinds) + np.int32(image[0])


def cell_complex(group: CrystallographicGroup, cubes_per_tile: int) -> Complex:
    """Return a partition into cells that is about as fine as so many cubes to a tile of the group.

    Prisms and tetrahedra are more, so that their surfaces are as fine.

    Raises:
        GroupError: For a group with mirrors, of another dimension, or whose translations are not
            simple fractions of its cell.
    """
    conventional = conventional_group(group)
    if _has_mirror(conventional):
        raise GroupError(
            f"{group.name or group!r} has mirrors: a solid would be cut flat along them; choose a "
            "group without mirrors"
        )
    shape = _shape_for(conventional)
    for factor in (1, 2, 3, 6):
        # more even counts keep axes and centres of symmetry off the centres of the cells
        cells = Complex(conventional, _counts(conventional, shape, cubes_per_tile, factor), shape)
        if not _fixes_a_cell(cells):
            return cells
    raise GroupError(_fixed_cell_message(group))


def _fixed_cell_message(group: CrystallographicGroup) -> str:
    return f"an element of {group.name or group!r} maps a cell of every grid to itself"


def _fixes_a_cell(grid: Complex) -> bool:
    try:
        return grid.orbits.size == 0
    except GroupError:
        return True


def _shape_for(group: CrystallographicGroup) -> CellShape:
    threefold = len(_axes(group, 3))
    return tetrahedra() if threefold > 1 else triangular_prisms() if threefold else cubes()


def _counts(
    group: CrystallographicGroup, shape: CellShape, cubes_per_tile: int, factor: int
) -> Integers:
    """Return numbers of blocks along the axes: multiples of what the translations need."""
    fractions = group.translations @ group.inverse_lattice.T * FINEST_TRANSLATION
    parts = np.round(fractions).astype(np.int64)
    if np.abs(fractions - parts).max() > 1e-6:
        raise GroupError(
            f"the translations of {group.name or group!r} are not simple fractions of its cell: "
            "move the origin to a centre or an axis of the group"
        )
    divisors = FINEST_TRANSLATION // np.gcd.reduce(parts, axis=0, initial=FINEST_TRANSLATION)
    linked = (np.abs(group.integral_parts).sum(axis=0) > 0) | np.eye(3, dtype=bool)
    bases = np.array([factor * np.lcm.reduce(divisors[row]) for row in linked])
    lengths = np.array([np.linalg.norm(group.lattice, axis=0)[row].mean() for row in linked])
    wanted = cubes_per_tile * shape.cells_for_a_cube * group.order / shape.kinds
    scale = (wanted / np.prod(lengths)) ** (1 / 3)
    counts = bases
    for _ in range(4):  # rounding changes the number of cells; the next scale makes up for it
        counts = bases * np.maximum(np.round(lengths * scale / bases), 1).astype(np.int64)
        scale *= (wanted / np.prod(counts)) ** (1 / 6)
    return np.maximum(counts, bases * -(-4 // bases))


def _has_mirror(group: CrystallographicGroup) -> bool:
    steps = np.array(list(itertools.product(range(-2, 3), repeat=3)))
    shifts = group.translations @ group.inverse_lattice.T
    for matrix, shift in zip(group.integral_parts, shifts, strict=True):
        square = np.array_equal(matrix @ matrix, np.eye(3))
        if square and np.trace(matrix) == 1:
            # a glide moves a point by half of this; a mirror not at all
            glides = (steps + shift) @ (matrix + np.eye(3)).T
            if np.abs(glides).max(axis=1).min() < 1e-6:
                return True
    return False


def _axes(group: CrystallographicGroup, order: int) -> list[Integers]:
    """Return the directions of rotation of this order, up to sign, in coordinates of the lattice."""
    axes: dict[tuple[int, ...], Integers] = {}
    for matrix in group.integral_parts:
        proper = matrix * round(np.linalg.det(matrix))
        powers = [np.linalg.matrix_power(proper, k) for k in range(12)]
        period = next(k for k in range(1, 12) if np.array_equal(powers[k], powers[0]))
        if period % order or period == 1:
            continue
        projection = np.sum(powers[:period], axis=0)
        column = projection[:, np.abs(projection).sum(axis=0).argmax()]
        axis = column // np.gcd.reduce(column)
        axis = axis * np.sign(axis[np.flatnonzero(axis)[0]])
        axes.setdefault(tuple(axis.tolist()), axis)
    return list(axes.values())


def _turn_about(group: CrystallographicGroup, axis: Integers, order: int) -> Integers:
    """Return the matrix of a rotation of this order about an axis, in coordinates of the lattice."""
    for matrix in group.integral_parts:
        proper = matrix * round(np.linalg.det(matrix))
        turn = 1 + 2 * np.cos(2 * np.pi / order)
        if np.array_equal(proper @ axis, axis) and abs(np.trace(proper) - turn) < 1e-6:
            return proper
    raise GroupError(f"no rotation of order {order} about {axis.tolist()} in {group!r}")


def _conventional_steps(group: CrystallographicGroup) -> Integers:
    """Return the conventional basis, in coordinates of the primitive one, as columns."""
    threefold, fourfold, twofold = (_axes(group, order) for order in (3, 4, 2))
    if not threefold and not twofold:
        return np.eye(3, dtype=np.int64)
    if len(threefold) > 1:
        axes = fourfold or twofold
        return np.stack(axes, axis=1)
    if threefold or len(fourfold) == 1:
        axis, order = (threefold[0], 3) if threefold else (fourfold[0], 4)
        side = _short_vectors_across(group, axis)[0]
        return np.stack([side, _turn_about(group, axis, order) @ side, axis], axis=1)
    if len(twofold) == 3:
        return np.stack(twofold, axis=1)
    first, second = _short_vectors_across(group, twofold[0])
    return np.stack([first, twofold[0], second], axis=1)


def _short_vectors_across(
    group: CrystallographicGroup, axis: Integers
) -> tuple[Integers, Integers]:
    """Return the two shortest lattice vectors at right angles to an axis, not along one line."""
    steps = np.array(list(itertools.product(range(-REACH, REACH + 1), repeat=3)))
    vectors = steps @ group.lattice.T
    direction = group.lattice @ axis / np.linalg.norm(group.lattice @ axis)
    lengths = np.linalg.norm(vectors, axis=1)
    across = (lengths > 0) & (np.abs(vectors @ direction) < 1e-6 * (lengths + 1e-300))
    steps = steps[across][np.argsort(lengths[across].round(9), kind="stable")]
    second = next(row for row in steps if np.cross(steps[0], row).any())
    return steps[0], second


def _points_between(coarser: Array) -> Sequence[Array]:
    """Return the points of a lattice in a cell of a coarser one, whose coordinates its basis has.

    The origin is the first.
    """
    index = round(1 / abs(np.linalg.det(coarser)))
    steps = np.array(list(itertools.product(range(index), repeat=3)))
    parts = np.round(steps @ coarser.T * index).astype(np.int64) % index
    _, first = np.unique(parts, axis=0, return_index=True)
    return [parts[k] / index for k in np.sort(first)]
