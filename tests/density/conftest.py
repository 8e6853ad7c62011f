"""Fits of all tests of densities try less, but for those that ask for `whole_fits`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from density.quick_fits import quick_fits


@pytest.fixture(name="_quick_fits", scope="module", autouse=True)
def quick_fits_fixture() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as patch:
        quick_fits(patch)
        yield patch


@pytest.fixture(name="whole_fits")
def whole_fits_fixture(_quick_fits: pytest.MonkeyPatch) -> Iterator[None]:
    """Fits within the test try all that they do for users."""
    _quick_fits.undo()
    yield
    quick_fits(_quick_fits)
