"""The density of some angles of a flow on two or three, by the trapezoidal rule over the others."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from orbiflow.density.models.symmetric import SymmetricDensity
from orbiflow.errors import OrbiflowError

FIRST, MOST = {1: 64, 2: 16}, {1: 512, 2: 64}
"""Nodes of each hidden angle at first and at most, by the number of hidden angles."""

SETTLED = 1e-7
"""Mean nats by which twice as many nodes may change the result."""

BLOCK = 65_536
"""Points at a time."""


def flow_at(density: SymmetricDensity, points: Tensor, observed: list[int]) -> Tensor:
    """Log density (N,) of the `observed` angles alone, at points (N, len(observed)).

    The others are integrated by the trapezoidal rule, which converges exponentially for periodic
    smooth functions; nodes are doubled until they change nothing.

    Raises:
        OrbiflowError: where more than two angles would have to be integrated out.
    """
    hidden = [axis for axis in range(density.space.dim) if axis not in observed]
    if len(hidden) > 2:
        raise OrbiflowError(
            f"a flow's density cannot be integrated over {len(hidden)} angles: fit without it, "
            '--parts kernels,mixture,chains (parts="kernels,mixture,chains")'
        )
    if not hidden:
        return _at(density, points, observed, hidden, points.new_zeros(1, 0))[:, 0]
    sums, count = None, FIRST[len(hidden)]
    now: Tensor | None = None
    while True:
        fresh = _nodes(count, len(hidden), all_of_them=sums is None)
        total = _at(density, points, observed, hidden, fresh).logsumexp(dim=1)
        sums = total if sums is None else torch.logaddexp(sums, total)
        last, now = now, sums - len(hidden) * math.log(count)
        settled = last is not None and float((now - last).abs().mean()) < SETTLED
        if settled or count >= MOST[len(hidden)]:
            return now
        count *= 2


def _nodes(count: int, axes: int, *, all_of_them: bool) -> Tensor:
    """An even grid (Q, axes) of `count` nodes an axis, or what half as many have not."""
    k = torch.arange(count)
    grid = torch.cartesian_prod(*[k] * axes).reshape(-1, axes)
    if not all_of_them:
        grid = grid[(grid % 2 == 1).any(dim=1)]
    return grid.double() / count


def _at(
    density: SymmetricDensity, points: Tensor, observed: list[int], hidden: list[int], nodes: Tensor
) -> Tensor:
    """Log densities (N, Q) of all angles, each point at each node."""
    parts: list[Tensor] = []
    for block in torch.split(points.double(), max(1, BLOCK // len(nodes))):
        whole = block.new_empty(len(block), len(nodes), density.space.dim)
        whole[:, :, observed] = block[:, None]
        whole[:, :, hidden] = nodes
        with torch.no_grad():
            parts.append(density.log_prob(whole))
    return torch.cat(parts)
