"""Networks of some of their angles: exact where no parent is hidden, by weighted draws elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from orbiflow.density.models.chains import SCALES, VonMisesChains, waves
from orbiflow.density.models.log_sum import log_sum_exp, shares_of
from orbiflow.density.models.network import (
    Factor,
    VonMisesNetwork,
    log_conditional,
    log_of_parents,
)
from orbiflow.density.partial.nodes import quantiles
from orbiflow.typed_torch import broadcast

DRAWS = 1024
"""Quasi-random draws of the hidden angles."""

AT_ONCE = 2**17
"""Points times draws that are worked on at a time."""


def network_at(
    network: VonMisesNetwork, points: Tensor, observed: list[int], seed: int = 0
) -> Tensor:
    """Log density (N,) of the `observed` angles alone, at points (N, len(observed)).

    Angles from which no arrow leads to an observed one integrate to 1. Parents that are hidden are
    drawn, each given its own, and the observed angles weigh the draws (likelihood weighting: Fung and
    Chang, 1990). The draws are quasi-random and the same at all points; `seed` is theirs.
    """
    factors = _leading_to(network, observed)
    hidden = [axes[-1] for axes, _ in factors if axes[-1] not in observed]
    count = DRAWS if hidden else 1
    draws = torch.quasirandom.SobolEngine(max(1, 2 * len(hidden)), scramble=True, seed=seed).draw(
        count, dtype=torch.float64
    )
    even = {axis: draws[:, 2 * k : 2 * k + 2] for k, axis in enumerate(hidden)}
    found: list[Tensor] = []
    for block in torch.split(points.double(), AT_ONCE // count):
        seen = dict(zip(observed, block.mT, strict=True))
        found.append(_weighted(factors, seen, even).expand(len(block), count))
    return log_sum_exp(torch.cat(found)) - math.log(count)


def _leading_to(network: VonMisesNetwork, observed: list[int]) -> list[Factor]:
    """The factors of the observed angles, and of all from which arrows lead to them."""
    wanted = set(observed)
    found: list[Factor] = []
    for factor in reversed(network.factors):
        if factor.axes[-1] in wanted:
            wanted |= set(factor.axes)
            found.append(factor)
    return found[::-1]


def _weighted(factors: list[Factor], seen: dict[int, Tensor], even: dict[int, Tensor]) -> Tensor:
    """Log density of what is seen (N,) given what is drawn: (N, Q), or what broadcasts to it."""
    at = {axis: _once(value)[:, None] for axis, value in seen.items()}
    total = torch.zeros(1, 1, dtype=torch.float64)
    for axes, chains in factors:
        if axes[-1] in seen:
            total = total + _along(lambda p, c=chains: log_conditional(c, p), axes, at)
        else:
            at[axes[-1]] = _drawn(chains, axes, at, even[axes[-1]])
    return total


def _once(value: Tensor) -> Tensor:
    """What is known is the same at all points, and is worked on once."""
    return value[:1] if bool((value == value[0]).all()) else value


def _along(
    function: Callable[[Tensor], Tensor], axes: tuple[int, ...], at: dict[int, Tensor]
) -> Tensor:
    """A function of points (R, len(axes)), at angles whose shapes broadcast: in their common one."""
    own = broadcast(*[at[axis] for axis in axes])
    value = function(torch.stack(own, dim=-1).flatten(0, 1))
    return value.reshape(*own[0].shape, *value.shape[1:])


def _drawn(
    chains: VonMisesChains, axes: tuple[int, ...], at: dict[int, Tensor], even: Tensor
) -> Tensor:
    """The last of the angles (N or 1, Q), given its parents, at probabilities (Q, 2)."""
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
