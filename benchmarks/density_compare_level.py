"""Level and power of the grouped test of two data sets: does p keep its promise?

    python benchmarks/density_compare_level.py [--trials N] [--quick]

Angles of two normal densities on a torus, in groups whose rows have the share `cluster` of their
variance in common. Each line is a design: groups of the first data set, of the second, and shared ones.
The level is the share of p <= 0.05 where both densities are equal, the power where they are `SHIFT`
standard deviations apart, each beside its standard error. The exit status is 1 if a level is more than
three standard errors above 0.05.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
import torch

from orbiflow.density import make_space
from orbiflow.density.comparing import mmd_test, resampling
from orbiflow.density.comparing.resampling import Groups

LEVEL, SHIFT = 0.05, 0.6
CLUSTERS = (0.0, 0.3, 0.9)
Sizes = list[tuple[int, int]]
"""Rows of each group in the first data set and in the second."""


def uneven(rng: np.random.Generator, groups: int, spread: float = 1.0) -> list[int]:
    """Return log-normal numbers of rows."""
    return np.maximum(1, np.round(rng.lognormal(1, spread, groups))).astype(int).tolist()


def nested(one: list[int], other: list[int]) -> Sizes:
    """Return groups that are each in one data set."""
    return [(rows, 0) for rows in one] + [(0, rows) for rows in other]


DESIGNS = {
    "rows, 60 and 60": lambda _: nested([1] * 60, [1] * 60),
    "20 x 5, 20 x 5": lambda _: nested([5] * 20, [5] * 20),
    "6 x 5, 6 x 5": lambda _: nested([5] * 6, [5] * 6),
    "6 x 8, 6 x 1": lambda _: nested([8] * 6, [1] * 6),
    "20 x 10, 20 x 1": lambda _: nested([10] * 20, [1] * 20),
    "40 x 3, 8 x 6": lambda _: nested([3] * 40, [6] * 8),
    "30 shared, 8 and 1": lambda _: [(8, 1)] * 30,
    "6 shared, 8 and 1": lambda _: [(8, 1)] * 6,
    "20 shared, log-normal": lambda rng: list(
        zip(uneven(rng, 20), uneven(rng, 20, 0.7), strict=True)
    ),
    "25, 25 log-normal": lambda rng: nested(uneven(rng, 25), uneven(rng, 25)),
    "20, 8 log-normal": lambda rng: nested(uneven(rng, 20), uneven(rng, 8)),
    "1 x 60 and 20 x 3, 20 x 3": lambda _: nested([60] + [3] * 20, [3] * 20),
    "mixed": lambda rng: (
        nested(uneven(rng, 10, 0.7), uneven(rng, 15, 0.7))
        + [(int(rng.integers(1, 8)), int(rng.integers(1, 4))) for _ in range(10)]
    ),
}


def p_value(design: str, cluster: float, shift: float, trial: int) -> tuple[float, bool]:
    """Return p of one drawn pair of data sets, and whether it is exact."""
    rng = np.random.default_rng(trial)
    sizes = DESIGNS[design](rng)
    labels = np.repeat(np.arange(len(sizes)), np.sum(sizes, axis=1))
    first = np.concatenate([np.arange(own + other) < own for own, other in sizes])
    rows, groups = rng.normal(size=(len(labels), 2)), rng.normal(size=(len(sizes), 2))
    angles = np.sqrt(1 - cluster) * rows + np.sqrt(cluster) * groups[labels]
    angles[:, 0] *= np.where(angles[:, 0] > 0, 0.8, 0.4)  # askew
    points = torch.as_tensor(((angles + shift * first[:, None]) / (2 * np.pi)) % 1)
    members = Groups.of(labels, len(labels))
    found = mmd_test(make_space("torus"), points, first, members, permutations=199, seed=trial)
    return found.p, found.exact


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--trials", type=int, default=400)
    parser.add_argument("--quick", action="store_true", help="20 trials of each design")
    options = parser.parse_args()
    torch.set_num_threads(1)
    resampling.PAIRS = 20_000  # enough for the widths of kernels on so few rows
    trials, bad = 20 if options.quick else options.trials, False
    print(f"{'groups x rows':28}{'test':8}{'cluster':>8}{'level':>18}{'power':>18}")
    for design in DESIGNS:
        for cluster in CLUSTERS:
            if cluster and design.startswith("rows"):
                continue
            columns = []
            for shift in (0.0, SHIFT):
                found = [p_value(design, cluster, shift, trial) for trial in range(trials)]
                share = float(np.mean([p <= LEVEL for p, _ in found]))
                columns.append(f"{share:.3f} +- {np.sqrt(share * (1 - share) / trials):.3f}")
                bad |= not shift and share > LEVEL + 3 * np.sqrt(LEVEL * (1 - LEVEL) / trials)
            kind = "exact" if all(exact for _, exact in found) else "signs"
            print(f"{design:28}{kind:8}{cluster:8.1f}{columns[0]:>18}{columns[1]:>18}", flush=True)
    print("a level is too high" if bad else "all levels hold")
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
