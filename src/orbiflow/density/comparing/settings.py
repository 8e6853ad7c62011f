"""Settings of comparisons."""

from __future__ import annotations

from typing import Annotated, Literal

from orbiflow.settings import DefaultText, Parsed, Range, Settings

TestName = Literal[
    "watson-williams", "common-mean", "common-median", "common-concentration",
    "mardia-watson-wheeler", "watson-u2", "kuiper", "bingham", "energy", "all",
]  # fmt: skip


def test_names(text: str) -> tuple[str, ...]:
    """Return the tests that a text names, such as "watson-williams,energy"."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


test_names.__test__ = False  # pyright: ignore[reportFunctionMemberAccess]


class ComparisonSettings(Settings, group="Uncertainty"):
    """How uncertain a comparison is, and how that is found out."""

    bootstrap: Annotated[int, Range(100, 1_000_000)] = 2000
    """Number of bootstrap resamples of rows or groups."""

    permutations: Annotated[int, Range(19, 100_000)] = 999
    """Number of permutations in tests of data sets; the least p is 1 / (permutations + 1)."""

    tests: Annotated[
        tuple[TestName, ...] | None,
        Parsed(test_names, "names such as watson-williams,energy, or all"),
        DefaultText("all of three data sets or more, none of two"),
    ] = None
    """Tests by name of two data sets or more, such as watson-williams,energy, or all that there are on
    the space. They take the place of the general comparison of two data sets."""

    divergence: bool = False
    """Also measure how far apart two data sets are, by fits to half of each: some 20 s."""

    level: Annotated[float, Range(0.5, 0.999)] = 0.95
    """Level of the intervals and of the test."""

    seed: Annotated[int, Range(0, 2**63 - 1)] = 0
    """Seed of all that is drawn: the same seed gives the same result."""
