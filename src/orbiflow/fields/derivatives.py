"""Values, divergence and Jacobian of any field: in closed form where it has one, else by autograd.

The one place that looks at what a field offers; see `orbiflow.fields.protocol`.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from orbiflow.fields.protocol import (
    Bindable,
    BindableWithDivergence,
    HasDivergence,
    HasDivergenceInTime,
    HasJacobian,
    HasLipschitzBound,
    VectorField,
    is_time_dependent,
)
from orbiflow.fields.transforms import transformed


def jacobian(field: VectorField, points: Tensor) -> Tensor:
    """dV_i / dp_j at points (..., d), as (..., d, d): exact, d backward passes."""
    if isinstance(field, HasJacobian):
        return field.jacobian(points)
    return _by_autograd(field, points, field)[1]


def divergence(field: VectorField, points: Tensor) -> Tensor:
    """Trace of the Jacobian at points (..., d), as (...,): exact."""
    if isinstance(field, HasDivergence):
        return field.divergence(points)
    return _trace(jacobian(field, points))


def prepared(field: Callable[..., Tensor]) -> Callable[..., Tensor]:
    """The field for many evaluations at unchanged parameters; takes what the field takes."""
    return field.bound() if isinstance(field, Bindable) else field


def prepared_with_divergence(
    field: Callable[..., Tensor],
) -> Callable[..., tuple[Tensor, Tensor]]:
    """As `prepared`, giving V and its divergence together, sharing work where the field can."""
    if is_time_dependent(field):
        if isinstance(field, HasDivergenceInTime):
            return field.with_divergence

        def in_time(points: Tensor, time: Tensor) -> tuple[Tensor, Tensor]:
            return _with_trace(lambda p: field(p, time), points, field)

        return in_time
    if isinstance(field, BindableWithDivergence):
        return field.bound_with_divergence()
    in_closed_form = isinstance(field, HasDivergence | HasJacobian)

    def both(points: Tensor) -> tuple[Tensor, Tensor]:
        if in_closed_form:
            return field(points), divergence(field, points)
        return _with_trace(field, points, field)

    return both


def lipschitz_bound(field: object) -> float | None:
    """The field's own bound of its Jacobian's spectral norm, None if it knows none."""
    if isinstance(field, HasLipschitzBound):
        return float(field.lipschitz_bound().max())
    return None


def _trace(slopes: Tensor) -> Tensor:
    return slopes.diagonal(dim1=-2, dim2=-1).sum(dim=-1)


def _with_trace(function: VectorField, points: Tensor, owner: object) -> tuple[Tensor, Tensor]:
    values, slopes = _by_autograd(function, points, owner)
    return values, _trace(slopes)


def _by_autograd(function: VectorField, points: Tensor, owner: object) -> tuple[Tensor, Tensor]:
    """V and its Jacobian, differentiable if V is: in the points or in anything the field holds."""
    if transformed():
        return _functionally(function, points)
    keep = torch.is_grad_enabled() and _is_differentiable(function, points, owner)
    # inference mode would forbid derivatives even here
    with torch.inference_mode(False), torch.enable_grad():
        inputs = points.clone() if points.is_inference() else points
        inputs = inputs if inputs.requires_grad else inputs.detach().requires_grad_()
        values = function(inputs)
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


def _functionally(function: VectorField, points: Tensor) -> tuple[Tensor, Tensor]:
    """The same under `torch.func`, where no tensor may be told to require a gradient."""
    values, pull, *_ = torch.func.vjp(function, points)
    units = torch.eye(points.shape[-1], dtype=points.dtype, device=points.device)
    rows = [pull(unit.expand(points.shape))[0] for unit in units]
    return values, torch.stack(rows, dim=-2)


def _is_differentiable(function: VectorField, points: Tensor, owner: object) -> bool:
    if points.requires_grad:
        return True
    if isinstance(owner, nn.Module) and any(p.requires_grad for p in owner.parameters()):
        return True
    # a plain function may hold parameters that only its values betray
    return function(points).requires_grad
