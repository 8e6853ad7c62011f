"""The protocols of vector fields, and their derivatives.

A field is any callable from points (..., d) to vectors of the same shape: a function, a lambda, a torch
module. Nothing else is required. These protocols find what else it offers; a method of one of these
names must do what is described here.

| the field has | then |
|---|---|
| `jacobian(points)`, `divergence(points)` | closed forms are used in place of autograd |
| `bound()` | what depends only on the parameters is computed once for many evaluations |
| `bound_with_divergence()` | V and its divergence come from shared work |
| `lipschitz_bound()` | the accuracy of integration steps is judged without trying them |
| `time_dependent` true | it is called as V(points, time), see `TimeDependentField` |
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import torch
from torch import Tensor, nn

from orbiflow.fields.transforms import transformed

VectorField = Callable[[Tensor], Tensor]
"""A map from points (..., d) to vectors (..., d)."""


@runtime_checkable
class HasJacobian(Protocol):
    """A field that knows its Jacobian: dV_i / dp_j at points (..., d), as (..., d, d)."""

    def __call__(self, points: Tensor, /) -> Tensor: ...

    def jacobian(self, points: Tensor, /) -> Tensor: ...


@runtime_checkable
class HasDivergence(Protocol):
    """A field that knows the trace of its Jacobian at points (..., d), as (...,)."""

    def __call__(self, points: Tensor, /) -> Tensor: ...

    def divergence(self, points: Tensor, /) -> Tensor: ...


@runtime_checkable
class Bindable(Protocol):
    """A field that prepares itself: the same map, for parameters that stay as they are."""

    def bound(self) -> VectorField: ...


@runtime_checkable
class BindableWithDivergence(Protocol):
    """A field that prepares a function for V (..., d) and its divergence (...,) together."""

    def bound_with_divergence(self) -> Callable[[Tensor], tuple[Tensor, Tensor]]: ...


@runtime_checkable
class HasLipschitzBound(Protocol):
    """A field that knows an upper bound of its Jacobian's spectral norm anywhere: () or (S,)."""

    def lipschitz_bound(self) -> Tensor: ...


@runtime_checkable
class TimeDependentField(Protocol):
    """A field V(x, t): called with points (..., d) and a time, a tensor of shape ().

    It may have `with_divergence(points, time)`, giving V and its divergence in the points (...,).
    Mark a plain function by `time_dependent`.
    """

    time_dependent: bool

    def __call__(self, points: Tensor, time: Tensor, /) -> Tensor: ...


@runtime_checkable
class HasDivergenceInTime(Protocol):
    """A time-dependent field that knows V and its divergence in the points together."""

    def with_divergence(self, points: Tensor, time: Tensor, /) -> tuple[Tensor, Tensor]: ...


class _Marked:
    time_dependent = True

    def __init__(self, function: Callable[[Tensor, Tensor], Tensor]) -> None:
        self._function = function
        self.__name__ = getattr(function, "__name__", "")

    def __call__(self, points: Tensor, time: Tensor, /) -> Tensor:
        return self._function(points, time)


def time_dependent(function: Callable[[Tensor, Tensor], Tensor]) -> TimeDependentField:
    """Mark a plain function V(points, time) as a time-dependent field; also a decorator.

    A torch module has an attribute `time_dependent = True` instead.

    >>> import torch
    >>> from orbiflow.flows import Flow
    >>> turning = time_dependent(lambda p, t: torch.ones_like(p) * 2 * t)
    >>> Flow(turning, steps=4, method="midpoint")(torch.zeros(2)).tolist()
    [1.0, 1.0]
    """
    return _Marked(function)


def is_time_dependent(field: object) -> bool:
    """Return whether `field` is to be called as V(points, time)."""
    return bool(getattr(field, "time_dependent", False))


def jacobian(field: VectorField, points: Tensor) -> Tensor:
    """Return dV_i / dp_j at points (..., d), as (..., d, d): exact, d backward passes."""
    if isinstance(field, HasJacobian):
        return field.jacobian(points)
    return _by_autograd(field, points, field)[1]


def divergence(field: VectorField, points: Tensor) -> Tensor:
    """Return the trace of the Jacobian at points (..., d), as (...,): exact."""
    if isinstance(field, HasDivergence):
        return field.divergence(points)
    return _trace(jacobian(field, points))


def prepared(field: Callable[..., Tensor]) -> Callable[..., Tensor]:
    """Return a function with the field's arguments, for many evaluations at fixed parameters."""
    return field.bound() if isinstance(field, Bindable) else field


def prepared_with_divergence(field: Callable[..., Tensor]) -> Callable[..., tuple[Tensor, Tensor]]:
    """Return, as `prepared` does, a function for V and its divergence, sharing work if possible."""
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
    """Return the field's own bound of its Jacobian's spectral norm, or None if it has none."""
    if isinstance(field, HasLipschitzBound):
        return float(field.lipschitz_bound().max())
    return None


def _trace(slopes: Tensor) -> Tensor:
    return slopes.diagonal(dim1=-2, dim2=-1).sum(dim=-1)


def _with_trace(function: VectorField, points: Tensor, owner: object) -> tuple[Tensor, Tensor]:
    values, slopes = _by_autograd(function, points, owner)
    return values, _trace(slopes)


def _by_autograd(function: VectorField, points: Tensor, owner: object) -> tuple[Tensor, Tensor]:
    """Return V and its Jacobian, differentiable in the points and in what the field holds."""
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
    """Return V and its Jacobian under `torch.func`, where requires_grad cannot be set."""
    values, pull, *_ = torch.func.vjp(function, points)
    units = torch.eye(points.shape[-1], dtype=points.dtype, device=points.device)
    rows = [pull(unit.expand(points.shape))[0] for unit in units]
    return values, torch.stack(rows, dim=-2)


def _is_differentiable(function: VectorField, points: Tensor, owner: object) -> bool:
    if points.requires_grad:
        return True
    if isinstance(owner, nn.Module) and any(p.requires_grad for p in owner.parameters()):
        return True
    # a plain function may use parameters that show only in its values
    return function(points).requires_grad
