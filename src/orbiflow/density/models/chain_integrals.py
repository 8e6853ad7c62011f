"""Von Mises chains of some of their angles, by quadrature over those that come before them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from orbiflow.density.models.terms import log_sum_exp
from orbiflow.typed_torch import listed, special, unique

if TYPE_CHECKING:
    from orbiflow.density.models.chains import VonMisesChains

SCALES = (1.0, 4.0, 16.0)
"""A component's concentrations are divided by these, each with its own weight: heavy tails."""

REACH = 7.0
"""Deviations from its mean beyond which an angle has no nodes."""

STEP = 0.9
"""Deviations between nodes, with which the trapezoidal rule is off by exp(-2 pi^2 / STEP^2)."""

FEWEST = 12
"""The fewest nodes of an angle."""

MOST, MOST_ALONE = 1024, 16_384
"""The most nodes of several hidden angles of a chain together, and of one. Where several need more,
the nodes are quasi-random."""

TABLE = 2048
"""Points of the distribution function whose inverse gives quasi-random nodes."""


@dataclass(frozen=True)
class Nodes:
    """Nodes of C components: log weights (C, Q) of sum 1, and offsets (C, Q) by axis."""

    log_weights: Tensor
    offsets: dict[int, Tensor]


def nodes_of(
    means: Tensor, kappa: Tensor, hidden: tuple[int, ...], observed: tuple[int, ...], seed: int = 0
) -> Iterator[tuple[Tensor, Nodes]]:
    """Yield the numbers of components, and their nodes; those that need as many come together.

    The trapezoidal rule over each hidden angle, as fine as it and the angles after it are sharp: to
    analytic functions it converges exponentially (Trefethen and Weideman, 2014). For means
    (C, d, 1 + 2 d) and concentrations (C, d); observed axes before a hidden one have slopes of 0 there.
    """
    count, d = kappa.shape
    if not hidden:
        yield torch.arange(count), Nodes(kappa.new_zeros(count, 1), {})
        return
    sharp = _sharpness(means, kappa, hidden, observed, d)
    reach = (REACH / kappa[:, hidden].clamp_min(1e-12).sqrt()).clamp_max(math.pi)
    sizes = (2 * reach * sharp.sqrt() / STEP).ceil().clamp_min(FEWEST)
    sizes = FEWEST * torch.exp2((sizes / FEWEST).log2().ceil())  # few different ones
    wanted, number = unique(sizes, dim=0, return_inverse=True)
    for k, size in enumerate(listed(wanted)):
        chosen = torch.nonzero(number == k)[:, 0]
        size = [min(int(s), MOST_ALONE) for s in size]
        fits = len(size) == 1 or math.prod(size) <= MOST
        own = kappa[chosen][:, hidden]
        rule = _trapezoidal(own, reach[chosen], size) if fits else _sobol(own, seed)
        yield chosen, Nodes(rule[0], dict(zip(hidden, rule[1], strict=True)))


def _sharpness(
    means: Tensor, kappa: Tensor, hidden: tuple[int, ...], observed: tuple[int, ...], d: int
) -> Tensor:
    """Return concentrations (C, H) of the integrand in each hidden angle, which bends others."""
    after = list(hidden + observed)
    columns: list[Tensor] = []
    for axis in hidden:
        slope = means[:, after, 1 + axis].square() + means[:, after, 1 + d + axis].square()
        columns.append(kappa[:, axis] + (kappa[:, after] * slope).sum(dim=1))
    return torch.stack(columns, dim=1)


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
    """Return `MOST` quasi-random nodes of equal weights, by von Mises quantiles."""
    count, axes = kappa.shape
    engine = torch.quasirandom.SobolEngine(axes, scramble=True, seed=seed)
    even = engine.draw(MOST, dtype=torch.float64)
    logs = kappa.new_full((count, MOST), -math.log(MOST))
    return logs, [quantiles(kappa[:, i], even[:, i]) for i in range(axes)]


def quantiles(kappa: Tensor, even: Tensor) -> Tensor:
    """Return von Mises quantiles (C, Q) of probabilities (Q,), by interpolation of a table."""
    reach = (REACH / kappa.clamp_min(1e-12).sqrt()).clamp_max(math.pi)[:, None]
    edge = torch.linspace(-1, 1, TABLE + 1, dtype=kappa.dtype) * reach
    middle = (edge[:, 1:] + edge[:, :-1]) / 2
    mass = torch.softmax(kappa[:, None] * (middle.cos() - 1), dim=1)
    below = torch.cat([torch.zeros_like(mass[:, :1]), mass.cumsum(dim=1)], dim=1)
    at = torch.searchsorted(below, even.expand(len(kappa), -1).contiguous(), right=True)
    at = at.clamp(1, TABLE)
    low = below.gather(1, at - 1)
    part = ((even - low) / (below.gather(1, at) - low).clamp_min(1e-300)).clamp(0, 1)
    start = edge.gather(1, at - 1)
    return start + part * (edge.gather(1, at) - start)


BLOCK_ENTRIES = 2_000_000
"""Entries of the table of points, components and nodes worked on at a time."""


@dataclass(frozen=True)
class _Group:
    """Components of one order: numbers (C,), the order, what is observed and hidden in it.

    Angles after the last that is observed integrate to 1 and are in neither.
    """

    components: Tensor
    order: tuple[int, ...]
    observed: tuple[int, ...]
    hidden: tuple[int, ...]


def chains_at(chains: VonMisesChains, points: Tensor, observed: list[int], seed: int = 0) -> Tensor:
    """Return log densities (N,) of the `observed` angles alone, at points (N, len(observed)).

    Angles before others that are not observed are integrated out at `nodes_of` them, spread about their
    means, which makes a mixture that is normalised however many nodes there are.
    """
    angle = torch.zeros(len(points), chains.order.shape[1], dtype=torch.float64)
    angle[:, observed] = 2 * math.pi * points.double()
    logs = [_group_at(chains, group, angle, seed) for group in _groups(chains, observed)]
    return log_sum_exp(torch.cat(logs, dim=1))


def _groups(chains: VonMisesChains, observed: list[int]) -> Iterator[_Group]:
    orders, number = unique(chains.order, dim=0, return_inverse=True)
    rows: list[list[int]] = listed(orders)
    for k, order in enumerate(rows):
        last = max(order.index(axis) for axis in observed)
        before = order[: last + 1]
        yield _Group(
            torch.nonzero(number == k)[:, 0],
            tuple(order),
            tuple(axis for axis in before if axis in observed),
            tuple(axis for axis in before if axis not in observed),
        )


def _group_at(chains: VonMisesChains, group: _Group, angle: Tensor, seed: int) -> Tensor:
    """Return log weight plus log density (N, C) of the group's components, each at every scale."""
    scale = torch.tensor(SCALES, dtype=torch.float64)
    means = chains.means[group.components].repeat_interleave(len(SCALES), dim=0)
    kappa = (chains.concentrations[group.components][:, None] / scale[:, None]).flatten(0, 1)
    constant = chains.log_weights[group.components].flatten()
    constant = constant - special.i0e(kappa[:, group.observed]).log().sum(dim=1)
    found = angle.new_empty(len(angle), len(means))
    for chosen, nodes in nodes_of(means, kappa, group.hidden, group.observed, seed):
        block = max(1, BLOCK_ENTRIES // nodes.log_weights.numel())
        parts = [
            _walked(part, means[chosen], kappa[chosen], group, nodes)
            for part in torch.split(angle, block)
        ]
        found[:, chosen] = torch.cat(parts) + constant[chosen]
    return found


def _walked(angle: Tensor, means: Tensor, kappa: Tensor, group: _Group, nodes: Nodes) -> Tensor:
    """Return logs (N, C) of the observed angles' factors without constants, summed over the nodes."""
    d = angle.shape[1]
    seen = torch.zeros(1 + 2 * d, dtype=angle.dtype)
    seen[[0, *(1 + j for j in group.observed), *(1 + d + j for j in group.observed)]] = 1
    known = (waves(angle) * seen) @ means.flatten(0, 1).mT
    known = known.reshape(len(angle), len(means), d)
    plain = torch.zeros_like(known[..., 0])  # what does not depend on the hidden angles
    bent: Tensor | None = None
    before: list[tuple[int, Tensor, Tensor]] = []
    for axis in group.order[: len(group.observed) + len(group.hidden)]:
        mean = known[..., axis]
        if before:
            mean = mean[..., None]
            for j, sin, cos in before:
                slope = means[:, axis, [1 + j, 1 + d + j], None]
                mean = mean + slope[:, 0] * sin + slope[:, 1] * cos
        if axis in group.hidden:
            drawn = (mean if before else mean[..., None]) + nodes.offsets[axis]
            before.append((axis, drawn.sin(), drawn.cos()))
        elif before:
            fit = (angle[:, None, None, axis] - mean).cos_().sub_(1).mul_(kappa[:, axis, None])
            bent = fit if bent is None else bent.add_(fit)
        else:
            plain = plain + kappa[:, axis] * ((angle[:, None, axis] - mean).cos() - 1)
    return plain if bent is None else plain + log_sum_exp(bent + nodes.log_weights)


def waves(angle: Tensor) -> Tensor:
    """Return 1, sin and cos of angles (N, d) in radians: (N, 1 + 2 d)."""
    return torch.cat([torch.ones_like(angle[:, :1]), angle.sin(), angle.cos()], dim=1)
