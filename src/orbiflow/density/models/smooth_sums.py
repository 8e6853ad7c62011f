"""Sums of kernels that are smooth across a box: polynomials, known by their values at few places."""

from __future__ import annotations

import copy
import math
from functools import lru_cache

import torch
from torch import Tensor

from orbiflow.density.models.terms import BLOCK_ENTRIES, LOG2_E, Terms, lengths2
from orbiflow.typed_torch import broadcast, linalg

LEAST = 1e-290
"""The least interpolated sum, relative to the largest value."""

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

    def nearest2(self, terms: Terms, factor: int) -> Tensor:
        """Return kappa times the squared distance (K,) of centers to the tile in one factor."""
        middle = self.middle.reshape(-1, self.factors)[:, factor, None]
        centers = terms.centers.reshape(-1, self.factors, terms.size)[:, factor]
        away = ((centers - middle) ** 2).sum(dim=0).sqrt_().sub_(self.radius[factor])
        return away.clamp_min_(0).square_().mul_(terms.kappa[factor])

    def _away2(self, features: Tensor) -> Tensor:
        """Return squares (F, N) of distances from the middle."""
        return lengths2(features - self.middle[:, None], self.factors)

    @property
    def has_chart(self) -> bool:
        """Whether it can have a `Chart`: two dimensions at most, less than a third of a turn."""
        dims = len(self.middle) - self.factors
        return dims <= 2 and bool((self.radius < 0.85).all())


class Chart:
    """Stereographic coordinates, the tangents of half the angles (D, N), about a tile's middle.

    D is F for circles and 2 for a sphere.
    """

    def __init__(self, tile: Tile) -> None:
        self.factors = tile.factors
        pole = tile.middle.reshape(-1, self.factors)
        self._frame = _frame(pole / linalg.vector_norm(pole, dim=0))

    def coordinates(self, features: Tensor) -> Tensor:
        """Return the coordinates (D, N) of features (m, N)."""
        return torch.cat([local[1:] / (1 + local[:1]) for local in self.turned(features)])

    def turned(self, features: Tensor) -> list[Tensor]:
        """Return features of each factor (s, N) in its frame: along the pole, then across."""
        split = features.reshape(-1, self.factors, features.shape[1]).unbind(dim=1)
        return [frame @ part for frame, part in zip(self._frame, split, strict=True)]

    def in_features(self, slope: Tensor, features: Tensor) -> Tensor:
        """Return a gradient (D, N) in the coordinates as one in the features, (m, N).

        It is that of some continuation beyond the spheres.
        """
        found: list[Tensor] = []
        parts = torch.split(slope, len(slope) // self.factors)
        for frame, local, part in zip(self._frame, self.turned(features), parts, strict=True):
            below = 1 + local[:1]
            across = part / below
            along = -(across * local[1:] / below).sum(dim=0, keepdim=True)
            found.append(frame.mT @ torch.cat([along, across]))
        return torch.stack(found, dim=1).flatten(0, 1)


class Patch:
    """Points u (D, N) of a chart, the box about them, and the sum of terms that are smooth across it.

    Sums of terms that are analytic well beyond the box are polynomials of degree `NODES` - 1 in each
    coordinate: they are known by their values (n, n), over exp(`top`), at Chebyshev points.
    """

    def __init__(self, chart: Chart, u: Tensor) -> None:
        self.chart, self.u = chart, u
        low, high = u.amin(dim=1), u.amax(dim=1)
        self.middle, self.half = (low + high) / 2, ((high - low) / 2).clamp_min(1e-9)
        self._values, self._top = u.new_zeros(1, 1), -math.inf

    @property
    def _sides(self) -> Tensor:
        """The coordinates (D, n) of the nodes."""
        return self.middle[:, None] + self.half[:, None] * _nodes()

    def only(self, which: Tensor) -> Patch:
        """Return the same sums in the same box, at some of its points."""
        own = copy.copy(self)
        own.u = self.u[:, which]
        return own

    def take(self, whole: Patch) -> None:
        """Take the sums of a patch that this one is a part of."""
        sides = (self._sides - whole.middle[:, None]) / whole.half[:, None]
        first, *second = (_chebyshev(t) @ _transform() for t in sides)
        self._values, self._top = first @ whole._values, whole._top
        if second:
            self._values = self._values @ second[0].mT

    def add(self, terms: Terms, top: float) -> None:
        """Add terms, which are below exp(top) in the box."""
        flat = len(terms.kappa) == 2
        found = self._product(terms, top) if flat else self._dense(terms, top)
        highest = max(top, self._top)
        self._values = self._values * math.exp(self._top - highest)
        self._values = self._values + found * math.exp(top - highest)
        self._top = highest

    def log_sum(self, features: Tensor, *, slope: bool) -> tuple[Tensor, Tensor | None]:
        """Return the logarithm (N,) of the sum at the points, and its gradient (m, N) if wanted."""
        u = (self.u - self.middle[:, None]) / self.half[:, None]
        along, *other = (_chebyshev(t) for t in u)
        across = other[0] if other else torch.ones_like(along[:, :1])
        series = _transform() @ self._values
        if other:
            series = series @ _transform().mT
        # what is negligible beside others may come out below 0
        sums = ((along @ series) * across).sum(dim=1).clamp_min_(LEAST)
        if not slope:
            return sums.log() + self._top, None
        rates = [((along @ (_derivative() @ series)) * across).sum(dim=1)]
        if other:
            rates.append(((along @ (series @ _derivative().mT)) * across).sum(dim=1))
        gradient = torch.stack(rates) / self.half[:, None] / sums
        return sums.log() + self._top, self.chart.in_features(gradient, features)

    def errors(self, terms: Terms, largest: Tensor, tile: Tile) -> Tensor:
        """Return logarithms (K,) of bounds on the interpolation error of each term.

        Along an axis by 4 M rho^(1 - n) / (rho - 1), M the largest value on the ellipse of rho
        (Trefethen, Approximation Theory and Approximation Practice, 2013, theorem 8.2), times the
        Lebesgue constant of the other axis. The terms in the tile are below exp(`largest`), (K,).
        """
        centers, factors = self.chart.turned(terms.centers), self.chart.factors
        lebesgue = 1 + 2 / math.pi * math.log(NODES)
        worst = largest + ROUNDING
        for axis in range(len(self.middle)):
            factor = axis if factors > 1 else 0
            best = torch.full_like(largest, math.inf)
            for rho in ELLIPSES:
                cosine = self._ellipse(axis, rho, centers[factor])
                if cosine is not None:
                    scale = math.log(8 * lebesgue / (rho - 1)) - (NODES - 1) * math.log(rho)
                    found = cosine.sub_(1).mul_(terms.kappa[factor]).add_(scale + BETWEEN)
                    best = torch.minimum(best, found)
            if factors > 1:
                # terms are products: the other factor's largest value counts as it is
                best += largest - terms.peaks + tile.nearest2(terms, factor) / 2
            worst = torch.maximum(worst, best + terms.peaks)
        return worst

    def _product(self, terms: Terms, top: float) -> Tensor:
        """Return values (n, n) at the nodes of terms that are products over the two coordinates."""
        first, second = (
            _exponents(center, kappa, _sphere(side[None])).mul_(LOG2_E).exp2_()
            for center, kappa, side in zip(
                self.chart.turned(terms.centers), terms.kappa, self._sides, strict=True
            )
        )
        return (first * (terms.peaks - top).exp()) @ second.mT

    def _dense(self, terms: Terms, top: float) -> Tensor:
        """Return values (n, n), or (n, 1) on a circle, at the nodes."""
        grid = torch.stack(torch.meshgrid(*self._sides, indexing="ij")).flatten(1)
        local, found = _sphere(grid), 0.0
        block = max(1, BLOCK_ENTRIES // local.shape[1])
        (centers,) = self.chart.turned(terms.centers)
        for at in torch.split(torch.arange(terms.size), block):
            table = _exponents(centers[:, at], terms.kappa[0][at], local)
            found = table.add_(terms.peaks[at] - top).mul_(LOG2_E).exp2_().sum(dim=1) + found
        assert isinstance(found, Tensor)
        return found.reshape(NODES, -1)

    def _ellipse(self, axis: int, rho: float, centers: Tensor) -> Tensor | None:
        """Return the largest real part (K,) of cosines to centers (s, K) along an ellipse.

        One coordinate runs along the ellipse, the other one is real. None if the ellipse comes near the
        poles of the chart.
        """
        if float(self.middle[axis].abs() + self.half[axis] * (rho + 1 / rho) / 2) > POLE:
            return None
        u = self.middle[axis] + self.half[axis] * _ellipse(rho)
        if self.chart.factors > 1 or len(self.middle) == 1:
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


@lru_cache(maxsize=1)
def _derivative() -> Tensor:
    """Return the matrix (n, n) that makes the coefficients of a Chebyshev series' derivative."""
    order = torch.arange(NODES, dtype=torch.float64)
    with torch.inference_mode(False):
        above = order - order[:, None]
        matrix = torch.where((above > 0) & (above % 2 == 1), 2 * order, 0.0)
        matrix[0] /= 2
        return matrix


def _chebyshev(t: Tensor) -> Tensor:
    """Return the Chebyshev polynomials (N, n) at t (N,), which rounding may put beyond 1."""
    return torch.outer(t.clamp(-1, 1).acos_(), torch.arange(NODES).to(t)).cos_()
