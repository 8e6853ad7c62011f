"""The shortest interval, or intervals, of one column that hold a mass: on a circle, arcs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from scipy.optimize import brentq
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.inference.angles import check_torus
from orbiflow.density.models import Density
from orbiflow.runtime import one_thread
from orbiflow.settings import as_number
from orbiflow.typed_torch import unique

PIECES = 2048
"""Even parts of a column, and about as many of even mass, by whose ends intervals are found."""

TAILS = 16
"""Smaller masses at both ends by which it is found, too."""

HALVINGS = 40
"""Times that a part in which an interval ends is halved."""

MASSES = 0.001, 0.999999
"""The least and the largest mass whose interval can be told by so many parts."""

NEAR = 4
"""Parts to either side of the level, between which it is looked for."""

FLAT_NATS = 1e-9
"""Log densities that differ by less are the same."""


@one_thread()
@torch.no_grad()
def shortest_intervals(density: Density, mass: float) -> Array:
    """Return the ends (m, 2), in the data's unit, of the shortest intervals that hold a mass together.

    They are where the density in natural measure is highest: one interval where it has one peak. On a
    circle they are arcs. Each begins within the turn in which data are written and ends after that,
    beyond the turn if need be: 350 to 370 goes through north. Of a uniform circle, on which all arcs
    are as good, it is the one opposite to where `cdf` begins.

    Raises `OrbiflowError` for several columns, other spaces, and a mass below 0.001 or above 0.999999.
    """
    mass = as_number(mass, "mass", *MASSES)
    cumulative = density.cumulative()
    torus = check_torus(density.space, "intervals")
    (axis,), start = torus.axes, cumulative.start
    period = axis.period
    even = torch.linspace(0, 1, PIECES + 1, dtype=torch.float64)
    even = even if period else even[1:-1]  # where log densities are minus infinity
    # more of them where the mass is, as a bump may be narrower than a piece
    levels = torch.cat([torch.logspace(-7, -4, TAILS, dtype=torch.float64), even[1:-1]])
    quantiles = np.interp(torch.cat([levels, 1 - levels]), cumulative.below, cumulative.ends)
    turns: Tensor = unique(torch.cat([even, torch.tensor(quantiles)]))

    def logs(at: Tensor) -> Tensor:
        return density.log_prob(at[:, None] + start, measure="natural")

    heights, between = logs(turns), logs((turns[1:] + turns[:-1]) / 2)
    if period and float(heights.max() - heights.min()) < FLAT_NATS:
        sides = np.array([[(1 - mass) / 2, (1 + mass) / 2]])
        return _written(axis.first_turn, start + sides, period)
    order = between.argsort(descending=True)
    held = cumulative.masses(turns).diff()[order].cumsum(0)
    place, last, reach = int(torch.searchsorted(held, mass)), len(order) - 1, NEAR

    def excess(level: float) -> float:
        low, high = torch.tensor(_above(level, turns, heights, logs, bool(period))).mT
        shares = cumulative.masses(high % 1) + high.floor() - cumulative.masses(low)
        return float(shares.sum()) - mass

    every = torch.cat([heights, between])
    beyond = float(every.min()) - FLAT_NATS, float(every.max()) + FLAT_NATS

    def near(by: int) -> float:
        if not 0 <= place + by <= last:
            return beyond[by < 0]
        return float(between[order[place + by]])

    while reach <= last and not excess(near(reach)) >= 0 >= excess(near(-reach)):
        reach *= 8
    # all of a line but tails that are too small to tell, unless the mass is less than that
    level: Any = beyond[0]
    if excess(near(reach)) >= 0:
        level = brentq(excess, near(reach), near(-reach), xtol=1e-9)
    pairs = _above(min(level, float(heights.max())), turns, heights, logs, bool(period))
    if period:
        return _written(axis.first_turn, start + pairs, period)
    return torus.from_chart(torch.tensor(pairs.reshape(-1, 1) + start)).reshape(-1, 2)


def _above(
    level: float, turns: Tensor, heights: Tensor, logs: Callable[[Tensor], Tensor], closed: bool
) -> Array:
    """Return the intervals (m, 2), in turns from the start on, in which logs are above a level."""
    above = heights >= level
    above[-1] = above[0] & closed  # the ends of a circle are one, those of a line are below
    above[0] &= closed
    if bool(above.all()):
        return np.array([[0.0, 1.0]])
    ends = torch.nonzero(above[1:] != above[:-1])[:, 0]
    low, high, rising = turns[ends], turns[ends + 1], above[ends + 1]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        later = (logs(middle) >= level) != rising
        low, high = torch.where(later, middle, low), torch.where(later, high, middle)
    edges = ((low + high) / 2).numpy()
    if bool(above[0]):
        edges = np.append(edges[1:], edges[:1] + 1)  # an arc over the start
    return edges.reshape(-1, 2)


def _written(first: float, arcs: Array, period: float) -> Array:
    """Return arcs (m, 2) in turns as the data are written, in order."""
    arcs = arcs - np.floor(arcs[:, :1] - first)
    return arcs[arcs[:, 0].argsort()] * period
