"""Kernel estimates, and kernels beside a flow, with widths and weights by held-out points."""

from __future__ import annotations

import itertools
import math

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from orbiflow.density.arguments import check_kind, points_tensor
from orbiflow.density.fitting.budget import training
from orbiflow.density.fitting.folds import places
from orbiflow.density.fitting.rows import mean_of
from orbiflow.density.models import AdaptiveKernels, Density, Mixture, UniformDensity
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import unique

MOST_KERNELS, MOST_HELD = 20_000, 2_000
"""The most centers, and the most held-out points that choose the widths."""

NEIGHBOURS = (2, 4, 8, 16)
SCALES = (0.1, 0.2, 0.4, 0.8, 1.6)
ISOTROPY = (0.05, 0.3)
NARROWEST, WIDEST = 1e7, 0.5
"""The largest and the least concentration: a deviation of 0.02 degrees, or nearly uniform."""

FLOOR = 1e-3
"""The least weight of the uniform density, so that no observation is impossible."""


@training()
def blend_kernels(
    density: Density,
    train: Tensor,
    held: Tensor,
    *,
    row_weights: Tensor | None = None,
    held_weights: Tensor | None = None,
) -> Mixture:
    """Blend a fitted density with adaptive kernels about the training points and a uniform floor.

    Each kernel's variance is a share of the mean square distance to its nearest neighbours (Breiman,
    Meisel, Purcell, 1977), on tori axis by axis. The share, the number of neighbours and the
    proportions of flow, kernels and floor are those best on the held-out points.

    Args:
        density: Any density.
        train: Canonical points (N, d) that the kernels are about.
        held: Canonical points (M, d) that choose widths and proportions.
        row_weights: Weights of the training points (N,); default: equal.
        held_weights: Weights of the held-out points (M,); default: equal.

    Raises:
        OrbiflowError: for points of another shape, fewer than three different ones to train on, or none
            held out.
    """
    space = check_kind(density, Density, "density").space
    train = points_tensor(train, space.dim, "training points", flat=True).double()
    held = points_tensor(held, space.dim, "held points", flat=True).double()
    centers, place, counts = unique(train, dim=0, return_inverse=True, return_counts=True)
    if row_weights is not None:
        counts = row_weights.new_zeros(len(centers)).index_add_(0, place, row_weights)
    if len(centers) > MOST_KERNELS:
        chosen = torch.randperm(len(centers), generator=torch.Generator().manual_seed(0))
        centers, counts = centers[chosen[:MOST_KERNELS]], counts[chosen[:MOST_KERNELS]]
    if len(centers) <= min(NEIGHBOURS) or not len(held):
        raise OrbiflowError(
            f"kernels need {min(NEIGHBOURS) + 1} different points or more and some held out, got "
            f"{len(centers)} and {len(held)}"
        )
    weights = counts.double() / counts.sum()
    held = held[:MOST_HELD]
    held_weights = None if held_weights is None else held_weights[:MOST_HELD]
    found_spreads = spreads(space, centers, [m for m in NEIGHBOURS if m < len(centers)])
    uniform = UniformDensity(space)
    with torch.no_grad():
        others = [density.log_prob(held), uniform.log_prob(held)]
    best, found = -math.inf, None
    shrinkage = (1.0,) if space.is_round or space.dim == 1 else ISOTROPY
    for spread, scale, share in itertools.product(found_spreads, SCALES, shrinkage):
        mean = spread.mean(dim=1, keepdim=True)
        kappa = 1 / (scale * ((1 - share) * spread + share * mean))
        kernels = AdaptiveKernels(space, centers, kappa.clamp(WIDEST, NARROWEST), weights)
        parts = torch.stack([others[0], kernels.log_prob(held), others[1]])
        shares, score = proportions(parts, row_weights=held_weights)
        if score > best:
            best, found = score, Mixture([density, kernels, uniform], shares)
    assert found is not None
    return found


def proportions(
    parts: Tensor, *, iterations: int = 60, row_weights: Tensor | None = None
) -> tuple[Tensor, float]:
    """Return proportions (3,) that suit log densities `parts` (3, N) best, by EM, and their score.

    The last is kept at `FLOOR` or more.
    """
    shares = torch.full_like(parts[:, 0], 1 / len(parts))
    for _ in range(iterations):
        joint = parts + shares.log()[:, None]
        each = (joint - joint.logsumexp(dim=0)).exp()
        shares = each.mean(dim=1) if row_weights is None else each @ row_weights / row_weights.sum()
    shares[-1] = shares[-1].clamp_min(FLOOR)
    shares = shares.clamp_min(1e-12) / shares.clamp_min(1e-12).sum()
    return shares, mean_of((parts + shares.log()[:, None]).logsumexp(dim=0), row_weights)


def spreads(space: Space, centers: Tensor, neighbours: list[int]) -> list[Tensor]:
    """Return mean square distances to the nearest neighbours, per axis: (N, 1) or (N, d) each."""
    images = space.features(centers)
    count = images.shape[1]
    tree = KDTree(images.reshape(-1, images.shape[-1]).numpy())
    _, nearest = tree.query(images[0].numpy(), k=neighbours[-1] + 1)
    near = images.reshape(-1, images.shape[-1])[torch.as_tensor(np.asarray(nearest)[:, 1:])]
    square = (near - images[0][:, None]) ** 2
    if space.is_round:
        square = square.sum(dim=-1, keepdim=True) / 2
    else:  # a chord's square is nearly the angle's
        square = square[..., : space.dim] + square[..., space.dim :]
    assert square.shape[:2] == (count, neighbours[-1])
    return [square[:, :m].mean(dim=1) + 1e-12 for m in neighbours]


MOST_CENTERS = 20_000
"""The most kernels of an estimate."""

LADDER = 27
"""Number of widths from `WIDEST` to `NARROWEST`; neighbours differ by a factor of 1.4."""


def kernel_estimates(
    space: Space,
    train: Tensor,
    *,
    narrowest: float = NARROWEST,
    repeats: bool = True,
    row_weights: Tensor | None = None,
) -> dict[str, AdaptiveKernels]:
    """Return estimates about training points (N, d) in random order, by their names.

    "width ..." have one concentration, in a ladder; "near ..." a share of the mean square distance to
    the nearest neighbours, on tori axis by axis (Breiman, Meisel, Purcell, 1977); "repeated" are the
    narrowest kernels, about the places of several points alone.

    Args:
        space: The space.
        train: The points.
        narrowest: The largest concentration.
        repeats: Whether places of several points count as such.
        row_weights: Weights of the points (N,); default: equal.
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
    """Return kernels of one concentration about centers (N, d); weights are equal by default."""
    width = 1 if space.is_round else space.dim
    if weights is None:
        weights = torch.full((len(centers),), 1 / len(centers), dtype=torch.float64)
    return AdaptiveKernels(space, centers, centers.new_full((len(centers), width), kappa), weights)
