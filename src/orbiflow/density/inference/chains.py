"""Von Mises chains of some angles: closed where chains end or begin, by quadrature elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from orbiflow.density.inference.axes import Split
from orbiflow.density.models import (
    SCALES,
    VonMisesChains,
    log_sum_exp,
    shares_of,
    waves,
)
from orbiflow.density.spaces import Torus
from orbiflow.typed_torch import (
    listed,
    special,
    unique,
)

REACH = 7.0
"""Deviations from its mean at which an angle is not looked at any more."""

STEP = 0.9
"""Deviations between nodes: the trapezoidal rule is then off by exp(-2 pi^2 / STEP^2)."""

FEWEST = 12
"""Nodes of an angle."""

MOST, MOST_ALONE = 1024, 16_384
"""Nodes of several hidden angles of a chain together, and of one. Where several need more, as many are
quasi-random."""

TABLE = 2048
"""Points of the distribution function that is inverted for quasi-random nodes."""


@dataclass(frozen=True)
class Nodes:
    """Of C components: `log_weights` (C, Q) whose exponentials sum to 1, offsets (C, Q) by axis."""

    log_weights: Tensor
    offsets: dict[int, Tensor]

    @property
    def count(self) -> int:
        """Nodes Q of a component."""
        return self.log_weights.shape[1]


def nodes_of(
    means: Tensor, kappa: Tensor, hidden: tuple[int, ...], observed: tuple[int, ...], seed: int = 0
) -> Iterator[tuple[Tensor, Nodes]]:
    """Numbers of components, and their nodes; components that need as many come together.

    The trapezoidal rule over each hidden angle, as fine as it and the angles after it are sharp: to
    analytic functions it converges exponentially (Trefethen and Weideman, 2014).

    Args:
        means: (C, d, 1 + 2 d), see `VonMisesChains`.
        kappa: concentrations (C, d).
        hidden: axes that are integrated out.
        observed: axes that are not; those before a hidden one do not depend on it, with slopes of 0.
        seed: of quasi-random nodes.
    """
    count, d = kappa.shape
    if not hidden:
        nothing = Nodes(kappa.new_zeros(count, 1), {})
        yield torch.arange(count), nothing
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
    """Concentrations (C, H) of the integrand in each hidden angle: its own and those bent by it."""
    after = list(hidden + observed)
    columns: list[Tensor] = []
    for axis in hidden:
        slope = means[:, after, 1 + axis].square() + means[:, after, 1 + d + axis].square()
        columns.append(kappa[:, axis] + (kappa[:, after] * slope).sum(dim=1))
    return torch.stack(columns, dim=1)


def _trapezoidal(kappa: Tensor, reach: Tensor, sizes: list[int]) -> tuple[Tensor, list[Tensor]]:
    """A product of rules: log weights (C, Q) and offsets (C, Q) an axis."""
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
    """`MOST` quasi-random nodes of equal weights, by quantiles of the von Mises distributions."""
    count, axes = kappa.shape
    engine = torch.quasirandom.SobolEngine(axes, scramble=True, seed=seed)
    even = engine.draw(MOST, dtype=torch.float64)
    logs = kappa.new_full((count, MOST), -math.log(MOST))
    return logs, [quantiles(kappa[:, i], even[:, i]) for i in range(axes)]


def quantiles(kappa: Tensor, even: Tensor) -> Tensor:
    """Von Mises quantiles (C, Q) of probabilities (Q,), by interpolation of a table."""
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
"""Of the table of points, components and nodes worked on at a time."""


@dataclass(frozen=True)
class _Group:
    """Components of one order: numbers (C,), the order, what is observed and hidden in it.

    Angles after the last that is observed integrate to 1 and are in neither.
    """

    components: Tensor
    order: tuple[int, ...]
    observed: tuple[int, ...]
    hidden: tuple[int, ...]


def partial_chains(
    chains: VonMisesChains, split: Split, space: Torus
) -> tuple[VonMisesChains | None, float, VonMisesChains | None, float]:
    """Chains of the kept angles where they are chains again, and those left, where they are not.

    Closed are components in which all that is given comes first and all that is integrated out last.

    Returns:
        Closed chains on `space`, or None; the log of their share times their log density at what is
        given; the others, all angles, or None; the log of their share.
    """
    order = chains.order
    place = order.argsort(dim=1)
    kept, given = list(split.kept), list(split.given)
    hidden = [axis for axis in range(split.dim) if axis not in split.observed]
    closed = torch.ones(len(order), dtype=torch.bool)
    first = place[:, kept].amin(dim=1)
    last = place[:, list(split.observed)].amax(dim=1)
    if given:
        closed &= place[:, given].amax(dim=1) < first
    if hidden:
        closed &= place[:, hidden].amin(dim=1) > last
    rest, rest_log = _some(chains, ~closed)
    some, some_log = _some(chains, closed)
    if some is None:
        return None, -math.inf, rest, rest_log
    found, evidence = _closed(some, split, space)
    return found, some_log + evidence, rest, rest_log


def _some(chains: VonMisesChains, chosen: Tensor) -> tuple[VonMisesChains | None, float]:
    if not bool(chosen.any()) or bool((chains.log_weights[chosen] == -math.inf).all()):
        return None, -math.inf
    logs = chains.log_weights[chosen]
    total = float(logs.flatten().logsumexp(0))
    found = VonMisesChains(
        chains.space,
        logs - total,
        chains.means[chosen],
        chains.concentrations[chosen],
        chains.order[chosen],
    )
    return found, total


def _closed(chains: VonMisesChains, split: Split, space: Torus) -> tuple[VonMisesChains, float]:
    """Chains of the kept angles, their constants moved and their weights changed by what is given."""
    kept, given, d = list(split.kept), list(split.given), split.dim
    logs, means, evidence = chains.log_weights, chains.means, 0.0
    constant = means[:, :, 0]
    if given:
        angle = torch.zeros(1, d, dtype=torch.float64)
        angle[0, given] = 2 * math.pi * torch.tensor(split.values, dtype=torch.float64)
        known = torch.zeros(1 + 2 * d, dtype=torch.float64)
        at = [0, *(1 + j for j in given), *(1 + d + j for j in given)]
        known[at] = waves(angle)[0, at]
        constant = means @ known
        residual = angle[0, given] - constant[:, given]
        kappa = chains.concentrations[:, given, None] / torch.tensor(SCALES)
        logs = logs + (kappa * (residual.cos() - 1)[..., None] - special.i0e(kappa).log()).sum(
            dim=1
        )
        evidence = float(log_sum_exp(logs.flatten()))
        logs = shares_of(logs.flatten()).log().reshape(logs.shape)
    at = [*(1 + j for j in kept), *(1 + d + j for j in kept)]
    some = torch.cat([constant[:, kept, None], means[:, kept][:, :, at]], dim=2)
    order = chains.order.argsort(dim=1)[:, kept].argsort(dim=1)
    return VonMisesChains(space, logs, some, chains.concentrations[:, kept], order), evidence


def chains_at(chains: VonMisesChains, points: Tensor, observed: list[int], seed: int = 0) -> Tensor:
    """Log density (N,) of the `observed` angles alone, at points (N, len(observed)).

    Angles that come before others and are not observed are integrated out at `nodes_of` them, spread
    about their means, which makes a mixture that is normalised however many nodes there are; `seed` is
    of those that are quasi-random.
    """
    angle = torch.zeros(len(points), chains.space.dim, dtype=torch.float64)
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
    """Logs (N, C) of weight times density of the group's components, each at every scale."""
    scale = torch.tensor(SCALES, dtype=torch.float64)
    means = chains.means[group.components].repeat_interleave(len(SCALES), dim=0)
    kappa = (chains.concentrations[group.components][:, None] / scale[:, None]).flatten(0, 1)
    constant = chains.log_weights[group.components].flatten()
    constant = constant - special.i0e(kappa[:, group.observed]).log().sum(dim=1)
    found = angle.new_empty(len(angle), len(means))
    for chosen, nodes in nodes_of(means, kappa, group.hidden, group.observed, seed):
        block = max(1, BLOCK_ENTRIES // (len(chosen) * nodes.count))
        parts = [
            _walked(part, means[chosen], kappa[chosen], group, nodes)
            for part in torch.split(angle, block)
        ]
        found[:, chosen] = torch.cat(parts) + constant[chosen]
    return found


def _walked(angle: Tensor, means: Tensor, kappa: Tensor, group: _Group, nodes: Nodes) -> Tensor:
    """Logs (N, C) of the observed angles' factors, less their constants, summed over the nodes."""
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
