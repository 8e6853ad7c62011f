"""What `density fit` chooses on tori of four to fourteen angles, beside each part alone.

    python benchmarks/density_many.py [--splits K] [--grouped] [--alone] [--workers W]
        [--quick] [DATA ...]

sidechains-D: phi, psi and side-chain angles of one, two or three neighbouring residues (Top8000, in
the repository: data/sidechains.npz). backbone-D: phi, psi of D / 2 residues in sequence (Top500).
known-D: a hidden Markov chain of rotamers, whose density is known. rna-7: the RNA benchmark. Random
90/10 splits, or with --grouped those that keep the rows of a protein or molecule on one side; test
NLL in nats per radian^D, beside a von Mises kernel estimate of one width and a floor, tuned.
--alone: kernels, mixtures, chains and networks alone as well.
Differences, regret, bar and seconds are those of density_default.py.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

from common import DATA
from density_compare import HEAD, Outcome, compare, line
from density_many_data import SETS, load

PARTS = ("kernels", "mixture", "chains", "network")


def run(job: tuple[str, int, tuple[str, ...], bool]) -> Outcome:
    """One split."""
    name, seed, parts, grouped = job
    drawn, group = load(name)
    return compare(drawn, seed, ("default", *parts), group if grouped else None)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="*", metavar="DATA", help=f"{', '.join(SETS)} (all)")
    parser.add_argument("--splits", type=int, default=2)
    parser.add_argument("--grouped", action="store_true", help="proteins on one side of a split")
    parser.add_argument("--alone", action="store_true", help="each part alone as well")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="two sets, one split")
    options = parser.parse_args()
    if unknown := set(options.data) - set(SETS):
        parser.error(f"no such data: {', '.join(sorted(unknown))}")
    names, count = options.data or list(SETS), options.splits
    if options.quick:
        names, count = ["sidechains-12", "known-4"], 1
    if not (DATA / "density" / "torus").exists():
        names = [name for name in names if name.startswith(("sidechains", "known"))]
    if options.grouped:
        names = [name for name in names if not name.startswith("known")]
    parts = PARTS if options.alone else ()
    print(f"{count} {'grouped' if options.grouped else 'random'} splits")
    print(HEAD)
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [(name, seed, parts, options.grouped) for name in names for seed in range(count)]
        found = pool.map(run, jobs)
        for name in names:
            outcomes = [next(found) for _ in range(count)]
            print(line(name, load(name).drawn, outcomes), flush=True)


if __name__ == "__main__":
    main()
