"""Pieces are nested in haste: less dense, but no nearer to each other."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from orbiflow.tiles.make import nesting


@contextmanager
def hasty_nesting() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name, few in {"TRIALS": 60, "ANGLES": 12, "PAIRS": 6, "DIRECTIONS": 15}.items():
            patch.setattr(nesting, name, few)
        yield


@pytest.fixture(autouse=True, scope="module")
def _hasty_nesting() -> Iterator[None]:
    with hasty_nesting():
        yield
