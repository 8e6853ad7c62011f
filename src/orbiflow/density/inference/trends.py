"""How one column of a torus goes with another: its mean and intervals, at each of many values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.inference.angles import at_observed, check_torus, chosen_columns
from orbiflow.density.inference.partial import marginal
from orbiflow.density.models import Density, cell_masses, cells
from orbiflow.density.spaces import Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.settings import as_array, as_number

TOGETHER = 8
"""Values whose conditional densities are found at a time."""

LEVELS = (0.5, 0.9)
"""The masses of the intervals."""

MOST_VALUES = 1000


class Trend(NamedTuple):
    """The mean of a column, and central intervals about it, where another column has some values.

    - `at`: Those values (n,), in the data's unit.
    - `mean`: The mean direction, or the mean of a real column, (n,).
    - `low`, `high`: The ends (n, L) of intervals of the masses `levels`. Of an angle they are
      counted from the direction opposite to the mean, and not beyond half a turn from it: means are
      written as data are, and ends about them, so that 350 to 370 goes through north.
    - `log_density`: The log density (n,) of the values in natural measure: how many data speak there.
      None of covariates, which have no density.
    """

    at: Array
    mean: Array
    low: Array
    high: Array
    levels: tuple[float, ...]
    log_density: Array | None


@one_thread()
@torch.no_grad()
def trend(
    density: Density,
    of: int,
    along: int,
    at: ArrayLike,
    *,
    levels: Sequence[float] = LEVELS,
    tick: Callable[[float], None] = lambda _share: None,
) -> Trend:
    """Return the mean and intervals of one column where another one is known, whatever the rest is.

    They are those of the conditional densities, by the joint density of both on even `cells`.

    Args:
        density: A density of two columns or more on a torus, some of which may be real.
        of, along: The numbers of both columns, from 0.
        at: Values (n,) of `along`, in the data's unit.
        levels: The masses of the intervals, between 0 and 1.
        tick: A function that is called with the share of the work done.

    Raises `OrbiflowError` for other spaces, columns and values.
    """
    torus = check_torus(density.space, "trends")
    values, masses = _checked(at, levels)
    if of == along:
        raise OrbiflowError("a trend is of one column along another one")
    turns = torus.axes[along].turns(torch.tensor(values))[:, None]
    alone_space, alone = torus.of_axes([of]), turns.new_full((len(turns), torus.dim), torch.nan)
    alone[:, along] = turns[:, 0]
    logs = at_observed(density, alone, measure="natural")
    middles = cells()
    rows = list[tuple[float, Array]]()
    for part in torch.split(turns, TOGETHER):
        both = torch.cat(
            [middles.repeat(len(part), 1), part.repeat_interleave(len(middles), 0)], dim=1
        )
        marginal_logs = density.log_marginal(both, [of, along]).reshape(-1, len(middles))
        rows += [
            _about_mean(alone_space, weights, masses)
            for weights in torch.softmax(marginal_logs, dim=1)
        ]
        tick(len(rows) / len(turns))
    return _of_rows(values, rows, masses, logs.numpy())


def pair_alone(density: Density, of: int, along: int, width: int) -> tuple[Density, int, int]:
    """Return a density on a torus that has two of so many columns, and their numbers there.

    Of a product both are beside its own columns, and have a marginal density.
    """
    if not density.space.parts:
        return density, of, along
    return marginal(density, chosen_columns(density.space, [of, along], width).axes), 0, 1


@one_thread()
@torch.no_grad()
def trend_of(
    densities: Iterable[Density], of: int, at: ArrayLike, *, levels: Sequence[float] = LEVELS
) -> Trend:
    """Return the mean and intervals of a column in densities that are those at values (n,).

    Arguments are those of `trend`; all densities are on one torus.
    """
    values, masses = _checked(at, levels)
    rows = list[tuple[float, Array]]()
    for density in densities:
        torus = check_torus(density.space, "trends")
        rows.append(_about_mean(torus.of_axes([of]), cell_masses(density, of), masses))
    return _of_rows(values, rows, masses, None)


def _checked(at: ArrayLike, levels: Sequence[float]) -> tuple[Array, tuple[float, ...]]:
    """Return values (n,) and masses, which are looked at."""
    values = as_array(at, "at", ("n",))
    masses = tuple(as_number(level, "levels") for level in levels)
    if not 0 < len(values) <= MOST_VALUES or not all(0 < mass < 1 for mass in masses):
        raise OrbiflowError(f"a trend has 1 to {MOST_VALUES} values and masses between 0 and 1")
    return values, masses


def _of_rows(
    values: Array,
    rows: Sequence[tuple[float, Array]],
    masses: tuple[float, ...],
    logs: Array | None,
) -> Trend:
    mean, ends = np.array([row[0] for row in rows]), np.stack([row[1] for row in rows])
    return Trend(values, mean, ends[:, 0], ends[:, 1], masses, logs)


def _about_mean(space: Torus, weights: Tensor, masses: Sequence[float]) -> tuple[float, Array]:
    """Return the mean of a column and the lower and upper ends (2, L) of intervals, in its unit.

    `weights` (n,) are masses of even `cells` of its circle.
    """
    turns = cells()[:, 0]
    tails = np.array([[(1 - m) / 2 for m in masses], [(1 + m) / 2 for m in masses]])
    (axis,) = space.axes
    period = axis.period
    if not period:
        values = space.from_chart(turns[:, None])[:, 0]
        below = np.cumsum(weights.numpy()) - weights.numpy() / 2
        return float(weights.numpy() @ values), np.interp(tails, below, values)
    angle = 2 * np.pi * turns
    mean = float(torch.atan2(weights @ angle.sin(), weights @ angle.cos())) / (2 * np.pi)
    mean += mean < axis.first_turn
    away = ((turns - mean + 0.5) % 1 - 0.5).numpy()
    order = np.argsort(away)
    mass = weights.numpy()[order]
    ends = np.interp(tails, np.cumsum(mass) - mass / 2, away[order])
    return mean * period, (mean + ends) * period
