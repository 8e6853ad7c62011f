"""Test log-likelihoods on the seven torsion angles of RNA (torus T^7).

    python benchmarks/density_rna.py [--splits K] [--seconds S] [--quick]

Random 80/10/10 splits, mean negative log-likelihood in nats per radian^7 of what `density fit` chooses
by itself, beside a product von Mises kernel density estimate tuned on the same validation points, the
chains of the mixture alone, and the published rows of data/published.json (RFM: Riemannian flow
matching; RDM: Riemannian diffusion model). Then the seconds of the fit and for 10,000 query points.
The fit is held to --seconds.
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import numpy as np
import torch
from common import published
from density_data import rna, splits
from density_kde import KernelDensity

from orbiflow.density import DensitySettings, Mixture, Torus, fit_automatic

QUERIES = 10_000


class Outcome(NamedTuple):
    """Of one split: test NLL of the density, its chains and the KDE; seconds."""

    density: float
    chains: float
    kde: float
    fit: float
    density_queries: float
    kde_queries: float


def run(seed: int, seconds: float) -> Outcome:
    """One split."""
    train, held, test = splits(np.radians(rna()), seed + 1)[seed]
    kde = KernelDensity.tuned(train, held, round_=False)
    space = Torus(train.shape[1])
    rows = space.to_chart(np.concatenate([train, held]))
    begin = time.perf_counter()
    density, _ = fit_automatic(space, rows, DensitySettings(seconds=seconds, seed=seed))
    fit = time.perf_counter() - begin
    queries = np.random.default_rng(seed).uniform(-np.pi, np.pi, (QUERIES, train.shape[1]))
    points = space.to_chart(test)
    with torch.no_grad():
        nll = -float(density.log_prob(points, measure="natural").mean())
        begin = time.perf_counter()
        density.log_prob(space.to_chart(queries))
        density_queries = time.perf_counter() - begin
    begin = time.perf_counter()
    kde.score_samples(queries)
    kde_queries = time.perf_counter() - begin
    return Outcome(
        nll,
        chains_nll(density, points),
        -float(kde.score_samples(test).mean()),
        fit,
        density_queries,
        kde_queries,
    )


@torch.no_grad()
def chains_nll(density: Mixture, points: torch.Tensor) -> float:
    """Test NLL of the chains alone; nan where there are none."""
    found = [part for part in density.components if part.kind == "chains"]
    return -float(found[0].log_prob(points, measure="natural").mean()) if found else float("nan")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--splits", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=300.0, help="of each fit")
    parser.add_argument("--quick", action="store_true", help="one split, 10 s")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rna()  # what is missing is said here
    count, seconds = (1, 10.0) if options.quick else (options.splits, options.seconds)
    figures = published("density_nll")
    print(f"RNA, {count} random splits, {seconds:g} s of fit")
    print("split     density   chains      kde    fit s  10k: density s   kde s")
    rows = []
    for seed in range(count):
        rows.append(run(seed, seconds))
        print(f"{seed:5}   {_line(np.array(rows[-1]))}", flush=True)
    table = np.array(rows)
    print(f"mean    {_line(table.mean(axis=0))}")
    print(f"spread  {_line(table.std(axis=0))}")
    for key in ("rfm", "rdm", "kde_random_split"):
        print(f"published {key:18}{figures[key]['rna']:7.2f}")


def _line(row: np.ndarray) -> str:
    density, chains, kde, fit, density_queries, kde_queries = row
    return (
        f"{density:9.3f}{chains:9.3f}{kde:9.3f}{fit:9.1f}{density_queries:16.2f}{kde_queries:8.2f}"
    )


if __name__ == "__main__":
    main()
