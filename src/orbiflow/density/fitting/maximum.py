"""The maximum of the likelihood of a parametric family, and how sure its parameters are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.fitting.forms import FORMS, Cloud, Form, Start
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import linalg

MOST_STEPS, LEAST_GAIN = 200, 1e-15
"""Steps of Newton's method at most, and the relative gain at which it ends."""

LEFT_GAIN = 1e-6
"""Nats a row that a step may still promise where none is gained, which is rounding."""

LARGEST_TURN, LARGEST_STEP = 0.5, 1.0
"""Radians by which a step may turn the frame, and by how much it may change a shape parameter of 1."""

MOST_TOLD = 1e7
"""Concentration about a mean direction from which its information has too few digits."""

SINGULAR = 1e-12
"""Information about a parameter, relative to its own scale, below which there is none."""


def turned(frame: Tensor, angles: Tensor, planes: list[tuple[int, int]]) -> Tensor:
    """Return a frame (p, p) turned by small angles (P,) in planes of its axes.

    The rotation's exponential to the second order, which first and second derivatives see.
    """
    turn = _skew(angles, planes, len(frame))
    return frame + turn @ frame + turn @ turn @ frame / 2


def _skew(angles: Tensor, planes: list[tuple[int, int]], width: int) -> Tensor:
    """Return the skew matrix (p, p) of turns by angles (P,) in planes of axes."""
    turn = angles.new_zeros(width, width)
    if not planes:
        return turn
    first, other = torch.tensor(planes).mT
    return turn.index_put((first, other), angles).index_put((other, first), -angles)


@dataclass(frozen=True)
class Local:
    """A family about a frame and shape, in local coordinates (q,): small turns, then the shape."""

    form: Form
    at: Start
    width: int

    @property
    def planes(self) -> list[tuple[int, int]]:
        """The planes of the turns, in the order of the coordinates."""
        return self.form.planes(self.width)

    def origin(self) -> Tensor:
        """Return the coordinates (q,) of the frame and shape themselves."""
        return torch.zeros(len(self.planes) + len(self.at.shape), dtype=torch.float64)

    def place(self, q: Tensor) -> Start:
        """Return the frame and the shape at coordinates (q,)."""
        turns = len(self.planes)
        return Start(turned(self.at.frame, q[:turns], self.planes), self.at.shape + q[turns:])

    def mean_log(self, q: Tensor, cloud: Cloud) -> Tensor:
        """Return the mean log density of a cloud, per area of the whole sphere."""
        frame, shape = self.place(q)
        return self.form.mean_log(shape, frame, cloud)

    def scores(self, vectors: Tensor) -> Tensor:
        """Return the gradients (N, q) of the log density at each of some vectors."""

        def logs(q: Tensor) -> Tensor:
            frame, shape = self.place(q)
            return self.form.logs(shape, vectors @ frame.mT)

        # the derivative of weights times logs by q is linear in the weights: its columns are scores
        weights = torch.ones(len(vectors), dtype=torch.float64, requires_grad=True)
        q = self.origin().requires_grad_()
        (total,) = torch.autograd.grad(weights @ logs(q), q, create_graph=True)
        columns = [torch.autograd.grad(one, weights, retain_graph=True)[0] for one in total]
        return torch.stack(columns, dim=1)

    def information(self, cloud: Cloud) -> Tensor:
        """Return minus the second derivatives (q, q) of the mean log density."""
        derivatives: Any = torch.autograd.functional

        def mean_log(q: Tensor) -> Tensor:
            return self.mean_log(q, cloud)

        return -derivatives.hessian(mean_log, self.origin())

    def moved(self, step: Tensor) -> Local:
        """Return the family about where a step (q,) leads, its frame orthogonal again."""
        turns = len(self.planes)
        skew = _skew(step[:turns], self.planes, self.width)
        frame = linalg.matrix_exp(skew) @ self.at.frame
        return Local(self.form, Start(frame, self.at.shape + step[turns:]), self.width)


def at_maximum(form: Form, cloud: Cloud) -> Local:
    """Return a family where the likelihood of a cloud is highest, by Newton's method."""
    maxima = [_climbed(Local(form, start, cloud.width), cloud) for start in form.starts(cloud)]
    best = max(maxima, key=lambda one: float(one.mean_log(one.origin(), cloud)))
    return Local(form, form.ordered(best.at), cloud.width)


def highest_log_likelihood(name: str, vectors: Tensor) -> tuple[float, int]:
    """Return the log-likelihood of a family at its maximum, and how many parameters are free.

    It is per area of the whole sphere, of unit vectors (N, p).
    """
    cloud = Cloud(vectors, None)
    local = at_maximum(FORMS[name], cloud)
    return len(vectors) * float(local.mean_log(local.origin(), cloud)), len(local.origin())


def _climbed(local: Local, cloud: Cloud) -> Local:
    value = float(local.mean_log(local.origin(), cloud))
    for _ in range(MOST_STEPS):
        q = local.origin().requires_grad_()
        (slope,) = torch.autograd.grad(local.mean_log(q, cloud), q)
        step = _newton_step(local, slope, local.information(cloud))
        expected = float(slope @ step)
        size = 1.0
        while size > 1e-9:
            tried = local.moved(size * step)
            new = float(tried.mean_log(tried.origin(), cloud))
            if new > value:
                break
            size /= 4
        else:
            if expected > LEFT_GAIN:
                break
            return local
        gained, local, value = new - value, tried, new
        if max(gained, expected) < LEAST_GAIN * (1 + abs(value)):
            return local
    raise OrbiflowError(
        f"no likeliest parameters of the {local.form.name} density were found for these rows: its "
        "concentration may grow without end"
    )


def _newton_step(local: Local, slope: Tensor, information: Tensor) -> Tensor:
    """Return an uphill step (q,), within what a quadratic may be trusted with."""
    scale = information.diagonal().abs().clamp_min(1e-30).rsqrt()
    values, axes = linalg.eigh(information * scale[:, None] * scale)
    values = values.abs().clamp_min(SINGULAR)
    step = scale * (axes @ ((axes.mT @ (scale * slope)) / values))
    turns = len(local.planes)
    most = torch.full_like(step, LARGEST_TURN)
    most[turns:] = LARGEST_STEP * (1 + local.at.shape.abs())
    return step / float((step.abs() / most).max().clamp_min(1.0))


def covariance(
    local: Local, cloud: Cloud, rows: float, groups: Tensor | None, even: bool
) -> Tensor:
    """Return the covariance (q, q) of the estimates, infinite where the rows say nothing.

    Of `rows` that are independent and count alike, it is the inverse of Fisher's information. Otherwise
    it is that of estimating equations with a term for each row or group, which holds whatever the rows'
    density is (White, Maximum likelihood estimation of misspecified models, 1982); it is infinite if
    there are no more groups than parameters.
    """
    information = local.information(cloud)
    sharp = float(local.at.shape.abs().max()) > MOST_TOLD
    if local.form.about in ("angles", "directions") and sharp:
        shapes = slice(len(local.planes), None)
        information[shapes] = information[:, shapes] = 0.0
    scale = information.diagonal().clamp_min(1e-300).rsqrt()
    values, axes = linalg.eigh(information * scale[:, None] * scale)
    none = values < SINGULAR**0.5
    inverse = (axes / torch.where(none, math.inf, values)) @ axes.mT * scale[:, None] * scale
    if even and groups is None:
        spread = inverse / rows
    else:
        terms = local.scores(cloud.vectors) * cloud.weights[:, None]
        if groups is not None:
            count = int(groups.max()) + 1
            if count <= terms.shape[1]:
                return torch.full_like(information, math.inf)
            terms = terms.new_zeros(count, terms.shape[1]).index_add(0, groups, terms)
            terms = terms * math.sqrt(count / (count - 1))
        spread = inverse @ (terms.mT @ terms) @ inverse
    unknown = (axes[:, none].abs() > 1e-6).any(dim=1)
    spread[unknown.nonzero(), unknown.nonzero()] = math.inf
    return spread
