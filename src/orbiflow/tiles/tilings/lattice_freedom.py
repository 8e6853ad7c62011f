"""The lattice freedom of a group: linear maps that commute with its point group (design point 7)."""

import math
from typing import Any

import numpy as np

from orbiflow.arguments import is_tensor
from orbiflow.arrays import Array
from orbiflow.symmetry import Points, cast_like

_ROUNDING_ERROR = 1e-9


def commutant(linear_parts: Array) -> Array:
    """Return an orthonormal basis (m, 2) of the (a, b) whose [[a, b], [b, -a]] commutes with a group.

    The mean over the group projects on them: R X R^T turns (a, b) as R turns directions, twice as
    far. The basis is made by Gram-Schmidt in the order a, b, so that it depends only on the group;
    saved parameters are coordinates in it.

    >>> commutant(np.array([np.eye(2), np.diag([1.0, -1.0])])).tolist()
    [[1.0, 0.0]]
    """
    units = np.array([[[1.0, 0.0], [0.0, -1.0]], [[0.0, 1.0], [1.0, 0.0]]])
    turned = np.einsum("gij,kjl,gml->kim", linear_parts, units, linear_parts) / len(linear_parts)
    basis: list[Array] = []
    for a, b in turned[:, 0]:
        rest = np.array([a, b])
        for known in basis:
            rest = rest - (rest @ known) * known
        if np.linalg.norm(rest) > _ROUNDING_ERROR:
            rest = rest / np.linalg.norm(rest)
            # exact for a group in the frame of its axes
            near = np.round(rest)
            basis.append(near if np.abs(rest - near).max() < _ROUNDING_ERROR else rest)
    return np.array(basis).reshape(-1, 2)


def stretch_matrix(basis: Array, parameters: Points) -> Points:
    """Return unimodular symmetric maps (..., 2, 2) for parameters (..., m) over a basis of `commutant`.

    exp [[a, b], [b, -a]], where (a, b) = parameters @ basis. Differentiable, at zero too.
    """
    both = parameters @ cast_like(basis, parameters)
    a, b = both[..., 0], both[..., 1]
    cosh, sinhc = _cosh_sinhc(a * a + b * b)
    rows = [cosh + sinhc * a, sinhc * b, sinhc * b, cosh - sinhc * a]
    return array_functions(parameters).stack(rows, -1).reshape(*parameters.shape[:-1], 2, 2)


def array_functions(values: Any) -> Any:
    """Return the library that these values belong to, of which functions of both are used."""
    if not is_tensor(values):
        return np
    import torch

    return torch


# of NumPy arrays, rounded as torch rounds them
_cosh, _sinh = (np.vectorize(f, otypes=[float]) for f in (math.cosh, math.sinh))


def _cosh_sinhc(square: Any) -> tuple[Any, Any]:
    """Return cosh r and sinh(r) / r as functions of r^2, by their series where the root would hurt."""
    own = array_functions(square)
    hyperbolic_cosh, hyperbolic_sinh = (own.cosh, own.sinh) if is_tensor(square) else (_cosh, _sinh)
    small = square < 1e-2
    root = own.sqrt(own.where(small, own.ones_like(square), square))
    s = own.where(small, square, own.zeros_like(square))
    cosh = 1 + s / 2 * (1 + s / 12 * (1 + s / 30 * (1 + s / 56 * (1 + s / 90))))
    sinhc = 1 + s / 6 * (1 + s / 20 * (1 + s / 42 * (1 + s / 72 * (1 + s / 110))))
    return (
        own.where(small, cosh, hyperbolic_cosh(root)),
        own.where(small, sinhc, hyperbolic_sinh(root) / root),
    )
