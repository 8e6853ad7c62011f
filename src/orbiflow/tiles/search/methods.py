"""The methods of fitting, chosen by their settings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

from orbiflow.runtime import Cancel
from orbiflow.tiles.search.bending_fit import fit_bending
from orbiflow.tiles.search.co_deformation import Hand, hands
from orbiflow.tiles.search.descent_fit import fit_descent
from orbiflow.tiles.search.fit import Fit, Progress
from orbiflow.tiles.search.occupancy import OccupancySettings, fit_occupancy
from orbiflow.tiles.search.settings import BendingSettings, DescentSettings
from orbiflow.tiles.search.starts import initial_poses
from orbiflow.tiles.silhouette import (
    Emphasis,
    Pins,
    SoftTarget,
    Target,
)
from orbiflow.tiles.tilings import CLASSES, IsohedralClass


@dataclass(frozen=True)
class BothSettings:
    """Search for likeness and for overlap, each with its own settings."""

    likeness: BendingSettings = field(default_factory=BendingSettings)
    overlap: DescentSettings = field(default_factory=DescentSettings)

    @property
    def seed(self) -> int:
        """Of both."""
        return self.likeness.seed


OneSettings = BendingSettings | DescentSettings | OccupancySettings
Settings = OneSettings | BothSettings


def parts(settings: Settings) -> list[tuple[float, OneSettings]]:
    """The fits that settings ask for, each with its share of the work."""
    if isinstance(settings, BothSettings):
        return [(0.3, settings.likeness), (0.7, settings.overlap)]
    return [(1.0, settings)]


def method_name(settings: Settings) -> str:
    """As in `--method`."""
    return "occupancy" if isinstance(settings, OccupancySettings) else "descent"


def objective_name(settings: Settings) -> str:
    """As in `--objective`."""
    if isinstance(settings, BendingSettings):
        return "likeness"
    return "both" if isinstance(settings, BothSettings) else "overlap"


def fit(
    target: Target,
    kind: IsohedralClass,
    settings: OneSettings,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    per_class: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Fit tiles of one class by the method that the settings belong to.

    Args:
        target: the silhouette.
        kind: the class.
        settings: of the method.
        emphasis: what must survive; the occupancy method takes no notice.
        pins: what must not bend; only the search for likeness takes notice.
        per_class: certified tiles that are wanted.
        progress: told how far it is.
        cancel: looked at before each step.

    Raises:
        CertificationError: if no candidate is left.
        Cancelled: if it was told to stop.
    """
    if isinstance(settings, BendingSettings):
        both = shared_hands(target, settings, emphasis, pins)
        return fit_bending(
            target, kind, settings, both, per_class=per_class, progress=progress, cancel=cancel
        )
    if isinstance(settings, DescentSettings):
        soft = _soft_target(target, emphasis)
        settings = settings.with_survivors(2 * per_class)
        found = fit_descent(target, kind, settings, soft=soft, progress=progress, cancel=cancel)
        return found._replace(enough=1 if per_class == 1 else 2 * per_class)
    number = list(CLASSES).index(kind.name)
    own = replace(settings, seed=(settings.seed * 1009 + number) % 2**32)
    model = fit_occupancy(target, kind, own, progress, cancel=cancel)
    return Fit(model, len(initial_poses(kind, settings.turns)[0]), 0, model.size)


def prepare(
    target: Target, settings: Settings, emphasis: Emphasis | None, pins: Pins | None = None
) -> None:
    """Compute what the fits of all classes share, so that forked processes find it done."""
    for _, part in parts(settings):
        if isinstance(part, BendingSettings):
            shared_hands(target, part, emphasis, pins)
        elif isinstance(part, DescentSettings):
            _soft_target(target, emphasis)


@lru_cache(maxsize=2)  # targets hash by identity; one serves all classes
def _soft_target(target: Target, emphasis: Emphasis | None) -> SoftTarget:
    return SoftTarget(target, emphasis=emphasis)


def shared_hands(
    target: Target,
    settings: BendingSettings,
    emphasis: Emphasis | None,
    pins: Pins | None = None,
) -> tuple[Hand, Hand]:
    """The target's hands, made once for all classes."""
    return _hands(target, settings.seed, settings.multiples, emphasis, pins)


@lru_cache(maxsize=2)
def _hands(
    target: Target,
    seed: int,
    multiples: tuple[int, ...],
    emphasis: Emphasis | None,
    pins: Pins | None,
) -> tuple[Hand, Hand]:
    settings = BendingSettings(seed=seed, multiples=multiples)
    return hands(target, settings, emphasis=emphasis, pins=pins)
