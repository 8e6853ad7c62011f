"""Fits that try less, for tests of what is done with a fit and not of what a fit finds."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from orbiflow.density.pictures import coastlines
from orbiflow.drawing import Sheet

FITTING = "orbiflow.density.fitting"


def quick_fits(patch: pytest.MonkeyPatch) -> None:
    """Try fewer widths, sizes and steps, hold out two parts of the rows, and draw fewer samples."""
    patch.setattr(f"{FITTING}.kernels.LADDER_RUNGS", 9)
    patch.setattr(f"{FITTING}.kernels.SCALES", (0.4, 1.6))
    for family in ("MixtureFamily", "ProductChainFamily"):
        patch.setattr(f"{FITTING}.families.{family}.tried", (1, 4, 16))
    patch.setattr(f"{FITTING}.families.ChainFamily.tried", (4, 16))
    patch.setattr(f"{FITTING}.held_out.USED", ())
    patch.setattr("orbiflow.density.models.figures.DRAWS", 2**13)
    patch.setattr("orbiflow.density.regions.boundaries.CHECKED", 20_000)


def quick_pictures(patch: pytest.MonkeyPatch) -> None:
    """Draw densities and fields from fewer values and by shorter lines, and few coasts."""
    pictures = "orbiflow.density.pictures"
    patch.setattr(f"{pictures}.square._GRID", 40)
    patch.setattr(f"{pictures}.square._FINE_GRID", 80)
    patch.setattr(f"{pictures}.surfaces._CELLS", 20)
    patch.setattr(f"{pictures}.surfaces._RESOLUTION", 30)
    patch.setattr(f"{pictures}.maps._PIXELS", 2000)
    patch.setattr(f"{pictures}.colours._COARSE", 24)
    patch.setattr("orbiflow.drawing.canvas._SAMPLES", 40)
    patch.setattr("orbiflow.drawing.canvas._STEPS", 4)
    coasts = coastlines.earth()[::8]
    patch.setattr(f"{pictures}.coastlines.earth", lambda: coasts)
    small_sheets(patch)


def small_sheets(patch: pytest.MonkeyPatch) -> None:
    """Draw what is for screens with a fourth of the pixels a side."""
    whole = Sheet.screen
    patch.setattr(Sheet, "screen", lambda width=1600: replace(whole(width), dpi=50))


@pytest.fixture(name="_quick_fits", scope="module", autouse=True)
def quick_fits_fixture() -> Iterator[pytest.MonkeyPatch]:
    """Fits of all tests in the folder try less, but for those that ask for `whole_fits`."""
    with pytest.MonkeyPatch.context() as patch:
        quick_fits(patch)
        yield patch


@pytest.fixture(name="whole_fits")
def whole_fits_fixture(_quick_fits: pytest.MonkeyPatch) -> Iterator[None]:
    """Fits within the test try all that they do for users."""
    _quick_fits.undo()
    yield
    quick_fits(_quick_fits)
