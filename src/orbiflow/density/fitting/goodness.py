"""A smooth test whether rows are of a parametric family, by moments that it does not fit itself."""

from __future__ import annotations

from itertools import combinations, combinations_with_replacement, islice

import numpy as np
import torch
from scipy import special
from torch import Tensor

from orbiflow.density.fitting.maximum import Local
from orbiflow.density.fitting.parameters import Goodness
from orbiflow.typed_torch import linalg

DRAWS = 40_000
"""Draws of the fitted density that say how moments vary, and the most rows that are looked at."""

MOST_RESAMPLED, RESAMPLES = 2_000, 999
"""Rows up to which p is from resampled draws, and how many samples of these there are."""

MOST_MOMENTS = 60
"""Moments looked at: those of the highest degree are left out where there would be more."""

REDUNDANT = 5e-2
"""Share of the largest variance below which a moment is one that is fitted, or that others say."""


def smooth_test(
    sides: list[tuple[Local, Tensor, Tensor]], generator: torch.Generator
) -> Goodness | None:
    """Test a family by moments of the rows that it does not fit (Boulerice and Ducharme, Smooth tests
    of goodness-of-fit for directional and axial data, 1997).

    Moments are polynomials of the coordinates in the fitted frame, of degrees 1 to 3 for directions
    and of 2 and 4 for axes. What the estimates take up of them is projected out along the scores, and
    the rest is compared with what the fitted density has. Moments of which little is left are left out,
    since what the estimates take up in second order would count there.

    Args:
        sides: The family on each factor of the space, with the vectors (N, p) of the rows and those
            (M, p) of draws from the fitted density.
    """
    seen = [_features(*side) for side in sides]
    rows, draws = (torch.cat([first[k] for first in seen], dim=1) for k in (0, 1))
    for first, other in islice(combinations(range(len(seen)), 2), MOST_MOMENTS // 4):
        # whether factors go together: products of what has degree 1
        rows, draws = (
            torch.cat([now, _products(seen[first][k], seen[other][k])], dim=1)
            for k, now in enumerate((rows, draws))
        )
    scores = torch.cat([local.scores(drawn) for local, _, drawn in sides], dim=1)
    scores_of_rows = torch.cat([local.scores(vectors) for local, vectors, _ in sides], dim=1)
    scores = scores - scores.mean(dim=0)
    mean, spread = draws.mean(dim=0), draws.std(dim=0).clamp_min(1e-300)
    rows, draws = (rows - mean) / spread, (draws - mean) / spread
    fitted = linalg.lstsq(scores, draws, driver="gelsd").solution
    rows, draws = rows - scores_of_rows @ fitted, draws - scores @ fitted
    count, drawn = len(rows), len(draws)
    values, axes = linalg.eigh(draws.mT @ draws / drawn)
    kept = values > REDUNDANT * float(values.max().clamp_min(REDUNDANT))
    degrees = int(kept.sum())
    if not degrees:
        return None
    turn = axes[:, kept] * values[kept].rsqrt()
    rows, draws = rows @ turn, draws @ turn
    share = 1 / (1 / count + 1 / drawn)
    statistic = float((rows.mean(dim=0) ** 2).sum()) * share
    if count > MOST_RESAMPLED:
        p = float(special.chdtrc(degrees, statistic))
        return Goodness(statistic, degrees, p, "chi-square")
    rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
    table, statistics = draws.numpy(), np.empty(RESAMPLES)
    for k in range(RESAMPLES):
        statistics[k] = count * (table[rng.integers(drawn, size=count)].mean(axis=0) ** 2).sum()
    p = (1 + int((statistics >= statistic).sum())) / (1 + RESAMPLES)
    return Goodness(statistic, degrees, p, "resampling")


def _products(one: Tensor, other: Tensor) -> Tensor:
    """Return the products (N, 4) of the first two columns of each."""
    return (one[:, :2, None] * other[:, None, :2]).flatten(1)


def _features(local: Local, vectors: Tensor, drawn: Tensor) -> tuple[Tensor, Tensor]:
    """Return the moments' polynomials at rows (N, k) and at draws (M, k)."""
    frame = local.at.frame
    rows, draws = vectors @ frame.mT, drawn @ frame.mT
    degrees, middle = (2, 4), torch.zeros(local.width, dtype=torch.float64)
    if local.form.about in ("angles", "directions"):
        degrees, middle = (1, 2, 3), draws.mean(dim=0)
    scale = ((draws - middle) ** 2).mean(dim=0).sqrt().clamp_min(1e-150)
    rows, draws = (rows - middle) / scale, (draws - middle) / scale
    moments: list[tuple[Tensor, Tensor]] = []
    for degree in degrees:
        # where rows are close together, the first coordinate is of degree 2 in the others
        first = int(degree == 3 and local.form.about == "directions")
        which = list(combinations_with_replacement(range(first, local.width), degree))
        if moments and len(moments) + len(which) > MOST_MOMENTS:
            break
        for powers in which:
            moments.append((rows[:, powers].prod(dim=1), draws[:, powers].prod(dim=1)))
    first, second = zip(*moments, strict=True)
    return torch.stack(first, dim=1), torch.stack(second, dim=1)
