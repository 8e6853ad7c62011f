"""Linear maps that commute with a point group, modulo similarity (design point 7).

A periodic flow cannot change its lattice; these maps do, and keep the group a group of isometries. Each
is a similarity times the exponential of a symmetric matrix of trace zero that commutes with the point
group; such matrices [[a, b], [b, -a]] form a space of dimension 2 (p1, p2), 1 (groups with mirrors or
glides, but no rotation of order 3 or more) or 0 (all others).
"""

from __future__ import annotations

import numpy as np
import torch

from orbiflow.symmetry.isometry import Array

_ROUNDING = 1e-9


def commutant(linear_parts: Array) -> Array:
    """Orthonormal basis (m, 2) of the (a, b) whose [[a, b], [b, -a]] commutes with a point group.

    The mean over the group projects on them: R X R^T turns (a, b) as R turns directions, twice as far.
    The basis is made by Gram-Schmidt in the order a, b, so that it depends on nothing but the group;
    saved parameters are coordinates in it.

    Args:
        linear_parts: (n, 2, 2), of every coset.

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
        if np.linalg.norm(rest) > _ROUNDING:
            rest = rest / np.linalg.norm(rest)
            # a group in the frame of its axes has just these: not a rounding beside them
            near = np.round(rest)
            basis.append(near if np.abs(rest - near).max() < _ROUNDING else rest)
    return np.array(basis).reshape(-1, 2)


def stretch_matrix(basis: Array, parameters: torch.Tensor) -> torch.Tensor:
    """Unimodular symmetric maps (..., 2, 2) for parameters (..., m) over a basis of `commutant`.

    exp [[a, b], [b, -a]], where (a, b) = parameters @ basis. Differentiable, at zero too.
    """
    a, b = (parameters @ parameters.new_tensor(basis)).unbind(dim=-1)
    cosh, sinhc = _cosh_sinhc(a * a + b * b)
    rows = [cosh + sinhc * a, sinhc * b, sinhc * b, cosh - sinhc * a]
    return torch.stack(rows, dim=-1).reshape(*parameters.shape[:-1], 2, 2)


def _cosh_sinhc(square: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """cosh r and sinh(r) / r as functions of r^2, by their series where the root would hurt."""
    small = square < 1e-2
    root = torch.sqrt(torch.where(small, torch.ones_like(square), square))
    s = torch.where(small, square, torch.zeros_like(square))
    cosh = 1 + s / 2 * (1 + s / 12 * (1 + s / 30 * (1 + s / 56 * (1 + s / 90))))
    sinhc = 1 + s / 6 * (1 + s / 20 * (1 + s / 42 * (1 + s / 72 * (1 + s / 110))))
    return (
        torch.where(small, cosh, torch.cosh(root)),
        torch.where(small, sinhc, torch.sinh(root) / root),
    )
