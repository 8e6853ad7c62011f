"""Chains on products by EM: other columns, and regressions of directions on them."""

from __future__ import annotations

import math
from typing import NamedTuple, cast

import torch
from torch import Tensor

from orbiflow.density.fitting.chains import PRIOR_POINTS, PRIOR_RESULTANT, concentration
from orbiflow.density.fitting.kernels import (
    MAX_ITERATIONS,
    MIN_GAIN_NATS,
    NARROWEST,
    WIDEST,
    concentrations_of,
)
from orbiflow.density.fitting.likelihood import training
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import AdaptiveKernels, ProductChains, waves
from orbiflow.density.spaces import ProductSpace
from orbiflow.typed_torch import linalg

PRIOR_SLOPES = 1.0
"""Rows in favour of slopes of 0, in squares."""

LEAST_DETERMINED = 1e-6
"""The same for constants, which any row determines."""

BLOCK_ENTRIES = 500_000
"""Entries of the table of points against components and features worked on at a time."""


class _Sums(NamedTuple):
    """What belongs to each component.

    - `rows`: How many rows (K,). `score`: The log-likelihood ().
    - `products`: Sums (K, L, L) of products of the rows' waves; `targets`: those (K, L, m) of waves and
      the features of nearest images.
    - `cosines`: Sums (K, F) of cosines on each sphere of the base.
    - `lines`: Sums (K, 2, k) of cosines and sines of the other columns.
    """

    rows: Tensor
    products: Tensor
    targets: Tensor
    cosines: Tensor
    lines: Tensor
    score: Tensor


@training()
@torch.no_grad()
def fit_product_chains(
    start: AdaptiveKernels,
    train: Rows,
    *,
    iterations: int = MAX_ITERATIONS,
    narrowest: float = NARROWEST,
) -> ProductChains:
    """Fit chains to rows by EM, from a mixture of as many products.

    The slopes are weighted least squares of features on waves, whose direction is nearly the likeliest
    where a component is concentrated. Weights of rows have the mean 1.
    """
    space = cast(ProductSpace, start.space)
    base, count = space.base, space.beside.dim
    center = base.features(start.centers[:, : base.chart_dim])[0]
    slopes = center.new_zeros(len(center), 1 + 2 * count, center.shape[1])
    slopes[:, 0] = center
    kappa, first = start.concentrations, len(base.spheres)
    chains = ProductChains(
        space, start.weights, start.centers[:, -count:], kappa[:, first:], slopes, kappa[:, :first]
    )
    prior = torch.full((1 + 2 * count,), PRIOR_SLOPES, dtype=torch.float64)
    prior[0] = LEAST_DETERMINED
    last = -math.inf
    for _ in range(iterations):
        sums = _expectation(chains, train)
        weights = (sums.rows + 0.01) / (sums.rows + 0.01).sum()
        slopes = linalg.solve(sums.products + prior.diag(), sums.targets)
        counts = sums.rows[:, None] + PRIOR_POINTS
        resultant = (sums.cosines + PRIOR_POINTS * PRIOR_RESULTANT) / counts
        kappa = concentrations_of(resultant, base.spheres).clamp(WIDEST / 100, narrowest)
        length = linalg.vector_norm(sums.lines, dim=1)
        sharp = concentration((length + PRIOR_POINTS * PRIOR_RESULTANT) / counts)
        center = torch.atan2(sums.lines[:, 1], sums.lines[:, 0]) / (2 * math.pi) % 1
        sharp = sharp.clamp(WIDEST / 100, narrowest)
        chains = ProductChains(space, weights, center, sharp, slopes, kappa)
        if float(sums.score) - last < MIN_GAIN_NATS * len(train):
            break
        last = float(sums.score)
    return chains


def _expectation(chains: ProductChains, train: Rows) -> _Sums:
    """Return what belongs to each component of chains."""
    base, parts = chains.base, list[_Sums]()
    entries = len(chains.weights) * chains.slopes.shape[-1]
    size = max(1, BLOCK_ENTRIES // entries)
    weights = [None] if train.weights is None else torch.split(train.weights, size)
    for k, points in enumerate(torch.split(train.points, size)):
        places, turns = points[:, : base.chart_dim], points[:, base.chart_dim :]
        images, row = base.features(places), weights[k] if train.weights is not None else None
        logs, cosines = chains.image_logs(images, turns)
        every = logs.logsumexp(dim=(0, 2))
        shares = (logs - every[:, None]).exp()
        score = (every if row is None else every * row).sum()
        shares = shares if row is None else shares * row[:, None]
        rows, seen = shares.sum(dim=0), waves(2 * math.pi * turns)
        nearest = torch.einsum("enk,enm->nkm", shares, images)
        angle = 2 * math.pi * turns
        parts.append(
            _Sums(
                rows.sum(dim=0),
                torch.einsum("nk,nl,nj->klj", rows, seen, seen),
                torch.einsum("nl,nkm->klm", seen, nearest),
                torch.einsum("enk,enkf->kf", shares, cosines),
                torch.einsum("nk,npf->kpf", rows, torch.stack([angle.cos(), angle.sin()], dim=1)),
                score,
            )
        )
    return _Sums(*(torch.stack(places).sum(dim=0) for places in zip(*parts, strict=True)))
