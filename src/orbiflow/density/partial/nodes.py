"""Where angles that are not observed are looked at: nodes of a quadrature about their means."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from orbiflow.typed_torch import listed, unique

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
