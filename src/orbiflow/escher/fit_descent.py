"""The whole fit of one class by descent: starts, successive halving, polish (design point 10)."""

from __future__ import annotations

import numpy as np
import shapely

from orbiflow.escher.descent import Descent
from orbiflow.escher.descent_settings import DescentSettings
from orbiflow.escher.fit import Fit, Progress
from orbiflow.escher.outline_starts import outline_starts, template_starts
from orbiflow.escher.prototiles import Prototiles
from orbiflow.escher.soft_target import SoftTarget
from orbiflow.escher.target import Target
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import IsohedralClass


def fit_descent(
    target: Target,
    kind: IsohedralClass,
    settings: DescentSettings | None = None,
    *,
    soft: SoftTarget | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit tiles of one class to a target by Sobolev descent, all starts side by side.

    Args:
        target: the silhouette.
        kind: the class.
        settings: of the descent; default effort "normal".
        soft: of the target, if it is at hand already.
        progress: told 1 - IoU of the best so far as the loss.
    """
    settings = settings or DescentSettings()
    soft = soft or SoftTarget(target)
    report = progress or (lambda _share, _loss: None)
    prototiles = _starts(target, kind, settings)
    report(0.1, float("nan"))
    descent = Descent(kind, prototiles, settings)
    goal = shapely.Polygon(target.normal)
    shapely.prepare(goal)
    crossed = 0
    best = 0.0
    for steps, survivors in settings.stages:
        for k in range(steps):
            descent.step(soft)
            if k % 8 == 7:
                report(0.1 + 0.8 * descent.done / settings.iterations, 1 - best)
        iou = boundary_iou(goal, descent.placed())
        crossed += int((iou < 0).sum())
        ranking = np.argsort(-iou, kind="stable")
        simple = ranking[: max(1, int((iou >= 0).sum()))]
        descent.keep(simple[:survivors].tolist(), iou)
        best = float(iou.max())
    return Fit(descent.flow_model(), len(prototiles), crossed, 1)


def boundary_iou(goal: shapely.Polygon, boundaries: Array) -> Array:
    """IoU (S,) of rings (S, N, 2) with a polygon; -1 for those that cross themselves."""
    polygons = np.asarray(shapely.polygons(boundaries))
    good = np.asarray(shapely.is_valid(polygons))
    scores = np.full(len(polygons), -1.0)
    common = shapely.area(shapely.intersection(polygons[good], goal))
    scores[good] = common / (shapely.area(polygons[good]) + goal.area - common)
    return scores


def _starts(target: Target, kind: IsohedralClass, settings: DescentSettings) -> Prototiles:
    phase = float(np.random.default_rng(settings.seed).random()) if settings.seed else 0.0
    if settings.starts == "outline":
        found = outline_starts(
            target,
            kind,
            count=settings.candidates,
            resolutions=settings.resolutions,
            vertices=settings.boundary,
            phase=phase,
        )
        if len(found.prototiles):
            return found.prototiles
    return template_starts(
        kind,
        turns=settings.turns,
        stretch=settings.stretch if settings.lattice else 0.0,
        vertices=settings.boundary,
        phase=phase,
    )
