"""Cells: the lengths and angles of a lattice's basis, and the cells that operators fit."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import as_array, refusal
from orbiflow.arrays import Array
from orbiflow.errors import GroupError, LatticeMismatchError
from orbiflow.symmetry.group import checked_lattice

_WANTED = "a, b, c and alpha, beta, gamma in degrees, three lengths alone, or a (3, 3) lattice"
_TYPICAL = (1.0, 1.1, 1.3, 80.0, 100.0, 95.0)  # without symmetry; all default cells come from it


def cell_lattice(cell: ArrayLike) -> Array:
    """Return the lattice (3, 3) of a cell, basis vectors as columns: a along x, b in the xy-plane.

    `cell` is a, b, c and alpha, beta, gamma in degrees; or the lengths alone, if the angles are right;
    or a lattice, which is returned. Raises `GroupError` for a cell without volume.

    >>> cell_lattice((2, 2, 3, 90, 90, 120)).round(3).tolist()
    [[2.0, -1.0, 0.0], [0.0, 1.732, 0.0], [0.0, 0.0, 3.0]]
    """
    if np.shape(cell) == (3, 3):
        return checked_lattice(as_array(cell, "cell", (3, 3)))
    if np.shape(cell) not in ((3,), (6,)):
        raise refusal("cell", _WANTED, cell)
    lengths, angles = (*as_array(cell, "cell", np.shape(cell)).reshape(-1, 3), np.full(3, 90.0))[:2]
    if lengths.min() <= 0:
        raise refusal("cell", "three lengths above 0, and angles", f"{lengths.tolist()}")
    cosines = np.cos(np.radians(angles))
    exact = np.where(np.isin(angles, (60, 90, 120)), np.round(2 * cosines) / 2, cosines)
    unit = np.eye(3)
    unit[[1, 0, 0], [2, 2, 1]] = unit[[2, 2, 1], [1, 0, 0]] = exact
    try:
        return checked_lattice(np.linalg.cholesky(unit).T * lengths)
    except np.linalg.LinAlgError as error:
        raise GroupError(f"no cell has the angles {angles.tolist()}: it would be flat") from error


def cell_parameters(lattice: Array) -> tuple[float, ...]:
    """Return the lengths of basis vectors and, in degrees, their angles.

    They are a, b, c, alpha, beta, gamma in three dimensions and a, b, gamma in two.
    """
    lengths = np.linalg.norm(lattice, axis=0)
    cosines = lattice.T @ lattice / np.outer(lengths, lengths)
    pairs = reversed(list(itertools.combinations(range(len(lengths)), 2)))
    return (*lengths.tolist(), *(float(np.degrees(np.arccos(cosines[p]))) for p in pairs))


def _fitting(linear: Array, lattice: Array) -> tuple[float, ...] | None:
    """Return the parameters of the cell nearest to `lattice` that operators map to itself.

    Its metric is the mean over the group of their matrices (n, d, d); None if they make no finite one.
    """
    before, metric = 0.0, lattice.T @ lattice
    for _ in range(64):  # generators are enough: repeated, their mean comes to that over the group
        before = metric
        metric = (metric + (linear.swapaxes(1, 2) @ metric @ linear).mean(axis=0)) / 2
    if not np.allclose(before, metric, rtol=1e-9, atol=1e-9 * np.trace(metric)):
        return None
    return cell_parameters(np.linalg.cholesky(metric).T)


def default_lattice(linear: Array) -> Array:
    """Return the lattice of a cell of round numbers, with a = 1, that operators (n, 3, 3) fit."""
    a, b, c, *angles = _fitting(linear, cell_lattice(_TYPICAL)) or _TYPICAL
    return cell_lattice([1.0, round(b / a, 2), round(c / a, 2), *(round(x) for x in angles)])


def check_cell(lattice: Array, linear: Array, texts: Sequence[str]) -> None:
    """Raise `LatticeMismatchError`, with a cell that would do, unless operators (n, d, d) fit."""
    metric = lattice.T @ lattice
    off = np.abs(linear.swapaxes(1, 2) @ metric @ linear - metric).max(axis=(1, 2))
    wrong = np.flatnonzero(~(off <= 1e-10 * np.trace(metric)))
    if not len(wrong):
        return
    nearest = _fitting(linear, lattice)
    cure = f"the nearest that fits has {_in_words(nearest)}" if nearest else "no cell fits them all"
    raise LatticeMismatchError(
        f"the operator {texts[wrong[0]]!r} does not map the lattice of the cell with "
        f"{_in_words(cell_parameters(lattice))} to itself; {cure}"
    )


def _in_words(cell: Sequence[float]) -> str:
    """Return "a = 1, b = 1.2, gamma = 90"."""
    names = {6: ("a", "b", "c", "alpha", "beta", "gamma")}.get(len(cell), ("a", "b", "gamma"))
    return ", ".join(f"{name} = {x:.8g}" for name, x in zip(names, cell, strict=False))
