"""Kernels whose width follows the data: a base distribution for sharp, clustered points."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.arguments import float_tensor
from orbiflow.density.models.bases import Base
from orbiflow.density.models.log_sum import log_sum_exp
from orbiflow.density.spaces.round import RoundSpace
from orbiflow.density.spaces.space import Space, rectangle
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array

BLOCK_ENTRIES = 250_000
"""Of the table of points against kernels worked on at a time: few enough for the cache."""


class AdaptiveKernels(Base):
    """A mixture of kernels made invariant under the space's group.

    Products of von Mises kernels in the angles of the lattice on torus and Klein bottle, summed over
    coset representatives; von Mises-Fisher kernels on sphere and projective plane, there summed over
    both ends of the axis.

    Args:
        space: any; with a rectangular lattice if it is flat.
        centers: (N, d) chart points.
        concentrations: kappa > 0, (N, d) on flat spaces and (N, 1) on round ones.
        weights: (N,) of sum 1.

    Raises:
        OrbiflowError: for wrong shapes or values.
    """

    def __init__(
        self, space: Space, centers: Tensor, concentrations: Tensor, weights: Tensor
    ) -> None:
        super().__init__(space)
        centers, concentrations, weights = (
            float_tensor(value, name)
            for name, value in (
                ("centers", centers),
                ("concentrations", concentrations),
                ("weights", weights),
            )
        )
        width = 1 if space.is_round else space.dim
        shapes = [tuple(t.shape) for t in (centers, concentrations, weights)]
        count = len(centers) if centers.dim() else 0
        if shapes != [(count, space.dim), (count, width), (count,)] or not count:
            raise OrbiflowError(f"kernels of shapes {shapes} do not fit a {space.name}")
        if not (
            bool(torch.isfinite(centers).all())
            and bool((concentrations > 0).all())
            and bool(torch.isfinite(concentrations).all())
            and bool((weights >= 0).all())
            and abs(float(weights.sum()) - 1) < 1e-6
        ):
            raise OrbiflowError("kernels need finite centers, positive widths, weights of sum 1")
        self.centers, self.concentrations, self.weights = (
            t.double() for t in (centers, concentrations, weights)
        )
        self._center_features = space.features(self.centers)[0]

    def log_prob(self, points: Tensor) -> Tensor:
        flat = points.reshape(-1, self.space.dim).double()
        rows, offsets = kernel_rows(self.space, self._center_features, self.concentrations)
        rows, offsets = rows.mT.contiguous(), offsets + self.weights.log()
        block = max(1, BLOCK_ENTRIES // len(self.centers))
        # features of all at once: block by block they would cost more than the kernels
        images = self.space.features(flat)
        parts = [_log_sum(part, rows, offsets) for part in images.split(block, dim=1)]
        values = torch.cat(parts)
        if self.space.is_round:
            values = values + self.space.log_area(flat)
        return values.reshape(points.shape[:-1]).to(points.dtype)

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        seed = int(torch.randint(2**31, (), generator=generator))
        rng = np.random.default_rng(seed)
        weights = self.weights.numpy()
        chosen = rng.choice(len(weights), count, p=weights / weights.sum())
        kappa = self.concentrations.numpy()[chosen]
        if self.space.is_round:
            vectors = _von_mises_fisher(self._center_features.numpy()[chosen], kappa[:, 0], rng)
            return cast(RoundSpace, self.space).vectors_to_chart(vectors)
        angle = torch.tensor(rng.vonmises(0.0, kappa))
        return self.space.project(
            self.centers[chosen] + angle / (2 * math.pi) * rectangle(self.space)
        )


def _log_sum(images: Tensor, rows: Tensor, offsets: Tensor) -> Tensor:
    """(N,) of features (E, N, m): over kernels and images."""
    sums = [log_sum_exp(torch.addmm(offsets, image, rows)) for image in images]
    return torch.stack(sums).logsumexp(dim=0)


def kernel_rows(space: Space, centers: Tensor, kappa: Tensor) -> tuple[Tensor, Tensor]:
    """Log kernels as linear functions of the space's `features`: rows (N, m) and offsets (N,).

    With respect to the chart's area on flat spaces and to the round area on round ones.
    """
    if space.is_round:
        k = kappa[:, 0]
        offsets = (k / (2 * math.pi)).log() - torch.log1p(-torch.exp(-2 * k)) - k
        return kappa * centers, offsets
    scaled = torch.special.i0e(kappa) * rectangle(space)
    return torch.cat([kappa, kappa], dim=1) * centers, -(scaled.log() + kappa).sum(dim=1)


def _von_mises_fisher(centers: Array, kappa: Array, rng: np.random.Generator) -> Array:
    """One draw (N, 3) about each of `centers` (Wood, 1994; closed form on the sphere)."""
    u = rng.uniform(size=len(centers))
    height = 1 + np.log(u + (1 - u) * np.exp(-2 * kappa)) / kappa
    across = rng.normal(size=centers.shape)
    across -= (across * centers).sum(axis=1, keepdims=True) * centers
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    vectors = height[:, None] * centers + np.sqrt(np.clip(1 - height**2, 0, 1))[:, None] * across
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
