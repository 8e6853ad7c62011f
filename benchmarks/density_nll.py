"""Test log-likelihoods on protein backbones (torus), earthquakes and wildfires (sphere).

    python benchmarks/density_nll.py [--splits K] [--grouped] [--quick] [DATA ...]

Random 80/10/10 splits (--grouped: equal locations stay together, since duplicates leak), mean negative
log-likelihood in nats, per radian^2 or steradian, beside a von Mises or von Mises-Fisher kernel
density estimate whose width and uniform floor are tuned on the same validation points, and the
published rows of data/published.json (RFM: Riemannian flow matching; RDM: Riemannian diffusion
model). Then the seconds for 100,000 query points, on the first split: exactly, and by the kernels
(timed on 5,000 and scaled). All are fitted as `density fit` does by default. The backbone angles are
rounded; see `density_data.backbone`.
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
import torch
from common import published
from density_data import EARTH, TORI, Data, backbone, earth, splits
from density_kde import KernelDensity

from orbiflow.density import DensityEstimator

QUERIES, KERNEL_QUERIES = 100_000, 5_000
PUBLISHED = {"quakes": "earthquake"}


class Outcome(NamedTuple):
    """Of one split: test NLL of both, fit and evaluation seconds, the integral."""

    flow: float
    kde: float
    fit: float
    exact: float
    kernels: float
    mass: float


def load(name: str) -> Data:
    """The data of one row."""
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
    rng = np.random.default_rng(seed)
    if round_:
        queries = np.degrees(
            np.stack([np.arcsin(rng.uniform(-1, 1, QUERIES)), rng.uniform(-3.1, 3.1, QUERIES)], 1)
        )
    else:
        queries = rng.uniform(-np.pi, np.pi, (QUERIES, 2))
    models = [(estimator, QUERIES), (kde, KERNEL_QUERIES)]
    times = [np.nan] * 2
    for number, (model, count) in enumerate(models if seed == 0 else []):
        begin = time.perf_counter()
        model.score_samples(queries[:count])
        times[number] = (time.perf_counter() - begin) * QUERIES / count
    return Outcome(
        -estimator.score(test),
        -float(kde.score_samples(test).mean()),
        fit,
        times[0],
        times[1],
        estimator.report_.mass or 0.0,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="*", choices=(*TORI, *EARTH, []))
    parser.add_argument("--splits", type=int, default=5)
    parser.add_argument("--grouped", action="store_true")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="proline, one split")
    options = parser.parse_args()
    names = options.data or [*TORI, *EARTH]
    count = options.splits
    if options.quick:
        names, count = ["proline"], 1
    for name in names:
        load(name)  # what is missing is said here, once
    figures = published("density_nll")
    print(f"{count} {'grouped' if options.grouped else 'random'} splits")
    print(
        "data         flow            kde      (difference)     rfm    rdm   fit s   100k: exact s"
        "   kde s     mass"
    )
    with ProcessPoolExecutor(options.workers) as pool:
        jobs = [(n, k, options.grouped) for n in names for k in range(count)]
        found = pool.map(run, jobs)
        for name in names:
            rows = np.array([next(found) for _ in range(count)])
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
