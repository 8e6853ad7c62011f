"""The search in two steps: fit one class by any method, then certify what it found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch

from orbiflow.arguments import (
    described,
    instance,
    is_a,
)
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import Cancel, one_thread
from orbiflow.tiles.likeness import least_neck
from orbiflow.tiles.search.bending_fit import fit_bending
from orbiflow.tiles.search.fit import Fit, Progress
from orbiflow.tiles.search.methods import (
    OneSettings,
    fit,
    shared_hands,
)
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.search.result import best_tiles
from orbiflow.tiles.search.settings import BendingSettings
from orbiflow.tiles.search.starts import outline_starts
from orbiflow.tiles.silhouette import (
    Emphasis,
    Pins,
    Target,
)
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class

_HOW = "Target.read, Target.from_mask and Target.from_polygon make one"


def fit_tile(
    target: Target,
    kind: IsohedralClass | str | int,
    settings: OneSettings | None = None,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Fit tiles of one class to a target, in this process; `certified_tiles` makes polygons of them.

    `escherize` does both, for several classes. This is for those who look at, or go on with, what was
    fitted: `Fit.model` is a `TileModel`, a torch module whose candidates may be trained on.

    Args:
        target: the silhouette.
        kind: the class, or its name.
        settings: of the method, as for `escherize`; default `BendingSettings`.
        emphasis: what must survive; the occupancy method takes no notice.
        pins: what must not bend, in the search for likeness.
        per_class: certified tiles that are wanted.
        progress: told the share of the work done, and the loss.
        cancel: looked at before each step.

    Raises:
        OrbiflowError: for an argument that cannot be used.
        CertificationError: if no candidate is left.
        Cancelled: if it was told to stop.

    >>> boot = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
    >>> few = BendingSettings(placements=10, held=3, finalists=1, rounds=2)
    >>> best, *_ = certified_tiles(boot, fit_tile(boot, "IH4", few))
    >>> best.name, best.certificate.valid
    ('IH4', True)
    """
    instance(target, Target, "the target", _HOW)
    if settings is not None and not is_a(settings, OneSettings):
        raise OrbiflowError(
            f"settings must be of one method, got {described(settings)}; for a level of effort: "
            'BendingSettings.for_effort("fast")'
        )
    if pins is not None and not isinstance(settings or BendingSettings(), BendingSettings):
        raise OrbiflowError("pins belong to the search for likeness, where silhouettes bend")
    with one_thread():
        return fit(
            target,
            isohedral_class(kind),
            BendingSettings.for_effort("normal") if settings is None else settings,
            emphasis=emphasis,
            pins=pins,
            per_class=per_class,
            progress=progress,
            cancel=cancel,
        )


def certified_tiles(
    target: Target, found: Fit | TileModel, *, force: bool = False, min_neck: float = 0.0
) -> list[EscherTile]:
    """Polygons of what was fitted, each proved to tile the plane, best first.

    Args:
        target: that it was fitted to.
        found: of `fit_tile`, `fit_descent` or `fit_bending`; the candidates of `fit_occupancy`, or any
            others, trained further or loaded.
        force: give tiles that are not certified, too; their certificates say why.
        min_neck: narrowest neck that a tile's score forgives, a share of its size.

    Raises:
        OrbiflowError: for what holds no candidates.
        CertificationError: if none of them is certified and `force` is not set.
    """
    instance(target, Target, "the target", _HOW)
    if isinstance(found, TileModel):
        found = Fit(found, found.size, 0, found.size)
    instance(found, Fit, "what was found", "fit_tile gives a Fit, load_model a TileModel")
    with one_thread():
        return best_tiles(target, found, force=force, min_neck=least_neck(target.normal, min_neck))


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
) -> EscherTile | None:
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
) -> EscherTile | None:
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
