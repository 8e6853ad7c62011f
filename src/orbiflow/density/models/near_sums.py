"""Sums of many kernels at many points: tile by tile, without what is too far to count."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.kernel_tiles import Chart, Tile
from orbiflow.density.models.terms import Terms
from orbiflow.typed_torch import applied

TOLERANCE = 1e-12
"""The share of a sum that may be left out, and that interpolation may miss."""

FEW_POINTS, FEW_PAIRS = 256, 200_000
"""Tiles with fewer points, or fewer points times terms, are not divided further."""

FEWEST_PAIRS = 20_000
"""Fewer points times terms are summed one by one at once: looking for tiles would take longer."""

WORTH_FLAT, WORTH_ROUND = 500, 2_000
"""The fewest points of a tile for which smooth terms are interpolated, flat and round."""

WORTH_TERMS = 200
"""The fewest terms for which they are."""

LESS, IDLE = 0.9, 3
"""A tile is divided at most `IDLE` times in a row while more than the share `LESS` of terms stays."""

LEAST = 1e-290
"""The least interpolated sum, relative to the largest value."""

SMOOTH_AT_MOST = 60.0
"""Concentration times squared radius of a tile above which terms are never smooth across it."""


def near_log_sum(
    terms: Terms, features: Tensor, floor: float = -math.inf, tolerance: float = TOLERANCE
) -> Tensor:
    """Return the logarithm (N,) of a sum of terms at features (m, N).

    It is exact within twice `tolerance` and rounding.

    Points are divided into tiles. Terms whose largest values in a tile are negligible beside the least
    sum there are left out; those that are smooth across the tile are summed at few places and
    interpolated; the rest is summed point by point, once tiles are small. `floor` is the logarithm of
    what the caller adds to the sum, to which errors are relative as well; it is not in the result.

    Differentiable in the features: the gradient in closed form, as fast as the sum; higher
    derivatives by autograd through all terms.
    """
    if features.shape[1] * terms.size < FEWEST_PAIRS:
        return terms.plain_log_sum(features)
    if not (features.requires_grad and torch.is_grad_enabled()):
        return _Walk(features, terms, floor, tolerance).log_sum
    return applied(_NearLogSum, features, terms, floor, tolerance)


class _NearLogSum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, terms: Terms, floor: float, tolerance: float) -> Tensor:
        walk = _Walk(features, terms, floor, tolerance, slope=True)
        ctx.save_for_backward(features, walk.slope)
        ctx.terms = terms
        return walk.log_sum

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        features, slope = ctx.saved_tensors
        if not torch.is_grad_enabled():
            return gradients[0] * slope, None, None, None
        # second derivatives were asked for: let autograd have them
        view: Tensor = features.view_as(features)
        plain = ctx.terms.plain_log_sum(view)
        (found,) = torch.autograd.grad(plain, view, gradients[0], create_graph=True)
        return found, None, None, None


class _Part(NamedTuple):
    """Points by their numbers (N,), their features (m, N), and the terms that count there.

    - `idle`: How often in a row nothing was left out.
    """

    numbers: np.ndarray
    features: Tensor
    terms: Terms
    idle: int


class _Walk:
    """Logarithms (N,) of sums, and their gradients (m, N) in the features if they are wanted."""

    def __init__(
        self, features: Tensor, terms: Terms, floor: float, tolerance: float, *, slope: bool = False
    ) -> None:
        self.floor = floor
        self.tolerance, self.each = math.log(tolerance), math.log(tolerance / terms.size)
        # the number of points of a tile from which on interpolation may pay
        self.worth = WORTH_ROUND if len(terms.centers) == 3 else WORTH_FLAT
        if terms.factors > 2:
            self.worth = math.inf
        features = features.detach()
        self.log_sum = torch.full_like(features[0], -math.inf)
        self.slope = torch.zeros_like(features) if slope else None
        stack = [_Part(np.arange(len(self.log_sum)), features, terms, 0)]
        while stack and len(self.log_sum):
            stack += self.step(stack.pop())

    def step(self, part: _Part) -> list[_Part]:
        """Treat a part, or return its halves."""
        index, features, terms, idle = part
        tile = Tile(features, terms.factors)
        least, largest = tile.bounds(terms)
        bottom = max(self.floor, float(least.logsumexp(dim=0)))
        near = largest > bottom + self.each
        if not bool(near.all()):
            terms, least, largest = terms.only(near), least[near], largest[near]
        terms = self._interpolated(part._replace(terms=terms), tile, least, largest, bottom)
        if not terms.size:
            return []
        count = len(index)
        idle = 0 if terms.size < LESS * part.terms.size or count > self.worth else idle + 1
        if count > FEW_POINTS and count * terms.size > FEW_PAIRS and idle <= IDLE:
            return [
                _Part(index[at], features[:, torch.as_tensor(at)], terms, idle)
                for at in _halves(features, tile)
            ]
        spread = float(terms.peaks.max()) - bottom
        found = terms.log_sum(features, tile.middle, spread, slope=self.slope is not None)
        self._add(torch.as_tensor(index), *found)
        return []

    def _add(self, at: Tensor, log_sum: Tensor, slope: Tensor | None) -> None:
        """Add to the sums at some points (N,) the logarithms of others, with their gradients (m, N)."""
        before = self.log_sum[at]
        after = torch.logaddexp(before, log_sum)
        self.log_sum[at] = after
        if self.slope is not None and slope is not None:
            old, new = ((x - after).exp().nan_to_num_(0.0) for x in (before, log_sum))
            self.slope[:, at] = self.slope[:, at] * old + slope * new

    def _interpolated(
        self, part: _Part, tile: Tile, least: Tensor, largest: Tensor, bottom: float
    ) -> Terms:
        """Add terms that are smooth across the tile to the sums, and return the others."""
        terms = part.terms
        if len(part.numbers) < self.worth or terms.size < WORTH_TERMS or not tile.has_chart:
            return terms
        wide = (terms.kappa * tile.radius[:, None] ** 2).amax(dim=0) < SMOOTH_AT_MOST
        if int(wide.sum()) < WORTH_TERMS:
            return terms
        chart = Chart(part.features, tile)
        allowed = (self.tolerance + least).clamp_min_(bottom + self.each)
        smooth = wide & (chart.errors(terms, largest) < allowed)
        if int(smooth.sum()) < WORTH_TERMS:
            return terms
        top = float(largest[smooth].max())
        values, slope = chart.sum(terms.only(smooth), top, slope=self.slope is not None)
        values.clamp_min_(LEAST)  # what is negligible beside others may come out below 0
        if slope is not None:
            slope = slope / values
        self._add(torch.as_tensor(part.numbers), values.log() + top, slope)
        return terms.only(~smooth)


def _halves(features: Tensor, tile: Tile) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the points in both halves, across the tile's longest side."""
    along = features[int(tile.sides.argmax())].numpy()
    order = np.argpartition(along, len(along) // 2)
    return order[: len(along) // 2], order[len(along) // 2 :]
