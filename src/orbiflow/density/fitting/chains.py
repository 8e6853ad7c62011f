"""Fitting a mixture of von Mises chains: EM with a prior, size by validation, averaged starts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from orbiflow.density.fitting.budget import Budget, training
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import (
    SCALES,
    VonMisesChains,
    averaged,
    chained,
    shares_of,
    waves,
)
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import linalg, special

PRIOR, PRIOR_RESULTANT = 0.05, 0.9
"""Imaginary points of a component and their mean cosine: none shrinks to a point."""

SHARED = 5.0
"""Imaginary points that draw a component's weights of the scales to those of all."""

RIDGE = 10.0
"""Prior precision of the slopes of the regressions."""

STRAIGHT = 5
"""First iterations of EM, without regressions."""

EVERY, PATIENCE = 5, 2
"""Iterations between looks at the validation points, and looks that may bring nothing better."""

SMALLEST, PER_POINT = 8, 10
"""Components tried first, and training points that each must have on average."""

WORTHWHILE = 0.01
"""Nats of validation that twice as many components must bring."""

Watch = Callable[[float, str], None]
"""Told the share of the work done and what is being done."""


@dataclass(frozen=True)
class ChainsFit:
    """What a fit found: the mixture, components of each member, members; whether time ran out."""

    mixture: VonMisesChains
    components: int
    members: int
    late: bool
    seconds: float


@training()
def fit_chains(
    space: Space,
    train: Tensor,
    validation: Tensor,
    *,
    components: int = 64,
    members: int = 12,
    iterations: int = 60,
    seconds: float = math.inf,
    seed: int = 0,
    watch: Watch | None = None,
) -> ChainsFit:
    """Mixtures of 8, 16, ... components while validation improves, then the mean of several starts.

    EM ends in another optimum from every start; the mean of their densities is better on new points
    than any of them (Breiman, Bagging predictors, 1996, without the bootstrap). Starts after the
    first have their angles in random orders, so that they differ more (as in Germain et al., MADE,
    2015).

    Args:
        space: a `Torus`.
        train, validation: (N, d) and (M, d) canonical points, float64.
        components: at most, in each member.
        members: starts that are averaged; those that do not help on `validation` are left out.
        iterations: of EM, at most.
        seconds: after which no further iteration of EM begins; the first mixture has its start at
            least.
        seed: of the starts.
        watch: told how far it is.

    Raises:
        OrbiflowError: for a space that is not a torus, or fewer than two training points.
    """
    if len(train) < 2 or not len(validation):
        raise OrbiflowError(f"a mixture needs 2 training points or more, got {len(train)}")
    began, budget = time.monotonic(), Budget(seconds=seconds)
    rows, held = Rows(train), Rows(validation)
    most = max(1, min(components, len(train) // PER_POINT))
    generator = torch.Generator().manual_seed(seed)
    size = min(SMALLEST, most)

    def start(count: int, order: Tensor) -> VonMisesChains:
        spread = spread_chains(space, rows, count, order, generator)
        return fit_chain_mixture(spread, rows, held, iterations, budget)

    natural = torch.arange(space.dim)
    best = start(size, natural)
    while size < most:
        if budget.is_spent:
            break
        larger = min(2 * size, most)
        if watch is not None:
            watch(0.0, f"mixture of {larger} components")
        found = start(larger, natural)
        if _nll(found, held) > _nll(best, held) - WORTHWHILE:
            break
        size, best = larger, found
    kept, score = [best], best.log_prob(validation)
    for number in range(1, members):
        if budget.is_spent:
            break
        if watch is not None:
            watch(number / members, f"mixture of {size} components, start {number + 1}")
        found = start(size, torch.randperm(space.dim, generator=generator))
        joint = torch.logaddexp(score, found.log_prob(validation))
        if _mean(joint, len(kept) + 1) > _mean(score, len(kept)):
            kept, score = [*kept, found], joint
    return ChainsFit(averaged(kept), size, len(kept), budget.is_late, time.monotonic() - began)


def _mean(log_sum: Tensor, count: int) -> float:
    return float(log_sum.mean()) - math.log(count)


def _nll(mixture: VonMisesChains, rows: Rows) -> float:
    return -rows.mean(mixture.log_prob(rows.points))


@torch.no_grad()
def fit_chain_mixture(
    start: VonMisesChains,
    train: Rows,
    held: Rows,
    iterations: int,
    budget: Budget,
    *,
    patience: int = PATIENCE,
    worthwhile: float = 0.0,
) -> VonMisesChains:
    """EM from a start, all of whose chains have one order; the iterate that was best on `held`.

    It ends after more looks than `patience` that bring no more than `worthwhile` nats.
    """
    step = _Maximization(train, start.order[0])
    mixture = best = start
    least, idle = _nll(start, held), 0
    for iteration in range(1, iterations + 1):
        late = budget.is_spent
        if not late:
            mixture = step(mixture, bent=iteration > STRAIGHT)
        if iteration % EVERY == 0 or iteration == iterations or late:
            score = _nll(mixture, held)
            idle = 0 if score < least - worthwhile else idle + 1
            if score < least:
                best, least = mixture, score
            if idle > patience:
                break
        if late:
            break
    return best


def spread_chains(
    space: Space, rows: Rows, count: int, order: Tensor, generator: torch.Generator
) -> VonMisesChains:
    """A uniform component and `count` round ones at rows far from each other (k-means++).

    Its chains take the angles in `order` (d,).
    """
    angle, own = 2 * math.pi * rows.points, rows.weights
    if own is None:
        chosen = [int(torch.randint(len(angle), (), generator=generator))]
    else:
        chosen = [int(torch.multinomial(own, 1, generator=generator))]
    far = (1 - (angle - angle[chosen[0]]).cos()).sum(dim=1)
    for _ in range(count - 1):
        odds = far + 1e-12 if own is None else own * (far + 1e-12)
        chosen.append(int(torch.multinomial(odds, 1, generator=generator)))
        far = torch.minimum(far, (1 - (angle - angle[chosen[-1]]).cos()).sum(dim=1))
    d = angle.shape[1]
    means = angle.new_zeros(count + 1, d, 1 + 2 * d)
    means[1:, :, 0] = angle[chosen]
    concentrations = angle.new_full((count + 1, d), 5.0)
    concentrations[0] = 0.0
    weights = angle.new_full((count + 1, len(SCALES)), 1.0 / (count + 1) / len(SCALES))
    return VonMisesChains(space, weights.log(), means, concentrations, order.repeat(count + 1, 1))


class _Maximization:
    """The E and M steps on fixed points, of chains of one order (d,); component 0 stays uniform."""

    def __init__(self, rows: Rows, order: Tensor) -> None:
        points = rows.points
        self.row_weights = rows.weights
        self.points, self.allowed = points, chained(order)
        self.angle = 2 * math.pi * points
        self.waves = waves(self.angle)
        self.products = (self.waves[:, :, None] * self.waves[:, None, :]).flatten(1)
        self.scale = points.new_tensor(SCALES)

    def __call__(self, mixture: VonMisesChains, *, bent: bool) -> VonMisesChains:
        joint = mixture.joint(self.points)
        share = shares_of(joint.flatten(1)).reshape(joint.shape)  # (N, L, K)
        if self.row_weights is not None:
            share = share * self.row_weights[:, None, None]
        weight = share[..., 1:].sum(dim=1)  # (N, K) of each component
        precise = (share[..., 1:] / self.scale[:, None]).sum(dim=1)  # each as far as it counts
        center = torch.atan2(precise.mT @ self.angle.sin(), precise.mT @ self.angle.cos())
        means = mixture.means.clone()
        if bent:
            means[1:] = self._regressed(mixture, precise, center)
        else:
            means[1:] = 0.0
            means[1:, :, 0] = center
        weights = self._weights(share)
        moved = VonMisesChains(mixture.space, weights, means, mixture.concentrations, mixture.order)
        loss = 1 - moved.residuals(self.points)[:, 1:].cos()
        spread = torch.einsum("nk,nkd->kd", precise, loss) + PRIOR * (1 - PRIOR_RESULTANT)
        concentrations = mixture.concentrations.clone()
        concentrations[1:] = concentration(1 - spread / (weight.sum(dim=0)[:, None] + PRIOR))
        return VonMisesChains(mixture.space, weights, means, concentrations, mixture.order)

    def _weights(self, share: Tensor) -> Tensor:
        count = share.sum(dim=0).mT
        pooled = count[1:].sum(dim=0)
        drawn = (count + SHARED * pooled / pooled.sum()) / (count.sum(1, keepdim=True) + SHARED)
        drawn[0] = 1 / len(SCALES)
        total = count.sum(dim=1, keepdim=True) + 0.1
        return (drawn * total / total.sum()).log()

    def _regressed(self, mixture: VonMisesChains, precise: Tensor, center: Tensor) -> Tensor:
        """One Fisher scoring step of all circular regressions, their slopes held by a ridge."""
        count, d = center.shape
        kappa = mixture.concentrations[1:]
        bessel = special.i1e(kappa) / special.i0e(kappa)
        local = _local(center)
        back = linalg.inv(local)
        gram = local @ (precise.mT @ self.products).reshape(count, 1 + 2 * d, -1) @ local.mT
        pull = mixture.residuals(self.points)[:, 1:].sin() * precise[..., None]
        force = torch.einsum("nkd,np->kdp", pull, self.waves) @ local.mT
        slopes = mixture.means[1:] @ back
        found = torch.zeros_like(slopes)
        for i, used in enumerate(self.allowed):
            at = used.nonzero()[:, 0]
            ridge = RIDGE / kappa[:, i, None] * torch.ones(len(at)).to(kappa)
            ridge[:, 0] = 1e-6
            now = slopes[:, i, at]
            # the constant is free
            right = force[:, i, at] - ridge * torch.cat([0 * now[:, :1], now[:, 1:]], dim=1)
            matrix = bessel[:, i, None, None] * gram[:, at][:, :, at] + torch.diag_embed(ridge)
            found[:, i, at] = now + linalg.solve(matrix, right)
        return (found @ local) * self.allowed


def _local(center: Tensor) -> Tensor:
    """Matrices (K, p, p): 1, sin(x - c), 1 - cos(x - c) from 1, sin x, cos x.

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


def concentration(resultant: Tensor) -> Tensor:
    """kappa of mean cosines I1(kappa) / I0(kappa) in (0, 1): Best and Fisher (1981), then Newton."""
    r = resultant.clamp(1e-6, 1 - 1e-8)
    kappa = torch.where(
        r < 0.53,
        2 * r + r**3 + 5 * r**5 / 6,
        torch.where(r < 0.85, -0.4 + 1.39 * r + 0.43 / (1 - r), 1 / (r**3 - 4 * r**2 + 3 * r)),
    )
    for _ in range(3):
        ratio = special.i1e(kappa) / special.i0e(kappa)
        kappa = kappa - (ratio - r) / (1 - ratio / kappa - ratio**2)
        kappa = kappa.clamp(1e-6, 1e8)
    return kappa
