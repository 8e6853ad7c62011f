"""Divergence of any field: in closed form where the field has one, else by autograd."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from orbiflow.fields.symmetrize import VectorField


def jacobian(field: VectorField, points: Tensor) -> Tensor:
    """dV_i / dp_j at points (..., d), as (..., d, d): exact, d backward passes."""
    closed = getattr(field, "jacobian", None)
    if closed is not None:
        return closed(points)
    return _by_autograd(field, points)[1]


def divergence(field: VectorField, points: Tensor) -> Tensor:
    """Trace of the Jacobian at points (..., d), as (...,): exact."""
    closed = getattr(field, "divergence", None)
    if closed is not None:
        return closed(points)
    return _trace(jacobian(field, points))


def with_divergence(field: VectorField) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
    """A callable giving V and its divergence together, sharing work where the field can."""
    joint = getattr(field, "bound_with_divergence", None)
    if joint is not None:
        return joint()
    if hasattr(field, "divergence") or hasattr(field, "jacobian"):
        return lambda points: (field(points), divergence(field, points))

    def both(points: Tensor) -> tuple[Tensor, Tensor]:
        values, slopes = _by_autograd(field, points)
        return values, _trace(slopes)

    return both


def _trace(slopes: Tensor) -> Tensor:
    return slopes.diagonal(dim1=-2, dim2=-1).sum(dim=-1)


def _by_autograd(field: VectorField, points: Tensor) -> tuple[Tensor, Tensor]:
    """V and its Jacobian, differentiable if V is: in the points or in anything the field holds."""
    keep = torch.is_grad_enabled() and _is_differentiable(field, points)
    # inference mode would forbid derivatives even here
    with torch.inference_mode(False), torch.enable_grad():
        inputs = points.clone() if points.is_inference() else points
        inputs = inputs if inputs.requires_grad else inputs.detach().requires_grad_()
        values = field(inputs)
        if not values.requires_grad:  # a constant field
            return values, points.new_zeros(*points.shape, points.shape[-1])
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
    return values if keep else values.detach(), torch.stack(rows, dim=-2)


def _is_differentiable(field: VectorField, points: Tensor) -> bool:
    if points.requires_grad:
        return True
    if isinstance(field, nn.Module) and any(p.requires_grad for p in field.parameters()):
        return True
    # a plain function may hold parameters that only its values betray
    return field(points).requires_grad
