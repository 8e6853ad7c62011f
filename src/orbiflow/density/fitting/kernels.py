"""Kernel densities: estimates about the data, and mixtures of few by EM."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from orbiflow.density.fitting.chains import PRIOR_POINTS, PRIOR_RESULTANT, concentration, far_apart
from orbiflow.density.fitting.likelihood import training
from orbiflow.density.fitting.orbits import Orbits
from orbiflow.density.fitting.repeats import places
from orbiflow.density.fitting.rows import Rows, is_whole
from orbiflow.density.models import (
    FAINT_LOG,
    LOG2_E,
    MAX_CONCENTRATION,
    AdaptiveKernels,
    kernel_rows,
)
from orbiflow.density.spaces import Space, UnitVectorSpace, by_sphere
from orbiflow.typed_torch import linalg, special

NEIGHBOURS = (2, 4, 8, 16)
SCALES = (0.1, 0.2, 0.4, 0.8, 1.6)
ISOTROPY = (0.05, 0.3)
NARROWEST, WIDEST = 1e7, 0.5
"""The largest and the least concentration: a deviation of 0.02 degrees, or nearly uniform. Rows that
crowd more ask for narrower kernels, see `narrowest_for`."""

CROWDED_SHARE, CROWDED_RATIO = 0.1, 0.1
"""The share of the rows that ask for narrower kernels, and how much nearer than in an even spread of
all rows their neighbours must be."""

MOST_LOOKED_AT = 2_000
"""The most rows whose neighbours are looked at."""


def narrowest_for(space: Space, points: Tensor) -> tuple[float, bool]:
    """Return the concentration of the narrowest kernels that points (N, d) ask for.

    It is `NARROWEST`, which blurs 2 km on earth, or more where many rows have neighbours that such
    kernels could not tell apart; `MAX_CONCENTRATION` at most. Second comes whether most rows ask for
    more.
    """
    counts, place = places(points)
    first = torch.empty_like(counts).scatter_(0, place, torch.arange(len(points)))
    some = points[first][torch.randperm(len(first), generator=torch.Generator().manual_seed(0))]
    some = some[:MOST_CENTERS]
    near = min(NEIGHBOURS[1], len(some) - 1)
    if near < 1:
        return NARROWEST, False
    away2 = spreads(space, some, [near], MOST_LOOKED_AT)[0].mean(dim=1).sort().values
    crowded = float(away2[int(CROWDED_SHARE * (len(away2) - 1))])
    # the mean side of a cell that has one of the rows
    even = 2 * math.pi * len(some) ** (-1 / space.dim)
    if crowded * SCALES[0] * NARROWEST > 1 or crowded > (CROWDED_RATIO * even) ** 2:
        return NARROWEST, False
    nearest, median = (float(away2[int(p * (len(away2) - 1))]) for p in (CROWDED_SHARE**2, 0.5))
    return min(MAX_CONCENTRATION, 1 / (SCALES[0] * nearest)), 1 / (
        SCALES[1] * median
    ) > MAX_CONCENTRATION


def _near_concentrations(
    space: Space, centers: Tensor, narrowest: float
) -> Iterator[tuple[str, Tensor]]:
    """Yield concentrations as wide as shares of the distances to neighbours, by name, of all shapes."""
    neighbours = [m for m in NEIGHBOURS if m < len(centers)]
    shrinkage = (1.0,) if len(space.spheres) == 1 else ISOTROPY
    for number, spread in zip(neighbours, spreads(space, centers, neighbours), strict=True):
        mean = spread.mean(dim=1, keepdim=True)
        for scale, share in itertools.product(SCALES, shrinkage):
            kappa = 1 / (scale * ((1 - share) * spread + share * mean))
            yield f"near {number}, {scale:g}, {share:g}", kappa.clamp(WIDEST, narrowest)


def limit_notes(space: Space, crowded: bool) -> list[str]:
    """Return what to say where most rows are closer together than kernels can be narrow."""
    if not crowded:
        return []
    least = MAX_CONCENTRATION**-0.5
    return [
        f"most rows lie closer together than {least:.0e} radians ({least / space.step_angle(1.0):.1g} "
        "in the unit of the data), and the density cannot tell them apart"
    ]


def spreads(
    space: Space, centers: Tensor, neighbours: list[int], most: int | None = None
) -> list[Tensor]:
    """Return mean square distances to the nearest neighbours, per axis of each sphere: (N, F) each.

    They are of all centers, or of the first `most`.
    """
    images = space.features(centers)
    features = images[0, :most]
    tree = KDTree(images.reshape(-1, images.shape[-1]).numpy())
    _, nearest = tree.query(features.numpy(), k=neighbours[-1] + 1)
    near = images.reshape(-1, images.shape[-1])[torch.as_tensor(np.asarray(nearest)[:, 1:])]
    # a chord's square is nearly the angle's
    square = by_sphere((near - features[:, None]) ** 2, len(space.spheres)).sum(dim=-2)
    square /= square.new_tensor(space.spheres)
    return [square[:, :m].mean(dim=1) + 1 / MAX_CONCENTRATION for m in neighbours]


MOST_CENTERS, MOST_IMAGES = 20_000, 40_000
"""The most rows that have a kernel in an estimate, and the most kernels: one for each of its images."""

LADDER_RUNGS = 27
"""Number of widths from `WIDEST` to `NARROWEST`; neighbours differ by a factor of 1.4."""


def ladder(narrowest: float) -> list[float]:
    """Return concentrations from `WIDEST` to `narrowest`; beyond `NARROWEST` there are more of them."""
    rungs: list[float] = np.geomspace(WIDEST, min(NARROWEST, narrowest), LADDER_RUNGS).tolist()
    if narrowest > NARROWEST:
        more = math.ceil((LADDER_RUNGS - 1) * math.log(narrowest / NARROWEST, NARROWEST / WIDEST))
        rungs += np.geomspace(NARROWEST, narrowest, more + 1)[1:].tolist()
    return rungs


TUNED_SCALES = (0.3, 1.0, 3.0)
"""Multiples of tuned concentrations that are tried."""


def kernel_estimates(
    space: Space,
    rows: Rows,
    *,
    narrowest: float = NARROWEST,
    repeats: bool = True,
    only: Collection[str] | None = None,
    tuned: Tensor | None = None,
) -> dict[str, AdaptiveKernels]:
    """Return estimates about training rows in random order, by their names; all, or `only` some.

    "width ..." have one concentration, in a ladder; "tuned ..." multiples of concentrations (F,) that
    were `tuned`; "near ..." a share of the mean square distance to
    the nearest neighbours, on tori axis by axis (Breiman, Meisel, Purcell, 1977); "repeated" are the
    narrowest kernels, about the places of several points alone, if `repeats` are real.
    """
    rows = rows[: min(MOST_CENTERS, MOST_IMAGES // space.kernel_images)]
    train, shares = rows.points, torch.full((len(rows),), 1 / len(rows), dtype=torch.float64)
    if rows.weights is not None:
        shares = rows.weights / rows.weights.sum()
    estimates: dict[str, AdaptiveKernels] = {}
    start = even_kernels(space, train, WIDEST, shares)
    for kappa in ladder(narrowest):
        name = f"width {kappa**-0.5:.2g}"
        if only is None or name in only:
            estimates[name] = start.with_concentrations(
                torch.full_like(start.concentrations, kappa)
            )
    if tuned is not None:
        for scale in TUNED_SCALES:
            name = f"tuned, {scale:g}"
            if only is None or name in only:
                kappa = (scale * tuned).clamp(WIDEST / 100, narrowest)
                estimates[name] = start.with_concentrations(kappa.expand_as(start.concentrations))
    counts, place = places(train)
    first = torch.full((len(counts),), len(train)).scatter_reduce(
        0, place, torch.arange(len(train)), "amin"
    )
    centers, weights = train[first], counts.double() / len(train)
    if rows.weights is not None:
        weights = torch.zeros_like(weights).index_add_(0, place, shares)
    if only is None or any(name.startswith("near") for name in only):
        start = even_kernels(space, centers, WIDEST, weights)
        for name, kappa in _near_concentrations(space, centers, narrowest):
            if only is None or name in only:
                estimates[name] = start.with_concentrations(kappa)
    repeated = counts > 1
    if repeats and bool(repeated.any()):
        weights = weights[repeated] / weights[repeated].sum()
        estimates["repeated"] = even_kernels(space, centers[repeated], narrowest, weights)
    return estimates


def even_kernels(space: Space, centers: Tensor, kappa: float, weights: Tensor) -> AdaptiveKernels:
    """Return kernels of one concentration about centers (N, d)."""
    wide = centers.new_full((len(centers), len(space.spheres)), kappa)
    return AdaptiveKernels(space, centers, wide, weights)


MAX_ITERATIONS, MIN_GAIN_NATS = 60, 1e-4
"""The most iterations of EM, and nats that each must gain."""

BLOCK, BLOCK_ENTRIES = 4_096, 2**18
"""The most points, and entries of images of points against components, worked on at a time: few enough
for the cache."""

MANY_IMAGES, FIRST_ROWS, LAST_ITERATIONS = 8, 2_000, 20
"""Images of a point from which on components have images instead. Then EM first climbs on so many rows,
and at most so many times more on all."""


Step = Callable[[Tensor, Tensor, Tensor], tuple[Tensor, Tensor, Tensor, float]]
"""A step of EM, as `_expectation` takes it, of components' means, concentrations and weights."""


@training()
@torch.no_grad()
def fit_mixture(
    space: Space,
    train: Rows,
    components: int,
    *,
    iterations: int = MAX_ITERATIONS,
    narrowest: float = NARROWEST,
    generator: torch.Generator,
) -> AdaptiveKernels:
    """Fit a mixture of few components with places, widths and weights of their own.

    Products of von Mises distributions with a concentration an angle on torus and Klein bottle, von
    Mises-Fisher on spheres and their quotients (Banerjee et al., Clustering on the unit hypersphere
    using von Mises-Fisher distributions, 2005), summed over the group. A few prior points hold each
    concentration finite.

    Of the rows, as many as components are whole. On tori, others may lack
    angles (NaN) and count by their marginal likelihood (Ghahramani and Jordan, Supervised learning
    from incomplete data via an EM approach, 1994). Weights have the mean 1.
    """
    many = isinstance(space, UnitVectorSpace) and len(space.elements) >= MANY_IMAGES
    first = train[:FIRST_ROWS] if many and len(train) > 2 * FIRST_ROWS else train
    seen, whole, away, step = _stage(space, first, components)
    chosen = far_apart(away, len(seen), components, generator, whole.weights)
    kappa = seen.new_full((components, len(space.spheres)), 10.0)
    start = seen[chosen].clone(), kappa, seen.new_full((components,), 1 / components)
    climbed = _climbed(space, step, start, iterations, MIN_GAIN_NATS * len(first), narrowest)
    if first is not train:
        *_, step = _stage(space, train, components)
        most = min(iterations, LAST_ITERATIONS)
        climbed = _climbed(space, step, climbed, most, MIN_GAIN_NATS * len(train), narrowest)
    mean, kappa, weights = climbed
    return AdaptiveKernels(space, space.lifted(mean), kappa, weights)


def _stage(
    space: Space, train: Rows, components: int
) -> tuple[Tensor, Rows, Callable[[int], Tensor], Step]:
    """Return features (N, m) of whole rows, these rows, and what fits components to all rows.

    That is the squared distances (N,) from one of them, and a step of EM.
    """
    if isinstance(space, UnitVectorSpace) and len(space.elements) >= MANY_IMAGES:
        orbits = Orbits(space, train.points, train.weights)
        return orbits.points, train, orbits.away, orbits.expectation
    return _by_images(space, train, components)


def _climbed(
    space: Space,
    step: Step,
    start: tuple[Tensor, Tensor, Tensor],
    most: int,
    least_gain: float,
    narrowest: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Return means, concentrations and weights after at most `most` steps that each gain enough."""
    mean, kappa, weights = start
    last = -math.inf
    for _ in range(most):
        count, seen, total, score = step(mean, kappa, weights)
        weights = (count + 0.01) / (count + 0.01).sum()
        mean, length = _directions(space, total)
        resultant = (length + PRIOR_POINTS * PRIOR_RESULTANT) / (seen + PRIOR_POINTS)
        kappa = concentrations_of(resultant, space.spheres).clamp(WIDEST / 100, narrowest)
        if score - last < least_gain:
            break
        last = score
    return mean, kappa, weights


def _by_images(
    space: Space, train: Rows, components: int
) -> tuple[Tensor, Rows, Callable[[int], Tensor], Step]:
    """Return what `_stage` does, by all images of all rows."""
    points, row_weights, whole = train.points, train.weights, is_whole(train)
    absent = points.isnan()
    images = space.features(points.nan_to_num(0.0))
    if not bool(whole.all()):
        images = images * ~torch.cat([absent, absent], dim=1)
    size = max(1, min(BLOCK, BLOCK_ENTRIES // (len(images) * components)))
    # images of a point lie together: sums over them run along the memory
    blocks = torch.split(images.transpose(0, 1).contiguous(), size)
    owns = [None] * len(blocks) if row_weights is None else torch.split(row_weights, size)
    gaps = [None] * len(blocks) if bool(whole.all()) else torch.split(absent.to(images), size)
    every = list(zip(blocks, owns, gaps, strict=True))
    seen = images[:, whole]

    def away(row: int) -> Tensor:
        return ((seen - seen[0, row]) ** 2).sum(dim=-1).amin(dim=0)

    return seen[0], train[whole], away, partial(_expectation, space, every)


def _expectation(
    space: Space,
    blocks: Sequence[tuple[Tensor, Tensor | None, Tensor | None]],
    mean: Tensor,
    kappa: Tensor,
    weights: Tensor,
) -> tuple[Tensor, Tensor, Tensor, float]:
    """Return what belongs to each component, and the log-likelihood.

    Blocks are features (n, E, m) of points, 0 where they are missing, their weights, and what is
    missing. What belongs to a component are points (K,), those of them that know each angle (K, 1) or
    (K, d), and sums (K, m) of their nearest images' features.
    """
    rows, offsets = kernel_rows(space, mean, kappa)
    rows, offsets = rows.mT.contiguous(), offsets + weights.log()
    count, total, score = torch.zeros_like(weights), torch.zeros_like(mean), 0.0
    unknown: Tensor | float = 0.0
    for images, counts, absent in blocks:
        share = (images @ rows).add_(offsets)
        if absent is not None:  # a factor that is not there has no constant either
            share += (absent @ (special.i0e(kappa).log() + kappa).mT)[:, None]
        flat = share.flatten(1)
        top = flat.amax(dim=1)
        flat.sub_(top[:, None]).clamp_min_(FAINT_LOG).mul_(LOG2_E).exp2_()
        every = flat.sum(dim=1)
        likelihood, row = every.log() + top, every.reciprocal()
        if counts is not None:
            likelihood, row = likelihood * counts, row * counts
        count += row @ share.sum(dim=1)
        if absent is not None:
            unknown = unknown + share[:, 0].mT @ (absent * row[:, None])
        weighed = images * row[:, None, None]
        total += share.flatten(0, 1).mT @ weighed.flatten(0, 1)
        score += float(likelihood.sum())
    return count, count[:, None] - unknown, total, score


def _directions(space: Space, total: Tensor) -> tuple[Tensor, Tensor]:
    """Return unit vectors (K, m) of sums on each sphere, and their lengths (K, F)."""
    parts = by_sphere(total, len(space.spheres))
    length = linalg.vector_norm(parts, dim=1)
    return (parts / length.clamp_min(1e-300)[:, None]).flatten(1), length


def concentrations_of(resultant: Tensor, spheres: Sequence[int]) -> Tensor:
    """Return the concentrations (K, F) of mean cosines on spheres of these dimensions."""
    kappa = torch.empty_like(resultant)
    for dim in set(spheres):
        alike = [k for k, sphere in enumerate(spheres) if sphere == dim]
        kappa[:, alike] = concentration(resultant[:, alike], dim)
    return kappa
