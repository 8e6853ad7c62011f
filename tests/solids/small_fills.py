"""Searches for solids that fill space, made small, and what one finds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from orbiflow.drawing import write_stl
from orbiflow.solids import EscherSolid, FillSettings, fill, search
from orbiflow.solids.bodies import as_body
from solids.known_bodies import creature

SMALL = FillSettings(effort="fast", groups=("P-1", "P21"), detail=6000, workers=1, size=60)


@contextmanager
def small_fills() -> Iterator[None]:
    """Search for solids from few poses and coarse bodies, in this process and its forks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(search.EFFORTS, "fast", search.Effort(2, 100, 2, 30, 1, 2, 2))
        patch.setattr(search, "FINE_SPACING", 0.12)
        patch.setattr(search, "ROUGH_SPACING", 0.15)
        yield


@cache
def found() -> tuple[EscherSolid, ...]:
    """What a small search finds for the creature."""
    with small_fills():
        return tuple(fill(creature(), SMALL, name="creature"))


def creature_file(folder: Path) -> Path:
    """Write the creature, 40 mm long, into a folder."""
    path = folder / "creature.stl"
    side = 40 / float(np.ptp(creature().points, axis=0).max())
    path.write_bytes(write_stl({"creature": as_body(creature().moved(side * np.eye(3)))}))
    return path
