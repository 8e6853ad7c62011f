"""Sums of kernels that are smooth across a box: polynomials, known by their values at few places."""

from __future__ import annotations

import copy
import math
from functools import lru_cache

import torch
from torch import Tensor

from orbiflow.density.models.charts import ELLIPSES, Chart, Tile
from orbiflow.density.models.terms import LOG2_E, Terms
from orbiflow.typed_torch import linalg

LEAST = 1e-290
"""The least interpolated sum, relative to the largest value."""

NODES = 48
"""Chebyshev points along a side of a tile."""

BETWEEN = 1.5
"""Logarithm of how much larger a term may be between the points at which it is bounded."""

ROUNDING = math.log(1e-15)
"""Logarithm of the rounding error of interpolation, relative to the largest value in the tile."""

MOST_POINTS = 64
"""The most points at which exponents are interpolated."""

FELT = 1e-16
"""Coefficients that are together below this share of the largest are left out, like rounding."""


class Patch:
    """Points u (D, N) of a chart, the box about them, and the sum of terms that are smooth across it.

    Sums of terms that are analytic well beyond the box are polynomials of degree `NODES` - 1 in
    each coordinate: `_series` are their Chebyshev coefficients (n, n), over exp(`_top`).
    """

    def __init__(self, chart: Chart, u: Tensor) -> None:
        self.chart, self.u = chart, u
        low, high = torch.aminmax(u, dim=1)
        self.middle, self.half = (low + high) / 2, ((high - low) / 2).clamp_min(1e-9)
        self._series, self._top = u.new_zeros(NODES, NODES if len(u) > 1 else 1), -math.inf

    def only(self, which: Tensor) -> Patch:
        """Return the same sums in the same box, at some of its points."""
        own = copy.copy(self)
        own.u = gathered(self.u, which)
        return own

    def take(self, whole: Patch) -> None:
        """Take the sums of a patch that this one is a part of."""
        nodes = self.middle[:, None] + self.half[:, None] * _nodes(NODES)
        sides = (nodes - whole.middle[:, None]) / whole.half[:, None]
        first, *second = (_transform(NODES) @ _chebyshev(t).mT for t in sides)
        self._series, self._top = first @ whole._series, whole._top
        if second:
            self._series = self._series @ second[0].mT

    def add(self, terms: Terms, top: float) -> None:
        """Add terms, which are below exp(top) in the box."""
        offset = self.half[:, None] * _nodes(NODES)
        values = self._on_sphere if self.chart.is_round else self._on_circles
        highest = max(top, self._top)
        found = _transform(NODES) @ values(terms, top, offset)
        if len(offset) > 1:
            found = found @ _transform(NODES).mT
        self._series = self._series * math.exp(self._top - highest)
        self._series += found * math.exp(top - highest)
        self._top = highest

    def log_sum(self, features: Tensor, *, slope: bool) -> tuple[Tensor, Tensor | None]:
        """Return the logarithm (N,) of the sum at the points, and its gradient (m, N) if wanted."""
        u = (self.u - self.middle[:, None]) / self.half[:, None]
        series = self._series[tuple(slice(_felt(own)) for own in (self._series, self._series.mT))]
        along, *other = (_chebyshev(t, n) for t, n in zip(u, series.shape, strict=False))
        across = other[0] if other else torch.ones_like(along[:1])
        # what is negligible beside others may come out below 0
        sums = (series @ across).mul_(along).sum(dim=0).clamp_min_(LEAST)
        if not slope:
            return sums.log() + self._top, None
        rates = [(_derivative(len(series)) @ series @ across).mul_(along).sum(dim=0)]
        if other:
            bent = series @ _derivative(series.shape[1]).mT
            rates.append((bent @ across).mul_(along).sum(dim=0))
        gradient = torch.stack(rates) / self.half[:, None] / sums
        return sums.log() + self._top, self.chart.in_features(gradient, features)

    def errors(self, terms: Terms, largest: Tensor, tile: Tile) -> Tensor:
        """Return logarithms (K,) of bounds on each term's interpolation error.

        Along an axis by 4 M rho^(1 - n) / (rho - 1), M the largest value on the ellipse of rho
        (Trefethen, Approximation Theory and Approximation Practice, 2013, theorem 8.2), times the
        Lebesgue constant of the other axis. The terms in the tile are below exp(`largest`), (K,).
        """
        reach = self.chart.reach(self.middle, self.half, self.chart.turned(terms.centers))
        exponents = reach.sub_(1).mul_(terms.kappa[:, None]).add_(_scale()[:, None])
        worst = exponents.amin(dim=1)
        if self.chart.factors > 1:
            # terms are products: the other factor's largest value counts as it is
            worst += (tile.nearest2(terms) / 2).add_(largest - terms.peaks)
        return torch.maximum(worst.amax(dim=0) + terms.peaks, largest + ROUNDING)

    def _on_circles(self, terms: Terms, top: float, offset: Tensor) -> Tensor:
        """Return values (n, n), or (n, 1) on a circle, of terms: products over the coordinates."""
        u = self.middle[:, None] + offset
        square = u * u
        local = torch.stack([1 - square, 2 * u], dim=1) / (1 + square)[:, None]
        # about the nodes' middle, see `Terms.log_sum`
        middle = local.mean(dim=2, keepdim=True)
        centers, near = self.chart.turned(terms.centers) - middle, local - middle
        table = torch.baddbmm((centers**2).sum(dim=1, keepdim=True) / -2, near.mT, centers)
        table.sub_((near**2).sum(dim=1)[..., None] / 2).mul_(terms.kappa[:, None] * LOG2_E)
        first, *second = table.exp2_()
        first.mul_((terms.peaks - top).exp_())
        return first @ second[0].mT if second else first.sum(dim=1, keepdim=True)

    def _on_sphere(self, terms: Terms, top: float, offset: Tensor) -> Tensor:
        """Return values (n, n) of terms on a sphere, which are nearly products over the coordinates.

        A term is exp(peak - kappa |x0 - c|^2 / 2 + kappa c.(x - x0)) about a place x0 in the box. The
        height of x - x0 is a sum over the coordinates, but for a small rest. Its exponential is
        interpolated in kappa c: few Chebyshev points between the smallest and the largest are enough.
        """
        (centers,), kappa = self.chart.turned(terms.centers), terms.kappa[0]
        start = torch.cat([(1 - self.middle.square().sum()).sqrt()[None], self.middle])
        bias = terms.peaks - top - kappa / 2 * ((centers - start[:, None]) ** 2).sum(dim=0)
        height = self._height(offset[0][:, None], offset[1])
        sides = height.mean(dim=1), height.mean(dim=0) - height.mean()
        rest = height - sides[0][:, None] - sides[1]
        sharp = kappa * centers[0]
        along, across = (
            torch.stack([own, side], dim=1) @ torch.stack([kappa * center, sharp])
            for own, side, center in zip(offset, sides, centers[1:], strict=True)
        )
        left = along.add_(bias).mul_(LOG2_E).exp2_()
        right = across.mul_(LOG2_E).exp2_()
        low, high = torch.aminmax(sharp)
        middle, half = (low + high) / 2, ((high - low) / 2).clamp_min(1e-9)
        count = _points_of_exponential(float(half * rest.abs().max()))
        shares = _transform(count).mT @ _chebyshev((sharp - middle) / half, count)
        products = (left * shares[:, None]).flatten(0, 1) @ right.mT
        factors = ((middle + half * _nodes(count))[:, None, None] * rest).exp_()
        return products.reshape(factors.shape).mul_(factors).sum(dim=0)

    def _height(self, first: Tensor, second: Tensor) -> Tensor:
        """Return heights (n, n) of the sphere over offsets (n, 1) and (n,), above its middle's."""
        a, b = self.middle
        fall = first * (2 * a + first) + second * (2 * b + second)
        below = 1 - a * a - b * b
        return -fall / ((below - fall).sqrt() + below.sqrt())


def gathered(table: Tensor, which: Tensor) -> Tensor:
    """Return columns of a table (m, N) by their numbers (n,), four times as fast as by an index."""
    return table.gather(1, which.expand(len(table), -1))


def _felt(series: Tensor) -> int:
    """Return how many rows of coefficients (n, m), from the first, are felt."""
    size = linalg.vector_norm(series, dim=1)
    beyond = size.square().flip(0).cumsum(0).flip(0).sqrt()
    return max(1, int((beyond > FELT * size.max()).sum()))


def _points_of_exponential(largest: float) -> int:
    """Return how many Chebyshev points give exponentials of exponents up to +-`largest`."""
    count, error = 1, largest
    while error > 1e-16 and count < MOST_POINTS:
        count += 1
        error *= largest / (2 * count)
    return count


@lru_cache(maxsize=1)
def _scale() -> Tensor:
    """Return logarithms (E,) of what bounds on the `ELLIPSES` are times."""
    lebesgue = 1 + 2 / math.pi * math.log(NODES)
    with torch.inference_mode(False):
        rho = torch.tensor(ELLIPSES, dtype=torch.float64)
        return (8 * lebesgue / (rho - 1)).log() - (NODES - 1) * rho.log() + BETWEEN


@lru_cache(maxsize=MOST_POINTS)
def _nodes(count: int) -> Tensor:
    """Return the Chebyshev points (n,) of [-1, 1]."""
    with torch.inference_mode(False):
        return torch.cos(math.pi * (torch.arange(count, dtype=torch.float64) + 0.5) / count)


@lru_cache(maxsize=MOST_POINTS)
def _transform(count: int) -> Tensor:
    """Return the matrix (n, n) that makes Chebyshev coefficients from values at the nodes."""
    angle = math.pi * (torch.arange(count, dtype=torch.float64) + 0.5) / count
    with torch.inference_mode(False):
        matrix = torch.cos(torch.arange(count, dtype=torch.float64)[:, None] * angle)
        matrix[0] /= 2
        return matrix * (2 / count)


@lru_cache(maxsize=MOST_POINTS)
def _derivative(count: int) -> Tensor:
    """Return the matrix (n, n) that makes the coefficients of a Chebyshev series' derivative."""
    order = torch.arange(count, dtype=torch.float64)
    with torch.inference_mode(False):
        above = order - order[:, None]
        matrix = torch.where((above > 0) & (above % 2 == 1), 2 * order, 0.0)
        matrix[0] /= 2
        return matrix


def _chebyshev(t: Tensor, count: int = NODES) -> Tensor:
    """Return the first Chebyshev polynomials (n, N) at t (N,), which rounding may put beyond 1."""
    table = t.new_empty(max(2, count), len(t))
    table[0] = 1
    table[1] = t.clamp(-1, 1)
    known = 1
    while known < count - 1:  # T_(k + i) = 2 T_k T_i - T_(k - i)
        more = min(known, count - 1 - known)
        found = torch.mul(
            table[1 : more + 1], 2 * table[known], out=table[known + 1 : known + 1 + more]
        )
        found.sub_(table[known - more : known].flip(0))
        known += more
    return table[:count]
