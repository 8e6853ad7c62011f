"""Figures of a density that torch's distributions have: mean, mode, cdf, entropy, divergence."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import torch
from torch import Tensor
from torch.distributions import Distribution, kl

from orbiflow.density.spaces import CHART, Line, Space
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_tensor, as_whole
from orbiflow.typed_torch import linalg

DRAWS = 2**16
"""Draws of what is estimated, always the same ones."""

STARTS, STEPS = 32, 200
"""Places from which a mode is looked for, and the most steps of each."""

NODES = ((-0.7745966692414834, 5 / 9), (0.0, 8 / 9), (0.7745966692414834, 5 / 9))
"""Places and weights of Gauss's rule in a cell from -1 to 1."""

FIRST_CELLS, MOST_CELLS, MASS_ERROR = 2**11, 2**14, 1e-7
"""Cells of a line of turns at first and at most, and the error of the mass that is small enough."""


LEAST_RESULTANT = 1e-9
"""Mean resultant length below which a circle has no mean direction."""


WITHIN_TWO_SCALES = 2 / 8**0.5
"""The share of a line, z / sqrt(4 + z^2), two scales from the centre: five deviations."""


class Cumulative(NamedTuple):
    """The masses of a density of one column, from its start on.

    - `log_prob`: The density per turn at points (..., 1).
    - `start`: Where the column starts, in turns.
    - `ends`, `below`: Ends (N + 1,) of even cells from there on, and the masses below them.
    """

    log_prob: Callable[[Tensor], Tensor]
    start: float
    ends: Tensor
    below: Tensor

    def masses(self, shares: Tensor) -> Tensor:
        """Return the masses (...,) up to turns (...,) from the start on, from 0 to 1."""
        cell = (shares * (len(self.ends) - 1)).long().clamp(max=len(self.ends) - 2)
        low, width = self.ends[cell], shares - self.ends[cell]
        rest = torch.zeros_like(shares)
        for node, weight in NODES:
            at = low + width * (node + 1) / 2
            rest += weight * width / 2 * self.log_prob(at[..., None] + self.start).exp()
        return (self.below[cell] + rest).clamp(0, 1)


class Estimate(NamedTuple):
    """A number with its standard error, both in nats."""

    value: float
    error: float


class WithFigures(Distribution):
    """What torch's distributions have beside log_prob and samples, for densities on any space.

    What is estimated from draws has the same ones every time, so it is the same number twice.
    """

    space: Space
    log_prob: Callable[..., Tensor]  # pyright: ignore[reportIncompatibleMethodOverride]
    sample: Callable[..., Tensor]  # pyright: ignore[reportIncompatibleMethodOverride]
    log_marginal: Callable[..., Tensor]
    bumps: Callable[[], Tensor]

    def _draws(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        return self.sample((count,), generator or torch.Generator().manual_seed(0))

    @property
    @torch.no_grad()
    def mean(self) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The chart point (d,) of the mean: the mean direction, of real columns the mean value.

        Of a torus each angle has its own, from an integral over its marginal density; on spheres it is
        estimated from `DRAWS` draws, with an error of some 1 / 256 of the deviation.

        Raises `OrbiflowError` on other spaces, whose points have no mean.
        """
        space = self.space
        if space.is_torus:
            return torch.stack([self._mean_of(axis) for axis in range(space.dim)])
        if space.parts:
            raise OrbiflowError(
                f"columns beside the {space.parts[0].name} have means of their own: ask marginal "
                "densities for them"
            )
        if space.name not in ("sphere", "hypersphere"):
            raise OrbiflowError(
                f"points of the {space.name} have no mean, as several images of a point are the same: "
                "ask for the mode"
            )
        vector = space.features(self._draws(DRAWS))[0].mean(dim=0)
        return space.from_features((vector / linalg.vector_norm(vector))[None])[0]

    def _mean_of(self, axis: int) -> Tensor:
        """Return the mean of one column of a torus in turns."""
        turns, weights = self._masses(axis)
        space = self.space
        line = space.axes[axis]
        if isinstance(line, Line):
            row = torch.full((len(turns), space.dim), 0.25, dtype=torch.float64)
            row[:, axis] = turns
            values = torch.tensor(space.from_chart(row)[:, axis])
            if line.kind != "linear":  # whose far ends are beyond all numbers
                weights = weights * (line.share(values).abs() < WITHIN_TWO_SCALES)
            return line.turns((weights * values).sum() / weights.sum())
        return _direction(turns, weights)[0]

    def _masses(self, axis: int, start: float = 0.0) -> tuple[Tensor, Tensor]:
        """Return turns (N,) of one column from a start on, and the masses (N,) about them."""
        cells = FIRST_CELLS
        while True:
            turns, weights = _nodes(cells)
            parts = torch.split(turns[:, None] + start, 4096)
            is_alone = self.space.dim == 1
            logs = [self.log_prob(x) if is_alone else self.log_marginal(x, [axis]) for x in parts]
            masses = weights * torch.cat(logs).exp()
            if abs(float(masses.sum()) - 1) < MASS_ERROR or cells >= MOST_CELLS:
                return turns, masses
            cells *= 8

    @property
    def mode(self) -> Tensor:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The chart point (d,) at which the density in natural measure is highest, as far as was found.

        It is looked for uphill from the best of some draws and of the middles of the kernels.
        """
        some = self._draws(DRAWS // 8)
        places = torch.cat([some, self.bumps().to(some)[:DRAWS]])
        with torch.no_grad():
            best = self.log_prob(places, measure="natural").topk(min(STARTS, len(places))).indices
        at = places[best].double()
        step = torch.full((len(best), 1), 1e-3, dtype=torch.float64)
        values, slopes = self._slopes(at)
        for _ in range(STEPS):
            scale = linalg.vector_norm(slopes, dim=1, keepdim=True).clamp_min(1e-300)
            tried = self.space.retracted(at + step * slopes / scale)
            new, tilts = self._slopes(tried)
            better = (new > values)[:, None]
            at = torch.where(better, tried, at)
            slopes = torch.where(better, tilts, slopes)
            values = torch.where(better[:, 0], new, values)
            step = torch.where(better, 1.6 * step, 0.4 * step)
            if float(step.max()) < 1e-10:
                break
        return self.space.project(at[values.argmax()][None])[0]

    def _slopes(self, points: Tensor) -> tuple[Tensor, Tensor]:
        with torch.enable_grad():
            at = points.detach().clone().requires_grad_()
            values = self.log_prob(at, measure="natural")
            (slopes,) = torch.autograd.grad(values.sum(), at)
        return values.detach(), slopes.nan_to_num()

    @torch.no_grad()
    def cdf(self, value: Tensor) -> Tensor:
        """Return the mass (...,) from the start of the only column up to points (..., 1) of the chart.

        A circle is cut opposite its mean direction (`mean`); a real column begins at minus infinity.
        The error is below 1e-7, unless bumps are narrower than 1e-4 turns.

        Raises `OrbiflowError` if there are several columns: take a marginal density.
        """
        points, cumulative = self._only(value), self.cumulative()
        return cumulative.masses((points[..., 0].double() - cumulative.start) % 1)

    @torch.no_grad()
    def icdf(self, value: Tensor) -> Tensor:
        """Return the chart points (..., 1) up to which there are these masses (...,), from 0 to 1.

        Errors and refusals are those of `cdf`.
        """
        masses = as_tensor(value, "masses").double()
        if not bool(((masses >= 0) & (masses <= 1)).all()):
            raise OrbiflowError("masses are from 0 to 1")
        cells = self.cumulative()
        high_end = torch.searchsorted(cells.below, masses.contiguous()).clamp(
            1, len(cells.ends) - 1
        )
        low, high = cells.ends[high_end - 1].clone(), cells.ends[high_end].clone()
        for _ in range(40):
            middle = (low + high) / 2
            less = cells.masses(middle) < masses
            low, high = torch.where(less, middle, low), torch.where(less, high, middle)
        return (((low + high) / 2 + cells.start) % 1)[..., None]

    def _only(self, value: Any) -> Tensor:
        points = as_tensor(value, "points")
        if not self.space.is_torus or self.space.dim != 1:
            raise OrbiflowError(
                "cumulative masses are of one column: take its marginal density first"
                if self.space.is_torus
                else f"points of the {self.space.name} have no order to accumulate masses in"
            )
        if not points.dim() or points.shape[-1] != 1:
            raise OrbiflowError(f"expected points (..., 1), got {tuple(points.shape)}")
        return points

    @torch.no_grad()
    def cumulative(self) -> Cumulative:
        """Return the masses of the only column from its start on, by which `cdf` and `icdf` are found.

        Refusals are those of `cdf`.
        """
        self._only(torch.zeros(1))
        start = 0.0
        if not self.space.axes[0].is_real:
            mean, resultant = _direction(*self._masses(0))
            # no direction is opposite to a mean that there is not
            start = 0.5 if resultant < LEAST_RESULTANT else (float(mean) + 0.5) % 1
        _, masses = self._masses(0, start)
        sums = masses.reshape(-1, len(NODES)).sum(dim=1).cumsum(0) / masses.sum()
        ends = torch.linspace(0, 1, len(sums) + 1, dtype=torch.float64)
        return Cumulative(self.log_prob, start, ends, torch.cat([sums.new_zeros(1), sums]))

    def entropy(
        self, count: int = DRAWS, *, measure: str = CHART, generator: torch.Generator | None = None
    ) -> Tensor:
        """Return -E[log p] in nats, as `estimated_entropy` does, without its error."""
        estimate = self.estimated_entropy(count, measure=measure, generator=generator)
        return torch.tensor(estimate.value, dtype=torch.float64)

    @torch.no_grad()
    def estimated_entropy(
        self, count: int = DRAWS, *, measure: str = CHART, generator: torch.Generator | None = None
    ) -> Estimate:
        """Return an estimate of -E[log p] from `count` draws, always the same ones without a generator.

        It is with respect to `measure`, by default that of `log_prob`; "natural" gives the entropy in
        the user's units or per steradian.
        """
        draws = self._draws(as_whole(count, "count", 2), generator)
        return _estimate(-self.log_prob(draws, measure=measure))

    @torch.no_grad()
    def divergence(
        self, other: WithFigures, count: int = DRAWS, *, generator: torch.Generator | None = None
    ) -> Estimate:
        """Return an estimate of the Kullback-Leibler divergence E[log p - log q], of q from this one.

        `torch.distributions.kl_divergence` gives its value.

        Raises `OrbiflowError` if both are not on the same space. A real column of both may have its own
        centre and scale.
        """
        here, there = self.space, other.space
        if here != there and not _same_columns(here, there):
            raise OrbiflowError(f"densities on {here} and {there} cannot be compared")
        draws = self._draws(as_whole(count, "count", 2), generator)
        at = draws if here == there else there.to_chart(here.from_chart(draws))
        logs, others = (
            density.log_prob(x, measure="natural") for density, x in ((self, draws), (other, at))
        )
        return _estimate(logs - others)


def _same_columns(one: Space, other: Space) -> bool:
    """Return whether both are tori whose angles have one unit, and whose other circles one period."""
    periods = [[axis.period for axis in space.axes] for space in (one, other)]
    return bool(one.axes) and one.unit == other.unit and periods[0] == periods[1]


def _nodes(cells: int) -> tuple[Tensor, Tensor]:
    """Return turns (3 n,) in [0, 1] and their weights, for integrals over so many cells."""
    places = torch.tensor([node for node, _ in NODES], dtype=torch.float64)
    weights = torch.tensor([weight for _, weight in NODES], dtype=torch.float64)
    middles = (torch.arange(cells, dtype=torch.float64) + 0.5) / cells
    turns = (middles[:, None] + places / (2 * cells)).flatten()
    return turns, weights.repeat(cells) / (2 * cells)


def _direction(turns: Tensor, masses: Tensor) -> tuple[Tensor, float]:
    """Return the mean direction, in turns, of masses (N,) at turns (N,), and its resultant length."""
    angle = 2 * math.pi * turns
    east, north = masses @ angle.cos(), masses @ angle.sin()
    return torch.atan2(north, east) / (2 * math.pi) % 1, float(torch.hypot(east, north))


def _estimate(values: Tensor) -> Estimate:
    return Estimate(float(values.mean()), float(values.std()) / math.sqrt(len(values)))


def _divergence(one: WithFigures, other: WithFigures) -> Tensor:
    return torch.tensor(one.divergence(other).value, dtype=torch.float64)


cast(Any, kl).register_kl(WithFigures, WithFigures)(_divergence)
