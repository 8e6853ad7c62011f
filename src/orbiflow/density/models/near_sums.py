"""Sums of many kernels at many points: tile by tile, without what is too far to count.

Sums of kernels that are smooth across a tile are read off few places.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.terms import BLOCK_ENTRIES, WIDE, Terms, lengths2
from orbiflow.typed_torch import applied, broadcast, linalg

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
        if len(self.log_sum):
            self._add_terms(torch.arange(len(self.log_sum)), features, terms, 0)

    def _add_terms(self, at: Tensor, features: Tensor, terms: Terms, idle: int) -> None:
        """Add terms at points, by their numbers (N,) and features (m, N), or in both halves of them.

        Nothing has been left out `idle` times in a row.
        """
        tile, count, given = Tile(features, terms.factors), len(at), terms.size
        least, largest = tile.bounds(terms)
        bottom = max(self.floor, float(least.logsumexp(dim=0)))
        near = largest > bottom + self.each
        if not bool(near.all()):
            terms, least, largest = terms.only(near), least[near], largest[near]
        terms = self._interpolated(at, features, terms, tile, least, largest, bottom)
        if not terms.size:
            return
        idle = 0 if terms.size < LESS * given or count > self.worth else idle + 1
        if count > FEW_POINTS and count * terms.size > FEW_PAIRS and idle <= IDLE:
            for half in _halves(features, tile):
                self._add_terms(at[half], features[:, half], terms, idle)
            return
        spread = float(terms.peaks.max()) - bottom
        self._add(at, *terms.log_sum(features, tile.middle, spread, slope=self.slope is not None))

    def _add(self, at: Tensor, log_sum: Tensor, slope: Tensor | None) -> None:
        """Add to the sums at some points (N,) the logarithms of others, with their gradients (m, N)."""
        before = self.log_sum[at]
        after = torch.logaddexp(before, log_sum)
        self.log_sum[at] = after
        if self.slope is not None and slope is not None:
            old, new = ((x - after).exp().nan_to_num_(0.0) for x in (before, log_sum))
            self.slope[:, at] = self.slope[:, at] * old + slope * new

    def _interpolated(
        self,
        at: Tensor,
        features: Tensor,
        terms: Terms,
        tile: Tile,
        least: Tensor,
        largest: Tensor,
        bottom: float,
    ) -> Terms:
        """Add terms that are smooth across the tile to the sums, and return the others."""
        if len(at) < self.worth or terms.size < WORTH_TERMS or not tile.has_chart:
            return terms
        wide = (terms.kappa * tile.radius[:, None] ** 2).amax(dim=0) < SMOOTH_AT_MOST
        if int(wide.sum()) < WORTH_TERMS:
            return terms
        chart = Chart(features, tile)
        allowed = (self.tolerance + least).clamp_min_(bottom + self.each)
        smooth = wide & (chart.errors(terms, largest) < allowed)
        if int(smooth.sum()) < WORTH_TERMS:
            return terms
        top = float(largest[smooth].max())
        values, slope = chart.sum(terms.only(smooth), top, slope=self.slope is not None)
        values.clamp_min_(LEAST)  # what is negligible beside others may come out below 0
        if slope is not None:
            slope = slope / values
        self._add(at, values.log() + top, slope)
        return terms.only(~smooth)


def _halves(features: Tensor, tile: Tile) -> tuple[Tensor, Tensor]:
    """Return the numbers of the points in both halves, across the tile's longest side."""
    along = features[int(tile.sides.argmax())].numpy()
    order = torch.as_tensor(np.argpartition(along, len(along) // 2))
    return order[: len(along) // 2], order[len(along) // 2 :]


NODES = 28
"""Chebyshev points along a side of a tile."""

ELLIPSES = (3.0, 5.0, 9.0)
"""Sums of the half axes of the ellipses on which terms are bounded, in half sides of the tile."""

TURNS = 9
"""Points of half an ellipse at which terms are bounded; between them they are within `BETWEEN`."""

BETWEEN = 1.5
"""Logarithm of how much larger a term may be between those points."""

ROUNDING = math.log(1e-15)
"""Logarithm of the rounding error of interpolation, relative to the largest value in the tile."""

POLE = 0.75
"""The largest coordinate, complex ones included: the chart has poles at plus and minus i."""


class Tile:
    """A box around features (m, N), N > 0."""

    def __init__(self, features: Tensor, factors: int) -> None:
        low, high = features.amin(dim=1), features.amax(dim=1)
        self.factors = factors
        self.middle, self.sides = (low + high) / 2, high - low
        self.radius = self._away2(features).amax(dim=1).sqrt()

    def bounds(self, terms: Terms) -> tuple[Tensor, Tensor]:
        """Return the least and largest logarithms (K,) of the terms in the tile.

        They are bounds by the triangle inequality.
        """
        away, radius = self._away2(terms.centers).sqrt_(), self.radius[:, None]
        nearest = (away - radius).clamp_min_(0).square_().mul_(terms.kappa)
        farthest = away.add_(radius).square_().mul_(terms.kappa)
        return (
            torch.sub(terms.peaks, farthest.sum(dim=0), alpha=0.5),
            torch.sub(terms.peaks, nearest.sum(dim=0), alpha=0.5),
        )

    def _away2(self, features: Tensor) -> Tensor:
        """Return squares (F, N) of distances from the middle."""
        return lengths2(features - self.middle[:, None], self.factors)

    @property
    def has_chart(self) -> bool:
        """Whether it can have a `Chart`: two dimensions at most, less than a third of a turn."""
        dims = len(self.middle) - self.factors
        return dims <= 2 and bool((self.radius < 0.85).all())


class Chart:
    """Stereographic coordinates u on a tile, the tangents of half the angles, (D, N).

    D is F for circles and 2 for a sphere. Sums of terms that are analytic well beyond the tile are
    polynomials of degree `NODES` - 1 in each of them.
    """

    def __init__(self, features: Tensor, tile: Tile) -> None:
        self.factors, self._tile = tile.factors, tile
        pole = tile.middle.reshape(-1, self.factors)
        self._frame = _frame(pole / linalg.vector_norm(pole, dim=0))
        self._local = self._turned(features)
        u = torch.cat([local[1:] / (1 + local[:1]) for local in self._local])
        low, high = u.amin(dim=1), u.amax(dim=1)
        self.middle, self.half = (low + high) / 2, ((high - low) / 2).clamp_min(1e-9)
        self._t = (u - self.middle[:, None]) / self.half[:, None]

    def errors(self, terms: Terms, largest: Tensor) -> Tensor:
        """Return logarithms (K,) of bounds on the interpolation error of each term.

        Along an axis by 4 M rho^(1 - n) / (rho - 1), M the largest value on the ellipse of rho
        (Trefethen, Approximation Theory and Approximation Practice, 2013, theorem 8.2), times the
        Lebesgue constant of the other axis. The terms in the tile are below exp(`largest`), (K,).
        """
        centers = self._turned(terms.centers)
        lebesgue = 1 + 2 / math.pi * math.log(NODES)
        worst = largest + ROUNDING
        for axis in range(len(self.middle)):
            factor = axis if self.factors > 1 else 0
            best = torch.full_like(largest, math.inf)
            for rho in ELLIPSES:
                cosine = self._ellipse(axis, rho, centers[factor])
                if cosine is not None:
                    scale = math.log(8 * lebesgue / (rho - 1)) - (NODES - 1) * math.log(rho)
                    found = cosine.sub_(1).mul_(terms.kappa[factor]).add_(scale + BETWEEN)
                    best = torch.minimum(best, found)
            if self.factors > 1:
                # terms are products: the other factor's largest value counts as it is
                best += largest - terms.peaks + self._nearest2(terms, factor) / 2
            worst = torch.maximum(worst, best + terms.peaks)
        return worst

    def sum(self, terms: Terms, top: float, *, slope: bool) -> tuple[Tensor, Tensor | None]:
        """Return the sum (N,) of terms at the tile's points over exp(top), and its gradient (m, N).

        The gradient, None unless `slope`, is that of some continuation beyond the spheres.
        """
        nodes = _nodes()
        sides = self.middle[:, None] + self.half[:, None] * nodes
        flat = len(terms.kappa) == 2
        table = self._product(terms, top, sides) if flat else self._dense(terms, top, sides)
        (along, rising), *second = (_lagrange(t, slope) for t in self._t)
        across, turning = second[0] if second else (torch.ones_like(along[:, :1]), None)
        rows = along @ table
        values = (rows * across).sum(dim=1)
        if rising is None:
            return values, None
        rated = [((rising @ table) * across).sum(dim=1)]
        if turning is not None:
            rated.append((rows * turning).sum(dim=1))
        return values, self._in_features(torch.stack(rated) / self.half[:, None])

    def _in_features(self, slope: Tensor) -> Tensor:
        """Return a gradient (D, N) in the coordinates as one in the features, (m, N)."""
        found: list[Tensor] = []
        parts = torch.split(slope, len(slope) // self.factors)
        for frame, local, part in zip(self._frame, self._local, parts, strict=True):
            below = 1 + local[:1]
            across = part / below
            along = -(across * local[1:] / below).sum(dim=0, keepdim=True)
            found.append(frame.mT @ torch.cat([along, across]))
        return torch.stack(found, dim=1).flatten(0, 1)

    def _product(self, terms: Terms, top: float, sides: Tensor) -> Tensor:
        """Return values (n, n) at the nodes of terms that are products over the two coordinates."""
        first, second = (
            _exponents(center, kappa, _sphere(side[None])).clamp_min_(-WIDE).exp_()
            for center, kappa, side in zip(
                self._turned(terms.centers), terms.kappa, sides, strict=True
            )
        )
        return (first * (terms.peaks - top).exp()) @ second.mT

    def _dense(self, terms: Terms, top: float, sides: Tensor) -> Tensor:
        """Return values (n, n), or (n, 1) on a circle, at the nodes."""
        grid = torch.stack(torch.meshgrid(*sides, indexing="ij")).flatten(1)
        local, found = _sphere(grid), 0.0
        block = max(1, BLOCK_ENTRIES // local.shape[1])
        (centers,) = self._turned(terms.centers)
        for at in torch.split(torch.arange(terms.size), block):
            table = _exponents(centers[:, at], terms.kappa[0][at], local)
            found = table.add_(terms.peaks[at] - top).clamp_min_(-WIDE).exp_().sum(dim=1) + found
        assert isinstance(found, Tensor)
        return found.reshape(NODES, -1)

    def _nearest2(self, terms: Terms, factor: int) -> Tensor:
        """Return kappa times the squared distance (K,) of centers to the tile in one factor."""
        middle = self._tile.middle.reshape(-1, self.factors)[:, factor, None]
        centers = terms.centers.reshape(-1, self.factors, terms.size)[:, factor]
        away = ((centers - middle) ** 2).sum(dim=0).sqrt_().sub_(self._tile.radius[factor])
        return away.clamp_min_(0).square_().mul_(terms.kappa[factor])

    def _turned(self, features: Tensor) -> list[Tensor]:
        """Return features of each factor (s, N) in its frame: along the pole, then across."""
        split = features.reshape(-1, self.factors, features.shape[1]).unbind(dim=1)
        return [frame @ part for frame, part in zip(self._frame, split, strict=True)]

    def _ellipse(self, axis: int, rho: float, centers: Tensor) -> Tensor | None:
        """Return the largest real part (K,) of cosines to centers (s, K) along an ellipse.

        One coordinate runs along the ellipse, the other one is real. None if the ellipse comes near the
        poles of the chart.
        """
        if float(self.middle[axis].abs() + self.half[axis] * (rho + 1 / rho) / 2) > POLE:
            return None
        u = self.middle[axis] + self.half[axis] * _ellipse(rho)
        if self.factors > 1 or len(self.middle) == 1:
            return (_sphere(u[None]).real.mT @ centers).amax(dim=0)
        other = 1 - axis
        across = self.middle[other] + self.half[other] * torch.tensor([-1.0, 0.0, 1.0])
        pair = broadcast(u[:, None], across.to(u))
        places = torch.stack(pair if axis == 0 else pair[::-1]).flatten(1)
        return (_sphere(places).real.mT @ centers).amax(dim=0)


def _sphere(u: Tensor) -> Tensor:
    """Return unit vectors (D + 1, N) of stereographic coordinates (D, N), complex ones too."""
    square = (u * u).sum(dim=0, keepdim=True)
    return torch.cat([1 - square, 2 * u]) / (1 + square)


@lru_cache(maxsize=len(ELLIPSES))
def _ellipse(rho: float) -> Tensor:
    """Return half of an ellipse (T,) about -1 and 1, complex."""
    with torch.inference_mode(False):
        angle = torch.linspace(0, math.pi, TURNS, dtype=torch.float64)
        turned = torch.polar(torch.full_like(angle, rho), angle)
        return (turned + 1 / turned) / 2


def _exponents(centers: Tensor, kappa: Tensor, local: Tensor) -> Tensor:
    """Return kappa (cos - 1), (n, K), of unit vectors (s, K) and (s, n)."""
    # about the nodes' middle, see `Terms.log_sum`
    middle = local.mean(dim=1, keepdim=True)
    offset, near = centers - middle, local - middle
    table = torch.addmm((offset**2).sum(dim=0) / -2, near.mT, offset)
    return table.sub_((near**2).sum(dim=0)[:, None] / 2).mul_(kappa)


def _frame(pole: Tensor) -> Tensor:
    """Return frames (F, s, s): rows are the pole (s, F) of each factor and unit vectors across."""
    if len(pole) == 2:
        x, y = pole
        return torch.stack([torch.stack([x, y], dim=1), torch.stack([-y, x], dim=1)], dim=1)
    start = pole[:, 0]
    across = torch.zeros_like(start)
    across[start.abs().argmin()] = 1
    first = linalg.cross(start, across)
    first = first / linalg.vector_norm(first)
    return torch.stack([start, first, linalg.cross(start, first)])[None]


@lru_cache(maxsize=1)
def _nodes() -> Tensor:
    """Return the Chebyshev points (n,) of [-1, 1]."""
    with torch.inference_mode(False):
        return torch.cos(math.pi * (torch.arange(NODES, dtype=torch.float64) + 0.5) / NODES)


@lru_cache(maxsize=1)
def _transform() -> Tensor:
    """Return the matrix (n, n) that makes Chebyshev coefficients from values at the nodes."""
    angle = math.pi * (torch.arange(NODES, dtype=torch.float64) + 0.5) / NODES
    with torch.inference_mode(False):
        matrix = torch.cos(torch.arange(NODES, dtype=torch.float64)[:, None] * angle)
        matrix[0] /= 2
        return matrix * (2 / NODES)


def _lagrange(t: Tensor, slope: bool) -> tuple[Tensor, Tensor | None]:
    """Return weights (N, n) of values at the nodes for a polynomial's values and slopes at t (N,)."""
    values, rates = [torch.ones_like(t), t], [torch.zeros_like(t), torch.ones_like(t)]
    for _ in range(NODES - 2):
        values.append(2 * t * values[-1] - values[-2])
        if slope:
            rates.append(2 * values[-2] + 2 * t * rates[-1] - rates[-2])
    found = torch.stack(values, dim=1) @ _transform()
    return found, torch.stack(rates, dim=1) @ _transform() if slope else None
