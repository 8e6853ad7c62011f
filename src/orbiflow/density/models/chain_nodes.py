"""Nodes at which von Mises chains are integrated over hidden angles, on tori."""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
from torch import Tensor

from orbiflow.typed_torch import listed, unique

REACH_DEVIATIONS = 7.0
"""Deviations from its mean beyond which an angle has no nodes."""

STEP_DEVIATIONS = 0.9
"""Deviations between nodes: the trapezoidal rule is then off by exp(-2 pi^2 / 0.9^2)."""

MIN_NODES = 12
"""The fewest nodes of an angle."""

MAX_NODES, MAX_NODES_ALONE = 1024, 16_384
"""The most nodes of several hidden angles of a chain together, and of one. Where several need more,
the nodes are quasi-random."""

TABLE_POINTS = 2048
"""Points of the distribution function whose inverse gives quasi-random nodes."""


def nodes_of(
    means: Tensor, kappa: Tensor, hidden: list[int], observed: list[int], seed: int
) -> Iterator[tuple[Tensor, Tensor, dict[int, Tensor]]]:
    """Yield numbers of components, and log weights (C, Q) of sum 1 and offsets (C, Q) of their nodes.

    Offsets are by axis; components that need as many come together.

    The trapezoidal rule over each hidden angle, as fine as it and the angles after it are sharp: to
    analytic functions it converges exponentially (Trefethen and Weideman, 2014). For means
    (C, d, 1 + 2 d) and concentrations (C, d); observed axes before a hidden one have slopes of 0 there.
    """
    count = len(kappa)
    if not hidden:
        yield torch.arange(count), kappa.new_zeros(count, 1), {}
        return
    reach, sizes = node_counts(means, kappa, hidden, observed)
    wanted, number = unique(sizes, dim=0, return_inverse=True)
    for k, size in enumerate(listed(wanted)):
        chosen = torch.nonzero(number == k)[:, 0]
        size = [min(int(s), MAX_NODES_ALONE) for s in size]
        fits = len(size) == 1 or math.prod(size) <= MAX_NODES
        own = kappa[chosen][:, hidden]
        rule = _trapezoidal(own, reach[chosen], size) if fits else _sobol(own, seed)
        yield chosen, rule[0], dict(zip(hidden, rule[1], strict=True))


def node_counts(
    means: Tensor, kappa: Tensor, hidden: list[int], observed: list[int]
) -> tuple[Tensor, Tensor]:
    """Return how far nodes reach from the mean of each hidden angle, and how many there are (C, H)."""
    # concentrations (C, H) of the integrand in each hidden angle, which bends others
    after, d = hidden + observed, kappa.shape[1]
    slope = means[:, after][:, :, [1 + axis for axis in hidden]].square()
    slope += means[:, after][:, :, [1 + d + axis for axis in hidden]].square()
    sharp = kappa[:, hidden] + (kappa[:, after, None] * slope).sum(dim=1)
    reach = (REACH_DEVIATIONS / kappa[:, hidden].clamp_min(1e-12).sqrt()).clamp_max(math.pi)
    sizes = (2 * reach * sharp.sqrt() / STEP_DEVIATIONS).ceil().clamp_min(MIN_NODES)
    return reach, MIN_NODES * torch.exp2((sizes / MIN_NODES).log2().ceil())  # few different ones


def _trapezoidal(kappa: Tensor, reach: Tensor, sizes: list[int]) -> tuple[Tensor, list[Tensor]]:
    """Return a product of rules: log weights (C, Q), and offsets (C, Q) for each axis."""
    logs: list[Tensor] = []
    offsets: list[Tensor] = []
    for i, size in enumerate(sizes):
        step = (torch.arange(size, dtype=kappa.dtype) + 0.5) / size * 2 - 1
        offset = reach[:, i, None] * step
        logs.append(torch.log_softmax(kappa[:, i, None] * (offset.cos() - 1), dim=1))
        offsets.append(offset)
    shape = (len(kappa), *sizes)

    def spread(value: Tensor, i: int) -> Tensor:
        own = [1] * len(sizes)
        own[i] = sizes[i]
        return value.reshape(len(kappa), *own).expand(shape).flatten(1)

    total = torch.stack([spread(value, i) for i, value in enumerate(logs)]).sum(dim=0)
    return total, [spread(value, i) for i, value in enumerate(offsets)]


def _sobol(kappa: Tensor, seed: int) -> tuple[Tensor, list[Tensor]]:
    """Return `MAX_NODES` quasi-random nodes of equal weights, by von Mises quantiles."""
    count, axes = kappa.shape
    engine = torch.quasirandom.SobolEngine(axes, scramble=True, seed=seed)
    even = engine.draw(MAX_NODES, dtype=torch.float64)
    logs = kappa.new_full((count, MAX_NODES), -math.log(MAX_NODES))
    return logs, [quantiles(kappa[:, i], even[:, i]) for i in range(axes)]


def quantiles(kappa: Tensor, even: Tensor) -> Tensor:
    """Return von Mises quantiles (C, Q) of probabilities (Q,), by interpolation of a table."""
    reach = (REACH_DEVIATIONS / kappa.clamp_min(1e-12).sqrt()).clamp_max(math.pi)[:, None]
    edge = torch.linspace(-1, 1, TABLE_POINTS + 1, dtype=kappa.dtype) * reach
    middle = (edge[:, 1:] + edge[:, :-1]) / 2
    mass = torch.softmax(kappa[:, None] * (middle.cos() - 1), dim=1)
    below = torch.cat([torch.zeros_like(mass[:, :1]), mass.cumsum(dim=1)], dim=1)
    at = torch.searchsorted(below, even.expand(len(kappa), -1).contiguous(), right=True)
    at = at.clamp(1, TABLE_POINTS)
    low = below.gather(1, at - 1)
    part = ((even - low) / (below.gather(1, at) - low).clamp_min(1e-300)).clamp(0, 1)
    start = edge.gather(1, at - 1)
    return start + part * (edge.gather(1, at) - start)
