"""Likelihood refinement: L-BFGS on the exact log density, with a kinetic penalty."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import torch
from torch import Tensor

from orbiflow.density.density import SymmetricDensity
from orbiflow.fields import InvariantField
from orbiflow.symmetry.isometry import Array

ORDER = 3
"""Of the derivatives whose energy is the roughness: smooth displacements are to be cheap."""

EVERY = 3
"""Iterations between scores of the validation points."""

PATIENCE = 12
"""Iterations without a better validation score after which refinement ends."""

Watch = Callable[[int, float, float], None]
"""Told the iteration, the training and the validation negative log-likelihood, in nats."""


@dataclass(frozen=True)
class Refinement:
    """What became of it.

    - `train`, `validation`: mean negative log density with respect to the square, at the start and
      every `EVERY` iterations.
    - `best`: the entry whose parameters were kept.
    - `stopped`: "iterations", "validation", "converged" or "time".
    - `seconds`: that it took.
    """

    train: tuple[float, ...]
    validation: tuple[float, ...]
    best: int
    stopped: str
    seconds: float


class _Stop(Exception):
    def __init__(self, reason: str) -> None:
        self.reason = reason


class Objective:
    """Mean NLL of the training points plus penalties, as SciPy wants it.

    Args:
        density: whose flow has Fourier or spline fields.
        points: (N, d) canonical, training.
        weights: (N,) of sum 1; default equal.
        kinetic: weight of the flow's kinetic energy, E|V|^2 summed over segments.
        roughness: weight of E|grad^3 V|^2 summed over segments, with lengths in wavelengths.
    """

    def __init__(
        self,
        density: SymmetricDensity,
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
        self._weights = [self._penalty_weights(f, kinetic, roughness) for f in self.fields]
        self.last = math.inf

    def get(self) -> Array:
        """All parameters, flat."""
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
        """Kinetic energy and roughness, exact: the basis is orthonormal."""
        total = self.points.new_zeros(())
        count = len(self.fields)
        for field, weights in zip(self.fields, self._weights, strict=True):
            total = total + ((field.parameters_ * field.scale) ** 2 * weights).sum()
        return total * count  # a segment of duration 1 stands for a time 1 / count

    @staticmethod
    def _penalty_weights(field: InvariantField, kinetic: float, roughness: float) -> Tensor:
        """Of each coefficient's square, (P,)."""
        magnitude = torch.as_tensor(field.basis.magnitude).to(field.parameters_)
        return kinetic + roughness * magnitude ** (2 * ORDER)

    def __call__(self, values: Array) -> tuple[float, Array]:
        """Loss and gradient; a barrier where the density is not finite."""
        self.set(values)
        for parameter in self.parameters:
            parameter.grad = None
        nll = -(self.weights * self.density.log_prob(self.points)).sum()
        loss = nll + self.penalty()
        if not bool(torch.isfinite(loss)):
            return 1e10, np.zeros(len(values))
        loss.backward()
        gradient = torch.cat(
            [
                torch.zeros_like(p).reshape(-1) if p.grad is None else p.grad.reshape(-1)
                for p in self.parameters
            ]
        )
        self.last = float(nll.detach())
        return float(loss.detach()), gradient.double().cpu().numpy()


def refine(
    density: SymmetricDensity,
    train: Tensor,
    validation: Tensor,
    *,
    weights: Tensor | None = None,
    held_weights: Tensor | None = None,
    iterations: int = 100,
    kinetic: float = 0.0,
    roughness: float = 0.0,
    seconds: float = math.inf,
    watch: Watch | None = None,
) -> Refinement:
    """Descend on the negative log-likelihood; the parameters best on `validation` are left in place.

    Args:
        density: its flow's parameters are changed.
        train, validation: canonical points (N, d) in the parameters' dtype.
        weights, held_weights: of the two, (N,) of sum 1; default equal.
        iterations: at most; it stops where validation has not improved for `PATIENCE` of them.
        kinetic, roughness: see `Objective`.
        seconds: after which it stops, at the best so far.
        watch: called with every score.
    """
    weights = _even(train) if weights is None else weights
    held_weights = _even(validation) if held_weights is None else held_weights
    objective = Objective(density, train, weights, kinetic=kinetic, roughness=roughness)
    finer = density.with_steps(2 * density.flow.steps)
    began = time.monotonic()

    def score() -> float:
        # at doubled steps: what only exploits the integrator gains nothing here
        with torch.no_grad():
            return -float((held_weights * finer.log_prob(validation)).sum())

    with torch.no_grad():
        trains = [-float((weights * density.log_prob(train)).sum())]
    scores = [score()]
    best, kept, done = 0, objective.get(), 0

    def after(values: Array) -> None:
        nonlocal best, kept, done
        done += 1
        if done % EVERY == 0:
            objective.set(values)
            trains.append(objective.last)
            scores.append(score())
            if watch is not None:
                watch(done, trains[-1], scores[-1])
            if scores[-1] < scores[best] or not math.isfinite(scores[best]):
                best, kept = len(scores) - 1, np.array(values)
            if EVERY * (len(scores) - 1 - best) >= PATIENCE:
                raise _Stop("validation")
        if time.monotonic() - began > seconds:
            raise _Stop("time")

    stopped = "iterations"
    try:
        found = scipy.optimize.minimize(
            objective,
            kept,
            jac=True,
            method="L-BFGS-B",
            callback=after,
            options={"maxiter": iterations, "maxcor": 20, "maxls": 20, "ftol": 1e-9, "gtol": 1e-7},
        )
        if found.nit < iterations:
            stopped = "converged"
    except _Stop as stop:
        stopped = stop.reason
    objective.set(kept)
    return Refinement(tuple(trains), tuple(scores), best, stopped, time.monotonic() - began)


def _even(points: Tensor) -> Tensor:
    return torch.full_like(points[:, 0], 1 / len(points))
