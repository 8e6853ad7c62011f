"""Mixtures of von Mises chains, integrated over hidden angles: nodes, and tables of what is seen.

A component is sharp and covers little of the circle, so its table is as fine as it is sharp and no
wider than it reaches. What a component hides is integrated at nodes, which all of its table share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from orbiflow.density.models.chain_sums import SCALES
from orbiflow.density.models.density import Split
from orbiflow.density.models.kernels import KERNEL_STEP, sharpest_on
from orbiflow.density.models.sums import FAINT_LOG, LOG2_E
from orbiflow.typed_torch import broadcast, listed, special, unique

if TYPE_CHECKING:
    from orbiflow.density.models.chains import VonMisesChains


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
        rule = _trapezoidal(own, reach[chosen], size) if fits else _sobol(own, MAX_NODES, seed)
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


def _sobol(kappa: Tensor, count: int, seed: int) -> tuple[Tensor, list[Tensor]]:
    """Return quasi-random nodes of equal weights, by von Mises quantiles."""
    axes = kappa.shape[1]
    engine = torch.quasirandom.SobolEngine(axes, scramble=True, seed=seed)
    even = engine.draw(count, dtype=torch.float64)
    logs = kappa.new_full((len(kappa), count), -math.log(count))
    return logs, [quantiles(kappa[:, i], even[:, i]) for i in range(axes)]


def _nodes(kappa: Tensor, count: int, seed: int) -> tuple[Tensor, list[Tensor]]:
    """Return log weights (C, Q) and offsets (C, Q) of nodes of angles of concentrations (C, H)."""
    if kappa.shape[1] != 1:
        return (
            _sobol(kappa, count, seed) if kappa.shape[1] else (kappa.new_zeros(len(kappa), 1), [])
        )
    reach = (REACH_DEVIATIONS / kappa.clamp_min(1e-12).sqrt()).clamp_max(math.pi)
    return _trapezoidal(kappa, reach, [count])


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


GRID_SIZES = (24, 48, 96, 192, 384, 768, 1536, 3072)
"""Numbers of points of a grid along an angle."""

MAX_GRID_SIZES = {1: 3072, 2: 768}
"""The most of them, by the number of angles kept."""

FAINTEST_LOG = 25.0
"""Components whose logarithm is further than this below that of the largest are left out."""

FIRST_NODES = 24
"""Nodes of hidden angles at first. Each level has twice as many of one angle, four times of several."""

BLOCK_ENTRIES = 2**18
"""Entries worked on at a time: few enough for the cache."""

WIDE_CONCENTRATION = 8.0
"""Concentration below which a given angle does not tell how likely a component is."""


def chain_tables(
    chains: VonMisesChains, split: Split, level: int, start: float, tick: Callable[[], None]
) -> tuple[float, list[Tensor]]:
    """Return tables (n,) or (n, m) on even grids whose sum is the density of what is kept and given.

    First comes the logarithm of their scale. The grids begin at `start`, in turns; each level has more
    nodes of the hidden angles.
    """
    scale = torch.tensor(SCALES, dtype=torch.float64)
    kappa = (chains.concentrations[:, None] / scale[:, None]).flatten(0, 1)
    means, logs = chains.means.repeat_interleave(len(SCALES), dim=0), chains.log_weights.flatten()
    orders, number = unique(chains.order, dim=0, return_inverse=True)
    number = number.repeat_interleave(len(SCALES))
    walks: list[_Walk] = []
    for k, order in enumerate(listed(orders)):
        last = max(order.index(axis) for axis in split.observed)
        own = number == k
        walks.append(_Walk(order[: last + 1], split, logs[own], means[own], kappa[own]))
    top = max(float(walk.likely.max()) for walk in walks)
    tables: dict[tuple[int, ...], Tensor] = {}
    for walk in walks:
        tick()
        walk.add_to(tables, top, level, start)
    return top, [*tables.values()]


class _Walk:
    """Components (C,) of one order, walked from the first angle to the last that is observed.

    To first order an angle is the sum of its own noise and that of the angles before it.

    - `middle`, `reach`: The angles (C, d) where all noise is 0, and how far they reach from there.
    - `likely`: The logarithm (C,) of weight times the density of what is given, roughly.
    - `wanted`, `widths`: Sizes (C, K) of grids that resolve the angles kept, and of windows in them.
    """

    def __init__(
        self, order: list[int], split: Split, logs: Tensor, means: Tensor, kappa: Tensor
    ) -> None:
        self.order, self.split = order, split
        self.logs, self.means, self.kappa = logs, means, kappa
        d = split.dim
        self.hidden = [axis for axis in order if axis not in split.observed]
        given = dict(zip(split.given, split.values, strict=True))
        self.middle = means[:, :, 0].clone()
        # (C, d, d): of each angle, from each
        noise = torch.diag_embed(kappa.clamp_min(1e-12).rsqrt())
        bend = torch.zeros_like(kappa)
        self.reach = torch.zeros_like(kappa)
        self.likely = logs.clone()
        for place, axis in enumerate(order):
            for j in order[:place]:
                sin, cos = means[:, axis, 1 + j], means[:, axis, 1 + d + j]
                at = self.middle[:, j]
                slope, most = sin * at.cos() - cos * at.sin(), torch.hypot(sin, cos)
                self.middle[:, axis] += sin * at.sin() + cos * at.cos()
                noise[:, axis] += slope[:, None] * noise[:, j]
                curved = slope.abs() * bend[:, j] + most * (self.reach[:, j] / 2) ** 2 / 2
                bend[:, axis] += torch.minimum(curved, 2 * most)
            self.reach[:, axis] = (
                REACH_DEVIATIONS * noise[:, axis].square().sum(dim=1).sqrt() + bend[:, axis]
            )
            if axis in given:
                at = torch.tensor(2 * math.pi * given[axis], dtype=torch.float64)
                rough = (
                    noise[:, axis].square().sum(dim=1)
                    + bend[:, axis].square()
                    + 1 / WIDE_CONCENTRATION**2
                )
                self.likely += ((at - self.middle[:, axis]).cos() - 1) / rough - rough.log() / 2
                self.middle[:, axis] = at
                noise[:, axis], bend[:, axis], self.reach[:, axis] = 0, 0, 0
        sharp = kappa.clone()
        joint = torch.zeros_like(kappa[:, 0])
        for axis in split.observed:
            slopes = torch.hypot(means[:, axis, 1 : 1 + d], means[:, axis, 1 + d :])
            sharp += kappa[:, axis, None] * slopes.square()
            own = slopes.index_fill(1, torch.tensor(axis), 1.0)[:, list(split.kept)]
            joint += kappa[:, axis] * own.prod(dim=1)
        apart = sharp[:, list(split.kept)]
        # kernels along the axes stand for a slanted bump only if they are narrower than its narrow side
        both = apart.prod(dim=1).sqrt().clamp_min(1e-12)  # 0 where both angles are even
        slanted = joint / both if apart.shape[1] > 1 else 0 * joint
        apart = apart * (1 + slanted.clamp_max(1))[:, None]
        count = 2 * math.pi / KERNEL_STEP * apart.sqrt()
        sizes = torch.tensor(
            [size for size in GRID_SIZES if size <= MAX_GRID_SIZES[len(split.kept)]]
        )
        self.wanted = sizes[torch.searchsorted(sizes, count).clamp_max(len(sizes) - 1)]
        reach = (self.reach[:, list(split.kept)] / (2 * math.pi) * self.wanted).ceil().long() + 1
        self.widths = torch.minimum(2 * reach + 1, self.wanted)

    def add_to(
        self, tables: dict[tuple[int, ...], Tensor], top: float, level: int, start: float
    ) -> None:
        """Add the densities of components, relative to exp(top), to tables of their sizes."""
        likely = torch.nonzero(self.likely > top - FAINTEST_LOG)[:, 0]
        sizes, number = unique(self.wanted[likely], dim=0, return_inverse=True)
        for k, size in enumerate(listed(sizes)):
            table = tables.setdefault(tuple(size), torch.zeros(*size, dtype=torch.float64))
            self._add(table, likely[number == k], top, level, start)

    def _add(self, table: Tensor, chosen: Tensor, top: float, level: int, start: float) -> None:
        count = (1, FIRST_NODES * 2**level, FIRST_NODES * 4**level)[min(len(self.hidden), 2)]
        kept, sizes = list(self.split.kept), torch.tensor(table.shape)
        middle = self.middle[:, kept] / (2 * math.pi) - start
        middle = (middle * sizes).round().long()
        chosen = chosen[self.widths[chosen].prod(dim=1).argsort()]
        while len(chosen):
            block = max(1, BLOCK_ENTRIES // (count * int(self.widths[chosen[-1]].prod())))
            some, chosen = chosen[-block:], chosen[:-block]
            at, widths = middle[some], self.widths[some].amax(dim=0)
            places = [
                (at[:, i, None] - width // 2 + torch.arange(width)) % size
                for i, (width, size) in enumerate(zip(listed(widths), table.shape, strict=True))
            ]
            angles = [
                2 * math.pi * (p.double() / size + start)
                for p, size in zip(places, table.shape, strict=True)
            ]
            nodes = _nodes(self.kappa[some][:, self.hidden], count, level)
            values = self._values(some, angles, top, nodes, table.shape)
            flat = places[0]
            if len(places) > 1:
                flat = flat[:, :, None] * table.shape[1] + places[1][:, None]
            table.view(-1).index_add_(0, flat.flatten(), values.flatten())

    def _values(
        self,
        rows: Tensor,
        angles: list[Tensor],
        top: float,
        nodes: tuple[Tensor, list[Tensor]],
        shape: tuple[int, ...],
    ) -> Tensor:
        """Return the densities (C, A) or (C, A, B), relative to exp(top), of components at angles."""
        kept, given = self.split.kept, dict(zip(self.split.given, self.split.values, strict=True))
        first_last = sorted(kept, key=self.order.index)
        total = ((self.logs[rows] - top)[:, None] + nodes[0])[:, :, None, None]
        # sines and cosines over components, nodes and grids
        seen = dict[int, tuple[Tensor, Tensor]]()
        for axis in self.order:
            kappa = self.kappa[rows, axis, None, None, None]
            own = self.means[rows, axis][:, :, None, None, None]
            mean = own[:, 0]
            for j, (sin, cos) in seen.items():
                mean = mean + own[:, 1 + j] * sin + own[:, 1 + self.split.dim + j] * cos
            if axis in self.hidden:
                at = mean + nodes[1][self.hidden.index(axis)][:, :, None, None]
                seen[axis] = at.sin(), at.cos()
                continue
            if axis in given:
                at = torch.full((1, 1, 1, 1), 2 * math.pi * given[axis], dtype=torch.float64)
            else:
                at = angles[kept.index(axis)][:, None, :, None]
            if axis == first_last[-1]:
                at = at.mT
            if axis in kept:
                kappa = kappa.clamp_max(sharpest_on(shape[kept.index(axis)]))
            if axis == first_last[-1]:
                images = torch.cat([at.cos(), at.sin(), torch.ones_like(at)], dim=2)[:, 0]
                total = total - kappa - special.i0e(kappa).log()
                linear = [kappa * mean.cos(), kappa * mean.sin(), total]
                table = torch.stack(broadcast(*linear), dim=-1)[:, :, :, 0]
                total = (table.flatten(1, 2) @ images).reshape(*table.shape[:3], -1)
            else:
                total = total + kappa * ((at - mean).cos() - 1) - special.i0e(kappa).log()
            seen[axis] = at.sin(), at.cos()
        values = total.clamp_min_(FAINT_LOG).mul_(LOG2_E).exp2_().sum(dim=1)
        if len(kept) == 1:
            return values[:, 0]
        return values if first_last[0] == kept[0] else values.mT
