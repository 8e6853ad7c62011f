"""How much two data sets differ: densities fitted to one half of each are judged by the other."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from scipy.optimize import minimize_scalar
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.arguments import silent
from orbiflow.density.comparing.resampling import Groups, resampled_sums
from orbiflow.density.comparing.settings import ComparisonSettings
from orbiflow.density.fitting import DensitySettings, Progress, fit_automatic
from orbiflow.density.models import Mixture
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError

PARTS = ("kernels",)
"""Components of the densities, which are fitted in a second or so."""


@dataclass(frozen=True)
class Estimate:
    """A value, its standard error and the bootstrap interval."""

    value: float
    error: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.4f} ± {self.error:.4f} ({self.low:.4f} to {self.high:.4f})"


@dataclass(frozen=True)
class Divergence:
    """How far apart two densities are, judged by held-out rows.

    - `accuracy`: How often an observer who is shown one row, of either data set with even chances,
      names its data set; 0.5 is chance.
    - `jensen_shannon`: The divergence in nats, from 0 (the same) to log 2 (never the same place). It is
      a lower bound on average, whatever the fits are, so that it may fall below 0.
    - `first_to_second`, `second_to_first`: Estimates of the Kullback-Leibler divergences in nats.
    """

    accuracy: Estimate
    jensen_shannon: Estimate
    first_to_second: Estimate
    second_to_first: Estimate


def cross_fitted(
    space: Space,
    points: Tensor,
    first: Array,
    groups: Groups,
    settings: ComparisonSettings,
    *,
    progress: Progress = silent,
) -> Divergence:
    """Fit a density to half of each data set, score the other halves, and swap the halves.

    With p and q fitted to the first and second, the log of the odds p / (p + q) at held-out rows has
    the mean of a lower bound on the Jensen-Shannon divergence (as of any classifier: Goodfellow and
    others, Generative adversarial nets, 2014, section 4). The log odds of either half are multiplied by
    what suits the other half best. Whole groups are held out, and resampled.

    `points` are chart points (N, d) of both data sets; `first` says which (N,) are of the first one.
    """
    seed, level = settings.seed, settings.level
    half = np.random.default_rng(seed).permutation(groups.count)[groups.index] % 2
    ratio = _held_out_ratio(space, points, first, half, seed, progress)
    own = np.where(first, ratio, -ratio)
    counts: tuple[float, float] = first.sum(), (~first).sum()
    weights = np.where(first, 1 / counts[0], 1 / counts[1])
    tempered = np.empty(len(own))
    for number in (0, 1):
        tempered[half == number] = own[half == number] * _trust(own, weights * (half != number))
    shares = np.stack(
        [
            np.ones(len(own)),
            math.log(2) - np.logaddexp(0.0, -tempered),
            (own > 0) + (own == 0) / 2,
            own,
        ],
        axis=1,
    )
    table = np.concatenate(
        [groups.sums(shares * first[:, None]), groups.sums(shares * ~first[:, None])], axis=1
    )
    drawn = resampled_sums(table, settings.bootstrap, np.random.default_rng(seed))
    drawn = drawn[(drawn[:, 0] > 0) & (drawn[:, 4] > 0)]
    found, spread = _figures(table.sum(axis=0)[None])[0], _figures(drawn)
    ends = np.quantile(spread, [(1 - level) / 2, (1 + level) / 2], axis=0)
    made = [
        Estimate(float(v), float(s), float(low), float(high))
        for v, s, low, high in zip(found, spread.std(axis=0), *ends, strict=True)
    ]
    return Divergence(
        accuracy=made[1], jensen_shannon=made[0], first_to_second=made[2], second_to_first=made[3]
    )


def _figures(sums: Array) -> Array:
    """Return Jensen-Shannon divergence, accuracy and both divergences (B, 4) from sums (B, 8)."""
    one, other = sums[:, 1:4] / sums[:, :1], sums[:, 5:] / sums[:, 4:5]
    even = (one[:, :2] + other[:, :2]) / 2
    return np.concatenate([even, one[:, 2:], other[:, 2:]], axis=1)


def _held_out_ratio(
    space: Space, points: Tensor, first: Array, half: Array, seed: int, progress: Progress
) -> Array:
    """Return log p - log q (N,) at each row, of fits to the other half."""
    ratio = np.empty(len(points))
    for number in (0, 1):
        held = half == number
        scores: list[Tensor] = []
        for which, rows in enumerate((first, ~first)):
            progress((2 * number + which) / 4, "fitting halves")
            train = points[torch.as_tensor(rows & ~held)]
            with torch.no_grad():
                scores.append(_fit(space, train, seed).log_prob(points[torch.as_tensor(held)]))
        ratio[held] = (scores[0] - scores[1]).numpy()
    return ratio


def _trust(own: Array, weights: Array) -> float:
    """Return the factor of log odds with which they score best: few rows make them too bold."""

    def loss(trust: float) -> float:
        return float((weights * np.logaddexp(0.0, -trust * own)).sum())

    found: Any = minimize_scalar(loss, bounds=(0.0, 2.0), method="bounded")
    return float(found.x)


def _fit(space: Space, train: Tensor, seed: int) -> Mixture:
    try:
        return fit_automatic(space, train, DensitySettings(components=PARTS, seed=seed))[0]
    except OrbiflowError as error:
        raise OrbiflowError(f"half of a data set is too small to fit: {error}") from error
