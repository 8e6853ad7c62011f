"""The last percent: L-BFGS on the exact IoU of the polygon, through one more segment of the flow."""

from __future__ import annotations

import contextlib

import numpy as np
import scipy.optimize
import shapely
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.fields import FourierField, steepness
from orbiflow.flows import Flow
from orbiflow.runtime import Cancel
from orbiflow.tiles.likeness import Overlap
from orbiflow.tiles.search.descent import calm
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.silhouette import Target

SMOOTHNESS = 1.25
"""Exponent s of the preconditioning (1 + |kappa|^2)^-s."""

STEPS = 2
"""Midpoint steps through the new segment; each stays injective."""

STALL = 2e-5
"""Polishing stops when ten iterations together gain less IoU than this."""


def polish(
    model: TileModel, target: Target, iterations: int, *, cancel: Cancel | None = None
) -> TileModel:
    """Improve a single candidate: a last stationary segment and its pose, by exact gradients.

    Args:
        model: one candidate, float32 or float64; left as it is.
        target: the silhouette.
        iterations: of L-BFGS at most; it stops early where the IoU stalls.
        cancel: looked at before each evaluation.

    Returns:
        A float64 model with one segment more, or as many if nothing was gained. Its sampled
        boundary is simple and its IoU no smaller.

    Raises:
        Cancelled: if it was told to stop.
    """
    cancel = cancel or Cancel()
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
        self.flow = Flow([self.field], steps=STEPS, method="midpoint", warn=False)
        magnitude = torch.tensor(self.field.basis.magnitude, dtype=torch.float64)
        self.scale = (1 + magnitude**2) ** (-SMOOTHNESS / 2)
        self.magnitude, self.limit = magnitude, calm(self.field) * STEPS
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
        """1 - IoU and its gradient in all parameters."""
        values = torch.tensor(x, dtype=torch.float64)
        parameters = self._set(values)
        placed = self.model.place(self.flow(self.points))
        ring = placed.detach()[0].numpy()
        if not (self._calm() and shapely.Polygon(ring).is_valid):
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
        """Stops the iteration when the last ten brought nothing."""
        self.history.append(self.best_iou)
        if len(self.history) > 10 and self.history[-1] - self.history[-11] < STALL:
            raise StopIteration

    def result(self) -> TileModel:
        """The model at the best iterate."""
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

    def _calm(self) -> bool:
        return float(steepness(self.field.parameters_.detach(), self.magnitude)) <= self.limit
