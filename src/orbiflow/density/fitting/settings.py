"""Knobs of a fit by splines."""

from __future__ import annotations

import math
from dataclasses import dataclass

from orbiflow.arguments import is_a
from orbiflow.density.arguments import (
    check_range,
    check_ranges,
    check_share,
)
from orbiflow.errors import OrbiflowError


@dataclass(frozen=True)
class FitSettings:
    """Knobs of a fit; the defaults are measured on the benchmarks.

    - `detail`: largest wave number of the fields, in waves along a side of the square.
    - `segments`: stationary pieces of the flow.
    - `steps`: RK4 steps in each, at first; doubled where the integrator has not converged.
    - `smoothness`: exponent s of the parameters' scaling (1 + |kappa|^2)^(-s/2).
    - `ridge`: of the closed-form start.
    - `roughness`: weights of the roughness penalty, each a stage of refinement from where the one
      before was best on the validation points; largest first.
    - `kinetic`: weight of the kinetic energy.
    - `iterations`: of L-BFGS in each stage, at most; 0 keeps the closed-form start.
    - `evaluations`: of the likelihood and its gradient in all stages together, at most. A stage of
      100 iterations takes about 105, so the default leaves those of `iterations` alone.
    - `validation`: share of the points held out for early stopping.
    - `base`: "uniform" or "von-mises", the paper's.
    - `kernels`: blend the flow with adaptive kernels about the training points, for data sharper than
      the flow's waves; see `blend_kernels`.
    - `single`: train in float32, about twice as fast; the result is float64 in any case.
    - `seconds`: of refinement at most, looked at between evaluations. A fit that it ends depends on
      the machine's speed, and its report says so; `evaluations` ends alike everywhere.
    - `seed`: of the split, the base points and the times.
    """

    detail: int = 8
    segments: int = 6
    steps: int = 1
    smoothness: float = 2.0
    ridge: float = 1e-4
    roughness: tuple[float, ...] = (1e-3, 1e-3, 1e-4)
    kinetic: float = 0.0
    iterations: int = 100
    evaluations: int = 1000
    validation: float = 0.1
    base: str = "uniform"
    kernels: bool = False
    single: bool = True
    seconds: float = math.inf
    seed: int = 0

    def __post_init__(self) -> None:
        whole = (
            ("detail", 1, 64),
            ("segments", 1, 256),
            ("steps", 1, 256),
            ("iterations", 0, 100_000),
            ("evaluations", 0, 1_000_000_000),
            ("seed", -(2**63), 2**64 - 1),
        )
        real = (
            ("smoothness", 0, 8),
            ("ridge", 0, math.inf),
            ("kinetic", 0, math.inf),
            ("seconds", 0, math.inf),
        )
        check_ranges(self, whole, integer=True)
        check_ranges(self, real)
        check_share(self.validation)
        if not is_a(self.roughness, tuple | list) or not self.roughness:
            raise OrbiflowError(f"roughness needs weights of at least 0, got {self.roughness!r}")
        for weight in self.roughness:
            check_range("each weight of roughness", weight, 0, math.inf)
        if self.base not in ("uniform", "von-mises"):
            raise OrbiflowError(f'base must be "uniform" or "von-mises", got {self.base!r}')
