"""Angles beside real columns with known truth: nats lost by the default and by a kernel estimate.

    python benchmarks/density_mixed.py [--rows 2000] [--sets cylinder,...]

Regret is the mean of log truth over log density at 5,000 rows that no fit has seen. The kernel estimate
has products of von Mises and normal kernels, one bandwidth for the angles and one for each real column,
chosen by leaving rows out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from density_data import Data
from scipy import optimize, special, stats

from orbiflow.density import DensityEstimator

UNSEEN = 5_000


class Known(NamedTuple):
    """How rows (N, k) are drawn, their log density (N,), and which columns are real."""

    draw: Callable[[int, np.random.Generator], Data]
    log: Callable[[Data], Data]
    real: tuple[int, ...]


def _cylinder(count: int, rng: np.random.Generator) -> Data:
    angle = rng.vonmises(0, 2, count)
    return np.column_stack([angle, 3 + np.cos(angle) / 2 + 0.2 * rng.normal(size=count)])


def _log_cylinder(x: Data) -> Data:
    line = stats.norm.logpdf(x[:, 1], 3 + np.cos(x[:, 0]) / 2, 0.2)
    return stats.vonmises.logpdf(x[:, 0], 2) + line


STATES = (  # weight, mean angles, their concentration, mean length, its deviation
    (0.5, (-1.1, -0.7), 12.0, 1.53, 0.012),
    (0.3, (-2.2, 2.4), 8.0, 1.51, 0.015),
    (0.2, (1.0, 0.6), 20.0, 1.55, 0.008),
)


def _backbone(count: int, rng: np.random.Generator) -> Data:
    chosen = rng.choice(len(STATES), count, p=[own[0] for own in STATES])
    kappa = np.array([STATES[k][2] for k in chosen])
    angles = rng.vonmises(np.array([STATES[k][1] for k in chosen]), kappa[:, None])
    lengths = rng.normal(*np.array([STATES[k][3:] for k in chosen]).T)
    return np.column_stack([angles, lengths])


def _log_backbone(x: Data) -> Data:
    terms = [
        np.log(weight)
        + np.asarray(stats.vonmises.logpdf(x[:, :2], kappa, loc=means)).sum(axis=1)
        + stats.norm.logpdf(x[:, 2], length, spread)
        for weight, means, kappa, length, spread in STATES
    ]
    return special.logsumexp(terms, axis=0)


def _season(count: int, rng: np.random.Generator) -> Data:
    """A day of the year, a heavy-tailed temperature, a wind of a log-normal speed."""
    day = rng.uniform(-np.pi, np.pi, count)
    warm = 10 - 9 * np.cos(day) + 3 * rng.standard_t(4, size=count)
    speed = np.exp(1 + 0.3 * np.cos(day) + 0.5 * rng.normal(size=count))
    return np.column_stack([day, warm, speed])


def _log_season(x: Data) -> Data:
    day, warm, speed = x.T
    logs = stats.t.logpdf(warm, 4, 10 - 9 * np.cos(day), 3) - np.log(2 * np.pi)
    return logs + stats.lognorm.logpdf(speed, 0.5, scale=np.exp(1 + 0.3 * np.cos(day)))


SETS = {
    "cylinder": Known(_cylinder, _log_cylinder, (1,)),
    "backbone": Known(_backbone, _log_backbone, (2,)),
    "season": Known(_season, _log_season, (1, 2)),
}


def kernel_estimate(data: Data, unseen: Data, real: tuple[int, ...]) -> Data:
    """Log densities (M,) of a product kernel estimate, whose bandwidths leaving out rows has chosen."""
    angles = [k for k in range(data.shape[1]) if k not in real]

    def table(at: Data, widths: Data, others: int) -> Data:
        total = np.full((len(at), len(data)), -np.log(others))
        kappa = np.exp(widths[0])
        for k in angles:
            cosine = np.cos(at[:, None, k] - data[None, :, k])
            total += kappa * (cosine - 1) - np.log(2 * np.pi * special.ive(0, kappa))
        for width, k in zip(np.exp(widths[1:]), real, strict=True):
            total += stats.norm.logpdf(at[:, None, k], data[None, :, k], width)
        return total

    some = data[:800]
    start = np.array([3.0, *(np.log(some[:, k].std() / 4) for k in real)])

    def loss(widths: Data) -> float:
        total = table(some, widths, len(data) - 1)
        np.fill_diagonal(total, -np.inf)
        return -float(special.logsumexp(total, axis=1).mean())

    widths = optimize.minimize(loss, start, method="Nelder-Mead", options={"maxiter": 120}).x
    parts = np.array_split(unseen, 20)
    return np.concatenate([special.logsumexp(table(p, widths, len(data)), axis=1) for p in parts])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=2_000)
    parser.add_argument("--sets", default=",".join(SETS))
    given = parser.parse_args()
    print(f"{'set':10} {'rows':>6} {'default':>8} {'kernels':>8} {'seconds':>8}")
    for name in given.sets.split(","):
        known, rng = SETS[name], np.random.default_rng(0)
        data, unseen = known.draw(given.rows, rng), known.draw(UNSEEN, rng)
        begin = time.perf_counter()
        fit = DensityEstimator("torus", unit="radians", linear=known.real).fit(data)
        seconds, truth = time.perf_counter() - begin, known.log(unseen)
        ours = float((truth - fit.score_samples(unseen)).mean())
        theirs = float((truth - kernel_estimate(data, unseen, known.real)).mean())
        print(f"{name:10} {given.rows:6} {ours:8.4f} {theirs:8.4f} {seconds:8.1f}", flush=True)


if __name__ == "__main__":
    main()
