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
import math
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any, NamedTuple

import density_data
import numpy as np
import torch
from density_default_data import SETS, Drawn, load
from density_kde import KernelDensity
from density_unoriented_kde import tuned

from orbiflow.density import DensityEstimator, to_latlon

Data = density_data.Data

PARTS: dict[str, dict[str, Any]] = {
    "default": {},
    "flow": {"parts": "flow"},
    "kernels": {"parts": "kernels"},
    "mixture": {"parts": "mixture"},
    "chains": {"parts": "chains"},
}


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


def run(job: tuple[str, int, bool]) -> Outcome:
    """One split."""
    torch.set_num_threads(1)
    name, seed, alone = job
    drawn = load(name)
    order = np.random.default_rng(seed).permutation(len(drawn.data))
    cut = len(order) // 10 if drawn.trained is None else len(order) - drawn.trained
    test, train = drawn.data[order[:cut]], drawn.data[order[cut:]]
    scores, seconds = {}, {}
    begin = time.process_time()
    latlon = drawn.space in ("sphere", "projective-plane") and train.shape[1] == 3
    forms = [to_latlon(part) if latlon else part for part in (train, test)]
    scores["kernel"] = kernel_estimate(forms[0], drawn.space)(forms[1])
    seconds["kernel"] = time.process_time() - begin
    for part, options in PARTS.items():
        chains = drawn.space == "torus" and train.shape[1] > 1
        if part != "default" and (not alone or (part == "chains" and not chains)):
            continue
        begin = time.process_time()
        estimator = DensityEstimator(drawn.space, seed=seed, **options).fit(train)
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
        f"{-scores[key].mean():10.3f}" if key in scores else f"{'':10}"
        for key in ("kernel", "flow", "kernels", "mixture", "chains", "default")
    )
    regret = f"{(scores['truth'] - own).mean():8.3f}" if "truth" in scores else " " * 8
    seconds = np.mean([outcome.seconds["default"] for outcome in outcomes])
    verdict = "met" if mean <= max(0.01, 2 * error) else "MISSED"
    return (
        f"{name:14}{drawn.space[:10]:11}{drawn.trained or len(drawn.data):7}{columns}"
        f"{mean:9.3f} +- {error:.3f}  {best:8}{regret}{seconds:8.1f}  {verdict}"
    )


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
    print(
        "data          space            n    kernel      flow   kernels   mixture    chains   default"
        "   difference      to      regret seconds"
    )
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [(name, seed, options.alone) for name in names for seed in range(count)]
        found = pool.map(run, jobs)
        for name in names:
            print(line(name, load(name), [next(found) for _ in range(count)]), flush=True)


if __name__ == "__main__":
    main()
