"""Linear maps that commute with a point group, modulo similarity (design point 7).

A periodic flow cannot change its lattice; these maps do, and keep the group a group of isometries.
"""

from __future__ import annotations

import torch

from orbiflow.tilings.class_table import LatticeFreedom

STRETCH_DIM: dict[LatticeFreedom, int] = {"general": 2, "rectangular": 1, "none": 0}
"""Number of parameters of each family."""


def stretch_matrix(freedom: LatticeFreedom, parameters: torch.Tensor) -> torch.Tensor:
    """Unimodular symmetric maps (..., 2, 2) for parameters (..., n), n = `STRETCH_DIM[freedom]`.

    general (p1, p2): exp [[a, b], [b, -a]]. rectangular (pg, pgg): diag(e^a, e^-a), in the frame of
    the glide axes. none (p3, p4, p6): the identity. Differentiable, at zero too.
    """
    batch = parameters.shape[:-1]
    if freedom == "none":
        eye = torch.eye(2, dtype=parameters.dtype, device=parameters.device)
        return eye.expand(*batch, 2, 2)
    a = parameters[..., 0]
    b = parameters[..., 1] if freedom == "general" else torch.zeros_like(a)
    cosh, sinhc = _cosh_sinhc(a * a + b * b)
    rows = [cosh + sinhc * a, sinhc * b, sinhc * b, cosh - sinhc * a]
    return torch.stack(rows, dim=-1).reshape(*batch, 2, 2)


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
