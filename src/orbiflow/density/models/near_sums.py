"""Sums of many kernels at many points: tile by tile, without what is too far to count.

Sums of kernels that are smooth across a tile are read off few places.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.charts import Chart, Tile
from orbiflow.density.models.smooth_sums import FEW_NODES, NODES, Patch, is_steep
from orbiflow.density.models.terms import LOG2_E, Terms
from orbiflow.typed_torch import applied

TOLERANCE = 1e-12
"""The share of a sum that may be left out, and that interpolation may miss."""

FEW_POINTS, FEW_PAIRS = 256, 5_000_000
"""Tiles with fewer points, or fewer points times terms, are not divided further."""

FEWEST_PAIRS = 20_000
"""Fewer points times terms are summed one by one at once: looking for tiles would take longer."""

WORTH_FLAT, WORTH_ROUND = 2_500, 2_500
"""The fewest points of a tile for which smooth terms are interpolated, flat and round."""

WORTH_TERMS = 200
"""The fewest terms for which they are."""

LESS, IDLE = 0.9, 3
"""A tile is divided at most `IDLE` times in a row while more than the share `LESS` of terms stays."""

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


class _Walk:
    """Logarithms (N,) of sums, and their gradients (m, N) in the features if they are wanted."""

    def __init__(
        self, features: Tensor, terms: Terms, floor: float, tolerance: float, *, slope: bool = False
    ) -> None:
        self.tolerance, self.each = math.log(tolerance), math.log(tolerance / terms.size)
        # the number of points of a tile from which on interpolation may pay
        self.worth = WORTH_ROUND if len(terms.centers) == 3 else WORTH_FLAT
        if terms.factors > 2:
            self.worth = math.inf
        features = features.detach()
        self.log_sum = torch.full_like(features[0], -math.inf)
        self.slope = torch.zeros_like(features) if slope else None
        if len(self.log_sum):
            self._add_terms(torch.arange(len(self.log_sum)), features, terms, floor, None, 0)

    def _add_terms(
        self,
        at: Tensor,
        features: Tensor,
        terms: Terms,
        beside: float,
        patch: Patch | None,
        idle: int,
    ) -> None:
        """Sum terms at points, by their numbers (N,) and features (m, N), or in both halves of them.

        The sum is at least exp(`beside`) without them. Those that are in the `patch` already are added.
        Nothing has been left out `idle` times in a row.
        """
        tile, count, given = Tile(features, terms.factors), len(at), terms.size
        least, largest = tile.bounds(terms)
        bottom = log_add(beside, least)
        near = largest > bottom + self.each
        if not bool(near.all()):
            terms, least, largest = terms.only(near), least[near], largest[near]
        patch, smooth = self._interpolated(features, terms, tile, least, largest, bottom, patch)
        if smooth is not None:
            beside, terms = log_add(beside, least[smooth]), terms.only(~smooth)
        idle = 0 if terms.size < LESS * given or count > self.worth else idle + 1
        if count > FEW_POINTS and count * terms.size > FEW_PAIRS and idle <= IDLE:
            for half in _halves(features, tile):
                part = patch and patch.only(half)
                self._add_terms(at[half], features[:, half], terms, beside, part, idle)
            return
        parts = [patch.log_sum(features, slope=self.slope is not None)] if patch else []
        if terms.size:
            spread = float(terms.peaks.max()) - bottom
            found = terms.log_sum(features, tile.middle, spread, slope=self.slope is not None)
            parts.append(found)
        self._put(at, parts)

    def _put(self, at: Tensor, parts: list[tuple[Tensor, Tensor | None]]) -> None:
        """Set the sums at points (N,), whose parts have logarithms (N,) and gradients (m, N)."""
        if not parts:
            return
        logs = [log for log, _ in parts]
        total = logs[0] if len(logs) == 1 else torch.logaddexp(*logs)
        self.log_sum[at] = total
        if self.slope is not None:
            for log, slope in parts:
                assert slope is not None
                self.slope[:, at] += slope * (log - total).exp().nan_to_num_(0.0)

    def _interpolated(
        self,
        features: Tensor,
        terms: Terms,
        tile: Tile,
        least: Tensor,
        largest: Tensor,
        bottom: float,
        patch: Patch | None,
    ) -> tuple[Patch | None, Tensor | None]:
        """Return a patch with the terms that are smooth across the tile, and which (K,) these are."""
        if features.shape[1] < self.worth or terms.size < WORTH_TERMS or not tile.has_chart:
            return patch, None
        wide = (terms.kappa * tile.radius[:, None] ** 2).amax(dim=0) < SMOOTH_AT_MOST
        if int(wide.sum()) < WORTH_TERMS:
            return patch, None
        chart = patch.chart if patch else Chart(tile)
        own = Patch(chart, patch.u if patch else chart.coordinates(features))
        allowed = (self.tolerance + least).clamp_min_(bottom + self.each)[wide]
        some, top = terms.only(wide), largest[wide]
        few, many = (errors < allowed for errors in own.errors(some, top, tile))
        many &= ~is_steep(some, tile)
        few &= many
        if int(many.sum()) < WORTH_TERMS:
            return patch, None
        if patch:
            own.take(patch)
        for which, count in ((few, FEW_NODES), (many & ~few, NODES)):
            if bool(which.any()):
                own.add(some.only(which), float(top[which].max()), count)
        smooth = wide.clone()
        smooth[wide] = many
        return own, smooth


def log_add(one: float, logs: Tensor) -> float:
    """Return the logarithm of exp(`one`) and all exponentials of logarithms (K,) together."""
    top = float(logs.max())
    if top == -math.inf:
        return one
    total = float((logs - top).mul_(LOG2_E).exp2_().sum())
    return float(np.logaddexp(one, top + math.log(total)))


def _halves(features: Tensor, tile: Tile) -> tuple[Tensor, Tensor]:
    """Return the numbers of the points in both halves, across the tile's longest side."""
    along = features[int(tile.sides.argmax())].numpy()
    order = torch.as_tensor(np.argpartition(along, len(along) // 2))
    return order[: len(along) // 2], order[len(along) // 2 :]
