"""How fast default densities are fitted and evaluated: exactly, and kernel by kernel.

    python benchmarks/density_speed.py [--rows N ...] [--points N] [--quick] [SPACE ...]

Points in forty clusters of 0.01 to 0.3 radians. Fit: seconds of processor time, and by the clock on
all cores that `taskset` leaves. Then evaluations a second of processor time, side by side in one run
(exact ones also in seconds by the clock, all points together):
of `log_prob`; of its gradient in the points; and of all kernels for all points. Off: the largest
difference in nats of the exact one to that of all kernels, which knows the narrowest ones to 1e-9.
--components: of the density, such as kernels. --search: `GridSearchCV` over five settings of 2,000
points in five folds. --commands: instead of the table, what a user types, `orbiflow density fit`, for
10,000 rows of two angles and a length and for a million places on the sphere, start included: seconds
by the clock, of processor time, and the most memory.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from density_mixed import SETS
from numpy.typing import NDArray

from orbiflow.density import AdaptiveKernels, DensityEstimator, Mixture, log_density_gradient
from orbiflow.density.models import kernel_rows, log_sum_exp
from orbiflow.density.models.sums import BLOCK_ENTRIES

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane", "three angles")
DENSE = 2_000
"""Points at which all kernels are summed."""


class Speed(NamedTuple):
    """Of one evaluation: processor seconds, the points, and seconds by the clock."""

    seconds: float
    points: int
    wall: float

    def __str__(self) -> str:
        return f"{self.points / self.seconds:12,.0f}"


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


def timed(function: Callable[[], torch.Tensor], points: int) -> tuple[torch.Tensor, Speed]:
    """What it returns and how long it takes."""
    begin, wall = time.process_time(), time.perf_counter()
    found = function()
    return found, Speed(time.process_time() - begin, points, time.perf_counter() - wall)


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
        f"{space:18}{rows:8,}{fit:9.1f}{wall:9.1f}{kernel_count(density):10,}{of_exact}"
        f"{of_exact.wall:9.1f}{of_slope}"
        f"{of_dense}{off:10.1e}"
    )


def search() -> str:
    """A search over five settings."""
    from sklearn.model_selection import GridSearchCV

    begin, wall = time.process_time(), time.perf_counter()
    settings = ["auto", "kernels", "mixture", "kernels,mixture", "flow,kernels"]
    found = GridSearchCV(DensityEstimator("torus", unit="radians"), {"components": settings}, cv=5)
    found.fit(clustered("torus", 2_000))
    return (
        f"GridSearchCV, 5 settings of 2,000 points, 26 fits on one core: "
        f"{time.process_time() - begin:.0f} s of processor time, {time.perf_counter() - wall:.0f} s"
    )


def arcs(rows: int) -> NDArray[np.float64]:
    """Unit vectors (N, 3) along sixty arcs, within a quarter of a degree or a degree: like faults."""
    rng = np.random.default_rng(1)
    ends = np.linalg.qr(rng.normal(size=(60, 3, 2)))[0]
    which, along = rng.integers(60, size=rows), rng.uniform(0, 1.2, rows)
    middles = (
        ends[which, :, 0] * np.cos(along)[:, None] + ends[which, :, 1] * np.sin(along)[:, None]
    )
    data = middles + rng.choice([0.004, 0.02], rows)[:, None] * rng.normal(size=(rows, 3))
    return data / np.linalg.norm(data, axis=1, keepdims=True)


def commands(scale: float) -> None:
    """Print what the command takes for tables of so many rows, in the sizes that the docs promise."""
    mixed, many = int(10_000 * scale), int(1_000_000 * scale)
    rng = np.random.default_rng(0)
    tables = (
        (
            "phi,psi,length",
            SETS["backbone"].draw(mixed, rng),
            "torus --unit radians --linear length",
        ),
        ("x,y,z", clustered("sphere", many), "sphere"),
        ("x,y,z", arcs(many), "sphere"),
    )
    print(f"{'columns':18}{'rows':>10}{'wall, s':>10}{'processor, s':>14}{'memory, GB':>12}")
    with tempfile.TemporaryDirectory() as folder:
        for columns, rows, options in tables:
            table = Path(folder, "table.csv")
            np.savetxt(table, rows, "%.6f", ",", header=columns, comments="")
            call = [sys.executable, "-m", "orbiflow", "density", "fit", str(table), "--space"]
            call += [*options.split(), "--columns", columns, "--out", str(Path(folder, "fit"))]
            begin = time.perf_counter()
            process = subprocess.Popen(call, stdout=subprocess.DEVNULL)
            _, status, used = os.wait4(process.pid, 0)  # with its workers, once they have ended
            wall, seconds = time.perf_counter() - begin, used.ru_utime + used.ru_stime
            if status:
                raise SystemExit(f"{' '.join(call)} ended with {os.waitstatus_to_exitcode(status)}")
            memory = used.ru_maxrss * 1024 / 1e9
            print(
                f"{columns:18}{len(rows):10,}{wall:10.1f}{seconds:14.1f}{memory:12.2f}", flush=True
            )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spaces", nargs="*", metavar="SPACE", help=f"{', '.join(SPACES)} (all)")
    parser.add_argument("--rows", type=int, nargs="+", default=[1_000, 10_000])
    parser.add_argument("--points", type=int, default=1_000_000, help="evaluated")
    parser.add_argument("--components", default="auto")
    parser.add_argument("--search", action="store_true", help="a grid search, too")
    parser.add_argument("--commands", action="store_true", help="what a user types, instead")
    parser.add_argument("--quick", action="store_true", help="one small fit")
    options = parser.parse_args()
    if options.commands:
        commands(0.03 if options.quick else 1)
        return
    torch.set_num_threads(1)
    rows = [300] if options.quick else options.rows
    spaces = ["torus"] if options.quick else options.spaces or SPACES
    points = 5_000 if options.quick else options.points
    print(
        f"{'space':18}{'rows':>8}{'fit, s':>9}{'wall, s':>9}{'kernels':>10}{'exact, 1/s':>12}"
        f"{'wall, s':>9}{'slope, 1/s':>12}{'dense, 1/s':>12}{'off':>10}"
    )
    for count in rows:
        for space in spaces:
            print(line(space, count, points, options.components), flush=True)
    if options.search:
        print(search())


if __name__ == "__main__":
    main()
