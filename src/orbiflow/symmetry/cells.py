"""Cells: the lengths and angles of a lattice's basis, and the cells that operators fit."""

import itertools

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import as_array, refusal
from orbiflow.arrays import Array
from orbiflow.errors import GroupError
from orbiflow.symmetry.group import checked_lattice


def cell_lattice(cell: ArrayLike) -> Array:
    """Return the lattice (3, 3) of a cell, basis vectors as columns: a along x, b in the xy-plane.

    `cell` is a, b, c and alpha, beta, gamma in degrees; or the lengths alone, if the angles are right;
    or a lattice, which is returned. Raises `GroupError` for a cell without volume.

    >>> cell_lattice((2, 2, 3, 90, 90, 120)).round(3).tolist()
    [[2.0, -1.0, 0.0], [0.0, 1.732, 0.0], [0.0, 0.0, 3.0]]
    """
    shape = np.shape(cell)
    if shape == (3, 3):
        return checked_lattice(as_array(cell, "cell", (3, 3)))
    if shape not in ((3,), (6,)):
        wanted = (
            "a,b,c or a,b,c,alpha,beta,gamma (lengths, and angles in degrees), or a (3, 3) lattice"
        )
        raise refusal("cell", wanted, cell)
    lengths, angles = (*as_array(cell, "cell", shape).reshape(-1, 3), np.full(3, 90.0))[:2]
    if lengths.min() <= 0:
        raise refusal("cell", "of lengths above 0", lengths.min())
    if abs(angles - 90).max() > 90:
        raise GroupError(
            f"no cell has the angles {angles.tolist()}: they lie from 0 to 180 degrees"
        )
    cosines = np.cos(np.radians(angles))
    exact = np.where(np.isin(angles, (60, 90, 120)), np.round(2 * cosines) / 2, cosines)
    unit = np.eye(3)
    unit[[1, 0, 0], [2, 2, 1]] = unit[[2, 2, 1], [1, 0, 0]] = exact
    try:
        return checked_lattice(np.linalg.cholesky(unit).T * lengths)
    except np.linalg.LinAlgError as error:
        raise GroupError(f"no cell has the angles {angles.tolist()}: it would be flat") from error


def cell_parameters(lattice: Array) -> tuple[float, ...]:
    """Return the lengths of basis vectors, a, b, c, and the angles alpha, beta, gamma in degrees.

    Of a plane lattice they are a, b and gamma.
    """
    lengths = np.linalg.norm(lattice, axis=0)
    cosines = lattice.T @ lattice / np.outer(lengths, lengths)
    pairs = reversed(list(itertools.combinations(range(len(lengths)), 2)))
    return (*lengths.tolist(), *(float(np.degrees(np.arccos(cosines[p]))) for p in pairs))


def fitting_cell(linear: Array, lattice: Array) -> tuple[float, ...] | None:
    """Return the parameters of the cell nearest to `lattice` that operators map to itself.

    Its metric is the mean over the group of their matrices (n, d, d); None if that is not finite.
    """
    before, metric = 0.0, lattice.T @ lattice
    for _ in range(64):  # generators are enough: repeated, their mean comes to that over the group
        before = metric
        metric = (metric + (linear.swapaxes(1, 2) @ metric @ linear).mean(axis=0)) / 2
    if not np.allclose(before, metric, rtol=1e-9, atol=1e-9 * np.trace(metric)):
        return None
    return cell_parameters(np.linalg.cholesky(metric).T)
