"""Likelihood refinement, L-BFGS on the exact log density with penalties, and what a fit may spend.

Evaluations end alike on every machine; time is an outer limit.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models import FlowDensity
from orbiflow.fields import InvariantField
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import unique

ORDER = 3
"""Order of the derivatives whose energy is the roughness, so that smooth displacements cost little."""

EVERY = 3
"""Iterations between scores of the validation points."""

PATIENCE = 12
"""Iterations without a better validation score after which refinement ends."""

MOST_EVALUATIONS = 10**9
"""For SciPy, whose own bound is 15,000: `Budget` counts them."""

Watch = Callable[[int, float, float], None]
"""A function called with the iteration and the training and validation scores, in nats."""


@dataclass(frozen=True)
class Refinement:
    """The course of a stage of refinement.

    - `train`, `validation`: Mean negative log densities with respect to the square, at the start, every
      `EVERY` iterations and at the end.
    - `best`: The entry whose parameters were kept.
    - `stopped`: What ended it: "iterations", "validation", "converged", "evaluations" or "time".
    - `seconds`: The time that it took.
    """

    train: tuple[float, ...]
    validation: tuple[float, ...]
    best: int
    stopped: str
    seconds: float


class _Idle(Exception):
    """Validation has not improved for `PATIENCE` iterations."""

    reason = "validation"


class Objective:
    """The mean negative log density of the training points plus penalties, as SciPy wants it.

    Args:
        density: A density whose flow has Fourier or spline fields.
        points: Canonical training points (N, d).
        weights: Weights (N,) of sum 1; default: equal.
        kinetic: Weight of the flow's kinetic energy, E|V|^2 summed over segments.
        roughness: Weight of E|grad^3 V|^2 summed over segments, with lengths in wavelengths.
    """

    def __init__(
        self,
        density: FlowDensity,
        points: Tensor,
        weights: Tensor | None = None,
        *,
        kinetic: float,
        roughness: float,
    ) -> None:
        self.density, self.points = density, points
        self.weights = _even(points) if weights is None else weights
        self.parameters = [p for p in density.flow.parameters() if p.requires_grad]
        self.fields = [f for f in density.flow.segments if isinstance(f, InvariantField)]
        self._weights: list[Tensor] = []
        for field in self.fields:  # of each coefficient's square, (P,)
            magnitude = torch.as_tensor(field.basis.magnitude).to(field.parameters_)
            self._weights.append(kinetic + roughness * magnitude ** (2 * ORDER))
        self.last = math.inf

    def get(self) -> Array:
        """Return all parameters, flat."""
        flat = torch.cat([p.detach().reshape(-1) for p in self.parameters])
        return flat.double().cpu().numpy()

    @torch.no_grad()
    def set(self, values: Array) -> None:
        """Put flat parameters back."""
        flat = torch.as_tensor(values)
        for parameter in self.parameters:
            parameter.copy_(flat[: parameter.numel()].reshape(parameter.shape))
            flat = flat[parameter.numel() :]

    def penalty(self) -> Tensor:
        """Return kinetic energy and roughness, which are exact as the basis is orthonormal."""
        total = self.points.new_zeros(())
        count = len(self.fields)
        for field, weights in zip(self.fields, self._weights, strict=True):
            total = total + ((field.parameters_ * field.scale) ** 2 * weights).sum()
        return total * count  # a segment of duration 1 stands for a time 1 / count

    def __call__(self, values: Array) -> tuple[float, Array]:
        """Return loss and gradient, or a barrier where the density is not finite."""
        self.set(values)
        for parameter in self.parameters:
            parameter.grad = None
        nll = -(self.weights * self.density.log_prob(self.points)).sum()
        loss = nll + self.penalty()
        if not bool(torch.isfinite(loss)):
            return 1e10, np.zeros(len(values))
        torch.autograd.backward(loss)
        gradient = torch.cat(
            [
                torch.zeros_like(p).reshape(-1) if p.grad is None else p.grad.reshape(-1)
                for p in self.parameters
            ]
        )
        self.last = float(nll.detach())
        return float(loss.detach()), gradient.double().cpu().numpy()


def refine(
    density: FlowDensity,
    train: Tensor,
    validation: Tensor,
    *,
    weights: Tensor | None = None,
    held_weights: Tensor | None = None,
    iterations: int = 100,
    kinetic: float = 0.0,
    roughness: float = 0.0,
    budget: Budget | None = None,
    watch: Watch | None = None,
) -> Refinement:
    """Descend on the negative log-likelihood, and leave the flow's parameters best on `validation`.

    Canonical points (N, d) are in the parameters' dtype; weights have the sum 1, by default equal ones.
    It ends after `iterations`, or `PATIENCE` of them that do not improve the validation score, or when
    the `budget` is spent. `watch` is told every score.
    """
    budget = Budget() if budget is None else budget
    began = time.monotonic()
    objective = Objective(density, train, weights, kinetic=kinetic, roughness=roughness)
    descent = _Descent(objective, validation, held_weights, watch)

    def loss(values: Array) -> tuple[float, Array]:
        budget.spend()
        return objective(values)

    stopped = "iterations"
    try:
        if iterations:  # SciPy does one at least
            found = scipy.optimize.minimize(
                loss,
                objective.get(),
                jac=True,
                method="L-BFGS-B",
                callback=descent.after,
                options={
                    "maxiter": iterations,
                    "maxfun": MOST_EVALUATIONS,
                    "maxcor": 20,
                    "maxls": 20,
                    "ftol": 1e-9,
                    "gtol": 1e-7,
                },
            )
            if found.nit < iterations:
                stopped = "converged"
    except (Spent, _Idle) as stop:
        stopped = stop.reason
    descent.finish()
    spent = time.monotonic() - began
    return Refinement(tuple(descent.trains), tuple(descent.scores), descent.best, stopped, spent)


class _Descent:
    """The iterates of a descent: every `EVERY`-th is scored, and so is the last."""

    def __init__(
        self, objective: Objective, validation: Tensor, weights: Tensor | None, watch: Watch | None
    ) -> None:
        self.objective, self.validation, self.watch = objective, validation, watch
        self.weights = _even(validation) if weights is None else weights
        self.done, self.best = 0, 0
        self.latest = self.kept = objective.get()
        self.nll = self._nll(objective.density, objective.points, objective.weights)
        self.trains, self.scores = [self.nll], [self._score()]
        self._scored = 0

    def after(self, xk: Array) -> None:
        """Take an iterate."""
        self.done += 1
        self.latest, self.nll = np.array(xk), self.objective.last
        if self.done % EVERY == 0:
            self._look()
            if EVERY * (len(self.scores) - 1 - self.best) >= PATIENCE:
                raise _Idle

    def finish(self) -> None:
        """Leave the best iterate in place."""
        if self._scored < self.done:
            self._look()
        self.objective.set(self.kept)

    def _look(self) -> None:
        self.objective.set(self.latest)
        self.trains.append(self.nll)
        self.scores.append(self._score())
        self._scored = self.done
        if self.watch is not None:
            self.watch(self.done, self.trains[-1], self.scores[-1])
        if self.scores[-1] < self.scores[self.best] or not math.isfinite(self.scores[self.best]):
            self.best, self.kept = len(self.scores) - 1, self.latest

    def _score(self) -> float:
        # at doubled steps: what only exploits the integrator gains nothing here
        density = self.objective.density
        finer = density.with_steps(2 * density.flow.steps)
        return self._nll(finer, self.validation, self.weights)

    @torch.no_grad()
    def _nll(self, density: FlowDensity, points: Tensor, weights: Tensor) -> float:
        return -float((weights * density.log_prob(points)).sum())


def _even(points: Tensor) -> Tensor:
    return torch.full_like(points[:, 0], 1 / len(points))


LEVELS = 5
"""Halvings of the cells at most: a point is then known to 1/32 of a cell."""


def merged(
    points: Tensor, cells: int, crowd: int, row_weights: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """Return means of the points in each cell of a grid, finer where points crowd, and their shares.

    A smooth log density summed over the points changes by half its curvature times their variance
    within a cell, which is below 1 / (6 cells^2). Where the density is sharp, points crowd: cells of
    more than `crowd` points are quartered, again and again.

    Points (N, d) in [0, 1]^d, with `row_weights` (N,) or equal ones, and so many `cells` along a side
    of the coarsest grid, become points (M, d) and weights (M,) of sum 1, M <= N, in the points' dtype.

    >>> merged(torch.tensor([[0.1], [0.2], [0.9]]), 2, crowd=2)[1]
    tensor([0.6667, 0.3333])
    """
    group = torch.zeros(len(points), dtype=torch.long, device=points.device)
    left = torch.arange(len(points), device=points.device)
    groups = 0
    for level in range(LEVELS + 1):
        side = cells << level
        cell = (points[left] * side).floor().clamp(0, side - 1).long()
        label = (cell * side ** torch.arange(points.shape[1], device=left.device).flip(0)).sum(
            dim=1
        )
        _, where, counts = unique(label, return_inverse=True, return_counts=True)
        settled = (counts[where] <= crowd) | (level == LEVELS)
        group[left[settled]] = groups + where[settled]
        left, groups = left[~settled], groups + len(counts)
        if not len(left):
            break
    _, where, counts = unique(group, return_inverse=True, return_counts=True)
    if row_weights is not None:
        points = points * row_weights[:, None]
        counts = row_weights.new_zeros(len(counts)).index_add_(0, where, row_weights)
        sums = points.new_zeros(len(counts), points.shape[1]).index_add_(0, where, points)
        return sums / counts[:, None], (counts / counts.sum()).to(points)
    sums = points.new_zeros(len(counts), points.shape[1]).index_add_(0, where, points)
    return sums / counts[:, None], counts.to(points) / len(points)


clock = time.monotonic
"""Seconds since some moment; tests put another in its place."""


class Spent(Exception):
    """Raised where the next evaluation would begin; `reason` is "evaluations" or "time"."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Budget:
    """Counts evaluations of an objective, and looks at the clock between them.

    A fit that ends by its evaluations is the same on a busy machine; one that ends by time is not, so
    it has to say so: `notes`.

    >>> budget = Budget(evaluations=1)
    >>> budget.spend()
    >>> budget.is_spent
    True
    """

    def __init__(self, evaluations: float = math.inf, seconds: float | None = None) -> None:
        self.evaluations = evaluations
        self.seconds = math.inf if seconds is None else seconds
        self.used = 0
        self._began = clock()
        self._reason: str | None = None

    @property
    def is_spent(self) -> bool:
        """Whether the next evaluation may not begin: ask only before one. Once so, always so."""
        if self._reason is None:
            if self.used >= self.evaluations:
                self._reason = "evaluations"
            # no limit needs no clock
            elif self.seconds < math.inf and clock() - self._began >= self.seconds:
                self._reason = "time"
        return self._reason is not None

    @property
    def seconds_left(self) -> float | None:
        """What is left of the limit on time, at least 0; None if there is no limit."""
        if self.seconds == math.inf:
            return None
        return max(0.0, self.seconds - (clock() - self._began))

    def spend(self) -> None:
        """Count an evaluation that is about to begin."""
        if self.is_spent:
            raise Spent(str(self._reason))
        self.used += 1

    def notes(self) -> list[str]:
        """What the user should know, in words."""
        if self._reason == "time":
            return [f"stopped by the limit of {self.seconds:g} s: another run may differ"]
        if self._reason == "evaluations":
            return [f"stopped by the budget of {self.evaluations:g} evaluations"]
        return []


@contextlib.contextmanager
def training() -> Generator[None]:
    """Train in a block, or in a function that it decorates; the caller's settings are left alone.

    Under `torch.no_grad()` or `torch.inference_mode()` there would be no gradients, and what is made
    in the latter could never be differentiated.
    """
    with one_thread(), torch.inference_mode(False), torch.enable_grad():
        yield
