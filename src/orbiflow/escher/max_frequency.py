"""Bounds of Omega, the largest frequency of a tile's fields."""

from __future__ import annotations

from orbiflow.arguments import whole
from orbiflow.errors import OrbiflowError

MAX_FREQUENCY = 60
"""Largest Omega that a fit takes on; time and memory grow with its square."""


def check_max_frequency(value: int) -> None:
    """Do nothing for an Omega from 0, constant fields (paper, figure of Omega), to `MAX_FREQUENCY`.

    Raises:
        OrbiflowError: for any other.
    """
    if not 0 <= whole(value, "max_frequency", 0) <= MAX_FREQUENCY:
        raise OrbiflowError(
            f"max_frequency must be from 0 to {MAX_FREQUENCY}, got {value}: "
            "10 is plenty for most silhouettes"
        )
