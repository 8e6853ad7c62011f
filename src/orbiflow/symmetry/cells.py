"""Cells: lengths and angles of a lattice's basis, and the cells that operators fit."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import as_array, refusal
from orbiflow.arrays import Array
from orbiflow.errors import LatticeMismatchError
from orbiflow.symmetry.group import checked_lattice

TYPICAL = (1.0, 1.1, 1.3, 80.0, 100.0, 95.0)
"""A cell without symmetry, from which the default cells of all groups are made."""


def cell_lattice(cell: ArrayLike) -> Array:
    """Return the lattice (3, 3) of a cell: a along x, b in the plane of x and y.

    Args:
        cell: The lengths a, b, c and the angles alpha, beta, gamma in degrees; or the lengths alone, if
            the angles are right; or a lattice (3, 3), basis vectors as columns, which is returned.

    Raises `GroupError` for a cell without volume, `SettingError` for anything else.

    >>> cell_lattice((2, 2, 3, 90, 90, 120)).round(3).tolist()
    [[2.0, -1.0, 0.0], [0.0, 1.732, 0.0], [0.0, 0.0, 3.0]]
    """
    shape = np.shape(cell)
    if shape == (3, 3):
        return checked_lattice(as_array(cell, "cell", (3, 3)))
    if shape not in ((3,), (6,)):
        raise refusal("cell", "a, b, c, alpha, beta, gamma in degrees, or a (3, 3) lattice", cell)
    a, b, c, *angles = as_array(cell, "cell", shape)
    if min(a, b, c) <= 0:
        raise refusal("cell", "three lengths above 0, and angles", f"{a:g}, {b:g}, {c:g}")
    alpha, beta, gamma = (_cosine(angle) for angle in angles or (90.0, 90.0, 90.0))
    sine = np.sqrt(1 - gamma**2) if abs(gamma) < 1 else 0.0
    along = (alpha - beta * gamma) / sine if sine else 0.0
    height = np.sqrt(max(0.0, 1 - beta**2 - along**2))
    columns = (a, 0, 0), (b * gamma, b * sine, 0), (c * beta, c * along, c * height)
    return checked_lattice(np.array(columns).T)


def _cosine(degrees: float) -> float:
    """Return the cosine, exact for the angles that crystal systems have."""
    exact = {60.0: 0.5, 90.0: 0.0, 120.0: -0.5}
    return exact.get(float(degrees), float(np.cos(np.radians(degrees))))


def cell_parameters(lattice: Array) -> tuple[float, ...]:
    """Return the lengths of a basis and, in degrees, the angles between its vectors.

    In three dimensions they are a, b, c, alpha, beta, gamma; in two a, b, gamma.
    """
    lengths = np.linalg.norm(lattice, axis=0)
    unit = lattice / lengths
    pairs = {2: [(0, 1)], 3: [(1, 2), (0, 2), (0, 1)]}.get(len(lengths), [])
    angles = [np.degrees(np.arccos(np.clip(unit[:, i] @ unit[:, j], -1, 1))) for i, j in pairs]
    return (*lengths.tolist(), *map(float, angles))


def fitting_cell(linear: Array, lattice: Array) -> tuple[float, ...] | None:
    """Return the parameters of the cell nearest to `lattice` that operators map to itself.

    Its metric is the mean over the group of the matrices (n, d, d). None if they are no finite group.

    >>> quarter = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    >>> cell = fitting_cell(np.array([np.eye(3), quarter]), cell_lattice((1, 7, 3)))
    >>> np.round(cell, 6).tolist()
    [5.0, 5.0, 3.0, 90.0, 90.0, 90.0]
    """
    metric = lattice.T @ lattice
    for _ in range(64):  # generators are enough: repeated, their mean comes to that over the group
        images = linear.swapaxes(1, 2) @ metric @ linear
        metric = (metric + images.mean(axis=0)) / 2
    if not np.allclose(images, metric, rtol=1e-6, atol=1e-6 * np.trace(metric)):
        return None
    return cell_parameters(np.linalg.cholesky(metric).T)


def default_cell(linear: Array) -> tuple[float, ...]:
    """Return a cell of round numbers, with a = 1, that matrices (n, 3, 3) of operators fit."""
    cell = fitting_cell(linear, cell_lattice(TYPICAL))
    if cell is None:
        raise LatticeMismatchError("the operators do not make a finite group, modulo a lattice")
    return (*(round(length / cell[0], 2) for length in cell[:3]), *(round(x) for x in cell[3:]))


def check_cell(lattice: Array, linear: Array, texts: Sequence[str]) -> None:
    """Raise `LatticeMismatchError`, with the cure, unless operators fit the cell."""
    metric = lattice.T @ lattice
    off = np.abs(linear.swapaxes(1, 2) @ metric @ linear - metric).max(axis=(1, 2))
    wrong = np.flatnonzero(~(off <= 1e-10 * np.trace(metric)))
    if not len(wrong):
        return
    nearest = fitting_cell(linear, lattice)
    cure = "no cell fits all of the operators"
    if nearest is not None:
        cure = f"the nearest cell that fits has {_in_words(nearest)}"
    raise LatticeMismatchError(
        f"the operator {texts[wrong[0]]!r} does not map the lattice of a cell with "
        f"{_in_words(cell_parameters(lattice))} to itself; {cure}"
    )


def _in_words(cell: Sequence[float]) -> str:
    """Return "a = 1, b = 1.2, gamma = 90"."""
    names = {3: ("a", "b", "gamma"), 6: ("a", "b", "c", "alpha", "beta", "gamma")}
    named = zip(names.get(len(cell), ("a",)), cell, strict=False)
    return ", ".join(f"{name} = {value:.8g}" for name, value in named)
