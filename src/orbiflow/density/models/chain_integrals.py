"""Mixtures of von Mises chains, integrated over hidden angles: nodes, and tables of what is seen.

A component is sharp and covers little of the circle, so its table is as fine as it is sharp and no
wider than it reaches. What a component hides is integrated at nodes, which all of its table share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
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

MIN_NODES, MAX_NODES = 12, 16_384
"""The fewest and the most nodes of an angle that is hidden alone."""

QUASI_RANDOM_NODES = 512
"""Quasi-random nodes of several hidden angles: log densities are right within some 3e-4 nats."""

TABLE_POINTS = 512
"""Points of the distribution function whose inverse gives quasi-random nodes."""


def nodes_of(
    means: Tensor, kappa: Tensor, hidden: list[int], observed: list[int], seed: int
) -> Iterator[tuple[Tensor, Tensor, dict[int, Tensor]]]:
    """Yield numbers of components, and log weights (C, Q) of sum 1 and offsets (C, Q) of their nodes.

    Offsets are by axis; components that need as many come together.

    Of a single hidden angle it is the trapezoidal rule, as fine as it and the angles after it are
    sharp: to analytic functions it converges exponentially (Trefethen and Weideman, 2014). Nodes of
    several are quasi-random, by von Mises quantiles. For means (C, d, 1 + 2 d) and concentrations
    (C, d); observed axes before a hidden one have slopes of 0 there.
    """
    every = torch.arange(len(kappa))
    if len(hidden) != 1:
        count = QUASI_RANDOM_NODES if hidden else 1
        even = _quasi_random(len(hidden), count, seed)
        offsets = {axis: quantiles(kappa[:, axis], even[:, k]) for k, axis in enumerate(hidden)}
        yield every, kappa.new_full((len(kappa), count), -math.log(count)), offsets
        return
    (axis,), d = hidden, kappa.shape[1]
    # concentrations (C,) of the integrand, which other angles bend
    slope = means[:, observed, 1 + axis].square() + means[:, observed, 1 + d + axis].square()
    sharp = kappa[:, axis] + (kappa[:, observed] * slope).sum(dim=1)
    reach = (REACH_DEVIATIONS / kappa[:, axis].clamp_min(1e-12).sqrt()).clamp_max(math.pi)
    sizes = (2 * reach * sharp.sqrt() / STEP_DEVIATIONS).ceil().clamp_min(MIN_NODES)
    sizes = MIN_NODES * torch.exp2((sizes / MIN_NODES).log2().ceil())  # few different ones
    for size in listed(unique(sizes)):
        chosen, count = torch.nonzero(sizes == size)[:, 0], min(int(size), MAX_NODES)
        step = (torch.arange(count, dtype=kappa.dtype) + 0.5) / count * 2 - 1
        offset = reach[chosen, None] * step
        logs = torch.log_softmax(kappa[chosen, axis, None] * (offset.cos() - 1), dim=1)
        yield chosen, logs, {axis: offset}


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

NODES_ALONE, NODES_OF_SEVERAL = 24, (8, 32, 128, 512)
"""The fewest nodes of an angle that is the only one hidden, and those of several by level."""

NOISE_LEFT, GENTLE_CONCENTRATION = (0.9, 0.7, 0.3, 0.1), 20.0
"""Share of hidden noise that is left about quasi-random nodes, level by level, and the concentration
below which it is less."""

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
        of_order = number == k
        walks.append(
            _Walk(order[: last + 1], split, logs[of_order], means[of_order], kappa[of_order])
        )
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
        fixed = dict(zip(split.given, split.values, strict=True))
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
            if axis in fixed:
                at = torch.tensor(2 * math.pi * fixed[axis], dtype=torch.float64)
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
            slants = slopes.index_fill(1, torch.tensor(axis), 1.0)[:, list(split.kept)]
            joint += kappa[:, axis] * slants.prod(dim=1)
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
        likely = torch.nonzero(self.likely - top > -FAINTEST_LOG)[:, 0]
        last = max(self.order.index(axis) for axis in self.split.kept)
        early = all(self.order.index(axis) < last for axis in self.hidden)
        rule = _Rule(len(self.hidden), level, early=early)
        sizes, number = unique(self.wanted[likely], dim=0, return_inverse=True)
        for k, size in enumerate(listed(sizes)):
            table = tables.setdefault(tuple(size), torch.zeros(*size, dtype=torch.float64))
            self._add(table, likely[number == k], top, rule, start)

    def _add(self, table: Tensor, chosen: Tensor, top: float, rule: _Rule, start: float) -> None:
        kept, sizes = list(self.split.kept), torch.tensor(table.shape)
        middle = self.middle[:, kept] / (2 * math.pi) - start
        middle = (middle * sizes).round().long()
        chosen = chosen[self.widths[chosen].prod(dim=1).argsort()]
        while len(chosen):
            block = max(1, BLOCK_ENTRIES // (rule.count * int(self.widths[chosen[-1]].prod())))
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
            values = self._values(some, angles, top, rule, table.shape)
            flat = places[0]
            if len(places) > 1:
                flat = flat[:, :, None] * table.shape[1] + places[1][:, None]
            table.view(-1).index_add_(0, flat.flatten(), values.flatten())

    def _values(
        self, rows: Tensor, angles: list[Tensor], top: float, rule: _Rule, shape: tuple[int, ...]
    ) -> Tensor:
        """Return the densities (C, A) or (C, A, B), relative to exp(top), of components at angles."""
        kept, fixed = self.split.kept, dict(zip(self.split.given, self.split.values, strict=True))
        first_last = sorted(kept, key=self.order.index)
        total = (self.logs[rows] - top)[:, None, None, None]
        # sines and cosines over components, nodes and grids
        seen = dict[int, tuple[Tensor, Tensor]]()
        near = _Near()
        for axis in self.order:
            kappa = self.kappa[rows, axis, None, None, None]
            mean, lean = self._mean(rows, axis, seen, near)
            if axis in self.hidden:
                number, left = self.hidden.index(axis), rule.left / (kappa + GENTLE_CONCENTRATION)
                offset, logs = rule.nodes(number, (kappa / (1 - kappa * left))[:, :, 0, 0])
                at, total = mean + offset[:, :, None, None], total + logs[:, :, None, None]
                if rule.left:
                    lean = lean + left.sqrt() * _unit(len(self.hidden), number)
                    near[axis] = lean, torch.zeros_like(left)
                mean_sine = (-lean.square().sum(dim=0) / 2).exp()
                seen[axis] = mean_sine * at.sin(), mean_sine * at.cos()
                continue
            if axis in fixed:
                at = torch.full((1, 1, 1, 1), 2 * math.pi * fixed[axis], dtype=torch.float64)
            else:
                at = angles[kept.index(axis)][:, None, :, None]
            if axis == first_last[-1]:
                at = at.mT
            if axis != self.order[-1]:
                _observe(near, at - mean, kappa, lean)
            kappa = kappa / (1 + kappa * lean.square().sum(dim=0))
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

    def _mean(
        self, rows: Tensor, axis: int, seen: dict[int, tuple[Tensor, Tensor]], near: _Near
    ) -> tuple[Tensor, Tensor]:
        """Return the mean of an angle given those before it, whose sines and cosines are seen.

        And how far it leans (H, ...) with what is left about nodes.
        """
        regression = self.means[rows, axis][:, :, None, None, None]
        mean, lean = regression[:, 0], regression.new_zeros(len(self.hidden), 1, 1, 1, 1)
        for j, (sin, cos) in seen.items():
            along, across = regression[:, 1 + j], regression[:, 1 + self.split.dim + j]
            mean = mean + along * sin + across * cos
            if j in near:
                slope = along * cos - across * sin
                mean, lean = mean + slope * near[j][1], lean + slope * near[j][0]
        return mean, lean


_Near = dict[int, tuple[Tensor, Tensor]]
"""What is left of hidden angles' noise about quasi-random nodes, in terms of H normal numbers.

How far (H, ...) each angle leans with them, and its shift by what was observed. To first order all
angles after it move in proportion: bumps become wider and aslant, in closed form.
"""


def _unit(size: int, number: int) -> Tensor:
    return torch.eye(size, dtype=torch.float64)[number].reshape(-1, 1, 1, 1, 1)


def _observe(near: _Near, off: Tensor, kappa: Tensor, lean: Tensor) -> None:
    """Learn from an angle that is off its mean (Kalman, 1960; of the covariance the square root)."""
    wider = 1 + kappa * lean.square().sum(dim=0)
    off = (torch.remainder(off + math.pi, 2 * math.pi) - math.pi) * kappa / wider
    less = kappa / (wider + wider.sqrt())
    for axis, (lean_of_axis, shift) in near.items():
        common = (lean_of_axis * lean).sum(dim=0)
        near[axis] = lean_of_axis - less * common * lean, shift + common * off


class _Rule:
    """Nodes of hidden angles: even ones of a single angle, quasi-random ones of several."""

    def __init__(self, hidden: int, level: int, *, early: bool) -> None:
        # of angles after those kept, it would have to be known at each point of the grid
        self.left = NOISE_LEFT[level] if early and hidden > 1 else 0.0
        self.count = (1, NODES_ALONE * 2**level, NODES_OF_SEVERAL[level])[min(hidden, 2)]
        self.even = _quasi_random(hidden, self.count, level)

    def nodes(self, number: int, kappa: Tensor) -> tuple[Tensor, Tensor]:
        """Return offsets (C, Q) of a hidden angle from its mean, and the logarithms of their weights.

        For concentrations (C, 1).
        """
        if self.even.shape[1] > 1:
            weight = -math.log(self.count) if number == 0 else 0.0
            return quantiles(kappa[:, 0], self.even[:, number]), kappa.new_tensor([[weight]])
        reach = (REACH_DEVIATIONS / kappa.clamp_min(1e-12).sqrt()).clamp_max(math.pi)
        offset = reach * ((2 * torch.arange(self.count) + 1) / self.count - 1)
        return offset, torch.log_softmax(kappa * (offset.cos() - 1), dim=1)


@lru_cache(maxsize=16)
def _quasi_random(hidden: int, count: int, seed: int) -> Tensor:
    """Return quasi-random probabilities (Q, H)."""
    with torch.inference_mode(False):
        engine = torch.quasirandom.SobolEngine(max(1, hidden), scramble=True, seed=seed)
        return engine.draw(count, dtype=torch.float64)
