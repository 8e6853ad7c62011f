"""Explicit Runge-Kutta methods with a fixed step, as tables.

Such a step is a combination of field values at points moved by field values, so it commutes with
every isometry that the field commutes with: equivariance holds to rounding at any step size (design
point 5). Injectivity does not follow; the step must be bounded by the field's Lipschitz constant,
see `RungeKutta.injective_below`.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import torch
from torch import Tensor

from orbiflow.errors import CoarseStepsWarning, OrbiflowError
from orbiflow.fields import lipschitz_bound
from orbiflow.typed_torch import linalg, transformed

if TYPE_CHECKING:
    from orbiflow.flows.flow import Flow

State = TypeVar("State", bound=tuple[Tensor, ...])


@dataclass(frozen=True)
class RungeKutta:
    """The Butcher tableau of an explicit method for an autonomous equation.

    Args:
        name: The method's name, for people and files.
        order: The order of convergence.
        stages: The coefficients; row i holds those of the earlier slopes at stage i + 1.
        weights: The weights of the slopes in the step.
    """

    name: str
    order: int
    stages: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]

    @cached_property
    def injective_below(self) -> float:
        """The largest h L for which a step h of a field of Lipschitz constant L must be injective.

        A step is x + h I(x), injective if h I has a Lipschitz constant below 1. That of a stage's
        slope is at most L (1 + h sum_k |a_ik| times the earlier stages'), that of I their sum with
        |weights|: a polynomial in h L. The result is where h I reaches 1.

        >>> round(METHODS["midpoint"].injective_below, 3)
        0.732
        """

        def increment(z: float) -> float:
            stages = [1.0]
            for row in self.stages:
                stages.append(1.0 + z * sum(abs(c) * s for c, s in zip(row, stages, strict=True)))
            return z * sum(abs(c) * s for c, s in zip(self.weights, stages, strict=True))

        low, high = 0.0, 1.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if increment(middle) <= 1.0 else (low, middle)
        return low

    def step(self, slope: Callable[[State], State], state: State, h: float) -> State:
        """Return the state after one step of length h of d state / dt = slope(state)."""
        slopes = [slope(state)]
        for row in self.stages:
            slopes.append(slope(_advance(state, slopes, row, h)))
        return _advance(state, slopes, self.weights, h)


def _advance(state: State, slopes: list[State], coefficients: tuple[float, ...], h: float) -> State:
    moved: list[Tensor] = []
    for i, part in enumerate(state):
        for k, c in zip(slopes, coefficients, strict=True):
            if c != 0.0:
                part = part.add(k[i], alpha=h * c)
        moved.append(part)
    return tuple(moved)  # pyright: ignore[reportReturnType]


METHODS: dict[str, RungeKutta] = {
    method.name: method
    for method in (
        RungeKutta("euler", 1, (), (1.0,)),
        RungeKutta("midpoint", 2, ((0.5,),), (0.0, 1.0)),
        RungeKutta("rk4", 4, ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
        # Kutta's third-order method
        RungeKutta("rk3", 3, ((0.5,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6)),
        # Butcher's six-stage fifth-order method (Hairer, Norsett, Wanner, section II.5)
        RungeKutta(
            "rk5",
            5,
            (
                (1 / 4,),
                (1 / 8, 1 / 8),
                (0.0, -1 / 2, 1.0),
                (3 / 16, 0.0, 0.0, 9 / 16),
                (-3 / 7, 2 / 7, 12 / 7, -12 / 7, 8 / 7),
            ),
            (7 / 90, 0.0, 32 / 90, 12 / 90, 32 / 90, 7 / 90),
        ),
    )
}
"""Euler, midpoint, Kutta 3, the classical Runge-Kutta 4, Butcher 5."""


def method(name: str) -> RungeKutta:
    """Return a method by its name; raise `OrbiflowError` for an unknown one."""
    if name not in METHODS:
        raise OrbiflowError(f"unknown integrator {name!r}; choose from {', '.join(METHODS)}")
    return METHODS[name]


CHECKED_POINTS = 128  # the number of points that are also moved with twice the steps
COARSE_ERROR = 0.05  # the largest accepted error, as a share of the distance that the points move
FINE_ERROR = 1e-4  # the largest error with the number of steps that a warning advises
MAX_ADVISED_STEPS = 1024  # the largest number of steps that a warning tries


class StepCheck:
    """A check of a flow's steps for new parameters, less and less often in training; warns once."""

    def __init__(self) -> None:
        self.warned = False
        self._seen: object = None
        self._calls, self._next = 0, 1

    def look(self, flow: Flow, points: Tensor, *, inverse: bool) -> None:
        """Warn if `flow` moves some of `points` (..., d) elsewhere with twice its steps."""
        if self.warned or transformed() or points.numel() == 0 or not self._is_due(flow):
            return  # under the transforms of torch there are no numbers to check
        # the check must not break a flow that is being traced
        with contextlib.suppress(RuntimeError):
            message = _warning(flow, points, inverse)
            if message:
                self.warned = True
                warnings.warn(message, CoarseStepsWarning, stacklevel=6)

    def _is_due(self, flow: Flow) -> bool:
        parameters = list(flow.parameters())
        if torch.is_grad_enabled() and any(p.requires_grad for p in parameters):
            self._calls += 1
            if self._calls < self._next:
                return False
            self._next *= 2
        version = [(p.data_ptr(), 0 if p.is_inference() else p._version) for p in parameters]
        if version == self._seen:
            return False
        self._seen = version
        return True


@torch.no_grad()
def _warning(flow: Flow, points: Tensor, inverse: bool) -> str:
    if _provably_fine(flow):
        return ""
    # a sample of the points; the first axes may be those of a stack of fields
    few, count = points.detach(), points.shape[-2] if points.dim() > 1 else 0
    if count > CHECKED_POINTS:
        few = few[..., [i * count // CHECKED_POINTS for i in range(CHECKED_POINTS)], :]
    error = _relative_error(flow, few, inverse)
    if not error > COARSE_ERROR:
        return ""
    steps = flow.steps
    now = error
    while now > FINE_ERROR and steps < MAX_ADVISED_STEPS:
        steps *= 2
        now = _relative_error(flow.with_steps(steps), few, inverse)
    advice = f"raise steps to {steps}" if now <= FINE_ERROR else f"raise steps beyond {steps}"
    return (
        f"{flow.steps} {flow.method} steps per segment are too coarse for this flow: with twice as "
        f"many, points move elsewhere by {100 * error:.0f} % of their way; {advice}, "
        "flow.with_steps(n) or Flow(..., steps=n), or make the field smaller"
    )


def _provably_fine(flow: Flow) -> bool:
    """Return whether the fields' bounds prove the error of a step small: (h L)^p / (p + 1)!."""
    bounds = [lipschitz_bound(field) for field in flow.fields()]
    finite = [bound for bound in bounds if bound is not None]
    if len(finite) < len(bounds):
        return False
    product = abs(flow.duration) / flow.steps * max(finite)
    order = flow.integrator.order
    return product**order / math.factorial(order + 1) <= COARSE_ERROR / 10


def _relative_error(flow: Flow, points: Tensor, inverse: bool) -> float:
    coarse = flow.carried(points, inverse=inverse)
    fine = flow.with_steps(2 * flow.steps).carried(points, inverse=inverse)
    way = max(float(linalg.vector_norm(end - points, dim=-1).max()) for end in (coarse, fine))
    return float(linalg.vector_norm(coarse - fine, dim=-1).max()) / way if way > 0 else 0.0
