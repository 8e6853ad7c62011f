"""Test log-likelihoods on protein backbones, RNA torsions (tori), earthquakes and wildfires (sphere).

    python benchmarks/density_nll.py [--splits K] [--grouped] [--quick] [DATA ...]

Random 80/10/10 splits (--grouped: equal locations stay together, since duplicates leak), mean negative
log-likelihood in nats, per radian^d or steradian, beside a von Mises or von Mises-Fisher kernel
density estimate whose width and uniform floor are tuned on the same validation points, and the
published rows of data/published.json (RFM: Riemannian flow matching; RDM: Riemannian diffusion
model). Then the seconds for 100,000 query points (10,000 of RNA), on the first split: by the default
and by the kernels (timed on 5,000 and scaled). All are fitted as `density fit` does by default. The
backbone angles are rounded; see `density_data.backbone`.
"""

from __future__ import annotations

import argparse
import math
import time
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
import torch
from common import published
from density_data import EARTH, TORI, Data, backbone, earth, rna, splits
from density_kde import KernelDensity

from orbiflow.density import DensityEstimator

QUERIES, RNA_QUERIES, KERNEL_QUERIES = 100_000, 10_000, 5_000
RNA = "rna"
PUBLISHED = {"quakes": "earthquake"}


class Times(NamedTuple):
    """Seconds for all queries, by the default and by kernels."""

    exact: float
    kernels: float


class Outcome(NamedTuple):
    """Of one split: test NLL of both, seconds of the fit, its times, and the integral."""

    default: float
    kde: float
    fit: float
    times: Times
    mass: float

    def figures(self) -> list[float]:
        """All of them in one row."""
        return [self.default, self.kde, self.fit, *self.times, self.mass]


def load(name: str) -> Data:
    """The data of one row."""
    if name == RNA:
        return np.radians(rna())
    return earth(name) if name in EARTH else backbone(name)


def run(job: tuple[str, int, bool]) -> Outcome:
    """One split."""
    torch.set_num_threads(1)
    name, seed, grouped = job
    round_ = name in EARTH
    train, held, test = splits(load(name), seed + 1, grouped=grouped)[seed]
    kde = KernelDensity.tuned(train, held, round_=round_)
    begin = time.perf_counter()
    estimator = DensityEstimator(
        "sphere" if round_ else "torus", seed=seed, repeats="rounding" if grouped else "places"
    )
    estimator.fit(np.concatenate([train, held]))
    fit = time.perf_counter() - begin
    unknown = Times(math.nan, math.nan)
    times = timed(name, estimator, kde) if seed == 0 else unknown
    return Outcome(
        -estimator.score(test),
        -float(kde.score_samples(test).mean()),
        fit,
        times,
        estimator.report_.mass or 0.0,
    )


def timed(name: str, estimator: DensityEstimator, kde: KernelDensity) -> Times:
    """How long both take for points all over the space."""
    count = RNA_QUERIES if name == RNA else QUERIES
    rng = np.random.default_rng(0)
    queries = rng.uniform(-np.pi, np.pi, (count, estimator.n_features_in_))
    if name in EARTH:
        lat, lon = np.arcsin(rng.uniform(-1, 1, count)), rng.uniform(-3.1, 3.1, count)
        queries = np.degrees(np.stack([lat, lon], 1))
    kernels = seconds(kde, queries[:KERNEL_QUERIES]) * count / KERNEL_QUERIES
    return Times(seconds(estimator, queries), kernels)


def seconds(model: DensityEstimator | KernelDensity, queries: Data) -> float:
    """Of the clock, for the log densities at all queries."""
    begin = time.perf_counter()
    model.score_samples(queries)
    return time.perf_counter() - begin


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="*", choices=(*TORI, RNA, *EARTH, []))
    parser.add_argument("--splits", type=int, default=5)
    parser.add_argument("--grouped", action="store_true")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="proline, one split")
    options = parser.parse_args()
    names = options.data or [*TORI, RNA, *EARTH]
    count = options.splits
    if options.quick:
        names, count = ["proline"], 1
    for name in names:
        load(name)  # what is missing is said here, once
    figures = published("density_nll")
    print(f"{count} {'grouped' if options.grouped else 'random'} splits")
    print(
        "data      default            kde      (difference)     rfm    rdm   fit s   100k: exact s"
        "   kde s     mass"
    )
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [(n, k, options.grouped) for n in names for k in range(count)]
        found = pool.map(run, jobs)
        for name in names:
            rows = np.array([next(found).figures() for _ in range(count)])
            mean, spread = rows.mean(axis=0), rows.std(axis=0)
            mean[3:5] = rows[0, 3:5]  # what the first split alone was timed on
            rfm, rdm = (figures[k].get(PUBLISHED.get(name, name), np.nan) for k in ("rfm", "rdm"))
            worst = rows[abs(rows[:, 5] - 1).argmax(), 5]
            print(
                f"{name:9}{mean[0]:7.3f} +- {spread[0]:.3f}{mean[1]:8.3f} +- {spread[1]:.3f}"
                f"{mean[0] - mean[1]:9.3f}{rfm:11.2f}{rdm:7.2f}{mean[2]:8.1f}{mean[3]:16.2f}"
                f"{mean[4]:8.2f}{worst:9.5f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
