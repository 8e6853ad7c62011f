"""Densities that are known, on spheres and on quotients of them: how near `density fit` comes.

    python benchmarks/density_spheres.py [--rows N ...] [--quick]

Regret is the mean of log p - log p_fit, in nats, at 10,000 new points of p. Beside the default fit, it
is that of the kernel estimate of one width and of the mixture of one size that are best on 2,000 other
points of p, which no user would have: a bound for what tuning can give.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.density import (
    AdaptiveKernels,
    DensityEstimator,
    Mixture,
    Space,
    UniformDensity,
    make_space,
)
from orbiflow.density.fitting.kernels import fit_mixture, kernel_estimates
from orbiflow.density.fitting.rows import Rows

FRESH, TUNING = 10_000, 2_000


class Truth(NamedTuple):
    """A density: points drawn from it, and its logarithm in natural measure."""

    draw: Callable[[int, int], Tensor]
    log_prob: Callable[[Tensor], Tensor]


def clusters(space: Space) -> Truth:
    """Five von Mises-Fisher clusters of deviations 5 to 30 degrees, and a tenth even."""
    generator = torch.Generator().manual_seed(1)
    kappa = torch.tensor([[130.0], [60.0], [30.0], [10.0], [4.0]], dtype=torch.float64)
    weights = torch.full((5,), 0.2, dtype=torch.float64)
    kernels = AdaptiveKernels(space, space.uniform(5, generator), kappa, weights)
    both = Mixture([kernels, UniformDensity(space)], [0.9, 0.1])
    return Truth(
        lambda count, seed: both.sample(count, torch.Generator().manual_seed(seed)),
        lambda points: both.log_prob(points, measure="natural"),
    )


def gaussian(space: Space) -> Truth:
    """Directions of a Gaussian vector whose deviations fall from 1 to 1/10, both ends alike.

    Its density is |S|^(-1/2) (x' S^-1 x)^(-m/2) over the area of the sphere, summed over images (Tyler,
    Statistical analysis for the angular central Gaussian distribution on the sphere, 1987).
    """
    size = space.chart_dim
    scale = torch.tensor(np.geomspace(1, 0.1, size))
    images = space.features(space.uniform(1, torch.Generator()))
    log_area = float(np.log(space.volume * len(images)))

    def draw(count: int, seed: int) -> Tensor:
        noise = torch.randn(count, size, dtype=torch.float64, generator=_seeded(seed)) * scale
        return space.project(noise / noise.norm(dim=1, keepdim=True))

    def log_prob(points: Tensor) -> Tensor:
        square = ((space.features(points) / scale) ** 2).sum(dim=-1)
        return (-size / 2 * square.log()).logsumexp(dim=0) - scale.log().sum() - log_area

    return Truth(draw, log_prob)


def fibre(space: Space) -> Truth:
    """Rotations that turn one axis nearly to another: exp(25 (x1^2 + x2^2)) on the sphere S^3.

    There x1^2 + x2^2 is even between 0 and 1, so that the integral is 2 pi^2 (e^25 - 1) / 25.
    """
    kappa = 25.0
    log_total = float(np.log(2 * np.pi**2 * np.expm1(kappa) / kappa))

    def draw(count: int, seed: int) -> Tensor:
        part = torch.rand(3, count, dtype=torch.float64, generator=_seeded(seed))
        square = (1 + part[0] * np.expm1(kappa)).log() / kappa
        near, far = square.sqrt(), (1 - square).clamp_min(0).sqrt()
        first, second = 2 * np.pi * part[1:]
        rows = [near * first.cos(), near * first.sin(), far * second.cos(), far * second.sin()]
        return space.project(torch.stack(rows, dim=1))

    def log_prob(points: Tensor) -> Tensor:
        square = (space.features(points)[..., :2] ** 2).sum(dim=-1)
        return (kappa * square).logsumexp(dim=0) - log_total

    return Truth(draw, log_prob)


CASES: tuple[tuple[str, dict[str, object], str, Callable[[Space], Truth]], ...] = (
    *(
        (name, {"dim": dim}, what, make)
        for dim in (1, 2, 3, 5, 9)
        for name, what, make in (
            ("hypersphere", "clusters", clusters),
            ("projective-space", "Gaussian", gaussian),
        )
    ),
    *(
        (name, {}, what, make)
        for name in ("rotation-space", "hexagonal-orientations", "cubic-orientations")
        for what, make in (("clusters", clusters), ("fibre", fibre))
    ),
)


def _seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def tuned(space: Space, truth: Truth, train: Tensor, fresh: Tensor) -> list[float]:
    """Mean log densities at `fresh` of the kernels and the mixture that are best on other points."""
    other, rows = truth.draw(TUNING, 3), Rows(train)
    widths = kernel_estimates(space, rows)
    kernels = [one for name, one in widths.items() if name.startswith("width")]
    sizes = [1, 2, 4, 8, 16, 32, 64]
    mixtures = [fit_mixture(space, rows, size, generator=_seeded(0)) for size in sizes]
    found = []
    for candidates in (kernels, mixtures):
        # a hundredth is even, or one lone point would cost any number of nats
        floored = [Mixture([one, UniformDensity(space)], [0.99, 0.01]) for one in candidates]
        scores = [float(one.log_prob(other, measure="natural").mean()) for one in floored]
        best = floored[int(np.argmax(scores))]
        found.append(float(best.log_prob(fresh, measure="natural").mean()))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few rows on two spaces")
    parser.add_argument("--rows", type=int, nargs="+", default=[1_000, 10_000])
    options = parser.parse_args()
    cases = [CASES[0], CASES[4]] if options.quick else CASES
    print("| space | density | rows | above uniform | regret | best width | best mixture | s |")
    print("|---|---|---|---|---|---|---|---|")
    for name, given, what, make in cases:
        space = make_space(name, **given)
        truth = make(space)
        fresh = truth.draw(FRESH, 2)
        true = float(truth.log_prob(fresh).mean())
        for count in [200] if options.quick else options.rows:
            train = truth.draw(count, 1)
            begin = time.process_time()
            fit = DensityEstimator(space).fit(space.from_chart(train))
            seconds = time.process_time() - begin
            with torch.no_grad():
                own = float(fit.density_.log_prob(fresh, measure="natural").mean())
                others = tuned(space, truth, train, fresh)
            figures = " | ".join(f"{true - value:.4f}" for value in (own, *others))
            title = f"{name} {given['dim']}" if given else name
            above = true + np.log(space.volume)
            print(
                f"| {title} | {what} | {count} | {above:.3f} | {figures} | {seconds:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
