"""Bayesian networks on tori: each angle given a few others, by mixtures of von Mises chains."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.chain_integrals import quantiles
from orbiflow.density.models.chain_sums import SCALES
from orbiflow.density.models.chains import Factor, VonMisesChains, waves
from orbiflow.density.models.density import Density, Split, Weighted
from orbiflow.density.models.elimination import eliminated, grids_for
from orbiflow.density.models.headers import within
from orbiflow.density.models.kernels import AdaptiveKernels, lattice_kernels
from orbiflow.density.models.sums import log_sum_exp, shares_of
from orbiflow.density.models.tensors import in_blocks
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import is_list, is_object
from orbiflow.settings import as_instance
from orbiflow.typed_torch import broadcast, listed, special, unique

DRAWS = 4096
"""Quasi-random draws of the hidden angles."""

BANDWIDTH = 0.25
"""Deviation of kernels about draws, relative to the noise of an angle on which others depend."""

MIN_CONCENTRATION = 1e-6
"""The least concentration of a kernel: an angle may be even, of concentration 0."""

AT_ONCE = 2**17
"""Points times draws worked on at a time."""

BLOCK_POINTS = 256
"""Points evaluated at a time: few enough for the cache."""

BLOCK_ROWS, BLOCK_ENTRIES = 256, 2**18
"""Rows of angles, and terms of a sum, at a time: few enough for the cache."""


class VonMisesNetwork(Density, kind="network"):
    """A Bayesian network of angles (Pearl, 1988): the product of each given its parents.

    A mixture of all angles at once needs a component for each combination of states that they take; a
    network needs a few for each angle and its parents. A factor is a mixture f of von Mises chains:
    f(parents, angle) / f(parents), both in closed form, since in chains the last angle integrates to
    1. So the product is exact and normalised.

    Args:
        space: A `Torus`.
        factors: One for each angle, parents before their children.
    """

    article = "a network"

    def __init__(self, space: Space, factors: Sequence[Factor]) -> None:
        super().__init__(space)
        if not space.is_torus:
            raise OrbiflowError(f"a von Mises network needs a torus, got the {space.name}")
        placed: list[int] = []
        for axes, chains in factors:
            as_instance(chains, VonMisesChains, "a factor's chains")
            if not axes or chains.space.dim != len(axes) or len(set(axes)) < len(axes):
                raise OrbiflowError(
                    f"a factor of the angles {axes} has chains of {chains.space.dim} angles"
                )
            if not set(axes[:-1]) <= set(placed) or axes[-1] in placed:
                raise OrbiflowError(
                    f"a factor of the angles {axes} comes before one of its parents, or is the "
                    "second of its angle"
                )
            if not torch.equal(
                chains.order.cpu(), torch.arange(len(axes)).expand(chains.order.shape)
            ):
                raise OrbiflowError("chains of a factor must end in its own angle, in their order")
            placed.append(axes[-1])
        if sorted(placed) != list(range(space.dim)):
            raise OrbiflowError(f"a network of {space.dim} angles needs a factor for each")
        self.factors = tuple(factors)

    def log_chart(self, points: Tensor) -> Tensor:
        def log_product(some: Tensor) -> Tensor:
            angles = some.unbind(dim=1)
            logs = [
                log_conditional(chains, torch.stack([angles[axis] for axis in axes], dim=1))
                for axes, chains in self.factors
            ]
            return torch.stack(logs).sum(dim=0)

        return in_blocks(log_product, points, BLOCK_POINTS)

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        return self.space.project(self._drawn(count, {}, generator).points)

    def draw_given(
        self, count: int, given: Mapping[int, float], generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Draw each angle given its parents, and weigh by the angles given (Fung and Chang, 1990)."""
        drawn = self._drawn(count, given, generator)
        return self.space.project(drawn.points), drawn.logs

    def _drawn(self, count: int, given: Mapping[int, float], generator: torch.Generator) -> _Draws:
        rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
        points = torch.zeros(count, self.space.dim, dtype=torch.float64)
        means, sharp, logs = points.clone(), points.clone(), points.new_zeros(count)
        for axes, chains in self.factors:
            factor = chains.to("cpu")
            if axes[-1] in given:
                points[:, axes[-1]] = given[axes[-1]]
                logs += in_blocks(
                    partial(log_conditional, factor), points[:, list(axes)], BLOCK_POINTS
                )
                continue
            angle = 2 * math.pi * points[:, list(axes)]
            chosen = [angle.new_zeros(0).long()]
            for block in torch.split(points[:, list(axes)], BLOCK_POINTS):
                shares = shares_of(_log_parents(factor, block))
                chosen.append(torch.multinomial(shares, 1, generator=generator)[:, 0])
            part = torch.cat(chosen)
            component, scale = part // len(SCALES), part % len(SCALES)
            mean = (waves(angle) * factor.means[component, -1]).sum(dim=1)
            kappa = factor.concentrations[component, -1] / torch.tensor(SCALES)[scale]
            drawn = mean + torch.tensor(rng.vonmises(0.0, kappa.numpy()))
            points[:, axes[-1]] = drawn / (2 * math.pi)
            means[:, axes[-1]], sharp[:, axes[-1]] = mean / (2 * math.pi), kappa
        return _Draws(points, means, sharp, logs)

    def approximated(
        self, split: Split, space: Space, level: int, tick: Callable[[], None]
    ) -> list[Weighted]:
        """Eliminate the hidden angles on grids, or draw them where too many depend on each other."""
        factors = self._leading_to(list(split.observed))
        grids = grids_for(factors, split, level)
        if grids is None:
            return [self._kernels_drawn(factors, split, space, level, tick)]
        log_scale, table = eliminated(factors, grids, split.kept, tick)
        log, kernels = lattice_kernels(table, space)
        return [(log_scale + log, kernels)]

    def _kernels_drawn(
        self,
        factors: Sequence[Factor],
        split: Split,
        space: Space,
        level: int,
        tick: Callable[[], None],
    ) -> Weighted:
        """Return kernels about draws of the angles kept, weighed by those given.

        An angle is its mean given its parents and noise, of which the kernel is a part: all of it if no
        other angle depends on it. The draw keeps the rest, so that the spread is right.
        """
        fixed = dict(zip(split.given, split.values, strict=True))
        generator = torch.Generator().manual_seed(level)
        parts: list[_Draws] = []
        for _ in range(4**level):
            tick()
            parts.append(self._drawn(DRAWS, fixed, generator))
        drawn = _Draws(*(torch.cat(column) for column in zip(*parts, strict=True)))
        parents = {axis for axes, _ in factors for axis in axes[:-1]}
        share = torch.tensor(
            [BANDWIDTH if axis in parents else 1.0 for axis in split.kept]
        ).double()
        points, means, sharp = (column[:, list(split.kept)] for column in drawn[:3])
        noise = (points - means + 0.5) % 1 - 0.5
        centers = means + (1 - share**2).sqrt() * noise
        sharp = sharp.clamp_min(MIN_CONCENTRATION) / share**2
        kernels = AdaptiveKernels(space, centers % 1, sharp, shares_of(drawn.logs))
        return float(log_sum_exp(drawn.logs)) - math.log(len(points)), kernels

    @property
    def device(self) -> torch.device | None:
        """The device of the factors."""
        return self.factors[0].chains.device

    def to(self, *wanted: Any) -> Self:
        new = super().to(*wanted)
        new.factors = tuple(Factor(axes, chains.to(*wanted)) for axes, chains in self.factors)
        return new

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        """Integrate over the other angles by draws that the observed angles weigh.

        Angles from which no arrow leads to an observed one integrate to 1. Parents that are hidden are
        drawn, each given its own, and the observed angles weigh the draws (likelihood weighting: Fung
        and Chang, 1990). The draws are quasi-random and the same at all points.
        """
        points = points.double()
        if not len(points):
            return points.new_zeros(0)
        factors = self._leading_to(axes)
        hidden = [factor_axes[-1] for factor_axes, _ in factors if factor_axes[-1] not in axes]
        count = DRAWS if hidden else 1
        draws = torch.quasirandom.SobolEngine(
            max(1, 2 * len(hidden)), scramble=True, seed=seed
        ).draw(count, dtype=torch.float64)
        even = {axis: draws[:, 2 * k : 2 * k + 2] for k, axis in enumerate(hidden)}
        same: list[bool] = listed((points == points[0]).all(dim=0))
        same_angles = {axis: points[:1, k, None] for k, axis in enumerate(axes) if same[k]}
        # what does not depend on the points is worked on once
        densities = dict[int, Callable[[Tensor], Tensor]]()
        total, left = _taken(factors, same_angles, even, densities)
        logs_of_blocks: list[Tensor] = []
        for block in torch.split(points, AT_ONCE // count):
            at = {axis: block[:, k, None] for k, axis in enumerate(axes) if not same[k]}
            logs = total + _taken(left, {**same_angles, **at}, even, densities)[0]
            logs_of_blocks.append(log_sum_exp(logs.expand(len(block), count)) - math.log(count))
        return torch.cat(logs_of_blocks)

    def _leading_to(self, observed: list[int]) -> list[Factor]:
        """Return the factors of the observed angles, and of all from which arrows lead to them."""
        wanted = set(observed)
        leading: list[Factor] = []
        for factor in reversed(self.factors):
            if factor.axes[-1] in wanted:
                wanted |= set(factor.axes)
                leading.append(factor)
        return leading[::-1]

    def header(self) -> dict[str, Any]:
        return {
            "factors": [{"axes": list(axes), **chains.header()} for axes, chains in self.factors]
        }

    def tensors(self) -> dict[str, Tensor]:
        """Return the tensors of all factors, by names that begin with the number of their angle."""
        return {
            f"{axes[-1]}.{name}": tensor
            for axes, chains in self.factors
            for name, tensor in chains.tensors().items()
        }

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        stored: Any = header.get("factors")
        if not is_list(stored) or len(stored) != space.dim or not all(map(is_object, stored)):
            raise OrbiflowError(f"a network of {space.dim} angles needs a factor for each")
        factors: list[Factor] = []
        for entry in stored:
            axes: Any = entry.get("axes")
            are_axes = is_list(axes) and all(type(a) is int and 0 <= a < space.dim for a in axes)
            if not are_axes or not 0 < len(axes) <= space.dim:
                raise OrbiflowError(f"a factor of the angles {axes!r}")
            below = within(tensors, f"{axes[-1]}.")
            chains = VonMisesChains.from_header(Torus(len(axes)), entry, below)
            factors.append(Factor(tuple(axes), chains))
        return cls(space, factors)

    def __repr__(self) -> str:
        arrows = ", ".join(
            f"{listed(torch.tensor(axes[:-1]))} -> {axes[-1]}" for axes, _ in self.factors
        )
        return f"VonMisesNetwork({self.space!r}, {arrows})"


class _Draws(NamedTuple):
    """Draws (N, d) in turns, the means and concentrations that they were drawn by, and log weights."""

    points: Tensor
    means: Tensor
    kappa: Tensor
    logs: Tensor


def log_conditional(chains: VonMisesChains, points: Tensor) -> Tensor:
    """Return log densities (N,) of the last angle given those before it, at points (N, d) of all."""
    before, child = _terms(chains, points)
    return log_sum_exp((before + child).flatten(1)) - log_sum_exp(before.flatten(1))


def _terms(chains: VonMisesChains, points: Tensor) -> tuple[Tensor, Tensor]:
    """Return logs (N, L, K) of weight times parents' density, and of the last angle given them."""
    kappa = chains.concentrations.to(points)
    scale = points.new_tensor(SCALES)[:, None]
    fit = (chains.residuals(points).cos() - 1) * kappa
    normal = special.i0e(kappa / scale[..., None]).log()  # (L, K, d)
    before = fit[..., :-1].sum(dim=-1)[:, None] / scale
    before = before + chains.log_weights.to(points).mT - normal[..., :-1].sum(dim=-1)
    return before, fit[..., -1][:, None] / scale - normal[..., -1]


def _log_parents(chains: VonMisesChains, points: Tensor) -> Tensor:
    """Return logs (N, K * L) of weight times parents' density, of each component at all scales."""
    return _terms(chains, points)[0].mT.flatten(1)


def averaged_networks(networks: Sequence[VonMisesNetwork]) -> VonMisesNetwork:
    """Return the network whose factors are the means of those of networks with the same arrows."""
    first = networks[0]
    if len({tuple(axes for axes, _ in network.factors) for network in networks}) > 1:
        raise OrbiflowError("networks with other arrows have no common mean")
    even = torch.ones(len(networks), dtype=torch.float64)
    columns = zip(*(network.factors for network in networks), strict=True)
    return VonMisesNetwork(
        first.space,
        [
            Factor(
                column[0].axes, VonMisesChains.joined([factor.chains for factor in column], even)
            )
            for column in columns
        ],
    )


def _given_parents(
    chains: VonMisesChains, axes: tuple[int, ...], at: dict[int, Tensor]
) -> Callable[[Tensor], Tensor]:
    """Return the log density (N, Q), given draws of the parents, at angles (N, 1) in turns."""
    around = {**at, axes[-1]: torch.zeros(1, 1, dtype=torch.float64)}
    logs = _along(lambda p: _log_parents(chains, p), axes, around)[0]
    scale = torch.tensor(SCALES, dtype=torch.float64)
    kappa = (chains.concentrations[:, -1, None] / scale).flatten()
    logs = logs - log_sum_exp(logs)[:, None] - special.i0e(kappa).log()
    wave = _along(lambda p: waves(2 * math.pi * p), axes, around)[0]
    means = (wave @ chains.means[:, -1].mT).repeat_interleave(len(SCALES), dim=1)

    def log_prob(angle: Tensor) -> Tensor:
        distinct, place = unique(angle[:, 0], return_inverse=True)  # equal ones are evaluated once
        rows = torch.split(
            2 * math.pi * distinct[:, None, None], max(1, BLOCK_ENTRIES // logs.numel())
        )
        values = [log_sum_exp((r - means).cos_().sub_(1).mul_(kappa).add_(logs)) for r in rows]
        return torch.cat(values)[place]

    return log_prob


def _taken(
    factors: Sequence[Factor],
    at: dict[int, Tensor],
    even: dict[int, Tensor],
    given: dict[int, Callable[[Tensor], Tensor]],
) -> tuple[Tensor, list[Factor]]:
    """Return the log density of the observed angles, and the factors that need angles not there yet.

    Angles `at` are known (N, 1) or drawn (N, Q) by probabilities `even`, and more are drawn on the way.
    `given` are the densities of angles whose parents were all there; those that can be made are added.
    """
    total = torch.zeros(1, 1, dtype=torch.float64)
    left: list[Factor] = []
    for axes, chains in factors:
        axis = axes[-1]
        fixed = all(parent in at for parent in axes[:-1])
        if axis in given:
            total = total + given[axis](at[axis])
        elif fixed and axis in even:
            at[axis] = _drawn_at(chains, axes, at, even[axis])
        elif fixed and axis in at:
            total = total + _along(lambda p, c=chains: log_conditional(c, p), axes, at)
        else:
            left.append(Factor(axes, chains))
            if fixed:
                given[axis] = _given_parents(chains, axes, at)
    return total, left


def _along(
    function: Callable[[Tensor], Tensor], axes: tuple[int, ...], at: dict[int, Tensor]
) -> Tensor:
    """Return a function of points (R, len(axes)) at angles whose shapes broadcast, in their shape."""
    angles = broadcast(*[at[axis] for axis in axes])
    rows = torch.stack(angles, dim=-1).flatten(0, 1)
    value = torch.cat([function(block) for block in torch.split(rows, BLOCK_ROWS)])
    return value.reshape(*angles[0].shape, *value.shape[1:])


def _drawn_at(
    chains: VonMisesChains, axes: tuple[int, ...], at: dict[int, Tensor], even: Tensor
) -> Tensor:
    """Draw the last angle, (N, Q) or (1, Q), given its parents, by probabilities (Q, 2)."""
    around = {**at, axes[-1]: even.new_zeros(1, 1)}
    shares = _along(lambda p: shares_of(_log_parents(chains, p)), axes, around)
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
