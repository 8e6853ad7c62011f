"""Bases of lattices."""

from __future__ import annotations

import numpy as np

from orbiflow.symmetry.isometry import Array


def reduced_basis(lattice: Array) -> Array:
    """Shortest basis (columns) of a plane lattice, with an angle of 60 to 120 degrees.

    Lagrange's and Gauss's reduction.

    >>> reduced_basis(np.array([[1.0, 7.0], [0.0, 1.0]])).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    first, second = lattice.T
    while True:
        if first @ first > second @ second:
            first, second = second, first
        steps = round(float(first @ second) / float(first @ first) * (1 - 1e-12))
        if steps == 0:
            return np.stack([first, second], axis=1)
        second = second - steps * first
