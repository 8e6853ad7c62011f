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
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from orbiflow.arrays import Array
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import FlowDensity
from orbiflow.fields import InvariantField
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import unique

ROUGHNESS_ORDER = 3
"""Order of the derivatives whose energy is the roughness, so that smooth displacements cost little."""

ITERATIONS_PER_SCORE = 3
"""Iterations between scores of the validation points."""

MAX_IDLE_ITERATIONS = 12
"""Iterations without a better validation score after which refinement ends."""

MOST_EVALUATIONS = 10**9
"""The most evaluations of a descent that has no other bound; SciPy's own is 15,000."""

Watch = Callable[[int, float, float], None]
"""A function called with the iteration and the training and validation scores, in nats."""

HopelessAt = Callable[[float], bool]
"""Whether to end a descent that may still gain so many nats."""

HOPED_GAINS = {0.25: 4.0, 0.5: 2.0}
"""What a descent may still gain after these shares of its iterations, in gains of the second half of
those so far: with each doubling of the iterations the gains become smaller."""


@dataclass(frozen=True)
class Refinement:
    """The course of a stage of refinement.

    - `train`, `validation`: Mean negative log densities with respect to the square, at the start, every
      `ITERATIONS_PER_SCORE` iterations and at the end.
    - `best`: The entry whose parameters were kept.
    - `stopped`: What ended it: "iterations", "validation", "converged", "outdone" or
      "evaluations".
    - `seconds`, `evaluations`: The time and the evaluations that it took.
    """

    train: tuple[float, ...]
    validation: tuple[float, ...]
    best: int
    stopped: str
    seconds: float
    evaluations: int = 0


class Stop(Exception):
    """Ends a descent; `reason` is what `Refinement.stopped` says of it."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


class Objective:
    """The mean negative log density of the training points plus penalties, as SciPy wants it.

    Args:
        density: A density whose flow has Fourier or spline fields.
        rows: Canonical training points (N, d), whose weights, if they have any, have the sum 1.
        roughness: Weight of E|grad^3 V|^2 summed over segments, with lengths in wavelengths.
    """

    def __init__(self, density: FlowDensity, rows: Rows, roughness: float) -> None:
        self.density, self.rows = density, rows
        self.parameters = [p for p in density.flow.parameters() if p.requires_grad]
        self.fields = [f for f in density.flow.segments if isinstance(f, InvariantField)]
        self._weights: list[Tensor] = []
        for field in self.fields:  # of each coefficient's square, (P,)
            magnitude = torch.as_tensor(field.basis.magnitude).to(field.parameters_)
            self._weights.append(roughness * magnitude ** (2 * ROUGHNESS_ORDER))
        self.last, self.evaluations = math.inf, 0

    def get(self) -> Array:
        """Return all parameters, flat."""
        return parameters_to_vector(self.parameters).detach().double().cpu().numpy()

    @torch.no_grad()
    def set(self, values: Array) -> None:
        """Put flat parameters back."""
        flat = torch.as_tensor(values).to(self.parameters[0])
        vector_to_parameters(flat, self.parameters)

    def roughness(self) -> Tensor:
        """Return the penalty, which is exact as the basis is orthonormal."""
        total = self.rows.points.new_zeros(())
        for field, weights in zip(self.fields, self._weights, strict=True):
            total = total + ((field.parameters_ * field.scale) ** 2 * weights).sum()
        # a segment of duration 1 stands for a time 1 / count
        return total * len(self.fields)

    def __call__(self, values: Array) -> tuple[float, Array]:
        """Return loss and gradient, or a barrier where the density is not finite."""
        self.evaluations += 1
        self.set(values)
        nll = _nll(self.density, self.rows)
        loss = nll + self.roughness()
        if not bool(torch.isfinite(loss)):
            return 1e10, np.zeros(len(values))
        gradient = parameters_to_vector(torch.autograd.grad(loss, self.parameters))
        self.last = float(nll.detach())
        return float(loss.detach()), gradient.double().cpu().numpy()


def _nll(density: FlowDensity, rows: Rows) -> Tensor:
    """Return the mean negative log density of rows whose weights have the sum 1."""
    points, weights = rows.points, rows.weights
    if weights is None:
        weights = torch.full_like(points[:, 0], 1 / len(points))
    return -(weights * density.log_prob(points)).sum()


def refine(
    density: FlowDensity,
    train: Rows,
    held: Rows,
    *,
    iterations: int,
    roughness: float = 0.0,
    evaluations: int = MOST_EVALUATIONS,
    watch: Watch | None = None,
    hopeless: HopelessAt | None = None,
) -> Refinement:
    """Descend on the negative log-likelihood, and leave the flow's parameters best on `held`.

    Canonical points (N, d) are in the parameters' dtype; weights, if there are any, have the sum 1. It
    ends after `iterations`, or `MAX_IDLE_ITERATIONS` of them that do not improve the held-out score, or
    after the one in which so many `evaluations` are reached, or where `HOPED_GAINS` ask if it is
    `hopeless`, which may look at the density. `watch` is called with every score.
    """
    began = time.monotonic()
    objective = Objective(density, train, roughness)
    descent = _Descent(objective, held, watch, iterations, hopeless)

    stopped = "iterations"
    try:
        if iterations:  # SciPy does one at least
            result = scipy.optimize.minimize(
                objective,
                objective.get(),
                jac=True,
                method="L-BFGS-B",
                callback=descent.after,
                options={
                    "maxiter": iterations,
                    "maxfun": evaluations,
                    "maxcor": 20,
                    "maxls": 20,
                    "ftol": 1e-9,
                    "gtol": 1e-7,
                },
            )
            if result.nit < iterations:
                stopped = "evaluations" if result.nfev >= evaluations else "converged"
    except Stop as stop:
        stopped = stop.reason
    descent.finish()
    spent = time.monotonic() - began
    return Refinement(
        tuple(descent.trains), tuple(descent.scores), descent.best, stopped, spent,
        objective.evaluations,
    )  # fmt: skip


class _Descent:
    """The iterates of a descent: every `ITERATIONS_PER_SCORE`-th is scored, and so is the last."""

    def __init__(
        self,
        objective: Objective,
        held: Rows,
        watch: Watch | None,
        iterations: int,
        hopeless: HopelessAt | None,
    ) -> None:
        self.objective, self.held, self.watch = objective, held, watch
        self.hopes = {share * iterations: hope for share, hope in HOPED_GAINS.items()}
        self.hopeless = hopeless
        self.done, self.best = 0, 0
        self.latest = self.kept = objective.get()
        with torch.no_grad():
            self.nll = float(_nll(objective.density, objective.rows))
        self.trains, self.scores = [self.nll], [self._score()]

    def after(self, xk: Array) -> None:
        """Take an iterate."""
        self.done += 1
        self.latest, self.nll = np.array(xk), self.objective.last
        if self.done % ITERATIONS_PER_SCORE == 0:
            self._look()
            if ITERATIONS_PER_SCORE * (len(self.scores) - 1 - self.best) >= MAX_IDLE_ITERATIONS:
                raise Stop("validation")
            for iteration, hope in self.hopes.items():
                if self.hopeless and self.done - ITERATIONS_PER_SCORE < iteration <= self.done:
                    halfway = self.scores[min(len(self.scores) // 2, len(self.scores) - 2)]
                    if self.hopeless(hope * (halfway - self.scores[-1])):
                        raise Stop("outdone")

    def finish(self) -> None:
        """Leave the best iterate in place."""
        if self.done % ITERATIONS_PER_SCORE:
            self._look()
        self.objective.set(self.kept)

    def _look(self) -> None:
        self.objective.set(self.latest)
        self.trains.append(self.nll)
        self.scores.append(self._score())
        if self.watch is not None:
            self.watch(self.done, self.trains[-1], self.scores[-1])
        if self.scores[-1] < self.scores[self.best] or not math.isfinite(self.scores[self.best]):
            self.best, self.kept = len(self.scores) - 1, self.latest

    @torch.no_grad()
    def _score(self) -> float:
        # at doubled steps: what only exploits the integrator gains nothing here
        density = self.objective.density
        return float(_nll(density.with_steps(2 * density.flow.steps), self.held))


MAX_HALVINGS = 5
"""Halvings of the cells at most: a point is then known to 1/32 of a cell."""


def merged(rows: Rows, cells: int, crowd: int) -> Rows:
    """Return means of the points in each cell of a grid, finer where points crowd, and their shares.

    A smooth log density summed over the points changes by half its curvature times their variance
    within a cell, which is below 1 / (6 cells^2). Where the density is sharp, points crowd: cells of
    more than `crowd` points are quartered, again and again.

    Points (N, d) of the chart become points (M, d), M <= N, with weights of sum 1; the coarsest grid
    has so many `cells` along a unit of length.

    >>> merged(Rows(torch.tensor([[0.1], [0.2], [0.9]])), 2, crowd=2).weights
    tensor([0.6667, 0.3333])
    """
    points = rows.points
    # the unit cube, or as many cubes as hold the points
    low = points.amin(dim=0).floor()
    high = (points.amax(dim=0) - low).ceil().clamp_min(1).max()
    cells = cells * int(high)
    group = torch.zeros(len(points), dtype=torch.long)
    left, groups = torch.arange(len(points)), 0
    for level in range(MAX_HALVINGS + 1):
        side = cells << level
        cell = ((points[left] - low) / high * side).floor().clamp(0, side - 1).long()
        label = (cell * side ** torch.arange(points.shape[1]).flip(0)).sum(dim=1)
        _, where, counts = unique(label, return_inverse=True, return_counts=True)
        settled = (counts[where] <= crowd) | (level == MAX_HALVINGS)
        group[left[settled]] = groups + where[settled]
        left, groups = left[~settled], groups + len(counts)
        if not len(left):
            break
    numbers, where = unique(group, return_inverse=True)
    weights = torch.ones_like(points[:, 0]) if rows.weights is None else rows.weights
    total = weights.new_zeros(len(numbers)).index_add_(0, where, weights)
    sums = points.new_zeros(len(numbers), points.shape[1])
    sums.index_add_(0, where, points * weights[:, None])
    return Rows(sums / total[:, None], (total / total.sum()).to(points))


@contextlib.contextmanager
def training() -> Generator[None]:
    """Train in a block, or in a function that it decorates; the caller's settings are left alone.

    Under `torch.no_grad()` or `torch.inference_mode()` there would be no gradients, and what is made
    in the latter could never be differentiated.
    """
    with one_thread(), torch.inference_mode(False), torch.enable_grad():
        yield
