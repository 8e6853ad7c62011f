"""Fitting a mixture of von Mises chains by EM with a prior."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from orbiflow.density.fitting.budget import Budget
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import SCALES, VonMisesChains, chained, shares_of, waves
from orbiflow.density.spaces import Space
from orbiflow.typed_torch import linalg, special

PRIOR, PRIOR_RESULTANT = 0.05, 0.9
"""Prior points of each component and their mean cosine, so that none shrinks to a point."""

SHARED = 5.0
"""Prior points that pull a component's weights of the scales to those of all."""

RIDGE = 10.0
"""Prior precision of the slopes of the regressions."""

STRAIGHT = 5
"""First iterations of EM, without regressions."""

EVERY, PATIENCE = 5, 2
"""Iterations between looks at the held-out points, and looks that may gain nothing."""


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
    """Fit by EM from a start whose chains have one order; return the iterate best on `held`.

    It ends after more than `patience` looks at `held` that gain no more than `worthwhile` nats.
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
    """Return a uniform component and `count` round ones at rows far from each other (k-means++).

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
        """Take one Fisher scoring step of all circular regressions, their slopes held by a ridge."""
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


def concentration(resultant: Tensor) -> Tensor:
    """Return kappa of mean cosines I1(kappa) / I0(kappa): Best and Fisher (1981), then Newton."""
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
