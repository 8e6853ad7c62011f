"""Conditional kernel densities: each row of the data counts by how near its covariates are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import torch
from torch import Tensor

from orbiflow.density.models.conditional_parts import ConditionalPart, checked
from orbiflow.density.models.kernels import AdaptiveKernels, kernel_rows
from orbiflow.density.spaces import CHART, Space
from orbiflow.errors import OrbiflowError

KERNEL_SCALES = (1.0, 4.0, 16.0)
"""Each row has a kernel at each scale: concentrations are divided by it."""

MOST_ROWS = 20_000
"""The most rows that have kernels."""

BLOCK_ENTRIES = 2**21
"""Rows times kernels worked on at a time."""

LEAST_SHARE = 1e-9
"""Kernels that weigh less are left out where covariates are known."""

APART_LOG = -1e4
"""What a row has of kernels that are left out."""


class KnownRows(NamedTuple):
    """Rows that have kernels.

    - `points`: Their points (N, d). `weights`: Their weights (N,), None where all weigh the same.
    - `x`: Their features (N, m). `number`: The number (m,) of the covariate of each feature.
    """

    points: Tensor
    weights: Tensor | None
    x: Tensor
    number: Tensor


class ConditionalKernels(ConditionalPart):
    """Sum of K(x, x_i) k(y, y_i) over sum of K(x, x_i), over rows i (Hall, Racine and Li, 2004).

    K is a product of one kernel for each covariate: normal in a real column's feature, von Mises in a
    cyclic one, and the same constant for all words but the row's own. What does not matter gets a wide
    kernel, and drops out. k is the space's kernel at `KERNEL_SCALES`.

    Args:
        space: Any space.
        rows: The rows with kernels.
        widths: The widths (c,) of covariates.
        concentrations: Those of the space's kernels (w,).
        shares: Those of the scales (L,), of sum 1.
    """

    kind = "kernels"
    stored = ("points", "weights", "x", "widths", "concentrations", "shares")

    def __init__(
        self, space: Space, rows: KnownRows, widths: Tensor, concentrations: Tensor, shares: Tensor
    ) -> None:
        self.space = space
        self.points, self.weights, self.x, self.number = rows
        self.widths, self.concentrations, self.shares = widths, concentrations, shares

    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        size = max(1, BLOCK_ENTRIES // len(self.points))
        blocks = zip(torch.split(points, size), torch.split(x, size), strict=True)
        logs = [self.logs(part, features) for part, features in blocks]
        return torch.cat(logs) + self.space.log_kernel_factor(points, CHART)

    def logs(self, points: Tensor, x: Tensor, apart: Tensor | None = None) -> Tensor:
        """Return log densities (M,) as kernels have them, at points (M, d) and features (M, m).

        Kernels that a mask `apart` (M, N) says are left out.
        """
        near = self._near(x)
        if apart is not None:
            near = near.masked_fill(apart, APART_LOG)
        centers = self.space.features(self.points, slice(1))[0]
        logs: list[Tensor] = []
        for scale, share in zip(KERNEL_SCALES, self.shares.log(), strict=True):
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
        first, other = x / width, self.x / width
        near = (
            first @ other.mT
            - other.square().sum(dim=1) / 2
            - first.square().sum(dim=1)[:, None] / 2
        )
        return near if self.weights is None else near + self.weights.log()

    @torch.no_grad()
    def at(self, x: Tensor) -> AdaptiveKernels:
        weights = torch.softmax(self._near(x[None])[0], dim=0)
        near = weights >= LEAST_SHARE * weights.max()
        weights = weights[near] / weights[near].sum()
        scales = torch.tensor(KERNEL_SCALES, dtype=torch.float64)
        kappa = self.concentrations / scales[:, None]
        return AdaptiveKernels(
            self.space,
            self.points[near].repeat(len(KERNEL_SCALES), 1),
            kappa.repeat_interleave(len(weights), dim=0),
            (self.shares[:, None] * weights).flatten(),
        )

    def with_rows(self, points: Tensor, weights: Tensor | None, x: Tensor) -> ConditionalKernels:
        """Return kernels of the same widths at other rows."""
        weights = None if weights is None else weights[:MOST_ROWS]
        rows = KnownRows(points[:MOST_ROWS], weights, x[:MOST_ROWS], self.number)
        return ConditionalKernels(self.space, rows, self.widths, self.concentrations, self.shares)

    def header(self) -> dict[str, Any]:
        return {"scales": list(KERNEL_SCALES)}

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        count = len(tensors["points"])
        shapes = {
            "points": (count, space.chart_dim), "x": (count, len(number)),
            "widths": (int(number.max()) + 1,), "concentrations": (len(space.spheres),),
            "shares": (len(KERNEL_SCALES),),
        }  # fmt: skip
        shapes |= {"weights": (count,)} if "weights" in tensors else {}
        points, x, *others = checked(tensors, shapes, "conditional kernels")
        if (
            not 1 <= count <= MOST_ROWS
            or not all(bool((tensor > 0).all()) for tensor in others)
            or abs(float(others[2].sum()) - 1) > 1e-6
            or header.get("scales") != list(KERNEL_SCALES)
        ):
            raise OrbiflowError("conditional kernels of other shapes or values")
        rows = KnownRows(points, tensors.get("weights"), x, number)
        return cls(space, rows, *others[:3])
