"""A first certified tile, within a second: the nearest tile to the outline, not yet descended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch

from orbiflow.cancel import Cancel
from orbiflow.errors import CertificationError
from orbiflow.escher.bending_settings import BendingSettings
from orbiflow.escher.fit import Fit
from orbiflow.escher.fit_bending import fit_bending
from orbiflow.escher.methods import shared_hands
from orbiflow.escher.model import TileModel
from orbiflow.escher.outline_starts import outline_starts
from orbiflow.escher.result import TileResult, best_tiles
from orbiflow.silhouette.emphasis import Emphasis
from orbiflow.silhouette.pins import Pins
from orbiflow.silhouette.target import Target
from orbiflow.tilings import isohedral_class

PREFERRED = ("IH6", "IH5", "IH4", "IH2", "IH3", "IH7", "IH21", "IH28", "IH1")
"""The classes by how often they come near a silhouette at once, for the time that they take."""

POINTS = 60


SKETCH = {
    "placements": 60,
    "held": 6,
    "starts": 1,
    "share": 0.1,
    "finalists": 1,
    "rounds": 10,
    "below": 0,
}
"""Settings of a first look for likeness."""


def quick_bent_tile(
    target: Target,
    names: Sequence[str],
    settings: BendingSettings,
    emphasis: Emphasis | None,
    pins: Pins | None = None,
    *,
    cancel: Cancel | None = None,
) -> TileResult | None:
    """The silhouette bent in haste into the first of the preferred classes among `names`, certified.

    None if no such tile is simple.

    Raises:
        Cancelled: if it was told to stop.
    """
    kind = isohedral_class(next(name for name in PREFERRED if name in names))
    both = shared_hands(target, settings, emphasis, pins)
    try:
        found = fit_bending(target, kind, replace(settings, **SKETCH), both, cancel=cancel)
        return best_tiles(target, found._replace(enough=1))[0]
    except CertificationError:
        return None


def quick_tile(
    target: Target, names: Sequence[str], *, cancel: Cancel | None = None
) -> TileResult | None:
    """The nearest tile of the first of the preferred classes among `names`, certified.

    None if no nearest tile is simple.

    Raises:
        Cancelled: if it was told to stop.
    """
    kind = isohedral_class(next(name for name in PREFERRED if name in names))
    found = outline_starts(
        target, kind, count=3, resolutions=(POINTS,), measured=40, vertices=POINTS, cancel=cancel
    )
    if not len(found.prototiles):
        return None
    model = TileModel(
        kind, max_frequency=1, steps=1, dtype=torch.float64, prototiles=found.prototiles
    )
    try:
        return best_tiles(target, Fit(model, len(found.prototiles), 0, 1))[0]
    except CertificationError:
        return None
