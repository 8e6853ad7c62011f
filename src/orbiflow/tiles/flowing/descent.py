"""The search for overlap in one class: Sobolev descent on the group of symmetric diffeomorphisms.

A tile's area is fixed by its group, so its overlap with the target is a boundary integral: its
derivative in the boundary is (occupancy - 1/2) n ds. Each step projects that force on the invariant
Fourier fields, damps it by (1 + |kappa|^2)^-s, adds momentum, and follows the field for a time in
which no boundary point moves far and the map stays injective. The fields are kept: one segment each
of the flow that is the result. No backpropagation through an equation, all starts side by side. The
last percent is L-BFGS on the exact IoU of the polygon, through one more segment (design point 10).
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy.optimize
import shapely
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields import FourierField, group_factor, steepness
from orbiflow.flows import METHODS, Flow
from orbiflow.runtime import NEVER, Cancel, one_thread
from orbiflow.settings import as_instance
from orbiflow.tiles.flowing.soft_target import SoftTarget
from orbiflow.tiles.flowing.starts import Starts, outline_starts, template_starts
from orbiflow.tiles.flowing.tile_model import TileModel
from orbiflow.tiles.likeness import Overlap, Recogniser, boundary_iou, prepared_region, rank_score
from orbiflow.tiles.search import ClassFinalists, OnProgress, Prototiles, SearchMethod, silent
from orbiflow.tiles.silhouette import Emphasis, Target
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class
from orbiflow.typed_torch import linalg

if TYPE_CHECKING:
    from orbiflow.tiles.flowing.overlap_search import OverlapSearch

MAX_STEP_STEEPNESS = 0.4  # of a step's length times the field's steepness


def max_step_steepness(field: FourierField) -> float:
    """Return `MAX_STEP_STEEPNESS`, or less where midpoint steps would not be injective otherwise."""
    factor = group_factor(field.group, field.basis)
    safe = METHODS["midpoint"].injective_below
    return min(MAX_STEP_STEEPNESS, safe / factor) if factor else MAX_STEP_STEEPNESS


class Descent:
    """Candidates on their way: boundary points in the group's frame, poses, momentum, the record."""

    def __init__(
        self, kind: IsohedralClass, prototiles: Prototiles, settings: OverlapSearch
    ) -> None:
        self.settings = settings
        self.done = 0
        self.record: list[Tensor] = []
        self._set_up(
            TileModel(
                kind,
                max_frequency=settings.max_frequency,
                smoothness=0.0,
                steps=1,
                method="midpoint",
                dtype=torch.float32,
                prototiles=prototiles,
            )
        )
        self.points = self.model.prototile()[0]
        self.momentum = torch.zeros_like(self.field.parameters_)
        self.pose_momentum = {name: torch.zeros_like(p) for name, p in self._pose().items()}
        self.threshold = torch.full((self.model.size,), 0.45)

    def _set_up(self, model: TileModel) -> None:
        self.model = model
        self.field = model.fourier_fields()[0]
        magnitude = torch.tensor(self.field.basis.magnitude, dtype=torch.float32)
        self.magnitude, self.steepest = magnitude, max_step_steepness(self.field)

    def _pose(self) -> dict[str, torch.nn.Parameter]:
        names = ["angle", "offset", "log_scale"] + ["stretch"] * self.settings.lattice
        every = dict(self.model.named_parameters())
        return {name: every[name] for name in names if every[name].numel()}

    def step(self, soft: SoftTarget) -> None:
        """Take one step with all candidates: another segment of their flows."""
        share = self.done / max(1, self.settings.iterations - 1)
        reach, blur = (between(ends, share) for ends in (self.settings.reach, self.settings.blur))
        first, last = self.settings.smoothness
        damping = (1 + self.magnitude**2) ** -(first + share * (last - first))
        pose = self._pose()
        placed = self.model.place(self.points)
        force = self._force(soft, placed.detach(), blur)
        # not grad_outputs: with them torch imports its symbolic shapes, half a second
        gradients = torch.autograd.grad((placed * force).sum(), list(pose.values()))
        with torch.no_grad():
            pulled = force @ self.model.linear()
            self.momentum *= self.settings.momentum
            self.momentum += self.field.adjoint(self.points, pulled) * damping
            self._move(reach)
            for (name, parameter), gradient in zip(pose.items(), gradients, strict=True):
                self._turn(parameter, self.pose_momentum[name], gradient, reach)
        self.done += 1

    def _force(self, soft: SoftTarget, placed: Tensor, blur: float) -> Tensor:
        """Return (occupancy - Dice / 2) n ds at boundary points, outward: the gradient of the IoU."""
        along = (placed.roll(-1, dims=1) - placed.roll(1, dims=1)) / 2
        outward = torch.stack([along[..., 1], -along[..., 0]], dim=-1)
        outward = torch.where(self.model.mirror[:, None, None], -outward, outward)
        pull = soft.occupancy(placed, blur) - self.threshold[:, None]
        return pull[..., None] * soft.weight(placed)[..., None] * outward

    def _move(self, reach: float) -> None:
        """Follow the momentum's field for one midpoint step; record it."""
        self.field.parameters_.copy_(self.momentum)
        velocity = self.field.bound()
        slope = velocity(self.points)
        size = slope.square().sum(dim=-1).amax(dim=1).sqrt() * self.model.log_scale.exp()
        steep = steepness(self.momentum, self.magnitude)
        tiny = torch.finfo(size.dtype).tiny
        time = torch.minimum(reach / size.clamp_min(tiny), self.steepest / steep.clamp_min(tiny))
        h = time[:, None, None]
        self.points = self.points + h * velocity(self.points + h / 2 * slope)
        self.record.append(time[:, None] * self.momentum)

    def _turn(self, parameter: Tensor, momentum: Tensor, gradient: Tensor, reach: float) -> None:
        momentum *= self.settings.momentum
        momentum += gradient
        flat = momentum.reshape(len(momentum), -1)
        size = linalg.vector_norm(flat, dim=1).clamp_min(1e-9)
        share = torch.minimum(torch.ones_like(size), reach / size)
        parameter += (share[:, None] * flat).reshape(parameter.shape)

    @torch.no_grad()
    def placed(self) -> Array:
        """Return boundaries (S, N, 2) in the target's normal form, float64."""
        return self.model.place(self.points).double().numpy()

    @torch.no_grad()
    def keep(self, chosen: Sequence[int], iou: Array) -> None:
        """Go on with the candidates `chosen` alone; `iou` (S,) is that of all, below 0 if unknown."""
        index = list(chosen)
        overlap = torch.tensor(iou, dtype=torch.float32).clamp(0.5, 1.0)
        self.threshold = (overlap / (1 + overlap))[index]
        self._set_up(self.model.take(index))
        self.points, self.momentum = self.points[index], self.momentum[index]
        self.record = [parameters[index] for parameters in self.record]
        self.pose_momentum = {name: m[index] for name, m in self.pose_momentum.items()}


def between(ends: tuple[float, float], share: float) -> float:
    """Return the geometric interpolation between two ends."""
    return ends[0] * (ends[1] / ends[0]) ** share


PRECONDITIONING_EXPONENT = 1.25  # exponent s of the preconditioning (1 + |kappa|^2)^-s
SEGMENT_STEPS = 2  # midpoint steps through the new segment; each stays injective
MIN_GAIN = 2e-5  # polishing stops when ten iterations together gain less IoU than this


def polish(
    model: TileModel, target: Target, iterations: int, *, cancel: Cancel = NEVER
) -> TileModel:
    """Improve a single candidate's IoU: a last segment, if it gains, and its pose; float64."""
    work = _Polish(model, target)
    if work.best_iou == 0.0:  # crosses itself already
        return model

    def loss(x: Array) -> tuple[float, Array]:
        cancel.check()
        return work.loss(x)

    with contextlib.suppress(StopIteration):  # older SciPy lets it through
        scipy.optimize.minimize(
            loss,
            np.zeros(work.size),
            jac=True,
            method="L-BFGS-B",
            callback=work.stalled,
            options={"maxiter": iterations, "maxls": 12, "ftol": 0.0, "gtol": 1e-9},
        )
    return work.result()


class _Polish:
    """The objective, and the best iterate that is simple and not too steep."""

    def __init__(self, model: TileModel, target: Target) -> None:
        self.model = model.take([0]).double()
        self.field = FourierField(
            model.group, model.max_frequency, batch=1, smoothness=0.0, dtype=torch.float64
        )
        self.flow = Flow([self.field], steps=SEGMENT_STEPS, method="midpoint", warn=False)
        magnitude = torch.tensor(self.field.basis.magnitude, dtype=torch.float64)
        self.scale = (1 + magnitude**2) ** (-PRECONDITIONING_EXPONENT / 2)
        self.magnitude, self.limit = magnitude, max_step_steepness(self.field) * SEGMENT_STEPS
        pose = (self.model.angle, self.model.log_scale, self.model.offset, self.model.stretch)
        self.pose = [parameter for parameter in pose if parameter.numel()]
        self.start = [p.detach().clone() for p in self.pose]
        with torch.no_grad():
            self.points = self.model.flow(self.model.prototile()[0])
        self.overlap = Overlap(target.normal)
        self.size = self.field.size + sum(p.numel() for p in self.pose)
        self.best = np.zeros(self.size)
        self.best_iou = 0.0
        self.gradient = np.zeros(self.size)
        self.loss(self.best)
        self.first_iou = self.best_iou
        self.history: list[float] = []

    def loss(self, x: Array) -> tuple[float, Array]:
        """Return 1 - IoU and its gradient in all parameters."""
        values = torch.tensor(x, dtype=torch.float64)
        parameters = self._set(values)
        placed = self.model.place(self.flow(self.points))
        ring = placed.detach()[0].numpy()
        is_flat_enough = steepness(self.field.parameters_.detach(), self.magnitude) <= self.limit
        if not (is_flat_enough and shapely.Polygon(ring).is_valid):
            return 1.0, self.gradient  # a barrier: the line search turns back
        value, gradient = self.overlap.iou(ring)
        if value > self.best_iou:
            self.best, self.best_iou = np.array(x), value
        work = (placed * torch.tensor(gradient)[None]).sum()
        parts = torch.autograd.grad(work, parameters)
        flat = torch.cat([(parts[0] * self.scale).flatten(), *(p.flatten() for p in parts[1:])])
        self.gradient = -flat.numpy()
        return 1 - value, self.gradient

    def stalled(self, xk: Array) -> None:  # noqa: ARG002 - SciPy's name
        """Stop the iteration when the last ten brought nothing."""
        self.history.append(self.best_iou)
        if len(self.history) > 10 and self.history[-1] - self.history[-11] < MIN_GAIN:
            raise StopIteration

    def result(self) -> TileModel:
        """Return the model at the best iterate."""
        if self.best_iou <= self.first_iou:
            self._set(torch.zeros(self.size, dtype=torch.float64))
            return self.model
        self._set(torch.tensor(self.best))
        old = [field.parameters_.detach() for field in self.model.fourier_fields()]
        # the model's own fields may scale their parameters
        scale = self.model.fourier_fields()[0].scale
        return self.model.with_fields([*old, self.field.parameters_.detach() / scale])

    def _set(self, values: Tensor) -> list[Tensor]:
        with torch.no_grad():
            self.field.parameters_.copy_(values[: self.field.size] * self.scale)
            at = self.field.size
            for parameter, start in zip(self.pose, self.start, strict=True):
                step = values[at : at + parameter.numel()].reshape(parameter.shape)
                parameter.copy_(start + step)
                at += parameter.numel()
        return [self.field.parameters_, *self.pose]


# Starts from the outline, and IoU of the best of them, below which the template's join them
MIN_STARTS, MIN_START_IOU = 8, 0.4
MAX_IOU_BEHIND = 0.01  # IoU that a more recognisable candidate of a class may be behind the best


def fit_descent(
    target: Target,
    kind: IsohedralClass | str,
    settings: OverlapSearch,
    *,
    emphasis: Emphasis | None = None,
    progress: OnProgress = silent,
    cancel: Cancel = NEVER,
) -> ClassFinalists:
    """Fit tiles of one class to a target by Sobolev descent, all starts side by side.

    `progress` is called with 1 - IoU as the loss.
    """
    kind = isohedral_class(kind)
    as_instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
    as_instance(settings, SearchMethod, "settings", "give an OverlapSearch")
    outline = shapely.Polygon(target.normal).exterior
    settings = settings.for_outline(outline.length)
    soft = shared_soft_target(target, emphasis)
    starts = _starts(target, kind, settings, cancel)
    prototiles = starts.prototiles
    progress(0.1, float("nan"))
    descent = Descent(kind, prototiles, settings)
    goal = prepared_region(target.normal)
    crossed = 0
    best = 0.0
    for steps, survivors in settings.stages:
        for k in range(steps):
            cancel.check()
            descent.step(soft)
            if k % 8 == 7:
                progress(0.1 + 0.8 * descent.done / settings.iterations, 1 - best)
        iou = _overlaps(goal, soft, descent)
        crossed += int((iou < 0).sum())
        ranking = np.argsort(-iou, kind="stable")
        simple = ranking[: max(1, int((iou >= 0).sum()))]
        descent.keep(simple[:survivors].tolist(), iou)
        best = float(iou.max())
    first = _best_first(target, goal, soft, descent)
    model = descent.model.with_fields(descent.record)  # a segment of the flow for each step
    if soft.weights is None and starts.iou.max() > first:
        model = _with_start(model, prototiles.take([int(starts.iou.argmax())]))
    if settings.polish and soft.weights is None:  # the exact overlap knows no emphasis
        progress(0.92, 1 - best)
        model = _polished(target, model, settings, cancel)
    return ClassFinalists(model, len(prototiles), crossed, 1)


@lru_cache(maxsize=2)  # targets hash by identity; one serves all classes
def shared_soft_target(target: Target, emphasis: Emphasis | None) -> SoftTarget:
    """Return the target with a soft edge, made once for all classes."""
    with one_thread():
        return SoftTarget(target, emphasis=emphasis)


def _with_start(model: TileModel, prototile: Prototiles) -> TileModel:
    """Return the candidates after a start that none of them beats, whose flow moves nothing."""
    zero = torch.zeros_like(model.fourier_fields()[0].parameters_[:1])
    start = model.with_fields([zero] * model.segments, [0])
    start.start_from(prototile)
    return TileModel.joined([start, model])


def _polished(
    target: Target, model: TileModel, settings: OverlapSearch, cancel: Cancel
) -> TileModel:
    """Return the same candidates, each with one segment more."""
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
    """Return IoU (S,) of the candidates, weighted if there is emphasis; -1 where one crosses itself."""
    boundaries = descent.placed()
    plain = boundary_iou(goal, boundaries)
    if soft.weights is None:
        return plain
    rings = torch.tensor(boundaries, dtype=soft.image.dtype)
    rings = torch.where(descent.model.mirror[:, None, None], rings.flip(1), rings)
    return np.where(plain < 0, plain, soft.weighted_iou(rings).numpy())


def _best_first(target: Target, goal: shapely.Polygon, soft: SoftTarget, descent: Descent) -> float:
    """Order survivors by IoU and recognisability, those that gave up IoU last; the IoU of the first."""
    boundaries = descent.placed()
    iou = _overlaps(goal, soft, descent)
    recognise = Recogniser(target.normal)
    scores = [
        rank_score(overlap, recognise(ring).score) - float(overlap < iou.max() - MAX_IOU_BEHIND)
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
    nearest: Starts | None = None
    if settings.starts == "outline":
        nearest = outline_starts(target, kind, settings, cancel=cancel)
        if len(nearest.prototiles) >= MIN_STARTS and nearest.iou.max() >= MIN_START_IOU:
            return nearest
    templates = template_starts(
        kind,
        turns=settings.turns,
        stretch=settings.stretch if settings.lattice else 0.0,
        vertices=settings.boundary,
        phase=settings.phase,
    )
    # their overlap is not known: 0 says that any result is better
    plain = Starts(templates, np.zeros(len(templates)))
    if nearest is None or not len(nearest.prototiles):
        return plain
    joined = Prototiles.joined([nearest.prototiles, templates])
    return Starts(joined, np.concatenate([nearest.iou, plain.iou]))
