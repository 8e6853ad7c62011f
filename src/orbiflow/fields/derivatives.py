"""Divergence of any field: in closed form where the field has one, else by autograd."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from orbiflow.fields.symmetrize import VectorField


def jacobian(field: VectorField, points: Tensor) -> Tensor:
    """dV_i / dp_j at points (..., d), as (..., d, d): exact, d backward passes."""
    closed = getattr(field, "jacobian", None)
    if closed is not None:
        return closed(points)
    # the result is differentiable if the values are: in the points or in anything the field holds
    keep = torch.is_grad_enabled() and (points.requires_grad or field(points).requires_grad)
    with torch.enable_grad():
        inputs = points if points.requires_grad else points.detach().requires_grad_()
        values = field(inputs)
        if not values.requires_grad:  # a constant field
            return points.new_zeros(*points.shape, points.shape[-1])
        rows = [
            torch.autograd.grad(
                values[..., i].sum(),
                inputs,
                create_graph=keep,
                retain_graph=True,
                materialize_grads=True,
            )[0]
            for i in range(points.shape[-1])
        ]
    return torch.stack(rows, dim=-2)


def divergence(field: VectorField, points: Tensor) -> Tensor:
    """Trace of the Jacobian at points (..., d), as (...,): exact."""
    closed = getattr(field, "divergence", None)
    if closed is not None:
        return closed(points)
    return jacobian(field, points).diagonal(dim1=-2, dim2=-1).sum(dim=-1)


def with_divergence(field: VectorField) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
    """A callable giving V and its divergence together, sharing work where the field can."""
    joint = getattr(field, "bound_with_divergence", None)
    if joint is not None:
        return joint()
    return lambda points: (field(points), divergence(field, points))
