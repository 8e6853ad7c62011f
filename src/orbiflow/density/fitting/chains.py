"""Fitting mixtures of von Mises chains by EM, and Bayesian networks of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from orbiflow.density.fitting.rows import Rows, gain_of
from orbiflow.density.models import (
    SCALES,
    ChainFits,
    Factor,
    VonMisesChains,
    VonMisesNetwork,
    at_scales,
    chained,
    concentration_for,
    log_conditional,
    seen_angles,
)
from orbiflow.density.spaces import Space, Torus
from orbiflow.typed_torch import linalg, special

PRIOR_POINTS, PRIOR_RESULTANT = 0.05, 0.9
"""Prior points of each component and their mean cosine, so that none shrinks to a point."""

SCALE_PRIOR_POINTS = 5.0
"""Prior points that pull a component's weights of the scales to those of all."""

SLOPE_PRECISION = 10.0
"""Prior precision of the slopes of the regressions."""

STRAIGHT_ITERATIONS = 5
"""First iterations of EM, without regressions."""

ITERATIONS_PER_LOOK, MIN_GAIN_NATS = 5, 1e-3
"""Iterations between looks at the held-out points, and nats between two of them that are too few."""


BLOCK_ENTRIES = 2**15
"""Rows times components worked on at a time: few enough for the cache."""


def _nll(mixture: VonMisesChains, rows: Rows) -> float:
    return -rows.mean(mixture.log_prob(rows.points))


@torch.no_grad()
def fit_chain_mixture(
    start: VonMisesChains, train: Rows, held: Rows, iterations: int
) -> VonMisesChains:
    """Fit by EM from a start whose chains have one order; return the iterate best on `held`."""
    step = _Maximization(train, start.order[0], len(start.order))
    mixture = best = start
    least = _nll(start, held)
    for iteration in range(1, iterations + 1):
        mixture = step(mixture, bent=iteration > STRAIGHT_ITERATIONS)
        if iteration % ITERATIONS_PER_LOOK == 0 or iteration == iterations:
            score = _nll(mixture, held)
            gain = least - score
            if gain > 0:
                best, least = mixture, score
            if not gain > MIN_GAIN_NATS:
                break
    return best


def spread_chains(
    space: Space, rows: Rows, count: int, order: Tensor, generator: torch.Generator
) -> VonMisesChains:
    """Return a uniform component and `count` round ones at rows far apart, in an order (d,)."""
    angle = 2 * math.pi * rows.points

    def away(row: int) -> Tensor:
        return (1 - (angle - angle[row]).cos()).sum(dim=1)

    chosen = far_apart(away, len(angle), count, generator, rows.weights)
    d = angle.shape[1]
    means = angle.new_zeros(count + 1, d, 1 + 2 * d)
    means[1:, :, 0] = angle[chosen]
    concentrations = angle.new_full((count + 1, d), 5.0)
    concentrations[0] = 0.0
    weights = angle.new_full((count + 1, len(SCALES)), 1.0 / (count + 1) / len(SCALES))
    return VonMisesChains(space, weights.log(), means, concentrations, order.repeat(count + 1, 1))


def far_apart(
    away: Callable[[int], Tensor],
    rows: int,
    count: int,
    generator: torch.Generator,
    weights: Tensor | None,
) -> list[int]:
    """Return `count` rows far from each other (k-means++); `away` tells the distances (N,) from one."""
    if weights is None:
        chosen = [int(torch.randint(rows, (), generator=generator))]
    else:
        chosen = [int(torch.multinomial(weights, 1, generator=generator))]
    far = away(chosen[0])
    for _ in range(count - 1):
        odds = far + 1e-12 if weights is None else weights * (far + 1e-12)
        chosen.append(int(torch.multinomial(odds, 1, generator=generator)))
        far = torch.minimum(far, away(chosen[-1]))
    return chosen


class _Block(NamedTuple):
    """Some rows: `seen_angles` (N, q), products of `waves` of all angles but the last, weights (N,)."""

    seen: Tensor
    products: Tensor
    row_weights: Tensor


class _Sums(NamedTuple):
    """What belongs to each component, summed over rows.

    - `counts`: (L, K), of each component and scale. `seen`: (K, p), waves, as far as rows count.
    - `gram`: (K, r), products of waves. `force`: (K, d - 1, p), waves times sines of residuals of all
      angles but the first, where they are regressed.
    """

    counts: Tensor
    seen: Tensor
    gram: Tensor
    force: Tensor


class _Maximization:
    """The E and M steps on fixed points, of chains of one order (d,); component 0 stays uniform."""

    def __init__(self, rows: Rows, order: Tensor, components: int) -> None:
        self.order, self.allowed = order, chained(order)
        seen, d = seen_angles(2 * math.pi * rows.points), len(order)
        before = order[:-1]
        self.regressors = torch.cat([before.new_zeros(1), 1 + before, 1 + d + before])
        before_waves = seen[:, d + self.regressors]
        products = (before_waves[:, :, None] * before_waves[:, None, :]).flatten(1)
        weights = torch.ones_like(seen[:, 0]) if rows.weights is None else rows.weights
        size = max(1, BLOCK_ENTRIES // components)
        parts = (torch.split(part, size) for part in (seen, products, weights))
        self.blocks = [_Block(*block) for block in zip(*parts, strict=True)]

    def __call__(self, mixture: VonMisesChains, *, bent: bool) -> VonMisesChains:
        sums, precise = self._expectation(mixture, bent)
        d, weight = mixture.means.shape[1], sums.counts.sum(dim=0)[1:]
        waves = sums.seen[1:]
        center = torch.atan2(waves[:, 1 : 1 + d], waves[:, 1 + d :])
        means = torch.zeros_like(mixture.means)
        means[1:, :, 0] = center
        if bent:
            means[1:] = self._regressed(mixture, sums, center)
        spread = self._spread(means, sums, precise)[1:] + PRIOR_POINTS * (1 - PRIOR_RESULTANT)
        concentrations = mixture.concentrations.clone()
        concentrations[1:] = concentration(1 - spread / (weight[:, None] + PRIOR_POINTS))
        return VonMisesChains(
            mixture.space, self._weights(sums.counts), means, concentrations, mixture.order
        )

    def _expectation(self, mixture: VonMisesChains, bent: bool) -> tuple[_Sums, list[Tensor]]:
        """Return sums, and what each row (N, K) counts for each component, one table a block."""
        scale = mixture.means.new_tensor(SCALES)
        scaled = mixture.concentrations / scale[:, None, None]
        peaks = (mixture.log_weights.mT - special.i0e(scaled).log().sum(dim=-1)).exp()
        fits = ChainFits(mixture.means, mixture.concentrations, mixture.order, regressed=bent)
        pairs = [_shared(block, fits, peaks, scale) for block in self.blocks]
        totals = (
            torch.stack(parts).sum(dim=0)
            for parts in zip(*[sums for sums, _ in pairs], strict=True)
        )
        return _Sums(*totals), [precise for _, precise in pairs]

    def _spread(self, means: Tensor, sums: _Sums, precise: list[Tensor]) -> Tensor:
        """Return sums (K, d) of 1 less the cosine of residuals of means (K, d, p)."""
        d, constant = len(self.order), means[..., 0]
        sine, cosine = sums.seen[:, 1 : 1 + d], sums.seen[:, 1 + d :]
        spread = sums.seen[:, :1] - (constant.sin() * sine + constant.cos() * cosine)
        for axis in range(d):
            if not bool(means[:, axis, 1:].any()):
                continue
            spread[:, axis] = sums.seen[:, 0]
            rows = -means[:, axis].mT
            for block, counts in zip(self.blocks, precise, strict=True):
                residual = torch.addmm(block.seen[:, axis, None], block.seen[:, d:], rows)
                spread[:, axis] -= residual.cos_().mul_(counts).sum(dim=0)
        return spread

    def _weights(self, count: Tensor) -> Tensor:
        count = count.mT
        pooled = count[1:].sum(dim=0)
        drawn = (count + SCALE_PRIOR_POINTS * pooled / pooled.sum()) / (
            count.sum(1, keepdim=True) + SCALE_PRIOR_POINTS
        )
        drawn[0] = 1 / len(SCALES)
        total = count.sum(dim=1, keepdim=True) + 0.1
        return (drawn * total / total.sum()).log()

    def _regressed(self, mixture: VonMisesChains, sums: _Sums, center: Tensor) -> Tensor:
        """Take one Fisher scoring step of all circular regressions, their slopes held by a ridge."""
        count, kappa = len(center), mixture.concentrations[1:]
        bessel = special.i1e(kappa) / special.i0e(kappa)
        local = _local(center)
        back = linalg.inv(local)
        at = self.regressors
        gram = torch.zeros_like(local)
        gram[:, at[:, None], at] = sums.gram[1:].reshape(count, len(at), -1)
        gram = local @ gram @ local.mT
        force = self._forces(mixture, sums)[1:] @ local.mT
        slopes = mixture.means[1:] @ back
        regressed = torch.zeros_like(slopes)
        for i, used in enumerate(self.allowed):
            at = used.nonzero()[:, 0]
            ridge = SLOPE_PRECISION / kappa[:, i, None] * torch.ones(len(at)).to(kappa)
            ridge[:, 0] = 1e-6
            now = slopes[:, i, at]
            # the constant is free
            right = force[:, i, at] - ridge * torch.cat([0 * now[:, :1], now[:, 1:]], dim=1)
            matrix = bessel[:, i, None, None] * gram[:, at][:, :, at] + torch.diag_embed(ridge)
            regressed[:, i, at] = now + linalg.solve(matrix, right)
        return (regressed @ local) * self.allowed

    def _forces(self, mixture: VonMisesChains, sums: _Sums) -> Tensor:
        """Return sums (K, d, p) of waves times sines of residuals; the first angle has a constant."""
        first, d = self.order[0], len(self.order)
        constant, forces = mixture.means[:, first, 0], torch.zeros_like(mixture.means)
        forces[:, self.order[1:]] = sums.force
        sine, cosine = sums.seen[:, 1 + first], sums.seen[:, 1 + d + first]
        forces[:, first, 0] = constant.cos() * sine - constant.sin() * cosine
        return forces


def _shared(block: _Block, fits: ChainFits, peaks: Tensor, scale: Tensor) -> tuple[_Sums, Tensor]:
    """Return what belongs to components of `peaks` (L, K), and what rows (N, K) count for each."""
    fit, residuals = fits.at(block.seen)
    tables = at_scales(fit)[::-1]
    total = sum(table @ peak for table, peak in zip(tables, peaks, strict=True))
    row = block.row_weights / total  # a uniform component keeps all sums above 0
    counts = torch.stack([table.mT @ row for table in tables]).mul_(peaks)
    precise = tables[0].mul_(peaks[0])
    for table, factor in zip(tables[1:], peaks[1:] / scale[1:, None], strict=True):
        precise.addcmul_(table, factor)
    precise.mul_(row[:, None])
    waves = block.seen[:, (block.seen.shape[1] - 1) // 3 :]
    force = [(precise * residual.sin_()).mT @ waves for residual in residuals]
    sums = _Sums(
        counts,
        precise.mT @ waves,
        precise.mT @ block.products,
        torch.stack(force, dim=1) if force else waves[:0],
    )
    return sums, precise


def _local(center: Tensor) -> Tensor:
    """Return matrices (K, p, p) that make 1, sin(x - c), 1 - cos(x - c) from 1, sin x, cos x.

    About its centre a component's regression is well conditioned and its slopes can be compared.
    """
    count, d = center.shape
    i = torch.arange(d)
    local = center.new_zeros(count, 1 + 2 * d, 1 + 2 * d)
    local[:, 0, 0] = 1
    local[:, 1 + i, 1 + i] = center.cos()
    local[:, 1 + i, 1 + d + i] = -center.sin()
    local[:, 1 + d + i, 0] = 1
    local[:, 1 + d + i, 1 + d + i] = -center.cos()
    local[:, 1 + d + i, 1 + i] = -center.sin()
    return local


def concentration(resultant: Tensor, dim: int = 1) -> Tensor:
    """Return kappa of von Mises-Fisher densities on S^dim that have these mean cosines.

    On the circle, where it is asked for at every step of a fit, by torch's own Bessel functions.
    """
    r = resultant.clamp(1e-6, 1 - 1e-8)
    if dim > 1:
        return concentration_for(r, 1 - r, dim + 1).clamp(1e-6, 1e8)
    kappa = r * (2 - r**2) / (1 - r**2)
    for _ in range(4):
        ratio = special.i1e(kappa) / special.i0e(kappa)
        kappa = (kappa - (ratio - r) / (1 - ratio**2 - ratio / kappa)).clamp(1e-6, 1e8)
    return kappa


MOST_PARENTS = 3
"""The most parents of an angle."""

MAX_PROPOSED_PARENTS = 2
"""Number of angles that are tried as a further parent."""

SIZES = (4, 8, 16, 32, 64, 128)
"""Numbers of components of a factor."""

FIRST_COMPONENTS = 16
"""Components with which parents are chosen, if there are rows for as many."""

ROWS_PER_COMPONENT = 20
"""Rows that each component must have on average."""

WORTHWHILE_NATS = 0.005
"""Nats that a parent, or twice as many components, must gain."""

MAX_SEARCHED_ROWS = 4_000
"""The most rows by which the arrows are chosen."""

MAX_ITERATIONS = 40
"""Maximum iterations of EM."""

HARMONICS, ADDED_VARIANCE = 4, 1e-3
"""Waves of each angle by which dependence is screened, and what is added to their variances."""


class FactorShape(NamedTuple):
    """The shape of a factor: its angles, parents before their child, and its number of components."""

    axes: tuple[int, ...]
    components: int


def network_shapes(rows: Rows, held: Rows, generator: torch.Generator) -> Iterator[FactorShape]:
    """Yield factors one after the other, chosen by held-out rows; parents before their children.

    The order is that of Prim's algorithm on the angles' dependence (as Chow and Liu, 1968), parents
    are taken one by one as long as they gain.
    """
    rows = rows[:MAX_SEARCHED_ROWS]
    seen = Screen(rows.points)
    order = seen.order()
    for place, axis in enumerate(order):
        yield _factor_shape(axis, order[:place], seen, rows, held, generator)


def fit_network(
    space: Torus, rows: Rows, held: Rows, shapes: Sequence[FactorShape], generator: torch.Generator
) -> VonMisesNetwork:
    """Fit factors of these shapes."""
    return VonMisesNetwork(
        space, [Factor(axes, _fitted(rows, held, axes, size, generator)) for axes, size in shapes]
    )


def _factor_shape(
    axis: int, before: list[int], seen: Screen, rows: Rows, held: Rows, generator: torch.Generator
) -> FactorShape:
    most = max(SIZES[0], len(rows) // ROWS_PER_COMPONENT)
    first = max(size for size in SIZES if size <= min(FIRST_COMPONENTS, most))

    def score(axes: tuple[int, ...], size: int) -> Tensor:
        chains = _fitted(rows, held, axes, size, generator)
        with torch.no_grad():
            return log_conditional(chains, held.points[:, list(axes)])

    parents: tuple[int, ...] = ()
    best = score((axis,), first)
    while len(parents) < min(MOST_PARENTS, len(before)):
        proposed = seen.parents(axis, parents, before)[:MAX_PROPOSED_PARENTS]
        scores = {parent: score((*parents, parent, axis), first) for parent in proposed}
        parent = max(scores, key=lambda candidate: held.mean(scores[candidate]))
        gain = gain_of(scores[parent], best, held.weights)
        if gain.nats <= max(WORTHWHILE_NATS, gain.error):
            break
        parents, best = (*parents, parent), scores[parent]
    size, axes = first, (*parents, axis)
    while 2 * size <= min(SIZES[-1], most):
        value = score(axes, 2 * size)
        if gain_of(value, best, held.weights).nats < WORTHWHILE_NATS:
            break
        size, best = 2 * size, value
    return FactorShape(axes, size)


def _fitted(
    rows: Rows, held: Rows, axes: tuple[int, ...], size: int, generator: torch.Generator
) -> VonMisesChains:
    train, beside = (Rows(part.points[:, list(axes)], part.weights) for part in (rows, held))
    start = spread_chains(Torus(len(axes)), train, size, torch.arange(len(axes)), generator)
    return fit_chain_mixture(start, train, beside, MAX_ITERATIONS)


class Screen:
    """How much angles (N, d), in turns, say about each other: Gaussian mutual information of waves.

    It uses a few moments only; what it proposes is then tried.
    """

    def __init__(self, points: Tensor) -> None:
        harmonics = torch.arange(1, HARMONICS + 1).to(points)
        angle = 2 * math.pi * points[..., None] * harmonics
        seen = torch.cat([angle.cos(), angle.sin()], dim=2).flatten(1)
        self.dim = points.shape[1]
        self.covariance = torch.cov(seen.mT)
        self.covariance += ADDED_VARIANCE * torch.eye(len(self.covariance)).to(points)

    def order(self) -> list[int]:
        """Return the angle that says most about all, then those about which the ones before do."""
        pairs = torch.zeros(self.dim, self.dim, dtype=torch.float64)
        for i in range(self.dim):
            for j in range(i):
                pairs[i, j] = pairs[j, i] = self.between(i, j)
        order = [int(pairs.sum(dim=1).argmax())]
        while len(order) < self.dim:
            left = [i for i in range(self.dim) if i not in order]
            order.append(max(left, key=lambda i: float(pairs[i, order].max())))
        return order

    def parents(self, axis: int, known: tuple[int, ...], before: list[int]) -> list[int]:
        """Return the angles before an angle, by what they say about it beyond those that are known."""
        left = [i for i in before if i not in known]
        return sorted(left, key=lambda i: -self.between(axis, i, known))

    def between(self, one: int, other: int, known: tuple[int, ...] = ()) -> float:
        """Return the nats that two angles say about each other, beyond those that are known."""
        return 0.5 * (
            self._log_det(one, *known)
            + self._log_det(other, *known)
            - self._log_det(*known)
            - self._log_det(one, other, *known)
        )

    def _log_det(self, *axes: int) -> float:
        if not axes:
            return 0.0
        width = 2 * HARMONICS
        at = torch.cat([torch.arange(width) + width * axis for axis in axes])
        return float(torch.logdet(self.covariance[at][:, at]))
