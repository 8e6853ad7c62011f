"""Sobolev descent on the group of symmetric diffeomorphisms (design point 10).

A tile's area is fixed by its group, so its overlap with the target is a boundary integral: its
derivative in the boundary is (occupancy - 1/2) n ds. Each step projects that force on the invariant
Fourier fields, damps it by (1 + |kappa|^2)^-s, adds momentum, and follows the field for a time in
which no boundary point moves far and the map stays injective. The fields are kept: one segment each of
the flow that is the result. No backpropagation through an equation, all starts side by side.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields import (
    FourierField,
    group_factor,
    steepness,
)
from orbiflow.flows import METHODS
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.search.overlap_search import OverlapSearch
from orbiflow.tiles.search.prototiles import Prototiles
from orbiflow.tiles.silhouette import SoftTarget
from orbiflow.tiles.tilings import IsohedralClass
from orbiflow.typed_torch import linalg

CALM = 0.4
"""Step length times the field's steepness, at most; less where `calm` finds it too bold."""


def calm(field: FourierField) -> float:
    """`CALM`, or as much less as makes every midpoint step injective whatever the field's group."""
    factor = group_factor(field.group, field.basis)
    safe = METHODS["midpoint"].injective_below
    return min(CALM, safe / factor) if factor else CALM  # a constant field is as calm as can be


class Descent:
    """Candidates on their way: boundary points in the group's frame, poses, momentum, the record.

    Args:
        kind: the class.
        prototiles: the starts, of `settings.boundary` vertices each.
        settings: of the descent.
    """

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
        self.threshold = torch.full((self.size,), 0.45)

    def _set_up(self, model: TileModel) -> None:
        self.model = model
        self.field = model.fourier_fields()[0]
        magnitude = torch.tensor(self.field.basis.magnitude, dtype=torch.float32)
        self.magnitude, self.calm = magnitude, calm(self.field)

    def _pose(self) -> dict[str, torch.nn.Parameter]:
        names = ["angle", "offset", "log_scale"] + ["stretch"] * self.settings.lattice
        every = dict(self.model.named_parameters())
        return {name: every[name] for name in names if every[name].numel()}

    @property
    def size(self) -> int:
        """Number of candidates."""
        return self.model.size

    def step(self, soft: SoftTarget) -> None:
        """One step of all candidates: another segment of their flows."""
        share = self.done / max(1, self.settings.iterations - 1)
        reach, blur = (_between(ends, share) for ends in (self.settings.reach, self.settings.blur))
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
        """(occupancy - Dice / 2) n ds at the boundary points, outward: the gradient of the IoU.

        For tiles of fixed area the constant has no effect; it decides where scale may change.
        """
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
        time = torch.minimum(reach / size.clamp_min(tiny), self.calm / steep.clamp_min(tiny))
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
        """Boundaries (S, N, 2) in the target's normal form, float64."""
        return self.model.place(self.points).double().numpy()

    @torch.no_grad()
    def keep(self, chosen: Sequence[int], iou: Array) -> None:
        """Go on with the candidates `chosen` alone.

        Args:
            chosen: their indices.
            iou: (S,) of all candidates as they are; below 0 if unknown.
        """
        index = list(chosen)
        known = torch.tensor(iou, dtype=torch.float32).clamp(0.5, 1.0)
        self.threshold = (known / (1 + known))[index]
        self._set_up(self.model.take(index))
        self.points, self.momentum = self.points[index], self.momentum[index]
        self.record = [parameters[index] for parameters in self.record]
        self.pose_momentum = {name: m[index] for name, m in self.pose_momentum.items()}

    def flow_model(self) -> TileModel:
        """The candidates, each with the recorded fields as the segments of its flow."""
        return self.model.with_fields(self.record)


def _between(ends: tuple[float, float], share: float) -> float:
    return ends[0] * (ends[1] / ends[0]) ** share
