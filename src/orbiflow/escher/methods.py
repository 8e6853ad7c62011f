"""The methods of fitting, chosen by their settings."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from orbiflow.cancel import Cancel
from orbiflow.escher.descent_settings import DescentSettings
from orbiflow.escher.fit import Fit, Progress
from orbiflow.escher.fit_descent import fit_descent
from orbiflow.escher.occupancy import OccupancySettings, fit_occupancy
from orbiflow.escher.starts import initial_poses
from orbiflow.silhouette.emphasis import Emphasis
from orbiflow.silhouette.soft_target import SoftTarget
from orbiflow.silhouette.target import Target
from orbiflow.tilings import CLASSES, IsohedralClass

Settings = DescentSettings | OccupancySettings


def method_name(settings: Settings) -> str:
    """As in `--method`."""
    return "descent" if isinstance(settings, DescentSettings) else "occupancy"


def fit(
    target: Target,
    kind: IsohedralClass,
    settings: Settings,
    *,
    emphasis: Emphasis | None = None,
    per_class: int = 1,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Fit tiles of one class by the method that the settings belong to.

    Args:
        target: the silhouette.
        kind: the class.
        settings: of the method.
        emphasis: what must survive; the descent alone takes notice.
        per_class: certified tiles that are wanted.
        progress: told how far it is.
        cancel: looked at before each step.

    Raises:
        Cancelled: if it was told to stop.
    """
    if isinstance(settings, DescentSettings):
        soft = _soft_target(target, emphasis)
        settings = settings.with_survivors(2 * per_class)
        found = fit_descent(target, kind, settings, soft=soft, progress=progress, cancel=cancel)
        return found._replace(enough=1 if per_class == 1 else 2 * per_class)
    number = list(CLASSES).index(kind.name)
    own = replace(settings, seed=(settings.seed * 1009 + number) % 2**32)
    model = fit_occupancy(target, kind, own, progress, cancel=cancel)
    return Fit(model, len(initial_poses(kind, settings.turns)[0]), 0, model.size)


def prepare(target: Target, settings: Settings, emphasis: Emphasis | None) -> None:
    """Compute what the fits of all classes share, so that forked processes find it done."""
    if isinstance(settings, DescentSettings):
        _soft_target(target, emphasis)


@lru_cache(maxsize=2)  # targets hash by identity; one serves all classes
def _soft_target(target: Target, emphasis: Emphasis | None) -> SoftTarget:
    return SoftTarget(target, emphasis=emphasis)
