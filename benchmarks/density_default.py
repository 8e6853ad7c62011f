"""What `density fit` chooses by itself, beside a kernel estimate and each part alone.

    python benchmarks/density_default.py [--splits K] [--alone] [--workers W] [--quick] [DATA ...]

Random 90/10 splits of real and synthetic data: clustered, repeated, rounded, smooth, tiny, large; test
NLL in nats per radian^d or steradian. Kernel: one von Mises or von Mises-Fisher width and a uniform
floor, tuned on a ninth of the training rows, and all training rows in the end. --alone: each part alone
as well (the flow at its own defaults). The difference is that of the default to the best of the others,
row by row, with its standard error over all test rows; regret: above the true density's NLL on the same
rows, where that is known. Bar: at most 0.01 nats or two standard errors above the best. Seconds are of
processor time.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

from density_compare import HEAD, PARTS, Outcome, compare, line
from density_default_data import SETS, load


def run(job: tuple[str, int, bool]) -> Outcome:
    """One split."""
    name, seed, alone = job
    return compare(load(name), seed, list(PARTS) if alone else ["default"])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="*", metavar="DATA", help=f"{', '.join(SETS)} (all)")
    parser.add_argument("--splits", type=int, default=5)
    parser.add_argument("--alone", action="store_true", help="each part alone as well")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="two sets, one split")
    options = parser.parse_args()
    if unknown := set(options.data) - set(SETS):
        parser.error(f"no such data: {', '.join(sorted(unknown))}")
    names, count = options.data or list(SETS), options.splits
    if options.quick:
        names, count = ["tiny", "axes"], 1
    print(HEAD)
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [(name, seed, options.alone) for name in names for seed in range(count)]
        found = pool.map(run, jobs)
        for name in names:
            print(line(name, load(name), [next(found) for _ in range(count)]), flush=True)


if __name__ == "__main__":
    main()
