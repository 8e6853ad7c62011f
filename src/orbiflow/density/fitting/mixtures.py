"""Mixtures of few von Mises or von Mises-Fisher components on any of the spaces, by EM."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from orbiflow.density.fitting.budget import training
from orbiflow.density.fitting.chains import PRIOR, PRIOR_RESULTANT, concentration
from orbiflow.density.fitting.kernels import NARROWEST, WIDEST
from orbiflow.density.models import FAINT, AdaptiveKernels, kernel_rows
from orbiflow.density.spaces import RoundSpace, Space, rectangle
from orbiflow.typed_torch import linalg, special

CONVERGED = 1e-4
"""Nats that an iteration of EM must gain."""

BLOCK = 4_096
"""Points worked on at a time."""


@training()
@torch.no_grad()
def fit_mixture(
    space: Space,
    train: Tensor,
    components: int,
    *,
    iterations: int = 60,
    narrowest: float = NARROWEST,
    generator: torch.Generator,
    row_weights: Tensor | None = None,
) -> AdaptiveKernels:
    """Fit a mixture of components with places, widths and weights of their own.

    Products of von Mises distributions with a concentration an angle on torus and Klein bottle, von
    Mises-Fisher on sphere and projective plane (Banerjee et al., Clustering on the unit hypersphere
    using von Mises-Fisher distributions, 2005), summed over the group. A few prior points hold each
    concentration finite.

    Args:
        space: The space.
        train: Canonical points (N, d), N >= components. On tori, angles may be missing (NaN): such a
            row counts by its marginal likelihood (Ghahramani and Jordan, Supervised learning from
            incomplete data via an EM approach, 1994). As many rows as components are whole.
        components: The number of components.
        iterations: Maximum number of iterations of EM.
        narrowest: The largest concentration.
        generator: The source of the start (k-means++).
        row_weights: Weights of the points (N,), of mean 1; default: equal.
    """
    absent = train.isnan()
    whole = ~absent.any(dim=1)
    images = space.features(train.nan_to_num(0.0))
    if not bool(whole.all()):
        images = images * ~torch.cat([absent, absent], dim=1)
    blocks = torch.split(images, BLOCK, dim=1)
    owns = [None] * len(blocks) if row_weights is None else torch.split(row_weights, BLOCK)
    gaps = [None] * len(blocks) if bool(whole.all()) else torch.split(absent.to(images), BLOCK)
    start = None if row_weights is None else row_weights[whole]
    mean = _spread_out(images[:, whole], components, generator, start)
    width = 1 if space.is_round else space.dim
    kappa = mean.new_full((components, width), 10.0)
    weights = mean.new_full((components,), 1 / components)
    last = -math.inf
    for _ in range(iterations):
        found = _expectation(
            space, list(zip(blocks, owns, gaps, strict=True)), mean, kappa, weights
        )
        count, known, total, score = found
        weights = (count + 0.01) / (count + 0.01).sum()
        mean, length = _directions(space, total)
        resultant = (length + PRIOR * PRIOR_RESULTANT) / (known + PRIOR)
        kappa = (_round_concentration if space.is_round else concentration)(resultant)
        kappa = kappa.clamp(WIDEST / 100, narrowest)
        if score - last < CONVERGED * len(train):
            break
        last = score
    return AdaptiveKernels(space, _points(space, mean), kappa, weights)


def _spread_out(
    images: Tensor, count: int, generator: torch.Generator, row_weights: Tensor | None
) -> Tensor:
    """Return features (K, m) of points far from each other over their images (E, N, m): k-means++."""
    own = images[0]
    weights = 1.0 if row_weights is None else row_weights
    if row_weights is None:
        chosen = [int(torch.randint(len(own), (), generator=generator))]
    else:
        chosen = [int(torch.multinomial(row_weights, 1, generator=generator))]
    far = ((images - own[chosen[0]]) ** 2).sum(dim=-1).amin(dim=0)
    for _ in range(count - 1):
        chosen.append(int(torch.multinomial(weights * (far + 1e-12), 1, generator=generator)))
        far = torch.minimum(far, ((images - own[chosen[-1]]) ** 2).sum(dim=-1).amin(dim=0))
    return own[chosen].clone()


def _expectation(
    space: Space,
    blocks: Sequence[tuple[Tensor, Tensor | None, Tensor | None]],
    mean: Tensor,
    kappa: Tensor,
    weights: Tensor,
) -> tuple[Tensor, Tensor, Tensor, float]:
    """Return what belongs to each component, and the log-likelihood.

    Args:
        blocks: features of points, 0 where they are missing, their weights, and what is missing.

    Returns:
        Points (K,) of each component, those of them that know each angle (K, 1) or (K, d), sums (K, m)
        of their nearest images' features, the log-likelihood.
    """
    rows, offsets = kernel_rows(space, mean, kappa)
    rows, offsets = rows.mT.contiguous(), offsets + weights.log()
    count, total, score = torch.zeros_like(weights), torch.zeros_like(mean), 0.0
    unknown: Tensor | float = 0.0
    for images, own, absent in blocks:
        joint = images @ rows + offsets
        if absent is not None:  # a factor that is not there has no constant either
            joint += absent @ (special.i0e(kappa).log() + kappa).mT
        top = joint.amax(dim=(0, 2), keepdim=True)
        share = (joint - top).clamp_min_(FAINT).exp_()
        every = share.sum(dim=(0, 2), keepdim=True)
        share /= every
        likelihood = every.log() + top
        if own is not None:
            share *= own[:, None]
            likelihood = likelihood[0, :, 0] * own
        count += share.sum(dim=(0, 1))
        if absent is not None:
            unknown = unknown + share[0].mT @ absent
        total += torch.einsum("enk,enm->km", share, images)
        score += float(likelihood.sum())
    return count, count[:, None] - unknown, total, score


def _directions(space: Space, total: Tensor) -> tuple[Tensor, Tensor]:
    """Return unit vectors of sums (K, m), and their lengths: of the whole, or of each angle."""
    parts = total[:, None] if space.is_round else torch.stack(total.chunk(2, dim=1), dim=-1)
    length = linalg.vector_norm(parts, dim=-1)
    unit = parts / length.clamp_min(1e-300)[..., None]
    return (unit[:, 0] if space.is_round else torch.cat(unit.unbind(dim=-1), dim=1)), length


def _round_concentration(resultant: Tensor) -> Tensor:
    """Return kappa of mean cosines coth(kappa) - 1 / kappa: Banerjee et al. (2005), then Newton."""
    r = resultant.clamp(1e-4, 1 - 1e-8)
    kappa = r * (3 - r**2) / (1 - r**2)
    for _ in range(4):
        ratio = 1 / torch.tanh(kappa) - 1 / kappa
        kappa = (kappa - (ratio - r) / (1 - ratio**2 - 2 * ratio / kappa)).clamp(1e-3, 1e8)
    return kappa


def _points(space: Space, mean: Tensor) -> Tensor:
    """Return chart points of features (K, m)."""
    if isinstance(space, RoundSpace):
        return space.vectors_to_chart(mean.numpy())
    cos, sin = mean.chunk(2, dim=1)
    return space.project(torch.atan2(sin, cos) / (2 * math.pi) * rectangle(space))
