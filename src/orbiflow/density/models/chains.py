"""Mixtures of von Mises chains: the component for dependent angles on tori.

Marginals are taken by quadrature over the angles that come before others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.chain_integrals import chain_tables, nodes_of
from orbiflow.density.models.chain_sums import SCALES, ChainFits, ChainSum
from orbiflow.density.models.density import Density, Restriction, Split, Weighted
from orbiflow.density.models.kernels import lattice_kernels
from orbiflow.density.models.sums import log_sum_exp, shares_of
from orbiflow.density.models.tensors import in_blocks
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_tensor
from orbiflow.typed_torch import listed, special, unique

PILOT_DRAWS, SHARE_BY_WEIGHT = 64, 1e-3
"""Draws of each component by which it is judged where angles are given, and the share of draws that
goes by weight alone."""

SHIFT_PER_LEVEL = (math.sqrt(5) - 1) / 2
"""How far the grids of a level are shifted from those of the one before, in turns: the change tells
what the grids miss."""

BLOCK_POINTS = 1024
"""Points at a time: few enough for the cache, and so many that little is left to do between sums."""


class VonMisesChains(Density, kind="chains"):
    """A mixture of chains of von Mises distributions, exact and normalised on the torus.

    In a component, angle i is von Mises about a trigonometric polynomial of the angles before it,
    m_i = b_i + sum over j before i of (s_ij sin x_j + c_ij cos x_j): a circular regression (Fisher
    and Lee, 1992), correlations at no cost, since each factor is normalised whatever the others are.
    Each component comes at several scales, its concentrations divided by `SCALES`.

    Args:
        space: A `Torus` of d angles.
        log_weights: Logarithms (K, L) of the weight of each component and scale, of sum 1.
        means: The regressions (K, d, 1 + 2 d): b_i, s_ij, c_ij in radians, zero unless j is before i.
        concentrations: Concentrations (K, d), at least 0; 0 is uniform.
        order: The numbers (K, d) of the angles from the first to the last of each chain; default
            0, 1, ..., d - 1.
    """

    stored = ("log_weights", "means", "concentrations", "order")

    def __init__(
        self,
        space: Space,
        log_weights: Tensor,
        means: Tensor,
        concentrations: Tensor,
        order: Tensor | None = None,
    ) -> None:
        super().__init__(space)
        if not space.is_torus:
            raise OrbiflowError(f"von Mises chains need a torus, got the {space.name}")
        d = space.dim
        named = zip(self.stored, (log_weights, means, concentrations), strict=False)
        log_weights, means, concentrations = (as_tensor(value, name) for name, value in named)
        count = concentrations.shape[0] if concentrations.dim() == 2 else 0
        if order is None:
            order = torch.arange(d, device=concentrations.device).repeat(count, 1)
        tensors = (log_weights, means, concentrations, order)
        shapes = ((count, len(SCALES)), (count, d, 1 + 2 * d), (count, d), (count, d))
        for name, tensor, shape in zip(self.stored, tensors, shapes, strict=True):
            if count < 1 or tuple(tensor.shape) != shape:
                raise OrbiflowError(f"{name} has shape {tuple(tensor.shape)}, expected {shape}")
        # a weight may be 0, its logarithm -inf
        if not bool((log_weights < 1e-3).all() and abs(log_weights.exp().sum() - 1) < 1e-3):
            raise OrbiflowError("the weights of a mixture must sum to 1")
        if not bool(means.isfinite().all() and (concentrations >= 0).all()):
            raise OrbiflowError("the means and concentrations of a mixture must be finite")
        if not torch.equal(order.sort(dim=1).values, torch.arange(d).to(order).expand(count, d)):
            raise OrbiflowError(f"each order of a mixture must hold 0 to {d - 1} once")
        if not bool((concentrations <= 1e9).all()) or bool((means * ~chained(order)).any()):
            raise OrbiflowError("a mixture needs concentrations of at most 1e9 and chained means")
        self.log_weights, self.means, self.concentrations = (
            t.detach().double().clone() for t in (log_weights, means, concentrations)
        )
        self.order = order.detach().long().clone()

    def log_chart(self, points: Tensor) -> Tensor:
        means, kappa = self.means.to(points), self.concentrations.to(points)
        # log weights less log normalising constants, per unit of the cube: (L, K)
        scaled = self.concentrations / self.concentrations.new_tensor(SCALES)[:, None, None]
        peaks = self.log_weights.mT - special.i0e(scaled).log().sum(dim=-1)
        chain_sum = ChainSum(ChainFits(means, kappa, self.order), peaks.to(points))
        return in_blocks(chain_sum.log, points, BLOCK_POINTS)

    def residuals(self, points: Tensor) -> Tensor:
        """Return angles less their regressions, in radians (N, K, d), for points (N, d)."""
        angle = 2 * math.pi * points
        mean = waves(angle) @ self.means.to(points).flatten(0, 1).mT
        # in place: at this size, fresh memory costs more than the arithmetic
        return mean.reshape(len(points), *self.concentrations.shape).neg_().add_(angle[:, None])

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        chains = self.to("cpu")
        weights = chains.log_weights.exp().flatten()
        chosen = torch.multinomial(weights, count, replacement=True, generator=generator)
        return self.space.project(chains._walk(chosen, {}, generator)[0])

    def draw_given(
        self, count: int, given: Mapping[int, float], generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Choose components by what they make of the given angles in a few draws each."""
        chains = self.to("cpu")
        logs = chains.log_weights.flatten()
        every = torch.arange(len(logs)).repeat_interleave(PILOT_DRAWS)
        pilots = chains._walk(every, given, generator)[1].reshape(-1, PILOT_DRAWS)
        likely = logs + log_sum_exp(pilots) - math.log(PILOT_DRAWS)
        proposed = shares_of(
            torch.logaddexp(likely, logs + log_sum_exp(likely) + math.log(SHARE_BY_WEIGHT))
        )
        chosen = torch.multinomial(proposed, count, replacement=True, generator=generator)
        points, weights = chains._walk(chosen, given, generator)
        return self.space.project(points), weights + (logs - proposed.log())[chosen]

    def _walk(
        self, chosen: Tensor, given: Mapping[int, float], generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Return draws (N, d) of components, and log densities (N,) of the given angles."""
        component = chosen // len(SCALES)
        kappa = self.concentrations[component] / torch.tensor(SCALES)[chosen % len(SCALES), None]
        rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
        noise = torch.tensor(rng.vonmises(0.0, kappa.numpy()))
        angle, rows = torch.zeros(noise.shape, dtype=torch.float64), torch.arange(len(noise))
        fixed_angles = angle.new_full((self.space.dim,), math.nan)
        fixed_angles[list(given)] = (
            2 * math.pi * torch.tensor([*given.values()], dtype=torch.float64)
        )
        logs = angle.new_zeros(len(angle))
        for now in self.order[component].mT:
            mean = (waves(angle) * self.means[component, now]).sum(dim=-1)
            fixed, sharp = ~fixed_angles[now].isnan(), kappa[rows, now]
            off = (fixed_angles[now] - mean).nan_to_num()
            logs += torch.where(fixed, sharp * (off.cos() - 1) - special.i0e(sharp).log(), 0.0)
            angle[rows, now] = torch.where(fixed, mean + off, mean + noise[rows, now])
        return angle / (2 * math.pi), logs

    @classmethod
    def joined(cls, components: Sequence[Any], weights: Tensor) -> Self:
        """Return all chains of several densities on one torus, in proportions (P,)."""
        logs = (weights.double() / weights.sum()).log()
        return cls(
            components[0].space,
            torch.cat([part.log_weights + log for part, log in zip(components, logs, strict=True)]),
            torch.cat([part.means for part in components]),
            torch.cat([part.concentrations for part in components]),
            torch.cat([part.order for part in components]),
        )

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        return _chains_at(self, points, axes, seed)

    def restricted(self, split: Split, space: Space) -> Restriction:
        """Keep the chains in which all that is given comes first and all that is hidden last."""
        place = self.order.argsort(dim=1)
        kept, fixed = list(split.kept), list(split.given)
        hidden = [axis for axis in range(split.dim) if axis not in split.observed]
        closed = torch.ones(len(self.order), dtype=torch.bool)
        first = place[:, kept].amin(dim=1)
        last = place[:, list(split.observed)].amax(dim=1)
        if fixed:
            closed &= place[:, fixed].amax(dim=1) < first
        if hidden:
            closed &= place[:, hidden].amin(dim=1) > last
        parts: list[Weighted] = []
        for log, chains in self._some(closed):
            evidence, some = chains._closed(split, space)
            parts.append((log + evidence, some))
        return Restriction(parts, [(log, some, split) for log, some in self._some(~closed)])

    def approximated(
        self, split: Split, space: Space, level: int, tick: Callable[[], None]
    ) -> list[Weighted]:
        start = level * SHIFT_PER_LEVEL % 1
        log_scale, tables = chain_tables(self, split, level, start, tick)
        parts = (lattice_kernels(table, space, start) for table in tables)
        return [(log_scale + log, kernels) for log, kernels in parts]

    def _some(self, chosen: Tensor) -> list[tuple[float, VonMisesChains]]:
        """Return the chains of a mask (K,), with the logarithm of their weight, if they have any."""
        if not bool(chosen.any()) or bool((self.log_weights[chosen] == -math.inf).all()):
            return []
        logs = self.log_weights[chosen]
        total = float(logs.flatten().logsumexp(0))
        parts = (self.means[chosen], self.concentrations[chosen], self.order[chosen])
        return [(total, VonMisesChains(self.space, logs - total, *parts))]

    def _closed(self, split: Split, space: Space) -> tuple[float, VonMisesChains]:
        """Return the log density of what is given, and chains of the angles kept.

        Their constants are moved and their weights changed by what is given.
        """
        kept, fixed, d = list(split.kept), list(split.given), split.dim
        logs, means, evidence = self.log_weights, self.means, 0.0
        constant = means[:, :, 0]
        if fixed:
            angle = torch.zeros(1, d, dtype=torch.float64)
            angle[0, fixed] = 2 * math.pi * torch.tensor(split.values, dtype=torch.float64)
            constant = means @ _known_part(angle, fixed)[0]
            residual = angle[0, fixed] - constant[:, fixed]
            kappa = self.concentrations[:, fixed, None] / torch.tensor(SCALES)
            logs = logs + (kappa * (residual.cos() - 1)[..., None] - special.i0e(kappa).log()).sum(
                dim=1
            )
            evidence = float(log_sum_exp(logs.flatten()))
            logs = shares_of(logs.flatten()).log().reshape(logs.shape)
        at = [*(1 + j for j in kept), *(1 + d + j for j in kept)]
        some = torch.cat([constant[:, kept, None], means[:, kept][:, :, at]], dim=2)
        order = self.order.argsort(dim=1)[:, kept].argsort(dim=1)
        return evidence, VonMisesChains(space, logs, some, self.concentrations[:, kept], order)

    def header(self) -> dict[str, Any]:
        return {"components": len(self.concentrations), "scales": list(SCALES)}


class Factor(NamedTuple):
    """An angle given others, its parents: a mixture over all of them, divided by that of the parents.

    - `axes`: The numbers of the parents, and of the angle, last.
    - `chains`: The mixture, on the torus of those angles, in this order.
    """

    axes: tuple[int, ...]
    chains: VonMisesChains


def chained(order: Tensor) -> Tensor:
    """Return which means (..., d, 1 + 2 d) chains of an order (..., d) may use.

    These are the constants and the waves of the angles before.

    >>> chained(torch.tensor([1, 0])).int()
    tensor([[1, 0, 1, 0, 1],
            [1, 0, 0, 0, 0]], dtype=torch.int32)
    """
    place = order.argsort(dim=-1)
    before = place[..., None, :] < place[..., :, None]
    return torch.cat([torch.ones_like(before[..., :1]), before, before], dim=-1)


def waves(angle: Tensor) -> Tensor:
    """Return 1, sin and cos of angles (..., d) in radians: (..., 1 + 2 d)."""
    return torch.cat([torch.ones_like(angle[..., :1]), angle.sin(), angle.cos()], dim=-1)


BLOCK_ENTRIES = 2_000_000
"""Entries of the table of points, components and nodes worked on at a time."""


def _chains_at(chains: VonMisesChains, points: Tensor, observed: list[int], seed: int) -> Tensor:
    """Return log densities (N,) of the `observed` angles alone, at points (N, len(observed)).

    Angles before others that are not observed are integrated out at `nodes_of` them, spread about
    their means, which makes a mixture that is normalised however many nodes there are.
    """
    angle = torch.zeros(len(points), chains.order.shape[1], dtype=torch.float64)
    angle[:, observed] = 2 * math.pi * points.double()
    logs = [
        _ordered_at(chains, which, order, angle, observed, seed)
        for which, order in _by_order(chains, observed)
    ]
    return log_sum_exp(torch.cat(logs, dim=1))


def _by_order(chains: VonMisesChains, observed: list[int]) -> Iterator[tuple[Tensor, list[int]]]:
    """Yield masks (K,) of chains of one order, and their angles up to the last that is observed.

    Angles after that integrate to 1.
    """
    orders, number = unique(chains.order, dim=0, return_inverse=True)
    rows: list[list[int]] = listed(orders)
    for k, order in enumerate(rows):
        yield number == k, order[: 1 + max(order.index(axis) for axis in observed)]


def _at_scales(chains: VonMisesChains, which: Tensor) -> tuple[Tensor, Tensor]:
    """Return means (C, d, 1 + 2 d) and concentrations (C, d) of some chains (K,) at each scale."""
    scale = torch.tensor(SCALES, dtype=torch.float64)
    means = chains.means[which].repeat_interleave(len(SCALES), dim=0)
    return means, (chains.concentrations[which][:, None] / scale[:, None]).flatten(0, 1)


def _ordered_at(
    chains: VonMisesChains,
    which: Tensor,
    order: list[int],
    angle: Tensor,
    observed: list[int],
    seed: int,
) -> Tensor:
    """Return log weight plus log density (N, C) of components (K,) of one order, at each scale."""
    seen = [axis for axis in order if axis in observed]
    hidden = [axis for axis in order if axis not in observed]
    means, kappa = _at_scales(chains, which)
    constant = chains.log_weights[which].flatten()
    constant = constant - special.i0e(kappa[:, seen]).log().sum(dim=1)
    logs_of_components = angle.new_empty(len(angle), len(means))
    for chosen, logs, offsets in nodes_of(means, kappa, hidden, seen, seed):
        parts = [
            _walked(part, means[chosen], kappa[chosen], order, logs, offsets)
            for part in torch.split(angle, max(1, BLOCK_ENTRIES // logs.numel()))
        ]
        logs_of_components[:, chosen] = torch.cat(parts) + constant[chosen]
    return logs_of_components


def _walked(
    angle: Tensor,
    means: Tensor,
    kappa: Tensor,
    order: list[int],
    logs: Tensor,
    offsets: dict[int, Tensor],
) -> Tensor:
    """Return logs (N, C) of the observed angles' factors without constants, summed over the nodes."""
    d = angle.shape[1]
    known_means = _known_part(angle, [axis for axis in order if axis not in offsets])
    known_means = (known_means @ means.flatten(0, 1).mT).reshape(len(angle), len(means), d)
    plain = torch.zeros_like(known_means[..., 0])  # what does not depend on the hidden angles
    bent: Tensor | None = None
    before: list[tuple[int, Tensor, Tensor]] = []
    for axis in order:
        mean = known_means[..., axis]
        if before:
            mean = mean[..., None]
            for j, sin, cos in before:
                slope = means[:, axis, [1 + j, 1 + d + j], None]
                mean = mean + slope[:, 0] * sin + slope[:, 1] * cos
        if axis in offsets:
            drawn = (mean if before else mean[..., None]) + offsets[axis]
            before.append((axis, drawn.sin(), drawn.cos()))
        elif before:
            fit = (angle[:, None, None, axis] - mean).cos_().sub_(1).mul_(kappa[:, axis, None])
            bent = fit if bent is None else bent.add_(fit)
        else:
            plain = plain + kappa[:, axis] * ((angle[:, None, axis] - mean).cos() - 1)
    return plain if bent is None else plain + log_sum_exp(bent + logs)


def _known_part(angle: Tensor, known: list[int]) -> Tensor:
    """Return the `waves` (N, 1 + 2 d) of angles (N, d), 0 for those that are not known."""
    d = angle.shape[1]
    seen = torch.zeros(1 + 2 * d, dtype=angle.dtype)
    seen[[0, *(1 + j for j in known), *(1 + d + j for j in known)]] = 1
    return waves(angle) * seen
