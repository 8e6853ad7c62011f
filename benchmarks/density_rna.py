"""Test log-likelihoods on the seven torsion angles of RNA (torus T^7).

    python benchmarks/density_rna.py [--splits K] [--seconds S] [--base BASE] [--curve] [--quick]

Random 80/10/10 splits, mean negative log-likelihood in nats per radian^7, beside a product von Mises
kernel density estimate tuned on the same validation points, the mixture that is the flow's base, and
the published rows of data/published.json (RFM: Riemannian flow matching; RDM: Riemannian diffusion
model). Then the seconds of the fit and for 10,000 query points. The fit is held to --seconds.

--base evidence (the default): what `density fit` chooses by itself, and its chains alone; mixture or
uniform: a neural flow on that base.

--curve: the mixture alone, by its size: components of one member, then members of that size.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import NamedTuple

import numpy as np
import torch
from common import published
from density_data import rna, splits
from density_kde import KernelDensity

from orbiflow.density import (
    AutomaticSettings,
    NeuralSettings,
    Torus,
    fit_automatic,
    fit_chains,
    fit_neural,
)

QUERIES = 10_000

SIZES = ((8, 1), (16, 1), (32, 1), (64, 1), (64, 2), (64, 4), (64, 8), (64, 12), (64, 16))
"""Components at most and members, of the curve."""


class Outcome(NamedTuple):
    """Of one split: test NLL of the density, its base or chains, KDE; seconds; steps, their error."""

    flow: float
    base: float
    kde: float
    fit: float
    flow_queries: float
    kde_queries: float
    steps: float
    error: float


def run(seed: int, seconds: float, base: str) -> Outcome:
    """One split."""
    train, held, test = splits(np.radians(rna()), seed + 1)[seed]
    kde = KernelDensity.tuned(train, held, round_=False)
    space = Torus(train.shape[1])
    rows = space.to_chart(np.concatenate([train, held]))
    begin = time.perf_counter()
    if base == "evidence":
        density, report = fit_automatic(space, rows, AutomaticSettings(seconds=seconds, seed=seed))
        alone = density.chains or density.base
    else:
        share = len(held) / len(rows)
        settings = NeuralSettings(base=base, seconds=seconds, validation=share, seed=seed)
        density, report = fit_neural(space, rows, settings)
        alone = density.base
    fit = time.perf_counter() - begin
    queries = np.random.default_rng(seed).uniform(-np.pi, np.pi, (QUERIES, train.shape[1]))
    with torch.no_grad():
        points = space.to_chart(test)
        flow_nll = -float(density.log_prob(points, measure="natural").mean())
        base_nll = math.log(space.volume) - float(alone.log_prob(points).mean())
        begin = time.perf_counter()
        density.log_prob(space.to_chart(queries))
        flow_queries = time.perf_counter() - begin
    begin = time.perf_counter()
    kde.score_samples(queries)
    kde_queries = time.perf_counter() - begin
    return Outcome(
        flow_nll,
        base_nll,
        -float(kde.score_samples(test).mean()),
        fit,
        flow_queries,
        kde_queries,
        report.steps,
        report.integration_error,
    )


def curve(count: int) -> None:
    """Print the test NLL of mixtures of growing size."""
    print(f"RNA, {count} random splits, mixtures alone")
    print("components  members   numbers  validation     test    fit s  10k: s")
    for components, members in SIZES:
        rows = np.array([mixture_row(seed, components, members) for seed in range(count)])
        numbers, validation, test, fit, queries = rows.mean(axis=0)
        print(
            f"{components:10}{members:9}{numbers:10.0f}{validation:12.3f}{test:9.3f}{fit:9.1f}"
            f"{queries:8.2f}",
            flush=True,
        )


def mixture_row(seed: int, components: int, members: int) -> tuple[float, ...]:
    """Parameters, validation and test NLL, seconds to fit and for `QUERIES` points of one split."""
    parts = splits(np.radians(rna()), seed + 1)[seed]
    space = Torus(parts[0].shape[1])
    train, held, test = (space.project(space.to_chart(part)) for part in parts)
    found = fit_chains(space, train, held, components=components, members=members, seed=seed)
    mixture, d = found.mixture, space.dim
    numbers = len(mixture.means) * (d * d + d + mixture.log_weights.shape[1])
    nll = [math.log(space.volume) - float(mixture.log_prob(part).mean()) for part in (held, test)]
    queries = torch.tensor(np.random.default_rng(seed).random((QUERIES, d)))
    begin = time.perf_counter()
    mixture.log_prob(queries)
    return numbers, *nll, found.seconds, time.perf_counter() - begin


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--splits", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=300.0, help="of each fit")
    parser.add_argument("--base", choices=("evidence", "mixture", "uniform"), default="evidence")
    parser.add_argument("--curve", action="store_true", help="by the mixture's size")
    parser.add_argument("--quick", action="store_true", help="one split, 10 s")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rna()  # what is missing is said here
    if options.curve:
        curve(options.splits)
        return
    count, seconds = (1, 10.0) if options.quick else (options.splits, options.seconds)
    figures = published("density_nll")
    print(f"RNA, {count} random splits, {options.base} base, {seconds:g} s of fit")
    print(
        "split        flow     base      kde    fit s  10k: flow s   kde s  steps  change at twice"
    )
    rows = []
    for seed in range(count):
        rows.append(run(seed, seconds, options.base))
        print(f"{seed:5}   {_line(np.array(rows[-1]))}", flush=True)
    table = np.array(rows)
    print(f"mean    {_line(table.mean(axis=0))}")
    print(f"spread  {_line(table.std(axis=0))}")
    for key in ("rfm", "rdm", "kde_random_split"):
        print(f"published {key:18}{figures[key]['rna']:7.2f}")


def _line(row: np.ndarray) -> str:
    flow, base, kde, fit, flow_queries, kde_queries, steps, error = row
    return (
        f"{flow:9.3f}{base:9.3f}{kde:9.3f}{fit:9.1f}{flow_queries:13.2f}{kde_queries:8.2f}"
        f"{steps:7.0f}{error:17.1e}"
    )


if __name__ == "__main__":
    main()
