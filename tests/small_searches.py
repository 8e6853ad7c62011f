"""Searches at the effort "fast" made smaller still, for tests of what a search is embedded in."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from orbiflow.tiles import LikenessSearch
from orbiflow.tiles.search.likeness_search import SKETCH

FEW: dict[str, Any] = {
    "phases": 1, "placements": 10, "held": 3, "starts": 2, "finalists": 1, "rounds": 2, "carved": 0,
    "bodies": ("firm",), "multiples": (2,),
}  # fmt: skip


@contextmanager
def small_searches() -> Iterator[None]:
    """Search for likeness at the effort "fast" from few places, in this process and its forks.

    What is found is drawn roughly.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(LikenessSearch.efforts, "fast", FEW)  # pyright: ignore[reportArgumentType]
        for name, value in {"placements": 10, "held": 3, "finalists": 1, "rounds": 2}.items():
            patch.setitem(SKETCH, name, value)
        for module in ("drawing.raster", "tiles.write.painting"):
            patch.setattr(f"orbiflow.{module}.FINER", 1)
        yield


@pytest.fixture(name="small_searches")
def small_searches_fixture() -> Iterator[None]:
    with small_searches():
        yield
