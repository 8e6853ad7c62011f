"""Times and errors of marginal and conditional densities of default fits on tori.

    python benchmarks/density_inference.py [--quick] [--rows N] [DATA ...]

gln-5, lys-6: backbone and side-chain angles of residues (Top8000); rna-7: the RNA benchmark. Each is
fitted once, as `density fit` would. Then every question is asked at the accuracies .01 and .001:
processor seconds and seconds on the clock, the error that the density states, and the true one at its
own samples, root mean square in nats. The truth is the whole density integrated over what is hidden, at
many more nodes of other seeds (by the trapezoidal rule where one angle is hidden); its own standard
error is beside it. --quick: 400 rows of gln-5, one question of each kind, at .01.
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np
import torch
from density_data import rna, rotamers

from orbiflow.density import DensityEstimator, Mixture, conditional, marginal
from orbiflow.runtime import one_blas_thread

POINTS = 200
"""Points at which the truth is found: errors are largest at few of them, in tails."""

SEEDS = {"chains": 2, "network": 32}
"""Sets of 1,024 nodes of the truth, by the kind of component; others need none. Few of a network's
nodes are where a rare point is."""

ASKED: dict[str, list[tuple[tuple[int, ...], dict[int, float]]]] = {
    "gln-5": [((2,), {}), ((2, 3), {}), ((2,), {0: -60, 1: -40}), ((3, 4), {2: -65})],
    "lys-6": [((2,), {}), ((2, 3), {}), ((2,), {0: -60, 1: -40}), ((4, 5), {2: -65})],
    "rna-7": [((0,), {}), ((0, 5), {}), ((6,), {3: 85}), ((0, 5), {3: 85})],
}
"""Which angles are kept, from 0, and which are given, in degrees."""


def angles(name: str, rows: int) -> np.ndarray:
    """Angles in radians."""
    if name == "rna-7":
        return np.radians(rna())[:rows]
    residue = {"gln-5": "gln", "lys-6": "lys-1m"}[name]
    return np.asarray(rotamers(residue, int(name[-1]), rows).data)


def integrated(
    density: Mixture, points: torch.Tensor, axes: list[int]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Log densities (N,) of some angles at points (N, len(axes)), and their standard errors."""
    logs: list[torch.Tensor] = []
    errors: list[torch.Tensor] = []
    for weight, own in zip(density.weights, density.components, strict=True):
        count = SEEDS.get(own.kind, 1)
        table = [own.log_marginal(points, axes, seed) for seed in range(101, 101 + count)]
        found = torch.stack(table) + weight.log()
        logs.append(found.logsumexp(dim=0) - math.log(count))
        off = (found - logs[-1]).expm1().square().mean(dim=0).sqrt()
        errors.append(off / math.sqrt(max(1, count - 1)))
    each = torch.stack(logs)
    shares = torch.softmax(each, dim=0)
    return each.logsumexp(dim=0), (shares * torch.stack(errors)).square().sum(dim=0).sqrt()


def truth(
    density: Mixture, points: torch.Tensor, kept: tuple[int, ...], given: dict[int, float]
) -> tuple[torch.Tensor, float]:
    """Log densities at points (N, k), and their standard error."""
    known = points.new_tensor([*given.values()])
    whole = torch.cat([points, known.expand(len(points), -1)], dim=1)
    logs, errors = integrated(density, whole, [*kept, *given])
    if given:
        evidence, error = integrated(density, known[None], [*given])
        logs, errors = logs - evidence, torch.hypot(errors, error)
    return logs, float(errors.square().mean().sqrt())


def line(
    density: Mixture, kept: tuple[int, ...], degrees: dict[int, float], accuracy: float, count: int
) -> str:
    """One row of the table."""
    given = {axis: value / 360 for axis, value in degrees.items()}
    clock, processor = time.perf_counter(), time.process_time()
    if given:
        found = conditional(density, given, kept, accuracy=accuracy)
    else:
        found = marginal(density, kept, accuracy=accuracy)
    processor, clock = time.process_time() - processor, time.perf_counter() - clock
    points = found.sample(count, torch.Generator().manual_seed(0))
    true, spread = truth(density, points, kept, given)
    off = float((found.log_prob(points) - true).square().mean().sqrt())
    asked = ",".join(map(str, kept)) + "".join(f" | {k}={v:g}" for k, v in degrees.items())
    return (
        f"{asked:18s} {accuracy:8g} {processor:8.1f} {clock:8.1f} {found.error:9.1e} {off:9.1e}"
        f" ± {spread:.0e}"
    )


@torch.no_grad()
def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="*", metavar="DATA", help=f"{', '.join(ASKED)} (all)")
    parser.add_argument("--rows", type=int, default=10_000)
    parser.add_argument("--quick", action="store_true", help="400 rows of gln-5, at .01")
    options = parser.parse_args()
    names = ["gln-5"] if options.quick else options.data or list(ASKED)
    if unknown := set(names) - set(ASKED):
        parser.error(f"no such data: {', '.join(sorted(unknown))}")
    for name in names:
        rows, count = (400, 4) if options.quick else (options.rows, POINTS)
        density = DensityEstimator("torus", seed=0).fit(angles(name, rows)).density_
        assert isinstance(density, Mixture)
        print(f"{name}: {density}")
        print("angles             accuracy  cpu / s clock / s   stated      true", flush=True)
        for accuracy in (0.01,) if options.quick else (0.01, 0.001):
            for kept, given in ASKED[name]:
                with one_blas_thread():
                    print(line(density, kept, given, accuracy, count), flush=True)


if __name__ == "__main__":
    main()
