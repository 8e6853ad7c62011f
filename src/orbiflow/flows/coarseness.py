"""Whether a flow's steps are fine enough for its fields: found out by a few points, said once."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from orbiflow.errors import CoarseStepsWarning
from orbiflow.fields.derivatives import lipschitz_bound
from orbiflow.fields.transforms import transformed
from orbiflow.typed_torch import linalg

if TYPE_CHECKING:
    from orbiflow.flows.flow import Flow

SAMPLE = 128
"""Points that are carried at twice the steps."""

TOLERANCE = 0.05
"""Largest error that is let pass, as a share of the way that the points are carried."""

GOOD = 1e-4
"""Error at the steps that a warning advises."""

MOST_STEPS = 1024
"""Up to which a warning looks for steps that are fine enough."""


class Watch:
    """Looks at a flow where its parameters are new, in training ever more rarely; warns once."""

    def __init__(self) -> None:
        self.warned = False
        self._seen: object = None
        self._calls, self._next = 0, 1

    def look(self, flow: Flow, points: Tensor, *, inverse: bool) -> None:
        """Warn if `flow` carries some of `points` (..., d) elsewhere at twice its steps.

        Warns:
            CoarseStepsWarning: with the error found and how many steps to take.
        """
        if self.warned or transformed() or points.numel() == 0 or not self._is_due(flow):
            return  # where torch transforms a flow there are no numbers to look at
        # a check may not break what it checks, be it traced
        with contextlib.suppress(RuntimeError):
            message = _complaint(flow, points, inverse)
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
def _complaint(flow: Flow, points: Tensor, inverse: bool) -> str:
    if _surely_fine(flow):
        return ""
    few = _some(points.detach())
    error = _relative_error(flow, few, inverse)
    if not error > TOLERANCE:
        return ""
    steps = flow.steps
    now = error
    while now > GOOD and steps < MOST_STEPS:
        steps *= 2
        now = _relative_error(flow.with_steps(steps), few, inverse)
    advice = f"raise steps to {steps}" if now <= GOOD else f"raise steps beyond {steps}"
    return (
        f"{flow.steps} {flow.method} steps a segment are too coarse for this flow: twice as many "
        f"carry points elsewhere by {100 * error:.0f} % of their way; {advice}, "
        "flow.with_steps(n) or Flow(..., steps=n), or make the field smaller"
    )


def _surely_fine(flow: Flow) -> bool:
    """Whether the fields' own bounds say that each step errs little: (h L)^p / (p + 1)!."""
    bounds = [lipschitz_bound(field) for field in flow.fields()]
    known = [bound for bound in bounds if bound is not None]
    if len(known) < len(bounds):
        return False
    product = abs(flow.duration) / flow.steps * max(known)
    order = flow.integrator.order
    return product**order / math.factorial(order + 1) <= TOLERANCE / 10


def _some(points: Tensor) -> Tensor:
    """Some of the points; the first axes may be those of a stack of fields."""
    if points.dim() < 2 or points.shape[-2] <= SAMPLE:
        return points
    count = points.shape[-2]
    chosen: Iterable[int] = (i * count // SAMPLE for i in range(SAMPLE))
    return points[..., list(chosen), :]


def _relative_error(flow: Flow, points: Tensor, inverse: bool) -> float:
    coarse = flow.carried(points, inverse=inverse)
    fine = flow.with_steps(2 * flow.steps).carried(points, inverse=inverse)
    way = max(float(linalg.vector_norm(end - points, dim=-1).max()) for end in (coarse, fine))
    return float(linalg.vector_norm(coarse - fine, dim=-1).max()) / way if way > 0 else 0.0
