"""Boxes around points on products of circles or on a sphere, and coordinates about their middles."""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor

from orbiflow.density.models.terms import Terms, lengths2
from orbiflow.typed_torch import broadcast, linalg

ELLIPSES = (3.0, 5.0, 9.0, 17.0)
"""Sums of the half axes of the ellipses on which terms are bounded, in half sides of the tile."""

TURNS = 9
"""Points of half an ellipse at which terms are bounded."""

ROUNDING = 1e-15
"""Rounding error of squared distances between unit vectors, which bounds allow for."""

POLE = 0.75
"""The largest coordinate, complex ones included: coordinates have poles, or branches, at size 1."""

RIM = 0.8
"""The largest sum of squares of both coordinates on a sphere."""


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

    def nearest2(self, terms: Terms) -> Tensor:
        """Return kappa times the squared distance (F, K) of centers to the tile in each factor."""
        away = self._away2(terms).sub_(ROUNDING).clamp_min_(0).sqrt_()
        return away.sub_(self.radius[:, None]).clamp_min_(0).square_().mul_(terms.kappa)

    def _away2(self, terms: Terms) -> Tensor:
        """Return squared distances (F, K) of centers from the middle, within `ROUNDING`."""
        rows = torch.zeros(self.factors, len(self.middle), dtype=self.middle.dtype)
        rows[torch.arange(len(self.middle)) % self.factors, torch.arange(len(self.middle))] = (
            -2 * self.middle
        )
        # centers are unit vectors
        square = 1 + lengths2(self.middle[:, None], self.factors)
        return torch.addmm(square, rows, terms.centers)

    @property
    def has_chart(self) -> bool:
        """Whether it can have a `Chart`: two dimensions at most, less than a third of a turn."""
        dims = len(self.middle) - self.factors
        return dims <= 2 and bool((self.radius < 0.85).all())


class Chart:
    """Coordinates (D, N) about a tile's middle: tangents of half the angles, or two across on a sphere.

    D is F for circles and 2 for a sphere.
    """

    def __init__(self, tile: Tile) -> None:
        self.factors = tile.factors
        pole = tile.middle.reshape(-1, self.factors)
        self.is_round = len(pole) > 2
        self._frame = _frame(pole / linalg.vector_norm(pole, dim=0))

    def coordinates(self, features: Tensor) -> Tensor:
        """Return the coordinates (D, N) of features (m, N)."""
        local = self.turned(features)
        return local[0, 1:] if self.is_round else local[:, 1] / (1 + local[:, 0])

    def turned(self, features: Tensor) -> Tensor:
        """Return features of each factor (F, s, N) in its frame: along the pole, then across."""
        split = features.reshape(-1, self.factors, features.shape[1]).transpose(0, 1)
        return self._frame @ split

    def in_features(self, slope: Tensor, features: Tensor) -> Tensor:
        """Return a gradient (D, N) in the coordinates as one in the features, (m, N).

        It is that of some continuation beyond the spheres.
        """
        if self.is_round:
            return self._frame[0, 1:].mT @ slope
        local = self.turned(features)
        across = slope / (1 + local[:, 0])
        along = -across * local[:, 1] / (1 + local[:, 0])
        found = self._frame.mT @ torch.stack([along, across], dim=1)
        return found.transpose(0, 1).flatten(0, 1)

    def reach(self, middle: Tensor, half: Tensor, centers: Tensor) -> Tensor:
        """Return the largest real parts (D, E, K) of cosines to centers (F, s, K) along ellipses.

        Coordinate D runs along an ellipse about the box of a middle and half sides (D,), the other one
        is real. Infinite where an ellipse comes near the poles.
        """
        rho = torch.tensor(ELLIPSES, dtype=torch.float64)
        size = middle.abs()[:, None] + half[:, None] * (rho + 1 / rho) / 2
        u = middle[:, None, None] + half[:, None, None] * _ellipses()
        if self.is_round:
            other = middle.flip(0)[:, None] + half.flip(0)[:, None] * torch.tensor([-1.0, 0.0, 1.0])
            own, across = broadcast(u[..., None], other[:, None, None].to(u))
            height: Tensor = (1 - own * own - across * across).sqrt().real
            pairs = torch.stack([own.real, across.real], dim=1)
            pairs[1] = pairs[1].flip(0)
            places = torch.cat([height[:, None], pairs], dim=1).flatten(2).mT
            far = size.square() + (middle.abs() + half).square().flip(0)[:, None] > RIM
        else:
            square = u * u
            places = (torch.stack([1 - square, 2 * u], dim=-1) / (1 + square)[..., None]).real
            places, far = places.flatten(1, 2), size > POLE
        table = places @ centers
        found = table.reshape(len(table), len(ELLIPSES), -1, table.shape[2]).amax(dim=2)
        found[far] = math.inf
        return found


@lru_cache(maxsize=1)
def _ellipses() -> Tensor:
    """Return halves of ellipses (E, T) about -1 and 1, complex."""
    with torch.inference_mode(False):
        angle = torch.linspace(0, math.pi, TURNS, dtype=torch.float64)
        rho = torch.tensor(ELLIPSES, dtype=torch.float64)[:, None]
        turned = torch.polar(rho.expand(-1, TURNS), angle.expand(len(rho), -1))
        return (turned + 1 / turned) / 2


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
