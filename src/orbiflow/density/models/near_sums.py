"""Sums of many kernels at many points: tile by tile, without what is too far to count."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.terms import LOG2_E, Terms, lengths2
from orbiflow.typed_torch import applied

LOG_TOLERANCE = math.log(1e-12)
"""Logarithm of the share of a sum that may be left out."""

ROUNDING = 1e-15
"""Rounding error of squared distances between unit vectors, which bounds allow for."""

FEW_POINTS, FEW_PAIRS = 256, 5_000_000
"""Tiles with fewer points, or fewer points times terms, are not divided further."""

FEWEST_PAIRS = 20_000
"""Fewer points times terms are summed one by one at once: looking for tiles would take longer."""

LESS_SHARE, MAX_IDLE_HALVINGS = 0.9, 3
"""A tile is divided at most `MAX_IDLE_HALVINGS` times in a row while more than the share `LESS_SHARE`
of the terms stays."""


def near_log_sum(terms: Terms, features: Tensor, floor: float = -math.inf) -> Tensor:
    """Return the logarithm (N,) of a sum of terms at features (m, N).

    It is exact within `LOG_TOLERANCE` and rounding.

    Points are divided into tiles. Terms whose largest values in a tile are negligible beside the least
    sum there are left out; the rest is summed point by point, once tiles are small. `floor` is the
    logarithm of what the caller adds to the sum, to which errors are relative as well; it is not in the
    result.

    Differentiable in the features: the gradient in closed form, as fast as the sum; higher
    derivatives by autograd through all terms.
    """
    if features.shape[1] * terms.size < FEWEST_PAIRS:
        return terms.plain_log_sum(features)
    if not (features.requires_grad and torch.is_grad_enabled()):
        return _Walk(features, terms, floor).log_sum
    return applied(_NearLogSum, features, terms, floor)


class _NearLogSum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, terms: Terms, floor: float) -> Tensor:
        walk = _Walk(features, terms, floor, slope=True)
        ctx.save_for_backward(features, walk.slope)
        ctx.terms = terms
        return walk.log_sum

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        features, slope = ctx.saved_tensors
        if not torch.is_grad_enabled():
            return gradients[0] * slope, None, None
        # second derivatives were asked for: let autograd have them
        view: Tensor = features.view_as(features)
        plain = ctx.terms.plain_log_sum(view)
        (found,) = torch.autograd.grad(plain, view, gradients[0], create_graph=True)
        return found, None, None


class Tile:
    """A box around features (m, N), N > 0."""

    def __init__(self, features: Tensor, factors: int) -> None:
        low, high = torch.aminmax(features, dim=1)
        self.factors = factors
        self.middle, self.sides = (low + high) / 2, high - low
        self.radius = lengths2(features - self.middle[:, None], factors).amax(dim=1).sqrt()

    def bounds(self, terms: Terms) -> tuple[Tensor, Tensor]:
        """Return the least and largest logarithms (K,) of the terms in the tile.

        They are bounds by the triangle inequality.
        """
        square, radius = self._away2(terms), self.radius[:, None]
        nearest = (square - ROUNDING).clamp_min_(0).sqrt_().sub_(radius).clamp_min_(0).square_()
        farthest = square.clamp_min_(0).add_(ROUNDING).sqrt_().add_(radius).square_()
        least = largest = terms.peaks
        for kappa, near, far in zip(terms.kappa, nearest, farthest, strict=True):
            least = torch.addcmul(least, kappa, far, value=-0.5)
            largest = torch.addcmul(largest, kappa, near, value=-0.5)
        return least, largest

    def _away2(self, terms: Terms) -> Tensor:
        """Return squared distances (F, K) of centers from the middle, within `ROUNDING`."""
        rows = torch.zeros(self.factors, len(self.middle), dtype=self.middle.dtype)
        rows[torch.arange(len(self.middle)) % self.factors, torch.arange(len(self.middle))] = (
            -2 * self.middle
        )
        # centers are unit vectors
        square = 1 + lengths2(self.middle[:, None], self.factors)
        return torch.addmm(square, rows, terms.centers)


class _Left(NamedTuple):
    """What is left to sum in a tile.

    - `terms`: The terms.
    - `lost`: The logarithm of what has been left out at most.
    - `idle`: How many times in a row nothing has been left out.
    """

    terms: Terms
    lost: float = -math.inf
    idle: int = 0


class _Walk:
    """Logarithms (N,) of sums, and their gradients (m, N) in the features if they are wanted."""

    def __init__(
        self, features: Tensor, terms: Terms, floor: float, *, slope: bool = False
    ) -> None:
        features, self.floor = features.detach(), floor
        self.log_sum = torch.full_like(features[0], -math.inf)
        self.slope = torch.zeros_like(features) if slope else None
        if len(self.log_sum):
            self._add(torch.arange(len(self.log_sum)), features, _Left(terms))

    def _add(self, at: Tensor, features: Tensor, left: _Left) -> None:
        """Sum terms at points, by their numbers (N,) and features (m, N), or in both halves of them."""
        tile, count, given = Tile(features, left.terms.factors), len(at), left.terms.size
        least, largest = tile.bounds(left.terms)
        bottom = log_add(self.floor, least)
        far, lost = _negligible(largest, left.lost, bottom + LOG_TOLERANCE)
        if far is not None:
            left = left._replace(terms=left.terms.only(~far), lost=lost)
        terms = left.terms
        left = left._replace(idle=0 if terms.size < LESS_SHARE * given else left.idle + 1)
        if count > FEW_POINTS and count * terms.size > FEW_PAIRS and left.idle <= MAX_IDLE_HALVINGS:
            for half in _halves(features, tile):
                self._add(at[half], _gathered(features, half), left)
            return
        slope, parts = self.slope is not None, list[tuple[Tensor, Tensor | None]]()
        sharp = terms.sharp(tile.radius)
        if bool(sharp.any()):
            parts.append(terms.only(sharp).sharp_log_sum(features, slope=slope))
            terms = terms.only(~sharp)
        if terms.size:
            spread = float(terms.peaks.max()) - bottom
            parts.append(terms.log_sum(features, tile.middle, spread, slope=slope))
        self._put(at, parts)

    def _put(self, at: Tensor, parts: list[tuple[Tensor, Tensor | None]]) -> None:
        """Set the sums at points (N,), whose parts have logarithms (N,) and gradients (m, N)."""
        if not parts:
            return
        logs = [log for log, _ in parts]
        total = reduce(torch.logaddexp, logs)
        self.log_sum[at] = total
        if self.slope is not None:
            for log, slope in parts:
                assert slope is not None
                self.slope[:, at] += slope * (log - total).exp().nan_to_num_(0.0)


def _negligible(logs: Tensor, lost: float, most: float) -> tuple[Tensor | None, float]:
    """Return which (K,) of the exponentials of logarithms may be lost, if any, and what is lost then.

    With exp(`lost`) they sum to less than exp(`most`): the smallest ones, whose sum is half of what
    is still allowed, so that something is left for smaller tiles.
    """
    if most == -math.inf:
        return None, lost
    ordered = np.sort(logs.numpy())
    before = math.exp(min(lost - most, 0.0))
    sums = np.exp(np.minimum(ordered - most, 1.0)).cumsum()
    count = int(np.searchsorted(sums, (1 - before) / 2))
    if not count:
        return None, lost
    lost = most + math.log(sums[count - 1] + before + 1e-300)
    return logs < (float(ordered[count]) if count < len(ordered) else math.inf), lost


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


def _gathered(table: Tensor, which: Tensor) -> Tensor:
    """Return columns of a table (m, N) by their numbers (n,), four times as fast as by an index."""
    return table.gather(1, which.expand(len(table), -1))
