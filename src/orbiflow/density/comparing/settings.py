"""Settings of comparisons."""

from __future__ import annotations

from typing import Annotated

from orbiflow.settings import Range, Settings


class ComparisonSettings(Settings, group="Uncertainty"):
    """How uncertain a comparison is, and how that is found out."""

    bootstrap: Annotated[int, Range(100, 1_000_000)] = 2000
    """Number of bootstrap resamples of rows or groups."""

    permutations: Annotated[int, Range(19, 100_000)] = 999
    """Number of permutations in the test of two data sets; its least p is 1 / (permutations + 1)."""

    level: Annotated[float, Range(0.5, 0.999)] = 0.95
    """Level of the intervals and of the test."""

    seed: Annotated[int, Range(0, 2**63 - 1)] = 0
    """Seed of all that is drawn: the same seed gives the same result."""
