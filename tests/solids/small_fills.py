"""Searches for solids that fill space, made small, and what one finds."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbiflow.drawing import write_stl
from orbiflow.runtime import Event
from orbiflow.solids import EscherSolid, FillSettings, fill, likeness, run_folder, search, solid_gif
from orbiflow.solids.bodies import as_body
from orbiflow.solids.closing import Function, ball_of_cells
from orbiflow.symmetry import CrystallographicGroup
from solids.known_solids import creature

CELLS = 400  # settings ask for 5000 at least
SMALL = FillSettings(effort="fast", groups=("P-1", "P21"), detail=5000, workers=1, size=60)


def _few_cells(depth: Function, bounds: Any, group: CrystallographicGroup, _detail: int) -> Any:
    return ball_of_cells(depth, bounds, group, CELLS)


@contextmanager
def small_fills() -> Iterator[None]:
    """Search for solids from few poses and coarse bodies."""
    with pytest.MonkeyPatch.context() as patch:
        few = search.Effort(
            groups=2, tried=30, climbed=2, steps=12, per_group=1, polishing=4, quick=2, full=2,
            closed=2, rough=0.25, fine=0.2, grain=0.1, stages=((1.0, 1), (8.0, 2)),
        )  # fmt: skip
        patch.setitem(search.EFFORTS, "fast", few)
        patch.setattr(search, "FINE", 0.06)
        patch.setattr(search, "PROBES", 500)
        patch.setattr(likeness, "GRAIN", 0.06)
        patch.setattr(search, "ball_of_cells", _few_cells)
        patch.setattr(run_folder, "SHEET_WIDTH", 320)
        patch.setattr(run_folder, "solid_gif", lambda own, **_: solid_gif(own, size=80, frames=2))
        yield


@cache
def _found() -> tuple[tuple[EscherSolid, ...], tuple[Event, ...]]:
    events = list[Event]()
    with small_fills():
        solids = fill(creature(), SMALL, name="creature", on_event=events.append)
    return tuple(solids), tuple(events)


def found() -> tuple[EscherSolid, ...]:
    """What a small search finds for the creature."""
    return _found()[0]


def told() -> tuple[Event, ...]:
    """What that search tells."""
    return _found()[1]


def creature_file(folder: Path) -> Path:
    """Write the creature, 40 mm long, into a folder."""
    path = folder / "creature.stl"
    side = 40 / float(np.ptp(creature().points, axis=0).max())
    path.write_bytes(write_stl({"creature": as_body(creature().moved(side * np.eye(3)))}))
    return path
