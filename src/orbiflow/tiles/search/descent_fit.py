"""The whole fit of one class by descent: starts, successive halving, polish (design point 10)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
import torch

from orbiflow.arguments import instance
from orbiflow.arrays import Array
from orbiflow.runtime import Cancel, one_thread
from orbiflow.tiles.likeness import (
    Recogniser,
    boundary_iou,
    prepared_region,
    rank_score,
)
from orbiflow.tiles.search.candidates import (
    Fit,
    Progress,
    silent,
)
from orbiflow.tiles.search.descent import Descent
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.search.overlap_search import OverlapSearch
from orbiflow.tiles.search.polish import polish
from orbiflow.tiles.search.prototiles import Prototiles
from orbiflow.tiles.search.starts import (
    Starts,
    outline_starts,
    template_starts,
)
from orbiflow.tiles.silhouette import Emphasis, SoftTarget, Target
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class

FEW, POOR = 8, 0.4
"""Starts from the outline, and IoU of the best of them, below which the template's join them."""

NEAR = 0.01
"""IoU that a more recognisable candidate of a class may be behind the best."""


def fit_descent(
    target: Target,
    kind: IsohedralClass | str,
    settings: OverlapSearch | None = None,
    *,
    soft: SoftTarget | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Fit:
    """Fit tiles of one class to a target by Sobolev descent, all starts side by side.

    Args:
        target: the silhouette.
        kind: the class, or its name.
        settings: of the descent; default effort "normal".
        soft: of the target, if it is at hand already.
        progress: told 1 - IoU of the best so far as the loss.
        cancel: looked at before each step.

    Raises:
        Cancelled: if it was told to stop.
    """
    kind = isohedral_class(kind)
    instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
    settings = instance(settings or OverlapSearch(), OverlapSearch, "settings")
    outline = shapely.Polygon(target.normal).exterior
    settings = settings.for_outline(outline.length)
    soft = soft or SoftTarget(target)
    report = progress or silent
    cancel = cancel or Cancel()
    starts = _starts(target, kind, settings, cancel)
    prototiles = starts.prototiles
    report(0.1, float("nan"))
    descent = Descent(kind, prototiles, settings)
    goal = prepared_region(target.normal)
    crossed = 0
    best = 0.0
    for steps, survivors in settings.stages:
        for k in range(steps):
            cancel.check()
            descent.step(soft)
            if k % 8 == 7:
                report(0.1 + 0.8 * descent.done / settings.iterations, 1 - best)
        iou = _overlaps(goal, soft, descent)
        crossed += int((iou < 0).sum())
        ranking = np.argsort(-iou, kind="stable")
        simple = ranking[: max(1, int((iou >= 0).sum()))]
        descent.keep(simple[:survivors].tolist(), iou)
        best = float(iou.max())
    first = _best_first(target, goal, soft, descent)
    model = descent.flow_model()
    if soft.weights is None and starts.iou.max() > first:
        model = _with_start(model, prototiles.take([int(starts.iou.argmax())]))
    if settings.polish and soft.weights is None:  # the exact overlap knows no emphasis
        report(0.92, 1 - best)
        model = _polished(target, model, settings, cancel)
    return Fit(model, len(prototiles), crossed, 1)


@lru_cache(maxsize=2)  # targets hash by identity; one serves all classes
def shared_soft_target(target: Target, emphasis: Emphasis | None) -> SoftTarget:
    """Return the target with a soft edge, made once for all classes."""
    with one_thread():
        return SoftTarget(target, emphasis=emphasis)


def _with_start(model: TileModel, prototile: Prototiles) -> TileModel:
    """The candidates after a start that none of them beats, with a flow that stays where it is."""
    still = TileModel(
        model.isohedral_class,
        max_frequency=model.max_frequency,
        smoothness=model.smoothness,
        steps=model.flow.steps,
        method=model.flow.method,
        dtype=model.angle.dtype,
        prototiles=prototile,
    )
    zero = torch.zeros_like(still.fourier_fields()[0].parameters_)
    return TileModel.joined([still.with_fields([zero] * model.segments), model])


def _polished(
    target: Target, model: TileModel, settings: OverlapSearch, cancel: Cancel
) -> TileModel:
    """The same candidates, each with one segment more."""
    polished: list[TileModel] = []
    for index in range(model.size):
        single = model.take([index])
        if index < settings.finalists:
            single = polish(single, target, settings.polish, cancel=cancel)
        if single.segments == model.segments:  # nothing gained
            fields = [field.parameters_.detach() for field in single.fourier_fields()]
            single = single.with_fields([*fields, torch.zeros_like(fields[0])])
        polished.append(single.double())
    return TileModel.joined(polished)


def _overlaps(goal: shapely.Polygon, soft: SoftTarget, descent: Descent) -> Array:
    """IoU (S,) of the candidates, weighted if there is emphasis; -1 for those that cross themselves."""
    boundaries = descent.placed()
    plain = boundary_iou(goal, boundaries)
    if soft.weights is None:
        return plain
    rings = torch.tensor(boundaries, dtype=soft.image.dtype)
    rings = torch.where(descent.model.mirror[:, None, None], rings.flip(1), rings)
    return np.where(plain < 0, plain, soft.weighted_iou(rings).numpy())


def _best_first(target: Target, goal: shapely.Polygon, soft: SoftTarget, descent: Descent) -> float:
    """Order the survivors by IoU and recognisability together, those that gave up IoU last.

    Returns:
        The IoU of the first.
    """
    boundaries = descent.placed()
    iou = _overlaps(goal, soft, descent)
    recognise = Recogniser(target.normal)
    scores = [
        rank_score(overlap, recognise(ring).score) - float(overlap < iou.max() - NEAR)
        if overlap >= 0
        else -2.0
        for overlap, ring in zip(iou, boundaries, strict=True)
    ]
    order = np.argsort(-np.array(scores), kind="stable").tolist()
    descent.keep(order, iou)
    return float(iou[order[0]])


def _starts(
    target: Target, kind: IsohedralClass, settings: OverlapSearch, cancel: Cancel
) -> Starts:
    phase = float(np.random.default_rng(settings.seed).random()) if settings.seed else 0.0
    found: Starts | None = None
    if settings.starts == "outline":
        found = outline_starts(
            target,
            kind,
            count=settings.candidates,
            resolutions=settings.resolutions,
            projected=settings.projected,
            measured=settings.measured,
            vertices=settings.boundary,
            phase=phase,
            cancel=cancel,
        )
        if len(found.prototiles) >= FEW and found.iou.max() >= POOR:
            return found
    templates = template_starts(
        kind,
        turns=settings.turns,
        stretch=settings.stretch if settings.lattice else 0.0,
        vertices=settings.boundary,
        phase=phase,
    )
    # their overlap is not known: 0 says that any result is better
    plain = Starts(templates, np.zeros(len(templates)))
    if found is None or not len(found.prototiles):
        return plain
    joined = Prototiles.joined([found.prototiles, templates])
    return Starts(joined, np.concatenate([found.iou, plain.iou]))
