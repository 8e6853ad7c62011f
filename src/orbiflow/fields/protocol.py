"""What a vector field must offer, and what it may offer to be used better.

A field is any callable from points (..., d) to vectors of the same shape: a function, a lambda, a torch
module. Nothing else is asked for. What it has beside that is found by these protocols, once, in
`orbiflow.fields.derivatives`; a method of these names must mean what is said here.

| the field has | then |
|---|---|
| `jacobian(points)`, `divergence(points)` | closed forms are used in place of autograd |
| `bound()` | what depends on the parameters alone is worked out once for many evaluations |
| `bound_with_divergence()` | V and its divergence come from shared work |
| `lipschitz_bound()` | steps are judged without trying them |
| `time_dependent` true | it is called as V(points, time), see `TimeDependentField` |
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from torch import Tensor

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
    """As `Bindable`, giving V (..., d) and its divergence (...,) together."""

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

    A torch module says so itself, by an attribute `time_dependent = True`.

    >>> import torch
    >>> from orbiflow.flows import Flow
    >>> turning = time_dependent(lambda p, t: torch.ones_like(p) * 2 * t)
    >>> Flow(turning, steps=4, method="midpoint")(torch.zeros(2)).tolist()
    [1.0, 1.0]
    """
    return _Marked(function)


def is_time_dependent(field: object) -> bool:
    """Whether `field` is to be called as V(points, time)."""
    return bool(getattr(field, "time_dependent", False))
