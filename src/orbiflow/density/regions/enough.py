"""How many samples of a density tell the region of a mass."""

from __future__ import annotations

import math
from collections.abc import Iterable

from orbiflow.arguments import number, whole
from orbiflow.errors import OrbiflowError

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
