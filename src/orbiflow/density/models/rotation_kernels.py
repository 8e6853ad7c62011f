"""Closed forms of von Mises-Fisher kernels on rotations: means over fibres, means of products."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from orbiflow.density.spaces import RotationSpace
from orbiflow.typed_torch import special

BLOCK_ENTRIES = 2**19
"""Entries of a table worked on at a time."""

LEAST_EXPONENT = -45.0
"""Exponent of what is left out: below 1e-19 of the kernel's largest value."""

MOST_PAIRS = 2**28
"""The most pairs of images of kernels whose products are summed one by one."""


class RotationKernels(NamedTuple):
    """Kernels on rotations: unit quaternions (K, 4), concentrations (K,) and weights (K,)."""

    space: RotationSpace
    centers: Tensor
    kappa: Tensor
    weights: Tensor

    def fibre_means(self, crystal: Tensor, specimen: Tensor) -> Tensor:
        """Return means (N,) over the rotations that take directions of the crystal to others (N, 3).

        They are in multiples of the uniform density. The quaternions of such rotations are a great
        circle, over which exp(kappa q . c) has the mean I_0(kappa rho). Here rho = cos(w / 2) is the
        largest q . c, and w the angle from where c takes the crystal's direction.
        """
        matrices = torch.tensor(Rotation.from_quat(self.centers.numpy()).as_matrix())
        flat = matrices.reshape(-1, 9).mT.contiguous()
        # one image of a kernel at its largest, in multiples of the uniform density
        peak = 2 * math.pi**2 * self._log_peaks().exp() * self.weights
        found = torch.zeros(len(specimen), dtype=torch.float64)
        step = max(1, BLOCK_ENTRIES // len(self.kappa))
        lefts, rights = self.space.specimen_rotations, self.space.crystal_rotations
        for there, left in zip(*_distinct(lefts, specimen), strict=True):
            for here, right in zip(*_distinct(rights, crystal), strict=True):
                # r . R h for all R is a product of two tables
                pairs = (there[:, :, None] * here[:, None, :]).reshape(-1, 9)
                parts = [self._means(part @ flat) @ peak for part in torch.split(pairs, step)]
                found += left * right * torch.cat(parts)
        return found

    def _means(self, cosines: Tensor) -> Tensor:
        """Return means (N, K) over circles, relative to the kernels' largest values."""
        radius = ((1 + cosines) / 2).clamp(0, 1).sqrt()
        exponent = self.kappa * (radius - 1)
        near = exponent > LEAST_EXPONENT
        found = torch.zeros_like(exponent)
        # Bessel functions are slow, and most kernels are far from most circles
        found[near] = exponent[near].exp() * special.i0e((self.kappa * radius)[near])
        return found

    def _log_peaks(self) -> Tensor:
        return _log_peaks(self.kappa)

    def mean_product(self, other: RotationKernels) -> float | None:
        """Return the mean of the product of two densities in multiples of the uniform one.

        It is under the uniform distribution. None if there are more than `MOST_PAIRS` pairs.
        The product of exp(a q . c) and exp(b q . d) is such a kernel again, whose concentration is the
        length of a c + b d.
        """
        images = self.space.features(other.centers)
        pairs = len(self.kappa) * images.shape[0] * images.shape[1]
        if pairs > MOST_PAIRS:
            return None
        total = 0.0
        logs = self._log_peaks() + self.weights.log(), other._log_peaks() + other.weights.log()
        step = max(1, BLOCK_ENTRIES // len(other.kappa))
        for image in images:
            for rows in torch.split(torch.arange(len(self.kappa)), step):
                a, b = self.kappa[rows, None], other.kappa
                apart = (2 - 2 * self.centers[rows] @ image.mT).clamp_min(0)
                length = ((a + b) ** 2 - a * b * apart).clamp_min(0).sqrt().clamp_min(1e-12)
                # what the product is below the product of both peaks: nothing cancels
                fall = a * b * apart / (a + b + length)
                exponent = logs[0][rows, None] + logs[1] - fall - _log_peaks(length)
                total += float(exponent.exp().sum())
        return self.space.volume * total


def _distinct(group: Rotation, directions: Tensor) -> tuple[Tensor, list[float]]:
    """Return different images (G, N, 3) of directions (N, 3) under a group, and the share of each."""
    images = np.stack([one.apply(directions.numpy()) for one in group])
    flat = images.reshape(len(images), -1).round(9)
    _, first, counts = np.unique(flat, axis=0, return_index=True, return_counts=True)
    return torch.tensor(images[first]), (counts / len(images)).tolist()


def _log_peaks(kappa: Tensor) -> Tensor:
    """Return logarithms of the largest values of kernels on the sphere of quaternions, per its area."""
    bessel = special.i1e(kappa)
    # I_1(k) / k is 1/2 where both are 0
    ratio = torch.where(kappa > 1e-6, bessel / kappa.clamp_min(1e-300), 0.5 * (-kappa).exp())
    return -(4 * math.pi**2 * ratio).log()
