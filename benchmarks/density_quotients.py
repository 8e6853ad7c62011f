"""Densities on the 17 plane orbifolds and the ten flat 3-manifolds, against known ones.

Each truth is a sum of kernels and a uniform part on the space. The regret of a fit is its mean log
density at fresh samples below that of the truth. The integral is summed over an even grid of the
lattice's cell and divided by the group's order, so that no constant of the library is taken on trust; a
flow that is fitted alone has its own.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import torch

from orbiflow.density import (
    AdaptiveKernels,
    Density,
    DensityEstimator,
    Mixture,
    QuotientSpace,
    UniformDensity,
    density_to_bytes,
    read_density,
)
from orbiflow.density.models import midpoints
from orbiflow.symmetry import FLAT_MANIFOLDS, WALLPAPER_GROUPS

KERNELS, FRESH = 6, 5_000
GRID = {2: 400, 3: 72}
"""Points along each side of the cell, by dimension."""


def truth_on(space: QuotientSpace, generator: torch.Generator) -> Mixture:
    """Return a density of `KERNELS` bumps and a tenth that is uniform."""
    rows = torch.rand(KERNELS, space.dim + 1, generator=generator, dtype=torch.float64)
    centers, weights = space.uniform(KERNELS, generator), rows[:, 0] / rows[:, 0].sum()
    bumps = AdaptiveKernels(space, centers, 5 + 20 * rows[:, 1:], weights)
    return Mixture([bumps, UniformDensity(space)], [0.9, 0.1])


@torch.no_grad()
def is_restored(density: Density, points: torch.Tensor) -> bool:
    """Return whether a density that is saved and loaded has the same values."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "density.safetensors"
        path.write_bytes(density_to_bytes(density))
        again, _ = read_density(path)
    return torch.equal(again.log_prob(points), density.log_prob(points))


@torch.no_grad()
def row_of(name: str, rows: int) -> str:
    """Fit the data of a known density, and return a row of the table."""
    space, generator = QuotientSpace(name), torch.Generator().manual_seed(0)
    truth = truth_on(space, generator)
    data = space.from_chart(truth.sample(rows, generator))
    fresh = truth.sample(FRESH, generator)
    best = truth.log_prob(fresh)
    fits: list[tuple[Density, float]] = []
    for components in (None, "flow"):
        began = time.perf_counter()
        with torch.enable_grad():
            fit = DensityEstimator(space, components=components).fit(data)
        fits.append((fit.density_, time.perf_counter() - began))
    (density, seconds), (flow, _) = fits
    regrets = [float((best - one.log_prob(fresh)).mean()) for one in (density, flow)]
    error = float((best - density.log_prob(fresh)).std()) / FRESH**0.5
    mass = float(density.log_prob(midpoints(space, GRID[space.dim])).exp().mean())
    own = flow.mass(64 if space.dim == 2 else 16)
    return (
        f"| {name} | {space.group.order} | {float(best.mean()):.3f} "
        f"| {regrets[0]:.4f} ± {error:.4f} "
        f"| {mass - 1:+.1e} | {'yes' if is_restored(density, fresh) else 'NO'} | {seconds:.0f} "
        f"| {regrets[1]:.4f} | {own - 1:+.1e} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[*FLAT_MANIFOLDS, *WALLPAPER_GROUPS])
    parser.add_argument("--rows", type=int, default=1_000)
    options = parser.parse_args()
    heads = ("group", "order", "nats above uniform", "regret", "integral - 1", "loaded equal", "s")
    heads += ("flow alone: regret", "its integral - 1")
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for name in options.names:
        print(row_of(name, options.rows), flush=True)


if __name__ == "__main__":
    main()
