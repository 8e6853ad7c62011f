"""Settings of comparisons."""

from __future__ import annotations

from typing import Annotated, Literal

from orbiflow.settings import DefaultText, Parsed, Range, Settings

TestName = Literal[
    "watson-williams", "common-mean", "common-median", "common-concentration",
    "mardia-watson-wheeler", "watson-u2", "kuiper", "bingham", "energy",
]  # fmt: skip


def names_of_tests(text: str) -> tuple[str, ...]:
    """Return the tests that a text names, such as "watson-williams,energy"."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


Permutations = Annotated[int, Range(19, 100_000)]


class ComparisonSettings(Settings, group="Uncertainty"):
    """How uncertain a comparison is, and how that is found out."""

    bootstrap: Annotated[int, Range(100, 1_000_000)] = 2000
    """Number of bootstrap resamples of rows or groups."""

    level: Annotated[float, Range(0.5, 0.999)] = 0.95
    """Level of the intervals and of the test."""

    seed: Annotated[int, Range(0, 2**63 - 1)] = 0
    """Seed of all that is drawn: the same seed gives the same result."""


class DataComparisonSettings(ComparisonSettings, group="Uncertainty"):
    """How two data sets are compared, and how uncertain that is."""

    permutations: Permutations = 999
    """Number of permutations in the test; the least p is 1 / (permutations + 1)."""

    divergence: bool = False
    """Also measure how far apart the data sets are, by fits to half of each: some 20 s."""


class NamedTestSettings(Settings, group="Tests"):
    """Which tests are made, and from how many permutations."""

    tests: Annotated[
        tuple[TestName, ...] | None,
        Parsed(names_of_tests, "names such as watson-williams,energy"),
        DefaultText("all that there are on the space"),
    ] = None
    """Tests by name, such as watson-williams,energy."""

    permutations: Permutations = 999
    """Number of permutations; the least p is 1 / (permutations + 1)."""

    seed: Annotated[int, Range(0, 2**63 - 1)] = 0
    """Seed of all that is drawn: the same seed gives the same result."""
