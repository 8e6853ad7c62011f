"""Searches that try less, for tests of what is done with a fit and not of what a fit finds."""

from __future__ import annotations

import pytest


def few_kernels(patch: pytest.MonkeyPatch) -> None:
    """Try fewer widths of kernels."""
    patch.setattr("orbiflow.density.fitting.kernels.LADDER_RUNGS", 9)
    patch.setattr("orbiflow.density.fitting.kernels.SCALES", (0.4, 1.6))


def quick_search(patch: pytest.MonkeyPatch) -> None:
    """Try fewer widths of kernels, and hold out two of the ten parts of the rows."""
    few_kernels(patch)
    patch.setattr("orbiflow.density.fitting.folds.USED", ())
