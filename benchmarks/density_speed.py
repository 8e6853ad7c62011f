"""How fast default densities are fitted and evaluated: exactly, and kernel by kernel.

    python benchmarks/density_speed.py [--rows N ...] [--points N] [--quick] [SPACE ...]

Points in forty clusters of 0.01 to 0.3 radians. Fit: seconds of processor time, and by the clock on
all cores that `taskset` leaves. Then evaluations a second of processor time, side by side in one run:
of `log_prob`; of its gradient in the points; and of all kernels for all points. Off: the largest
difference in nats of the exact one to that of all kernels, which knows the narrowest ones to 1e-9.
--components: of the density, such as kernels.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray

from orbiflow.density import AdaptiveKernels, DensityEstimator, Mixture, log_density_gradient
from orbiflow.density.models import kernel_rows, log_sum_exp
from orbiflow.density.models.sums import BLOCK_ENTRIES

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane", "three angles")
DENSE = 2_000
"""Points at which all kernels are summed."""


def clustered(space: str, rows: int, seed: int = 0) -> NDArray[np.float64]:
    """Data (N, k) in the units of the space."""
    rng = np.random.default_rng(seed)
    round_ = space in ("sphere", "projective-plane")
    dims = 3 if round_ or space == "three angles" else 2
    middles = rng.normal(size=(40, dims)) * (1 if round_ else 3)
    if round_:
        middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    spread = rng.uniform(0.01, 0.3, 40)
    which = rng.integers(40, size=rows)
    data = middles[which] + spread[which, None] * rng.normal(size=(rows, dims))
    return data / np.linalg.norm(data, axis=1, keepdims=True) if round_ else data


def timed(function: Callable[[], torch.Tensor], points: int) -> tuple[torch.Tensor, float]:
    """What it returns, and the points a second of processor time."""
    begin = time.process_time()
    found = function()
    return found, points / (time.process_time() - begin)


def dense(density: Mixture, points: torch.Tensor) -> torch.Tensor:
    """Log density (N,), all kernels at all points, as the formula says."""
    space, every = density.space, list(density.parts())
    weight, kernels = next((w, part) for w, part in every if isinstance(part, AdaptiveKernels))
    rows, offsets = kernel_rows(space, space.features(kernels.centers)[0], kernels.concentrations)
    rows, offsets = rows.mT.contiguous(), offsets + kernels.weights.log()
    block = max(1, BLOCK_ENTRIES // len(offsets))
    parts = [
        torch.stack([log_sum_exp(torch.addmm(offsets, end, rows)) for end in ends]).logsumexp(dim=0)
        for ends in space.features(points).split(block, dim=1)
    ]
    own = torch.cat(parts) + math.log(weight)
    rest = [part.log_density(points) + math.log(w) for w, part in every if part is not kernels]
    both = torch.stack([own, *rest]).logsumexp(dim=0)
    return both + space.log_area(points) if space.is_round else both


def kernel_count(density: Mixture) -> int:
    """How many kernels there are."""
    return sum(len(part.bumps()) for _, part in density.parts())


def line(space: str, rows: int, points: int, parts: str) -> str:
    """A row of the table."""
    data = clustered(space, rows)
    begin, wall = time.process_time(), time.perf_counter()
    name = "torus" if space == "three angles" else space
    unit = "radians" if name in ("torus", "klein-bottle") else None
    estimator = DensityEstimator(name, unit=unit, components=parts).fit(data)
    fit, wall = time.process_time() - begin, time.perf_counter() - wall
    density = estimator.density_
    assert isinstance(density, Mixture)
    generator = torch.Generator().manual_seed(0)
    drawn = density.sample((points,), generator)
    some = drawn[:DENSE]
    with torch.no_grad():
        _, of_exact = timed(lambda: density.log_prob(drawn), points)
        whole, of_dense = timed(lambda: dense(density, some), len(some))
    off = float((density.log_prob(some) - whole).detach().abs().max())
    few = min(points, 50_000)
    chart = density.space.from_chart(drawn[:few])
    _, of_slope = timed(lambda: torch.tensor(log_density_gradient(density, chart)[0]), few)
    return (
        f"{space:18}{rows:8,}{fit:9.1f}{wall:9.1f}{kernel_count(density):10,}"
        f"{of_exact:12,.0f}{of_slope:12,.0f}{of_dense:12,.0f}{off:10.1e}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spaces", nargs="*", metavar="SPACE", help=f"{', '.join(SPACES)} (all)")
    parser.add_argument("--rows", type=int, nargs="+", default=[1_000, 10_000])
    parser.add_argument("--points", type=int, default=1_000_000, help="evaluated")
    parser.add_argument("--components", default="auto")
    parser.add_argument("--quick", action="store_true", help="one small fit")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows = [300] if options.quick else options.rows
    spaces = ["torus"] if options.quick else options.spaces or SPACES
    points = 5_000 if options.quick else options.points
    print(
        f"{'space':18}{'rows':>8}{'fit, s':>9}{'wall, s':>9}{'kernels':>10}{'exact, 1/s':>12}"
        f"{'slope, 1/s':>12}{'dense, 1/s':>12}{'off':>10}"
    )
    for count in rows:
        for space in spaces:
            print(line(space, count, points, options.components), flush=True)


if __name__ == "__main__":
    main()
