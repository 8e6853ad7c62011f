"""Bounds of Omega, the largest frequency of a tile's fields."""

from __future__ import annotations

from orbiflow.arguments import whole
from orbiflow.errors import OrbiflowError

MAX_FREQUENCY = 60
"""Largest Omega that a fit takes on; time and memory grow with its square."""


def check_max_frequency(value: int, *, least: int) -> None:
    """Do nothing for an Omega from `least` to `MAX_FREQUENCY`.

    Raises:
        OrbiflowError: for any other.
    """
    if not least <= whole(value, "max_frequency", least) <= MAX_FREQUENCY:
        raise OrbiflowError(
            f"max_frequency must be from {least} to {MAX_FREQUENCY}, got {value}: "
            "10 is plenty for most silhouettes"
        )
