"""Fits that try less, for tests of what is done with a fit and not of what a fit finds."""

from __future__ import annotations

import pytest

FITTING = "orbiflow.density.fitting"


def quick_fits(patch: pytest.MonkeyPatch) -> None:
    """Try fewer widths and sizes of components, and hold out two of the ten parts of the rows."""
    patch.setattr(f"{FITTING}.kernels.LADDER_RUNGS", 9)
    patch.setattr(f"{FITTING}.kernels.SCALES", (0.4, 1.6))
    patch.setattr(f"{FITTING}.families.SIZES", (1, 4, 16))
    patch.setattr(f"{FITTING}.folds.USED", ())
