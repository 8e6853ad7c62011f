"""Regions where a density is highest: their thresholds, sizes and masses."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.comparing import density_of, scores_of
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models import AdaptiveKernels, Density, UniformDensity
from orbiflow.density.regions.settings import MAX_SAMPLES, MIN_SAMPLES, SAMPLES, samples_for
from orbiflow.density.spaces import whole_turn
from orbiflow.errors import SettingError
from orbiflow.runtime import Answer, one_thread
from orbiflow.settings import as_number, as_whole

SAMPLES_PER_EVEN_POINT = 4
"""Ratio of samples to points drawn evenly, which tell the sizes of regions of hardly any mass, too."""

KERNELS = 20_000
"""Number of samples of a density about which kernels stand that smooth it."""

MAX_CONCENTRATION = 1e7
"""Concentration of the narrowest of these kernels."""

SIGMAS_95 = 1.96
"""Standard errors on either side in an interval of 95 %."""


@dataclass(frozen=True, eq=False)
class DensityRegion(Answer):
    """A region in which a density is at least `exp(log_prob)`, in natural measure.

    - `mass`: The mass that was asked for, None for a region above a level.
    - `held`, `error`: The mass that the region holds, from samples, and its standard error. If a mass
      was asked for, the threshold is uncertain by so much.
    - `log_prob`: The threshold in nats. `log_prob_low`, `log_prob_high`: Its interval of 95 %.
    - `size`, `size_error`: The size in natural measure (steradians, or the product of the columns'
      units), from samples, and its standard error.
    - `smooth`: The width of the smoothing. Then `density` and `log_prob` are of the smoothed density,
      and `held` is the mass of the density itself.
    """

    kind = "region"

    density: Density = field(repr=False)
    mass: float | None
    held: float
    error: float
    log_prob: float
    log_prob_low: float
    log_prob_high: float
    size: float
    size_error: float
    smooth: float | None = None

    @property
    def fraction(self) -> float | None:
        """The share of the space's natural measure, None where columns are real."""
        volume = self.density.space.volume
        return self.size / volume if math.isfinite(volume) else None

    def contains(self, data: ArrayLike) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Return whether data (N, k), in the space's own units, lie inside: (N,)."""
        return scores_of(self.density, data) >= self.log_prob


class DensityLevels:
    """Samples of a density with their log densities, from which all its regions are read off.

    Args:
        density: A density or a fitted estimator.
        samples: Number of samples, 1000 to 10 million; `samples_for` says how many masses need.
        seed: Seed of the samples.
        smooth: Standard deviation of kernels with which the density is smoothed, in the data's unit of
            angles, or degrees of arc. Regions are then those of the smoothed density, which hold the
            masses of the density itself.
    """

    @one_thread()
    @torch.no_grad()
    def __init__(
        self,
        density: Density | DensityEstimator,
        *,
        samples: int = SAMPLES,
        seed: int = 0,
        smooth: float | None = None,
    ) -> None:
        self.density, self.smooth = density_of(density), smooth
        count = as_whole(samples, "samples", MIN_SAMPLES, MAX_SAMPLES)
        generator = torch.Generator().manual_seed(as_whole(seed, "seed", 0, 2**63 - 1))
        self.points: Tensor = self.density.sample((count,), generator).double()
        evenly = max(MIN_SAMPLES, count // SAMPLES_PER_EVEN_POINT)
        even = self.density.space.uniform(evenly, generator)
        self.surface = self.density
        if smooth is not None:
            self.surface = smoothed(self.density, smooth, generator)
        self.log_probs, self._even = (self._logs(points) for points in (self.points, even))
        drawn, self._of_surface = self.points, self.log_probs
        if smooth is not None:
            drawn = self.surface.sample((count,), generator).double()
            self._of_surface = self._logs(drawn)
        spread = UniformDensity(self.density.space)  # that of the even points
        self._floors = [
            spread.log_prob(points, measure="natural").numpy() + math.log(evenly)
            for points in (drawn, even)
        ]
        self._sorted = np.sort(self.log_probs)

    def _logs(self, points: Tensor) -> Array:
        return self.surface.log_prob(points, measure="natural").numpy()

    def highest(self, mass: float) -> DensityRegion:
        """Return the smallest region that holds a mass between 0 and 1, as these samples tell."""
        samples_for([mass], len(self._sorted))
        return self._region(self._threshold(float(mass)), float(mass))

    def above(self, log_prob: float) -> DensityRegion:
        """Return the region where the log density is at least `log_prob`, in natural measure."""
        return self._region(as_number(log_prob, "level"), None)

    def hdr(self, data: ArrayLike) -> Array:
        """Return the mass (N,) of the smallest region that holds each row of data (N, k).

        It is 0 at the peak and 1 where the density is lowest, and uniform for rows drawn from the
        density. The standard error is that of a share of the samples.
        """
        return self.hdr_of(scores_of(self.density, data))

    def hdr_of(self, log_probs: Array) -> Array:
        """Return `hdr` of log densities in natural measure."""
        return 1 - np.searchsorted(self._sorted, log_probs, side="right") / len(self._sorted)

    def _threshold(self, mass: float) -> float:
        count = len(self._sorted)
        return float(self._sorted[count - min(count, max(1, math.ceil(mass * count - 1e-9)))])

    def _region(self, level: float, mass: float | None) -> DensityRegion:
        inside = self.log_probs >= level
        held, count = float(inside.mean()), len(inside)
        # if it is none or all, one more sample might have said otherwise
        error = math.sqrt(max(held * (1 - held), 1 / count) / count)
        spread = 0.0 if mass is None else SIGMAS_95 * math.sqrt(mass * (1 - mass) / count)
        low = high = level
        if mass is not None:
            low, high = (self._threshold(min(1.0, max(0.0, mass + s))) for s in (spread, -spread))
        size = self._size(level)
        return DensityRegion(self.surface, mass, held, error, level, low, high, *size, self.smooth)

    def _size(self, level: float) -> tuple[float, float]:
        """Return the natural measure above a level, and its standard error.

        Samples and even points are weighted by the mixture that they are drawn from (balance
        heuristic: Veach and Guibas, Optimally combining sampling techniques, 1995).
        """
        size, variance = 0.0, 0.0
        for logs, floor in zip((self._of_surface, self._even), self._floors, strict=True):
            weights = np.exp(-np.logaddexp(logs + math.log(len(self.log_probs)), floor))
            shares = np.where(logs >= level, weights, 0.0)
            size += float(shares.sum())
            variance += float(shares.var()) * len(shares)
        return min(size, self.density.space.volume), math.sqrt(variance)


def smoothed(density: Density, width: float, generator: torch.Generator) -> AdaptiveKernels:
    """Return a density smoothed by kernels: of one width, about samples of it.

    Args:
        density: A density.
        width: Standard deviation of the kernels, in the data's unit of angles, or degrees of arc.
        generator: Source of the samples.
    """
    space = density.space
    if not space.is_round and (
        space.unit in (None, "units") or any(not axis.is_angle for axis in space.axes)
    ):
        raise SettingError(f"{{smooth}} is for angles and directions, not for the {space.name}")
    turn = 360.0 if space.is_round else whole_turn(str(space.unit))
    least = turn / (2 * math.pi) * MAX_CONCENTRATION**-0.5
    if not width >= least:
        raise SettingError(f"{{smooth}} must be at least {least:.2g}, got {width:g}")
    kappa = (2 * math.pi * width / turn) ** -2
    centers = density.sample((KERNELS,), generator).double()
    like = centers.new_ones(KERNELS, 1 if space.is_round else space.dim)
    return AdaptiveKernels(space, centers, kappa * like, like[:, 0] / KERNELS)


def highest_density_region(
    density: Density | DensityEstimator,
    mass: float = 0.9,
    *,
    samples: int | None = None,
    seed: int = 0,
) -> DensityRegion:
    """Return the smallest region that holds a mass.

    Its threshold is a quantile of the log density at samples of the density itself, in any dimension
    (Hyndman, Computing and graphing highest density regions, 1996).

    Args:
        density: A density or a fitted estimator.
        mass: The mass, between 0 and 1.
        samples: Number of samples. Default: as many as the mass needs, see `samples_for`.
        seed: Seed of the samples.

    >>> rng = np.random.default_rng(0)
    >>> angles = rng.vonmises([0.0, 1.0], 4.0, (200, 2))
    >>> fitted = DensityEstimator("torus", components="kernels").fit(angles)
    >>> region = highest_density_region(fitted, 0.5)
    >>> region.contains([[0.0, 1.0], [3.0, -2.0]]).tolist()
    [True, False]
    """
    count = samples_for([mass], samples)
    return DensityLevels(density, samples=count, seed=seed).highest(mass)
