"""Kernel densities on the Klein bottle and the projective plane: kernels summed over the group."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from density_kde import Data, with_floor
from scipy.special import ive

from orbiflow.density import to_vectors
from orbiflow.density.models import log_sum_exp
from orbiflow.density.models.terms import BLOCK_ENTRIES

CONCENTRATIONS = np.geomspace(2.0, 2e4, 9)
FINER = (1.78, 1.33)
"""Factors to both sides of the best concentration, in turn."""
RATIOS = (4.0, 2.0)
"""Factors to both sides of the best ratio of the two concentrations, in turn."""
SHARES = (0.0, 1e-4, 1e-3, 3e-3, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3)


class Kernel(NamedTuple):
    """Concentrations of the kernel, one an angle, or one for all directions; and the uniform share."""

    concentrations: tuple[float, ...]
    share: float


class UnorientedKernelDensity:
    """(1 - share) mean of kernels + share / area, invariant under the identification.

    Klein bottle: von Mises product kernels at theta, phi and at theta + pi, pi - phi. Projective
    plane: von Mises-Fisher kernels at both ends of each axis. Every kernel integrates to 1 over the
    double cover, so the sum over the two images does over the surface.

    Args:
        train: (N, 2) theta, phi in radians, or lat, lon in degrees.
        kernel: its widths and the uniform share.
        axes: whether the data are axes.
    """

    def __init__(self, train: Data, kernel: Kernel, *, axes: bool) -> None:
        self.axes, self.kernel, self.count = axes, kernel, len(train)
        self.area = 2 * math.pi if axes else 2 * math.pi**2
        if axes:
            vectors = to_vectors(train)
            self.points = self._scaled(np.concatenate([vectors, -vectors]))
        else:
            image = np.stack([train[:, 0] + math.pi, math.pi - train[:, 1]], axis=1)
            self.points = self._scaled(_circles(np.concatenate([train, image])))

    def kernels(self, data: Data) -> Data:
        """Log of the mean of kernels (N,), without the uniform share."""
        queries = self._scaled(to_vectors(data) if self.axes else _circles(data))
        most = sum(self.kernel.concentrations)
        shift = torch.tensor(-most, dtype=torch.float64)
        parts = [
            log_sum_exp(torch.addmm(shift, block, self.points.mT))
            for block in queries.split(max(1, BLOCK_ENTRIES // len(self.points)))
        ]
        return torch.cat(parts).numpy() - math.log(self.count) - self._log_normal()

    def score_samples(self, data: Data) -> Data:
        """Log densities (N,), per radian^2 or steradian."""
        return with_floor(self.kernels(data), self.kernel.share, self.area)

    def _scaled(self, embedded: Data) -> torch.Tensor:
        # a product of two scaled embeddings is the kernel's exponent
        scale = np.sqrt(self.kernel.concentrations)
        return torch.tensor(embedded * (scale if self.axes else np.tile(scale, 2)))

    def _log_normal(self) -> float:
        if self.axes:
            (kappa,) = self.kernel.concentrations
            return math.log(2 * math.pi / kappa) + math.log1p(-math.exp(-2 * kappa))
        return sum(math.log(2 * math.pi * float(ive(0, k))) for k in self.kernel.concentrations)


def tuned(train: Data, held: Data, *, axes: bool) -> UnorientedKernelDensity:
    """The kernel that suits the held-out data best: coordinate search, the share best for each.

    One concentration on a coarse grid, then finer; on the Klein bottle then the ratio of the two
    concentrations at the same product.
    """
    seen: dict[tuple[float, ...], tuple[float, UnorientedKernelDensity]] = {}

    def score(concentrations: tuple[float, ...]) -> float:
        if concentrations not in seen:
            model = UnorientedKernelDensity(train, Kernel(concentrations, 0.0), axes=axes)
            log = model.kernels(held)
            scores = [float(with_floor(log, share, model.area).mean()) for share in SHARES]
            top = int(np.argmax(scores))
            model.kernel = Kernel(concentrations, SHARES[top])
            seen[concentrations] = scores[top], model
        return seen[concentrations][0]

    width = 1 if axes else 2
    best = max(((float(k),) * width for k in CONCENTRATIONS), key=score)
    for factor in FINER:
        best = max((tuple(k * f for k in best) for f in (1 / factor, 1.0, factor)), key=score)
    if not axes:
        for factor in RATIOS:
            roots = [f**0.5 for f in (1 / factor, 1.0, factor)]
            best = max(((best[0] * r, best[1] / r) for r in roots), key=score)
    return seen[best][1]


def _circles(angles: Data) -> Data:
    return np.concatenate([np.cos(angles), np.sin(angles)], axis=1)
