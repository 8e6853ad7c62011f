"""Sums of many kernels at many points: tile by tile, without what is too far to be felt."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.terms import Terms
from orbiflow.density.models.tiles import Chart, Tile

TOLERANCE = 1e-13
"""Of a sum, what is left out and what interpolation misses: each at most."""

FEW_POINTS, FEW_PAIRS = 256, 200_000
"""Tiles are not parted further with fewer points, or fewer points times terms."""

WORTH_FLAT, WORTH_ROUND = 500, 2_000
"""Points of a tile from which on smooth terms are interpolated."""

WORTH_TERMS = 200
"""And terms."""

IDLE = 3
"""Times that a tile is parted though nothing is left out."""


def near_log_sum(terms: Terms, features: Tensor, floor: float = -math.inf) -> Tensor:
    """Logarithm (N,) of the sum of terms at features (m, N), right within `TOLERANCE` of the sum.

    Points are parted into tiles. Terms whose largest values in a tile cannot be felt beside the least
    sum there are left out; those that are smooth across the tile are summed at few places and
    interpolated; the rest is summed point by point, once tiles are small.

    Args:
        floor: logarithm of what is added to the sum elsewhere: errors may be as large relative to
            both. Not in the result.

    Differentiable in the features; then nothing is interpolated.
    """
    exact = features.requires_grad and torch.is_grad_enabled()
    plain = features.detach()
    sums = [torch.full((plain.shape[1],), -math.inf, dtype=plain.dtype)]
    order, parts = [], []
    stack = [(np.arange(plain.shape[1]), plain, terms, 0)]
    share = math.log(TOLERANCE / terms.count)
    worth = _worth(terms)
    while stack:
        index, own, terms, idle = stack.pop()
        tile = Tile(own, terms.factors)
        least, largest = tile.bounds(terms)
        bottom = max(floor, float(least.logsumexp(dim=0)))
        near = largest > bottom + share
        before = terms.count
        if not bool(near.all()):
            terms, least, largest = terms.only(near), least[near], largest[near]
        if not exact:
            terms = _interpolated(terms, own, index, tile, least, largest, bottom + share, sums[0])
        if not terms.count:
            continue
        hopeful = terms.count < 0.9 * before or (len(index) > worth and not exact)
        idle = 0 if hopeful else idle + 1
        if len(index) <= FEW_POINTS or len(index) * terms.count <= FEW_PAIRS or idle > IDLE:
            spread = float(terms.peaks.max()) - bottom
            seen = features[:, torch.as_tensor(index)] if exact else own
            order.append(index)
            parts.append(terms.log_sum(seen, tile.middle, spread))
            continue
        stack += [
            (index[at], own[:, torch.as_tensor(at)], terms, idle) for at in _halves(own, tile)
        ]
    if not parts:
        return sums[0]
    at = torch.as_tensor(np.concatenate(order))
    direct = torch.full_like(sums[0], -math.inf).index_copy(0, at, torch.cat(parts))
    return direct if exact else torch.logaddexp(direct, sums[0])


def _interpolated(
    terms: Terms,
    features: Tensor,
    index: np.ndarray,
    tile: Tile,
    least: Tensor,
    largest: Tensor,
    allowed: float,
    sums: Tensor,
) -> Terms:
    """Adds smooth terms to `sums`; returns the others."""
    worth = WORTH_FLAT if terms.factors == 2 else WORTH_ROUND
    if len(index) < worth or terms.count < WORTH_TERMS or not tile.has_chart:
        return terms
    # narrower ones are hopeless
    wide = (terms.kappa * tile.radius[:, None] ** 2).amax(dim=0) < 60
    if int(wide.sum()) < WORTH_TERMS:
        return terms
    chart = Chart(features, tile)
    errors = chart.errors(terms, largest)
    own = math.log(TOLERANCE) + least
    smooth = wide & (errors < torch.clamp_min(own, allowed))
    if int(smooth.sum()) < WORTH_TERMS:
        return terms
    top = float(largest[smooth].max())
    found = chart.sum(terms.only(smooth), top).clamp_min_(0).log_() + top
    at = torch.as_tensor(index)
    sums[at] = torch.logaddexp(sums[at], found)
    return terms.only(~smooth)


def _worth(terms: Terms) -> float:
    """Points of a tile from which on interpolation may pay."""
    if terms.factors > 1:
        return WORTH_FLAT if terms.factors == 2 else math.inf
    return WORTH_ROUND if len(terms.centers) > 2 else WORTH_FLAT


def _halves(features: Tensor, tile: Tile) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the points in both halves, across the tile's longest side."""
    along = features[int(tile.sides.argmax())].numpy()
    order = np.argpartition(along, len(along) // 2)
    return order[: len(along) // 2], order[len(along) // 2 :]
