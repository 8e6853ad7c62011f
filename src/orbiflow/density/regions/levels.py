"""Regions where a density is highest: thresholds, sizes, and what is inside."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import number, whole
from orbiflow.arrays import Array
from orbiflow.density.comparing import density_of, scores_of
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models import Density
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread

SAMPLES = 20_000
"""At least, where no number is given: the mass of a region of half of it is right within 0.35 %."""

LEAST_SAMPLES, MOST_SAMPLES = 1000, 10_000_000

MOST_UNASKED = 1_000_000
"""Samples drawn without being asked for: seconds, or a minute for many thousands of kernels."""

LEAST, GOOD = 10, 100
"""Samples expected inside the region or outside of it, where there are fewer: at least, so that the
interval of the threshold has two ends; and where no number is given, so that the lesser mass is right
within a tenth."""


def samples_for(
    masses: Iterable[float], samples: int | None = None, *, name: str = "samples"
) -> int:
    """The number of samples for regions of these masses: what was asked for, or else what suits them.

    Args:
        masses: between 0 and 1.
        samples: that were asked for, 1000 to 10 million; None for `SAMPLES`, or more where a mass needs
            it, `MOST_UNASKED` at most.
        name: of `samples`, for messages.

    Raises:
        OrbiflowError: for a mass out of range, or one that so few samples cannot tell.

    >>> samples_for([0.5, 0.9]), samples_for([0.5, 0.9995])
    (20000, 200000)
    """
    shares = [_share(mass) for mass in masses]
    least = min((min(share, 1 - share) for share in shares), default=0.5)
    if samples is None:
        count = min(max(SAMPLES, _count(GOOD, least)), MOST_UNASKED)
    else:
        count = whole(samples, name, LEAST_SAMPLES, MOST_SAMPLES)
    for share in shares:
        needed = _count(LEAST, min(share, 1 - share))
        if needed > MOST_SAMPLES:
            end = LEAST / MOST_SAMPLES
            raise OrbiflowError(
                f"a mass of {share:.10g} is too near to {round(share)}: take one from {end:g} to "
                f"{1 - end:.10g}"
            )
        if needed > count:
            raise OrbiflowError(
                f"a mass of {share:.10g} cannot be told from {round(share)} with {count} samples: "
                f"{name} must be at least {needed}"
            )
    return count


def told_masses(samples: int) -> tuple[float, float]:
    """The smallest and the largest mass that so many samples tell.

    >>> told_masses(20_000)
    (0.0005, 0.9995)
    """
    return LEAST / samples, 1 - LEAST / samples


def _share(mass: float) -> float:
    share = number(mass, "mass", 0.0, 1.0, above=True)
    if not share < 1:
        raise OrbiflowError("mass must be below 1: the region of all the mass is the whole space")
    return share


def _count(expected: int, share: float) -> int:
    """Samples of which so many are expected in a share; 1 - 0.9995 is not 0.0005 to the last digit."""
    return math.ceil(expected / share * (1 - 1e-9))


EVEN = 4
"""Samples for each point that is drawn evenly, for sizes: of regions of hardly any mass, too."""

SURE = 1.96
"""Standard errors of an interval of 95 %."""


@dataclass(frozen=True, eq=False)
class DensityRegion:
    """Where a density is at least `exp(log_prob)`, in natural measure.

    - `mass`: that was asked for; None for a region above a level.
    - `held`, `error`: the mass that the region holds, by samples, and its standard error: of a region
      of a mass the threshold is off by so much.
    - `log_prob`: the threshold, in nats; `log_prob_low`, `log_prob_high`: its interval of 95 %.
    - `size`, `size_error`: in natural measure (steradians; the product of the angles' units), by
      samples, and its standard error. `fraction`: of the space.

    """

    density: Density
    mass: float | None
    held: float
    error: float
    log_prob: float
    log_prob_low: float
    log_prob_high: float
    size: float
    size_error: float

    @property
    def fraction(self) -> float:
        """Of the space's natural measure."""
        return self.size / self.density.space.volume

    def contains(self, data: ArrayLike) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Whether data (N, k), in the space's own units, lie inside: (N,).

        Raises:
            OrbiflowError: for data that are not of the space.
        """
        return scores_of(self.density, data) >= self.log_prob

    def to_json(self) -> dict[str, Any]:
        """An object for `json.dumps`."""
        names = (
            "mass", "held", "error", "log_prob", "log_prob_low", "log_prob_high", "size",
            "size_error", "fraction",
        )  # fmt: skip
        return {name: getattr(self, name) for name in names}


class DensityLevels:
    """Samples of a density and its logarithm there, from which all its regions are read off.

    Args:
        density: or a fitted estimator.
        samples: that are drawn, 1000 to 10 million; `samples_for` says how many some masses need.
        seed: of them.

    Raises:
        OrbiflowError: for what is no density, or a number out of range.
    """

    @one_thread()
    @torch.no_grad()
    def __init__(
        self,
        density: Density | DensityEstimator,
        *,
        samples: int = SAMPLES,
        seed: int = 0,
    ) -> None:
        self.density = density_of(density)
        count = whole(samples, "samples", LEAST_SAMPLES, MOST_SAMPLES)
        generator = torch.Generator().manual_seed(whole(seed, "seed", 0, 2**63 - 1))
        self.points: Tensor = self.density.sample((count,), generator).double()
        self.log_probs = self.density.log_prob(self.points, measure="natural").numpy()
        self._sorted = np.sort(self.log_probs)
        even = self.density.space.uniform(max(LEAST_SAMPLES, count // EVEN), generator)
        self._even = self.density.log_prob(even, measure="natural").numpy()

    def highest(self, mass: float) -> DensityRegion:
        """The smallest region that holds a mass between 0 and 1.

        Raises:
            OrbiflowError: for a mass out of range, or one that these samples cannot tell.
        """
        samples_for([mass], len(self._sorted))
        return self._region(self._threshold(float(mass)), float(mass))

    def above(self, log_prob: float) -> DensityRegion:
        """Where the log density is at least `log_prob`, in natural measure."""
        return self._region(number(log_prob, "level"), None)

    def hdr(self, data: ArrayLike) -> Array:
        """Mass (N,) of the smallest highest-density region that holds each row of data (N, k).

        0 at the peak, 1 where the density is lowest; uniform between 0 and 1 for rows of the density
        itself. The standard error is that of a share of the samples.
        """
        return self.hdr_of(scores_of(self.density, data))

    def hdr_of(self, log_probs: Array) -> Array:
        """As `hdr`, of log densities in natural measure."""
        return 1 - np.searchsorted(self._sorted, log_probs, side="right") / len(self._sorted)

    def _threshold(self, mass: float) -> float:
        count = len(self._sorted)
        return float(self._sorted[count - min(count, max(1, math.ceil(mass * count - 1e-9)))])

    def _region(self, level: float, mass: float | None) -> DensityRegion:
        inside = self.log_probs >= level
        held, count = float(inside.mean()), len(inside)
        # of none or all, one more sample might have told otherwise
        error = math.sqrt(max(held * (1 - held), 1 / count) / count)
        spread = 0.0 if mass is None else SURE * math.sqrt(mass * (1 - mass) / count)
        ends = (level, level)
        if mass is not None:
            ends = tuple(self._threshold(min(1.0, max(0.0, mass + s))) for s in (spread, -spread))
        size, size_error = self._size(level)
        return DensityRegion(
            self.density,
            mass,
            held,
            error,
            level,
            ends[0],
            ends[1],
            size,
            size_error,
        )

    def _size(self, level: float) -> tuple[float, float]:
        """Natural measure above a level, and its standard error.

        Both kinds of points count by the mixture that they are drawn from (balance heuristic: Veach and
        Guibas, Optimally combining sampling techniques, 1995).
        """
        volume, kinds = self.density.space.volume, (self.log_probs, self._even)
        floor = math.log(len(self._even)) - math.log(volume)
        size, variance = 0.0, 0.0
        for logs in kinds:
            weights = np.exp(-np.logaddexp(logs + math.log(len(self.log_probs)), floor))
            shares = np.where(logs >= level, weights, 0.0)
            size += float(shares.sum())
            variance += float(shares.var()) * len(shares)
        return min(size, volume), math.sqrt(variance)


def highest_density_region(
    density: Density | DensityEstimator,
    mass: float = 0.9,
    *,
    samples: int | None = None,
    seed: int = 0,
) -> DensityRegion:
    """The smallest region that holds `mass` (Hyndman, Computing and graphing highest density regions,
    1996): a quantile of the log density at samples of the density itself, in any dimension.

    Args:
        samples: that are drawn; None for as many as the mass needs, see `samples_for`.

    Raises:
        OrbiflowError: as `DensityLevels` and `samples_for`.

    >>> rng = np.random.default_rng(0)
    >>> angles = rng.vonmises([0.0, 1.0], 4.0, (200, 2))
    >>> fitted = DensityEstimator("torus", components="kernels").fit(angles)
    >>> region = highest_density_region(fitted, 0.5)
    >>> region.contains([[0.0, 1.0], [3.0, -2.0]]).tolist()
    [True, False]
    """
    count = samples_for([mass], samples)
    return DensityLevels(density, samples=count, seed=seed).highest(mass)
