"""Networks of some of their angles: exact where no parent is hidden, by weighted draws elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from orbiflow.density.inference.chains import quantiles
from orbiflow.density.models import (
    SCALES,
    Factor,
    VonMisesChains,
    VonMisesNetwork,
    log_conditional,
    log_of_parents,
    log_sum_exp,
    shares_of,
    waves,
)
from orbiflow.typed_torch import (
    broadcast,
    listed,
    special,
    unique,
)

DRAWS = 4096
"""Quasi-random draws of the hidden angles."""

AT_ONCE = 2**17
"""Points times draws that are worked on at a time."""

ROWS, ENTRIES = 256, 2**18
"""Rows of angles, and terms of a sum, at a time: few enough for the cache."""


def network_at(
    network: VonMisesNetwork, points: Tensor, observed: list[int], seed: int = 0
) -> Tensor:
    """Log density (N,) of the `observed` angles alone, at points (N, len(observed)).

    Angles from which no arrow leads to an observed one integrate to 1. Parents that are hidden are
    drawn, each given its own, and the observed angles weigh the draws (likelihood weighting: Fung and
    Chang, 1990). The draws are quasi-random and the same at all points; `seed` is theirs.
    """
    points = points.double()
    if not len(points):
        return points.new_zeros(0)
    factors = _leading_to(network, observed)
    hidden = [axes[-1] for axes, _ in factors if axes[-1] not in observed]
    count = DRAWS if hidden else 1
    draws = torch.quasirandom.SobolEngine(max(1, 2 * len(hidden)), scramble=True, seed=seed).draw(
        count, dtype=torch.float64
    )
    even = {axis: draws[:, 2 * k : 2 * k + 2] for k, axis in enumerate(hidden)}
    same: list[bool] = listed((points == points[0]).all(dim=0))
    known = {axis: points[:1, k, None] for k, axis in enumerate(observed) if same[k]}
    once = _Once.of(factors, known, even)
    found: list[Tensor] = []
    for block in torch.split(points, AT_ONCE // count):
        at = {axis: block[:, k, None] for k, axis in enumerate(observed) if not same[k]}
        logs = once.weighted(at, even).expand(len(block), count)
        found.append(log_sum_exp(logs) - math.log(count))
    return torch.cat(found)


def draws_anew(network: VonMisesNetwork, observed: list[int], kept: list[int]) -> bool:
    """Whether hidden angles are drawn for each point anew, as they depend on angles that are kept."""
    moving = set(kept)
    for axes, _ in _leading_to(network, observed):
        if axes[-1] not in observed and moving & set(axes[:-1]):
            return True
    return False


def _leading_to(network: VonMisesNetwork, observed: list[int]) -> list[Factor]:
    """The factors of the observed angles, and of all from which arrows lead to them."""
    wanted = set(observed)
    found: list[Factor] = []
    for factor in reversed(network.factors):
        if factor.axes[-1] in wanted:
            wanted |= set(factor.axes)
            found.append(factor)
    return found[::-1]


@dataclass(frozen=True)
class _Mixture:
    """Of an angle given draws of its parents: logs of weights (Q, C), means (Q, C), kappa (C,)."""

    logs: Tensor
    means: Tensor
    kappa: Tensor

    @classmethod
    def of(cls, chains: VonMisesChains, axes: tuple[int, ...], at: dict[int, Tensor]) -> _Mixture:
        around = {**at, axes[-1]: torch.zeros(1, 1, dtype=torch.float64)}
        logs = _along(lambda p: log_of_parents(chains, p).mT.flatten(1), axes, around)[0]
        scale = torch.tensor(SCALES, dtype=torch.float64)
        kappa = (chains.concentrations[:, -1, None] / scale).flatten()
        logs = logs - log_sum_exp(logs)[:, None] - special.i0e(kappa).log()
        wave = _along(lambda p: waves(2 * math.pi * p), axes, around)[0]
        means = (wave @ chains.means[:, -1].mT).repeat_interleave(len(SCALES), dim=1)
        return cls(logs, means, kappa)

    def log_prob(self, angle: Tensor) -> Tensor:
        """(N, Q) at angles (N, 1) in turns; equal ones are worked on once."""
        own, place = unique(angle[:, 0], return_inverse=True)
        rows = torch.split(2 * math.pi * own[:, None, None], max(1, ENTRIES // self.logs.numel()))
        found = [
            log_sum_exp((row - self.means).cos_().sub_(1).mul_(self.kappa).add_(self.logs))
            for row in rows
        ]
        return torch.cat(found)[place]


@dataclass(frozen=True)
class _Once:
    """What does not depend on the points, and is worked on once.

    - `factors`: those that do.
    - `at`: angles that are known (1, 1) or drawn (1, Q). `total`: log density of those that are known.
    - `mixtures`: of angles whose parents are among them.
    """

    factors: list[Factor]
    at: dict[int, Tensor]
    total: Tensor
    mixtures: dict[int, _Mixture]

    @classmethod
    def of(cls, factors: list[Factor], known: dict[int, Tensor], even: dict[int, Tensor]) -> _Once:
        at, mixtures = dict(known), dict[int, _Mixture]()
        total = torch.zeros(1, 1, dtype=torch.float64)
        left: list[Factor] = []
        for axes, chains in factors:
            axis = axes[-1]
            fixed = all(parent in at for parent in axes[:-1])
            if fixed and axis in even:
                at[axis] = _drawn(chains, axes, at, even[axis])
            elif fixed and axis in at:
                total = total + _along(lambda p, c=chains: log_conditional(c, p), axes, at)
            else:
                left.append(Factor(axes, chains))
                if fixed:
                    mixtures[axis] = _Mixture.of(chains, axes, at)
        return cls(left, at, total, mixtures)

    def weighted(self, points: dict[int, Tensor], even: dict[int, Tensor]) -> Tensor:
        """Log density of what is seen, given what is drawn: (N, Q), or what broadcasts to it."""
        at, total = {**self.at, **points}, self.total
        for axes, chains in self.factors:
            axis = axes[-1]
            if axis in even:
                at[axis] = _drawn(chains, axes, at, even[axis])
            elif axis in self.mixtures:
                total = total + self.mixtures[axis].log_prob(at[axis])
            else:
                total = total + _along(lambda p, c=chains: log_conditional(c, p), axes, at)
        return total


def _along(
    function: Callable[[Tensor], Tensor], axes: tuple[int, ...], at: dict[int, Tensor]
) -> Tensor:
    """A function of points (R, len(axes)), at angles whose shapes broadcast: in their common one."""
    own = broadcast(*[at[axis] for axis in axes])
    rows = torch.stack(own, dim=-1).flatten(0, 1)
    value = torch.cat([function(block) for block in torch.split(rows, ROWS)])
    return value.reshape(*own[0].shape, *value.shape[1:])


def _drawn(
    chains: VonMisesChains, axes: tuple[int, ...], at: dict[int, Tensor], even: Tensor
) -> Tensor:
    """The last of the angles, (N, Q) or (1, Q), given its parents, at probabilities (Q, 2)."""
    around = {**at, axes[-1]: even.new_zeros(1, 1)}
    shares = _along(lambda p: shares_of(log_of_parents(chains, p).mT.flatten(1)), axes, around)
    rows = len(shares)
    below = shares.cumsum(dim=-1).expand(rows, len(even), -1).contiguous()
    chosen = torch.searchsorted(below, even[None, :, :1].expand(rows, -1, 1).contiguous())[..., 0]
    chosen = chosen.clamp_max(below.shape[-1] - 1)
    component = chosen // len(SCALES)
    kappa = chains.concentrations[:, -1, None] / torch.tensor(SCALES, dtype=torch.float64)
    offset = quantiles(kappa.flatten(), even[:, 1])[chosen, torch.arange(len(even))]
    wave = _along(lambda p: waves(2 * math.pi * p), axes, around)
    mean = (wave * chains.means[:, -1][component]).sum(dim=-1)
    return (mean + offset) / (2 * math.pi)
