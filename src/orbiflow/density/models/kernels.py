"""Kernels whose width follows the data: a base distribution for sharp, clustered points."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.arguments import float_tensor
from orbiflow.density.models.bases import Base
from orbiflow.density.models.near_sums import TOLERANCE, near_log_sum
from orbiflow.density.models.terms import Terms
from orbiflow.density.spaces import (
    RoundSpace,
    Space,
    rectangle,
)
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import special


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
        images = space.features(self.centers)
        self._center_features = images[0]
        self._terms = _terms(space, images, self.concentrations, self.weights)

    def log_prob(self, points: Tensor) -> Tensor:
        values = self.log_density(points)
        return values + self.space.log_area(points) if self.space.is_round else values

    def log_density(
        self, points: Tensor, beside: float = -math.inf, tolerance: float = TOLERANCE
    ) -> Tensor:
        """As `log_prob`, but on round spaces with respect to the round area: (...,) at points (..., d).

        Args:
            beside: logarithm of a constant density that will be added.
            tolerance: of the sum of both, what far kernels that are left out may add, and smooth ones
                that are interpolated may be off, at most each.
        """
        flat = points.reshape(-1, self.space.dim).double()
        features = self.space.features(flat)[0].mT
        if features.device.type == "cpu":
            values = near_log_sum(self._terms, features.contiguous(), beside, tolerance)
        else:
            values = self._terms.plain_log_sum(features)
        return values.reshape(points.shape[:-1]).to(points.dtype)

    def parted(self, wide: Tensor) -> tuple[AdaptiveKernels | None, AdaptiveKernels | None, float]:
        """Those of a mask (N,) and the others, each with weights of sum 1, and the former's weight."""
        weight = float(self.weights[wide].sum())
        found = [
            AdaptiveKernels(
                self.space, self.centers[w], self.concentrations[w], self.weights[w] / share
            )
            if share > 0
            else None
            for w, share in ((wide, weight), (~wide, float(self.weights[~wide].sum())))
        ]
        return found[0], found[1], weight

    def sample(self, count: int, generator: torch.Generator) -> Tensor:
        seed = int(torch.randint(2**31, (), generator=generator))
        rng = np.random.default_rng(seed)
        weights = self.weights.cpu().numpy()
        chosen = rng.choice(len(weights), count, p=weights / weights.sum())
        kappa = self.concentrations.cpu().numpy()[chosen]
        if self.space.is_round:
            centers = self._center_features.cpu().numpy()[chosen]
            vectors = _von_mises_fisher(centers, kappa[:, 0], rng)
            return cast(RoundSpace, self.space).vectors_to_chart(vectors)
        angle = torch.tensor(rng.vonmises(0.0, kappa))
        return self.space.project(
            self.centers.cpu()[chosen] + angle / (2 * math.pi) * rectangle(self.space)
        )


def _terms(space: Space, images: Tensor, kappa: Tensor, weights: Tensor) -> Terms:
    """Kernels about all images (E, N, m) of their centers: then points need no images."""
    if space.is_round:
        every = kappa.mT.repeat(1, len(images))
        peaks = _round_peaks(kappa[:, 0])
    else:
        # the lattice's rectangle leaves signed permutations of the axes
        turns = [torch.as_tensor(np.abs(g.linear)).to(kappa) for g in space.group.cosets]
        every = torch.cat([turn @ kappa.mT for turn in turns], dim=1)
        peaks = -(special.i0e(kappa) * rectangle(space).to(kappa)).log().sum(dim=1)
    centers = images.flatten(0, 1).mT.contiguous()
    return Terms(centers, every, (peaks + weights.log()).repeat(len(images)))


def _round_peaks(kappa: Tensor) -> Tensor:
    """Logarithms of the largest values of von Mises-Fisher kernels, per round area."""
    return (kappa / (2 * math.pi)).log() - (-torch.expm1(-2 * kappa)).log()


def kernel_rows(space: Space, centers: Tensor, kappa: Tensor) -> tuple[Tensor, Tensor]:
    """Log kernels as linear functions of the space's `features`: rows (N, m) and offsets (N,).

    With respect to the chart's area on flat spaces and to the round area on round ones.
    """
    if space.is_round:
        k = kappa[:, 0]
        return kappa * centers, _round_peaks(k) - k
    scaled = special.i0e(kappa) * rectangle(space).to(kappa)
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
