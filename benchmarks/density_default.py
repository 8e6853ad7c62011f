"""What `density fit` chooses by itself, beside a kernel estimate and each part alone.

    python benchmarks/density_default.py [--many] [--grouped] [--alone] [--splits K] [--workers W]
        [--quick] [DATA ...]

Random 90/10 splits of real and synthetic data: clustered, repeated, rounded, smooth, tiny, large; test
NLL in nats per radian^d or steradian. Kernel: one von Mises or von Mises-Fisher width and a uniform
floor, tuned on a ninth of the training rows, and all training rows in the end. --alone: each part alone
as well (the flow at its own defaults). The difference is that of the default to the best of the others,
row by row, with its standard error over all test rows; regret: above the true density's NLL on the same
rows, where that is known. Bar: at most 0.01 nats or two standard errors above the best. Seconds are of
processor time.

--many: tori of four to fourteen angles. sidechains-D: phi, psi and side-chain angles of one, two or
three neighbouring residues (Top8000, in the repository: data/sidechains.npz). backbone-D: phi, psi of
D / 2 residues in sequence (Top500). known-D: a hidden Markov chain of rotamers, whose density is known.
rna-7: the RNA benchmark. --grouped: the rows of a protein or molecule stay on one side of a split.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import torch
from common import DATA
from density_data import (
    Data,
    Drawn,
    backbone,
    backbone_windows,
    earth,
    rna_angles,
    rotamers,
    sidechains,
)
from density_kde import KernelDensity, tuned
from density_known import (
    bananas,
    checkerboard,
    hidden_markov_chain,
    one_angle,
    repeated,
    ring,
    round_clusters,
    smooth,
    surface,
)
from numpy.typing import NDArray

from orbiflow.density import DensityEstimator, to_latlon

SETS: dict[str, Callable[[], Drawn]] = {
    "tiny": lambda: round_clusters(1_000)._replace(trained=30),
    "clusters": lambda: round_clusters(3_000),
    "rounded": lambda: Drawn(np.round(round_clusters(2_000).data, 1), "torus"),
    "repeated": repeated,
    "one-angle": one_angle,
    "smooth": smooth,
    "bananas": bananas,
    "checkerboard": checkerboard,
    "ring": ring,
    "circles": lambda: surface("three-circles", "klein-bottle"),
    "patches": lambda: surface("patches", "klein-bottle"),
    "axes": lambda: surface("three-axes", "projective-plane"),
    "poles": lambda: surface("poles", "projective-plane"),
    "quakes": lambda: Drawn(earth("quakes"), "sphere"),
    "fire": lambda: Drawn(earth("fire"), "sphere"),
    "prepro": lambda: Drawn(backbone("prepro"), "torus"),
    "glycine": lambda: Drawn(backbone("glycine"), "torus"),
    "his-3": lambda: rotamers("his", 3, 4_000),
    "gln-5": lambda: rotamers("gln", 5, 3_000),
}

MANY: dict[str, Callable[[], Drawn]] = {
    **{f"sidechains-{d}": lambda d=d: sidechains(d) for d in range(4, 15)},
    **{f"backbone-{d}": lambda d=d: backbone_windows(d) for d in range(4, 15, 2)},
    **{f"known-{d}": lambda d=d: hidden_markov_chain(d) for d in range(4, 15, 2)},
    "rna-7": rna_angles,
}


@lru_cache(maxsize=2)
def load(name: str) -> Drawn:
    """One of `SETS` or `MANY`."""
    return (SETS | MANY)[name]()


PARTS: dict[str, dict[str, Any]] = {
    "default": {},
    "flow": {"components": "flow"},
    "kernels": {"components": "kernels"},
    "mixture": {"components": "mixture"},
    "chains": {"components": "chains"},
    "network": {"components": "network"},
}

COLUMNS = ("kernel", "flow", "kernels", "mixture", "chains", "network", "default")

HEAD = (
    f"{'data':14}{'space':11}{'n':>7}"
    + "".join(f"{name:>10}" for name in COLUMNS)
    + f"{'difference':>12}{'to':>8}{'regret':>13}{'seconds':>8}"
)


class Outcome(NamedTuple):
    """Of one split: log densities (N,) of the test rows by each model, and seconds of each fit."""

    scores: dict[str, Data]
    seconds: dict[str, float]


def kernel_estimate(train: Data, space: str) -> Callable[[Data], Data]:
    """Of one width, tuned on a ninth of the rows."""
    held, rest = train[: max(3, len(train) // 9)], train[max(3, len(train) // 9) :]
    if space in ("torus", "sphere"):
        found = KernelDensity.tuned(rest, held, round_=space == "sphere")
        return KernelDensity(
            train, found.kappa, round_=space == "sphere", floor=found.floor
        ).score_samples
    return tuned(rest, held, axes=space == "projective-plane").score_samples


def halves(drawn: Drawn, seed: int, group: NDArray[np.integer] | None = None) -> tuple[Data, Data]:
    """Training and test rows, a tenth; rows of a group (N,) on the same side."""
    rng = np.random.default_rng(seed)
    if group is None:
        order = rng.permutation(len(drawn.data))
    else:
        order = np.argsort(rng.permutation(int(group.max()) + 1)[group], kind="stable")
    cut = len(order) // 10 if drawn.trained is None else len(order) - drawn.trained
    if group is not None:  # no group on both sides
        own = group[order]
        while own[cut] == own[cut - 1]:
            cut += 1
    train = order[cut:]
    if group is not None:
        train = rng.permutation(train)
    return drawn.data[train], drawn.data[order[:cut]]


def compare(
    drawn: Drawn, seed: int, parts: Sequence[str], group: NDArray[np.integer] | None = None
) -> Outcome:
    """Fit the kernel estimate and `parts` (of `PARTS`) to one split."""
    torch.set_num_threads(1)
    train, test = halves(drawn, seed, group)
    scores, seconds = {}, {}
    begin = time.process_time()
    latlon = drawn.space in ("sphere", "projective-plane") and train.shape[1] == 3
    forms = [to_latlon(part) if latlon else part for part in (train, test)]
    scores["kernel"] = kernel_estimate(forms[0], drawn.space)(forms[1])
    seconds["kernel"] = time.process_time() - begin
    for part in parts:
        least = {"chains": 2, "network": 4}.get(part, 0)
        if least and (drawn.space != "torus" or train.shape[1] < least):
            continue
        begin = time.process_time()
        estimator = DensityEstimator(drawn.space, seed=seed, **PARTS[part]).fit(train)
        seconds[part] = time.process_time() - begin
        scores[part] = estimator.score_samples(test)
    if drawn.log_density is not None:
        scores["truth"] = drawn.log_density(test)
    return Outcome(scores, seconds)


def line(name: str, drawn: Drawn, outcomes: list[Outcome]) -> str:
    """A row of the table."""
    scores = {
        key: np.concatenate([outcome.scores[key] for outcome in outcomes])
        for key in outcomes[0].scores
    }
    own = scores["default"]
    others = {key: value for key, value in scores.items() if key not in ("default", "truth")}
    best = max(others, key=lambda key: float(others[key].mean()))
    worse = others[best] - own
    error = float(worse.std() / math.sqrt(len(worse)))
    mean = float(worse.mean())
    columns = "".join(
        f"{-scores[key].mean():10.3f}" if key in scores else f"{'':10}" for key in COLUMNS
    )
    regret = f"{(scores['truth'] - own).mean():8.3f}" if "truth" in scores else " " * 8
    seconds = np.mean([outcome.seconds["default"] for outcome in outcomes])
    verdict = "met" if mean <= max(0.01, 2 * error) else "MISSED"
    return (
        f"{name:14}{drawn.space[:10]:11}{drawn.trained or len(drawn.data):7}{columns}"
        f"{mean:9.3f} +- {error:.3f}  {best:8}{regret}{seconds:8.1f}  {verdict}"
    )


def run(job: tuple[str, int, tuple[str, ...], bool]) -> Outcome:
    """One split."""
    name, seed, parts, grouped = job
    drawn = load(name)
    return compare(drawn, seed, parts, drawn.group if grouped else None)


def chosen(options: argparse.Namespace) -> list[str]:
    """The names of the data that are asked for and at hand."""
    if options.quick:
        return ["sidechains-12", "known-4"] if options.many else ["tiny", "axes"]
    names = options.data or list(MANY if options.many else SETS)
    if options.many and not (DATA / "density" / "torus").exists():
        names = [name for name in names if name.startswith(("sidechains", "known"))]
    return [name for name in names if not (options.grouped and name.startswith("known"))]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", nargs="*", metavar="DATA", help="some of them (all)")
    parser.add_argument("--many", action="store_true", help="tori of four angles and more")
    parser.add_argument("--splits", type=int, default=5)
    parser.add_argument("--grouped", action="store_true", help="proteins on one side of a split")
    parser.add_argument("--alone", action="store_true", help="each part alone as well")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="two sets, one split")
    options = parser.parse_args()
    if unknown := set(options.data) - set(SETS | MANY):
        known = ", ".join(SETS | MANY)
        parser.error(f"no such data: {', '.join(sorted(unknown))}; there are {known}")
    if options.grouped and not set(options.data or MANY) <= set(MANY):
        parser.error("--grouped is for data of --many")
    alone = [part for part in PARTS if part != "flow" or not options.many]
    parts = tuple(alone) if options.alone else ("default",)
    names, count = chosen(options), 1 if options.quick else options.splits
    print(f"{count} {'grouped' if options.grouped else 'random'} splits\n{HEAD}")
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [(name, seed, parts, options.grouped) for name in names for seed in range(count)]
        found = pool.map(run, jobs)
        for name in names:
            print(line(name, load(name), [next(found) for _ in range(count)]), flush=True)


if __name__ == "__main__":
    main()
