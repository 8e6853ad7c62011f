"""Fitting Bayesian networks of angles: an order, the parents of each angle, a mixture for each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.density.fitting.budget import Budget
from orbiflow.density.fitting.chains import fit_chain_mixture, spread_chains
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.fitting.weights import Gain, gain_of
from orbiflow.density.models import (
    Factor,
    VonMisesChains,
    VonMisesNetwork,
    averaged,
    log_conditional,
)
from orbiflow.density.spaces import Torus

MOST_PARENTS = 3
"""The most parents of an angle."""

PROPOSED = 2
"""Number of angles that are tried as a further parent."""

SIZES = (4, 8, 16, 32, 64, 128)
"""Numbers of components of a factor."""

FIRST = 16
"""Components with which parents are chosen, if there are rows for as many."""

PER_COMPONENT = 20
"""Rows that each component must have on average."""

WORTHWHILE = 0.005
"""Nats that a parent, or twice as many components, must gain."""

SEARCHED = 4_000
"""The most rows by which the arrows are chosen."""

ITERATIONS, IDLE = 40, 1e-3
"""Maximum iterations of EM; it ends when five gain fewer nats than the latter."""

HARMONICS, RIDGE = 4, 1e-3
"""Waves of each angle by which dependence is screened, and what is added to their variances."""


class Shape(NamedTuple):
    """The shape of a factor: its angles, parents before their child, and its number of components."""

    axes: tuple[int, ...]
    components: int


def network_shapes(rows: Rows, held: Rows, generator: torch.Generator) -> Iterator[Shape]:
    """Yield factors one after the other, chosen by held-out rows; parents before their children.

    The order is that of Prim's algorithm on the angles' dependence (as Chow and Liu, 1968), parents
    are taken one by one as long as they gain.
    """
    rows = rows[:SEARCHED]
    seen = Screen(rows.points)
    order = seen.order()
    for place, axis in enumerate(order):
        yield _factor_shape(axis, order[:place], seen, rows, held, generator)


def fit_network(
    space: Torus,
    rows: Rows,
    held: Rows,
    shapes: Sequence[Shape],
    generator: torch.Generator,
    starts: int = 1,
) -> VonMisesNetwork:
    """Fit factors of these shapes, each the mean of EM from several starts."""
    return VonMisesNetwork(
        space,
        [
            Factor(
                axes, averaged([_fitted(rows, held, axes, size, generator) for _ in range(starts)])
            )
            for axes, size in shapes
        ],
    )


def _factor_shape(
    axis: int, before: list[int], seen: Screen, rows: Rows, held: Rows, generator: torch.Generator
) -> Shape:
    most = max(SIZES[0], len(rows) // PER_COMPONENT)
    first = max(size for size in SIZES if size <= min(FIRST, most))

    def score(axes: tuple[int, ...], size: int) -> Tensor:
        chains = _fitted(rows, held, axes, size, generator)
        with torch.no_grad():
            return log_conditional(chains, held.points[:, list(axes)])

    parents: tuple[int, ...] = ()
    best = score((axis,), first)
    while len(parents) < min(MOST_PARENTS, len(before)):
        proposed = seen.parents(axis, parents, before)[:PROPOSED]
        scores = {parent: score((*parents, parent, axis), first) for parent in proposed}
        parent = max(scores, key=lambda one: held.mean(scores[one]))
        if not _gains(gain_of(scores[parent], best, held.weights)):
            break
        parents, best = (*parents, parent), scores[parent]
    size, axes = first, (*parents, axis)
    while 2 * size <= min(SIZES[-1], most):
        value = score(axes, 2 * size)
        if gain_of(value, best, held.weights).nats < WORTHWHILE:
            break
        size, best = 2 * size, value
    return Shape(axes, size)


def _gains(gain: Gain) -> bool:
    return gain.nats > max(WORTHWHILE, gain.error)


def _fitted(
    rows: Rows, held: Rows, axes: tuple[int, ...], size: int, generator: torch.Generator
) -> VonMisesChains:
    own, beside = (Rows(part.points[:, list(axes)], part.weights) for part in (rows, held))
    start = spread_chains(Torus(len(axes)), own, size, torch.arange(len(axes)), generator)
    return fit_chain_mixture(start, own, beside, ITERATIONS, Budget(), patience=0, worthwhile=IDLE)


class Screen:
    """How much angles seem to say about each other: Gaussian mutual information of their waves.

    It uses a few moments only; what it proposes is then tried.

    Args:
        points: Points (N, d) in turns.
    """

    def __init__(self, points: Tensor) -> None:
        harmonics = torch.arange(1, HARMONICS + 1).to(points)
        angle = 2 * math.pi * points[..., None] * harmonics
        seen = torch.cat([angle.cos(), angle.sin()], dim=2).flatten(1)
        self.dim = points.shape[1]
        self.covariance = torch.cov(seen.mT)
        self.covariance += RIDGE * torch.eye(len(self.covariance)).to(points)

    def order(self) -> list[int]:
        """Return the angles in order: first the one that says most about the others.

        Each following one is the one about which those before say most.
        """
        pairs = torch.zeros(self.dim, self.dim, dtype=torch.float64)
        for i in range(self.dim):
            for j in range(i):
                pairs[i, j] = pairs[j, i] = self.between(i, j)
        order = [int(pairs.sum(dim=1).argmax())]
        while len(order) < self.dim:
            left = [i for i in range(self.dim) if i not in order]
            order.append(max(left, key=lambda i: float(pairs[i, order].max())))
        return order

    def parents(self, axis: int, known: tuple[int, ...], before: list[int]) -> list[int]:
        """Return the angles before an angle, by what they say about it beyond those that are known."""
        left = [i for i in before if i not in known]
        return sorted(left, key=lambda i: -self.between(axis, i, known))

    def between(self, one: int, other: int, known: tuple[int, ...] = ()) -> float:
        """Return the nats that two angles say about each other, beyond those that are known."""
        return 0.5 * (
            self._log_det(one, *known)
            + self._log_det(other, *known)
            - self._log_det(*known)
            - self._log_det(one, other, *known)
        )

    def _log_det(self, *axes: int) -> float:
        if not axes:
            return 0.0
        width = 2 * HARMONICS
        at = torch.cat([torch.arange(width) + width * axis for axis in axes])
        return float(torch.logdet(self.covariance[at][:, at]))
