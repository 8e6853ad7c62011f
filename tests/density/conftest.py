"""Fixtures of tests that fit densities."""

from __future__ import annotations

import pytest

from density.quick_fits import quick_search


@pytest.fixture(name="quick_fits")
def quick_fits_fixture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fits within the test try less."""
    quick_search(monkeypatch)
