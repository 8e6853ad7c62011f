"""Conditional kernel densities: each row of the data counts by how near its covariates are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import torch
from scipy import optimize
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.covariates.parts import (
    LEAST_LOG_KAPPA,
    MOST_LOG_KAPPA,
    Part,
    mean_cosines,
    on_chart,
)
from orbiflow.density.fitting import Rows
from orbiflow.density.models import AdaptiveKernels, kernel_rows
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError

SCALES = (1.0, 4.0, 16.0)
"""Each row has a kernel at each scale: concentrations are divided by it."""

MOST_ROWS = 20_000
"""The most rows that have kernels."""

ASKED, NEAR = 800, 5_000
"""Rows by whose densities the widths are chosen, and rows whose kernels these are of."""

MOST_STEPS = 60
"""Steps of L-BFGS for the widths."""

LEAST_LOG_WIDTH, MOST_LOG_WIDTH = math.log(0.01), math.log(30.0)
"""The widths of covariates in their features: beyond the largest a covariate has no effect."""

BLOCK_ENTRIES = 2**21
"""Rows times kernels worked on at a time."""

LEAST_SHARE = 1e-9
"""Kernels that weigh less are left out where covariates are known."""

OWN_LOG = -1e4
"""What a row has of the kernels of its own group when it is judged by the others."""


class ConditionalKernels(Part):
    """Sum of K(x, x_i) k(y, y_i) over sum of K(x, x_i), over rows i (Hall, Racine and Li, 2004).

    K is a product of one kernel for each covariate: normal in a real column's feature, von Mises in a
    cyclic one, and the same constant for all words but the row's own. What does not matter gets a wide
    kernel, and drops out. k is the space's kernel at `SCALES`.

    Args:
        space: Any space.
        rows: The rows' points (N, d), with their weights.
        x: Their features (N, m).
        number: The number (m,) of the covariate of each feature.
        widths: The widths (c,) of covariates.
        concentrations: Of the kernels (w,).
        shares: Those of the scales (L,), of sum 1.
    """

    kind = "kernels"

    def __init__(
        self,
        space: Space,
        rows: Rows,
        x: Tensor,
        number: Tensor,
        widths: Tensor,
        concentrations: Tensor,
        shares: Tensor,
    ) -> None:
        self.space, self.rows, self.x = space, rows, x
        self.number, self.widths = number, widths
        self.concentrations, self.shares = concentrations, shares

    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        size = max(1, BLOCK_ENTRIES // len(self.rows))
        blocks = zip(torch.split(points, size), torch.split(x, size), strict=True)
        logs = [self._logs(part, own) for part, own in blocks]
        return on_chart(self.space, points, torch.cat(logs))

    def _logs(self, points: Tensor, x: Tensor, own: Tensor | None = None) -> Tensor:
        """Return log densities (M,) as kernels have them, at points (M, d) and features (M, m).

        `own` (M,) are the numbers of the rows that these are: the kernels of their groups are left out.
        """
        near = self._near(x)
        if own is not None:
            group = self.rows.groups
            group = torch.arange(len(self.rows)) if group is None else group
            near = near.masked_fill(group[own, None] == group, OWN_LOG)
        centers = self.space.features(self.rows.points, slice(1))[0]
        logs: list[Tensor] = []
        for scale, share in zip(SCALES, self.shares.log(), strict=True):
            kappa = (self.concentrations / scale).expand(len(centers), -1)
            rows, offsets = kernel_rows(self.space, centers, kappa)
            logs += [
                (image @ rows.mT + (offsets + share) + near).logsumexp(dim=1)
                for image in self.space.features(points)
            ]
        return torch.stack(logs).logsumexp(dim=0) - near.logsumexp(dim=1)

    def _near(self, x: Tensor) -> Tensor:
        """Return the logarithms (M, N) of how much rows count where features are x (M, m)."""
        width = self.widths[self.number]
        one, other = x / width, self.x / width
        near = one @ other.mT - other.square().sum(dim=1) / 2 - one.square().sum(dim=1)[:, None] / 2
        return near if self.rows.weights is None else near + self.rows.weights.log()

    @torch.no_grad()
    def at(self, x: Tensor) -> AdaptiveKernels:
        weights = torch.softmax(self._near(x[None])[0], dim=0)
        kept = weights >= LEAST_SHARE * weights.max()
        weights = weights[kept] / weights[kept].sum()
        scales = torch.tensor(SCALES, dtype=torch.float64)
        kappa = self.concentrations / scales[:, None]
        return AdaptiveKernels(
            self.space,
            self.rows.points[kept].repeat(len(SCALES), 1),
            kappa.repeat_interleave(len(weights), dim=0),
            (self.shares[:, None] * weights).flatten(),
        )

    @torch.no_grad()
    def mean_features(self, x: Tensor) -> Tensor:
        scales = torch.tensor(SCALES, dtype=torch.float64)[:, None]
        length = self.shares @ mean_cosines(self.concentrations / scales)
        weights = torch.softmax(self._near(x), dim=1)
        return weights @ self.space.features(self.rows.points, slice(1))[0] * length.repeat(2)

    def with_rows(self, rows: Rows, x: Tensor) -> ConditionalKernels:
        """Return kernels of the same widths at other rows."""
        shape = (self.number, self.widths, self.concentrations, self.shares)
        return ConditionalKernels(self.space, rows[:MOST_ROWS], x[:MOST_ROWS], *shape)

    def header(self) -> dict[str, Any]:
        return {"scales": list(SCALES)}

    def tensors(self) -> dict[str, Tensor]:
        names = ("x", "widths", "concentrations", "shares")
        found = {name: getattr(self, name) for name in names} | {"points": self.rows.points}
        return found if self.rows.weights is None else {**found, "weights": self.rows.weights}

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        points, x, widths, kappa, shares = (
            tensors[name] for name in ("points", "x", "widths", "concentrations", "shares")
        )
        weights, count = tensors.get("weights"), len(points)
        wanted = ((count, space.chart_dim), (count, len(number)), (int(number.max()) + 1,))
        wanted = (*wanted, (len(space.spheres),), (len(SCALES),))
        given = (points, x, widths, kappa, shares)
        whole = [*given, *(() if weights is None else (weights,))]
        if (
            [tuple(own.shape) for own in given] != list(wanted)
            or not 1 <= count <= MOST_ROWS
            or (weights is not None and tuple(weights.shape) != (count,))
            or not all(own.dtype == torch.float64 and bool(own.isfinite().all()) for own in whole)
            or not all(bool((own > 0).all()) for own in (widths, kappa, shares, *whole[5:]))
            or abs(float(shares.sum()) - 1) > 1e-6
            or header.get("scales") != list(SCALES)
        ):
            raise OrbiflowError("conditional kernels of other shapes or values")
        return cls(space, Rows(points, weights), x, number, widths, kappa, shares)


def fit_kernels(space: Space, rows: Rows, x: Tensor, number: Tensor) -> ConditionalKernels:
    """Fit kernels to points and features (N, m), in random order.

    The widths make `ASKED` rows likeliest by the kernels of the others, of groups by those of others.
    """
    some, near = rows[:NEAR], x[:NEAR]
    asked = torch.arange(min(ASKED, len(some)))
    count, width = int(number.max()) + 1, len(space.spheres)
    weights = None if some.weights is None else some.weights[asked]

    def made(values: Tensor) -> ConditionalKernels:
        widths, kappa, shares = values.split([count, width, len(SCALES)])
        return ConditionalKernels(
            space, some, near, number, widths.exp(), kappa.exp(), torch.softmax(shares, 0)
        )

    def loss(values: Array) -> tuple[float, Array]:
        own = torch.tensor(values, requires_grad=True)
        logs = made(own)._logs(some.points[asked], near[asked], asked)
        mean = logs.mean() if weights is None else weights @ logs / weights.sum()
        (gradient,) = torch.autograd.grad(-mean, own)
        return -float(mean.detach()), gradient.numpy()

    start = [*[math.log(0.5)] * count, *[math.log(20.0)] * width, 0.5, 0.0, -0.5]
    bounds = [
        *[(LEAST_LOG_WIDTH, MOST_LOG_WIDTH)] * count,
        *[(LEAST_LOG_KAPPA, MOST_LOG_KAPPA)] * width,
        *[(-6.0, 6.0)] * len(SCALES),
    ]
    found = optimize.minimize(
        loss, np.array(start), jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxiter": MOST_STEPS},
    )  # fmt: skip
    best = made(torch.tensor(found.x))
    return best.with_rows(rows, x)
