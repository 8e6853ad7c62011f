"""Searches for two figures made small, and the pair that one finds."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import pytest

from orbiflow.tiles import EscherizeSettings, SearchResult, escherize
from orbiflow.tiles.search import pair_search
from orbiflow.tiles.search.pair_search import LOOK, PairSearch
from outlines import animal

NAMES = "squirrel.dat", "nagata/dolphin_60.dat"
FEW: dict[str, Any] = {
    "ratios": 1, "points": 40, "glues": 10, "placed": 40, "held": 4, "starts": 2, "carved": 1,
    "ranked": 1, "finalists": 1,
}  # fmt: skip
STEPS = {"FIRST_STEPS": 6, "LAST_STEPS": 6}


@contextmanager
def small_pairs() -> Iterator[None]:
    """Search for pairs at the effort "fast" in this process and its forks, in few steps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PairSearch.efforts, "fast", FEW)  # pyright: ignore[reportArgumentType]
        for name in ("glues", "placed", "held", "starts", "carved"):
            patch.setitem(LOOK, name, FEW[name])
        for name, count in STEPS.items():
            patch.setattr(pair_search, name, count)
        yield


@cache
def pair_result() -> SearchResult:
    """What a small search finds for two animals."""
    one, two = map(animal, NAMES)
    with small_pairs():
        return escherize(one, EscherizeSettings(effort="fast"), second=two)
