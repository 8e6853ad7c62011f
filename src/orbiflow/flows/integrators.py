"""Explicit Runge-Kutta methods with a fixed step, as tables.

Such a step is a combination of field values at points moved by field values, so it commutes with
every isometry that the field commutes with: equivariance holds to rounding at any step size (design
point 5). Injectivity does not follow; the step must be bounded by the field's Lipschitz constant,
see `RungeKutta.injective_below`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from torch import Tensor

from orbiflow.errors import OrbiflowError

State = TypeVar("State", bound=tuple[Tensor, ...])


@dataclass(frozen=True)
class RungeKutta:
    """Butcher tableau of an explicit method for an autonomous equation.

    Args:
        name: for people and files.
        order: of convergence.
        stages: row i holds the coefficients of the earlier slopes at stage i + 1.
        weights: of the slopes in the step.
    """

    name: str
    order: int
    stages: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]

    @cached_property
    def injective_below(self) -> float:
        """Largest h L for which a step h of a field of Lipschitz constant L is injective for sure.

        A step is x + h I(x), injective if h I has a Lipschitz constant below 1. That of a stage's
        slope is at most L (1 + h sum_k |a_ik| times the earlier stages'), that of I their sum with
        |weights|: a polynomial in h L, of which this is the place where h I reaches 1.

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
        """One step of length h of d state / dt = slope(state)."""
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
        RungeKutta(
            "rk4",
            4,
            ((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
            (1 / 6, 1 / 3, 1 / 3, 1 / 6),
        ),
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
    """Look a method up.

    Raises:
        OrbiflowError: for an unknown name.
    """
    if name not in METHODS:
        raise OrbiflowError(f"unknown integrator {name!r}; choose from {', '.join(METHODS)}")
    return METHODS[name]
