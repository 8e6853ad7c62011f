"""Kernel estimates at many scales: of one width, and of widths that follow the data."""

from __future__ import annotations

import itertools

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.fitting.folds import places
from orbiflow.density.fitting.kernels import (
    ISOTROPY,
    NARROWEST,
    NEIGHBOURS,
    SCALES,
    WIDEST,
    spreads,
)
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.spaces.space import Space

MOST_CENTERS = 20_000
"""Kernels of an estimate at most."""

LADDER = 27
"""Widths, from `WIDEST` to `NARROWEST`: neighbours differ by a factor of 1.4."""


def kernel_estimates(
    space: Space,
    train: Tensor,
    *,
    narrowest: float = NARROWEST,
    repeats: bool = True,
    row_weights: Tensor | None = None,
) -> dict[str, AdaptiveKernels]:
    """Estimates about training points (N, d) in random order, by their names.

    "width ..." have one concentration, in a ladder; "near ..." a share of the mean square distance to
    the nearest neighbours, on tori axis by axis (Breiman, Meisel, Purcell, 1977); "repeated" are the
    narrowest kernels, about the places of several points alone.

    Args:
        narrowest: concentration at most.
        repeats: whether places of several points count as such.
        row_weights: of the points (N,); default equal.
    """
    train = train[:MOST_CENTERS]
    own = (
        None
        if row_weights is None
        else row_weights[:MOST_CENTERS] / row_weights[:MOST_CENTERS].sum()
    )
    found: dict[str, AdaptiveKernels] = {}
    for kappa in np.geomspace(WIDEST, narrowest, LADDER):
        found[f"width {kappa**-0.5:.2g}"] = even_kernels(space, train, float(kappa), own)
    counts, place = places(train)
    first = torch.full((len(counts),), len(train)).scatter_reduce(
        0, place, torch.arange(len(train)), "amin"
    )
    centers, weights = train[first], counts.double() / len(train)
    if own is not None:
        weights = torch.zeros_like(weights).index_add_(0, place, own)
    neighbours = [m for m in NEIGHBOURS if m < len(centers)]
    shrinkage = (1.0,) if space.is_round or space.dim == 1 else ISOTROPY
    for number, spread in zip(neighbours, spreads(space, centers, neighbours), strict=True):
        mean = spread.mean(dim=1, keepdim=True)
        for scale, share in itertools.product(SCALES, shrinkage):
            kappa = 1 / (scale * ((1 - share) * spread + share * mean))
            name = f"near {number}, {scale:g}, {share:g}"
            found[name] = AdaptiveKernels(space, centers, kappa.clamp(WIDEST, narrowest), weights)
    repeated = counts > 1
    if repeats and bool(repeated.any()):
        weights = weights[repeated] / weights[repeated].sum()
        found["repeated"] = even_kernels(space, centers[repeated], narrowest, weights)
    return found


def even_kernels(
    space: Space, centers: Tensor, kappa: float, weights: Tensor | None = None
) -> AdaptiveKernels:
    """Kernels of one concentration about centers (N, d); weights default equal."""
    width = 1 if space.is_round else space.dim
    if weights is None:
        weights = torch.full((len(centers),), 1 / len(centers), dtype=torch.float64)
    return AdaptiveKernels(space, centers, centers.new_full((len(centers), width), kappa), weights)


def joined(parts: list[AdaptiveKernels], shares: Tensor) -> AdaptiveKernels:
    """The mixture of mixtures of kernels on one space, in proportions (P,)."""
    weights = [
        share * part.weights for share, part in zip(shares / shares.sum(), parts, strict=True)
    ]
    return AdaptiveKernels(
        parts[0].space,
        torch.cat([part.centers for part in parts]),
        torch.cat([part.concentrations for part in parts]),
        torch.cat(weights),
    )
