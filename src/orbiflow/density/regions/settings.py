"""Settings of regions, and how many samples of a density tell their masses."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

from orbiflow.errors import SettingError
from orbiflow.settings import DefaultText, Range, Settings, as_number, as_whole, placeholder

SAMPLES = 20_000
"""Default number of samples: the mass of a region of half of it is right within 0.35 %."""

MIN_SAMPLES, MAX_SAMPLES = 1000, 10_000_000

MAX_DEFAULT_SAMPLES = 1_000_000
"""Samples drawn by default at most: seconds, or a minute for many thousands of kernels."""

MIN_EXPECTED = 10
"""Samples expected inside a region and outside of it at least, so that the interval of its threshold
has two ends."""

GOOD_EXPECTED = 100
"""Samples expected there by default, so that the lesser mass is right within a tenth."""

MAX_REGIONS = 50

DefaultSamples = DefaultText("20000, or more if a mass needs it")
SampleCount = Annotated[int | None, Range(MIN_SAMPLES, MAX_SAMPLES), DefaultSamples]
"""A number of samples from which masses are told."""

Mass = Annotated[float, Range(above=0, below=1)]
"""A share of a density's mass."""


class RegionSettings(Settings, group="Regions"):
    """Which regions of a density are found, and how exactly.

    >>> RegionSettings().masses, RegionSettings(level=(-9,)).masses
    ((0.5, 0.9), ())
    """

    mass: Annotated[tuple[Mass, ...] | None, DefaultText("0.5,0.9, without levels")] = None
    """Masses of the smallest regions that hold them, such as 0.5,0.9."""

    level: tuple[float, ...] | None = None
    """Log densities in natural measure, as `score` gives them, above which regions lie."""

    smooth: Annotated[float | None, Range(above=0), DefaultText("not smoothed")] = None
    """Standard deviation of kernels that smooth the density, in the unit of its angles, or degrees of
    arc. The regions are smoother, and hold the same masses."""

    min_mass: Annotated[Mass | None, DefaultText("all are drawn")] = None
    """Least mass of an island that is drawn, in two dimensions. What is left is measured again."""

    samples: SampleCount = None
    """Number of samples from which the masses are told. 20000 tell a half within 0.35 %, and masses up
    to 0.9995."""

    budget: Annotated[int, Range(1, 10**9)] = 300_000
    """Number of evaluations after which outlines get no finer."""

    seed: Annotated[int, Range(0, 2**63 - 2)] = 0
    """Seed of the samples: the same seed gives the same result."""

    def check(self) -> None:
        if len(self.mass or ()) + len(self.level or ()) > MAX_REGIONS:
            raise SettingError(
                f"there are more than {MAX_REGIONS} regions: give fewer {{mass}} and {{level}}"
            )
        samples_for(self.masses, self.samples)

    @property
    def masses(self) -> tuple[float, ...]:
        """The masses of regions, those of the default included."""
        if self.mass is None and self.level is None:
            return (0.5, 0.9)
        return self.mass or ()


def samples_for(
    masses: Iterable[float], samples: int | None = None, *, name: str = "samples"
) -> int:
    """Return the number of samples for regions of these masses.

    It is the one that was asked for, or else 20,000 or as many as the masses need up to a million.
    Messages call it `name`.

    >>> samples_for([0.5, 0.9]), samples_for([0.5, 0.9995])
    (20000, 200000)
    """
    shares = [as_number(mass, "mass", above=0, below=1) for mass in masses]
    rarest = min((min(share, 1 - share) for share in shares), default=0.5)
    if samples is None:
        count = min(max(SAMPLES, _count(GOOD_EXPECTED, rarest)), MAX_DEFAULT_SAMPLES)
    else:
        count = as_whole(samples, name, MIN_SAMPLES, MAX_SAMPLES)
    for share in shares:
        needed = _count(MIN_EXPECTED, min(share, 1 - share))
        if needed > MAX_SAMPLES:
            end = MIN_EXPECTED / MAX_SAMPLES
            raise SettingError(
                f"a mass of {share:.10g} is too near to {round(share)}: take one from {end:g} to "
                f"{1 - end:.10g}"
            )
        if needed > count:
            raise SettingError(
                f"a mass of {share:.10g} cannot be told from {round(share)} with {count} samples: "
                f"{placeholder(name)} must be at least {needed}"
            )
    return count


def resolvable_masses(samples: int) -> tuple[float, float]:
    """Return the smallest and the largest mass that so many samples tell.

    >>> resolvable_masses(20_000)
    (0.0005, 0.9995)
    """
    return MIN_EXPECTED / samples, 1 - MIN_EXPECTED / samples


def _count(expected: int, share: float) -> int:
    """Return the number of samples of which so many are expected in a share."""
    return math.ceil(expected / share * (1 - 1e-9))  # 1 - 0.9995 is not 0.0005 to the last digit
