"""Kernel estimates to compare with: von Mises and von Mises-Fisher, on quotients over all images."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import ive

from orbiflow.density import to_vectors
from orbiflow.density.models import log_sum_exp
from orbiflow.density.models.sums import BLOCK_ENTRIES

Data = NDArray[np.float64]
WIDTHS = np.geomspace(2.0, 1e7, 48)
FLOORS = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1)

CONCENTRATIONS = np.geomspace(2.0, 2e4, 9)
FINER = (1.78, 1.33)
"""Factors to both sides of the best concentration, in turn."""
RATIOS = (4.0, 2.0)
"""Factors to both sides of the best ratio of the two concentrations, in turn."""
SHARES = (0.0, 1e-4, 1e-3, 3e-3, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3)


class KernelDensity:
    """Mean of von Mises product kernels (angles in radians) or von Mises-Fisher kernels (lat, lon).

    Args:
        train: (N, d) angles, or (N, 2) latitude and longitude in degrees.
        concentration: kappa of the kernels.
        round_: whether the data are directions.
        floor: share of the uniform density, without which one lone point costs any number of nats.
    """

    def __init__(
        self, train: Data, concentration: float, *, round_: bool, floor: float = 0.0
    ) -> None:
        self.floor = floor
        self.round, self.kappa = round_, float(concentration)
        self.train = self._embed(train)
        if round_:
            k = self.kappa
            self.log_normal = math.log(2 * math.pi / k) + math.log1p(-math.exp(-2 * k))
        else:
            self.log_normal = train.shape[1] * math.log(2 * math.pi * float(ive(0, self.kappa)))

    def _embed(self, data: Data) -> torch.Tensor:
        if self.round:
            return torch.tensor(to_vectors(data))
        return torch.tensor(_circles(data))

    def score_samples(self, data: Data) -> Data:
        """Log densities (N,), per radian^d or steradian."""
        points = self._embed(data)
        axes = 1 if self.round else data.shape[1]
        parts = []
        # cosines of all pairs are dot products
        for block in points.split(max(1, BLOCK_ENTRIES // len(self.train))):
            table = torch.addmm(
                torch.tensor(-self.kappa * axes, dtype=torch.float64),
                block,
                self.train.mT,
                alpha=self.kappa,
            )
            parts.append(log_sum_exp(table))
        log_sum = torch.cat(parts).double().numpy()
        kernels = log_sum - math.log(len(self.train)) - self.log_normal
        return with_floor(kernels, self.floor, self.volume(data))

    def volume(self, data: Data) -> float:
        """Of the whole space."""
        return 4 * math.pi if self.round else (2 * math.pi) ** data.shape[1]

    @classmethod
    def tuned(cls, train: Data, validation: Data, *, round_: bool) -> KernelDensity:
        """The concentration and floor that suit (at most 2,000 of) the validation data best.

        Of `WIDTHS` every fourth is tried, then those about the best.
        """
        best, validation = (-math.inf, 1.0, 0.0), validation[:2000]

        def look(places: range) -> None:
            nonlocal best
            for kappa in WIDTHS[[k for k in places if 0 <= k < len(WIDTHS)]]:
                bare = cls(train, kappa, round_=round_)
                values, volume = bare.score_samples(validation), bare.volume(validation)
                for floor in FLOORS:
                    score = float(with_floor(values, floor, volume).mean())
                    best = max(best, (score, float(kappa), floor))

        look(range(0, len(WIDTHS), 4))
        at = int(abs(WIDTHS - best[1]).argmin())
        look(range(at - 3, at + 4))
        return cls(train, best[1], round_=round_, floor=best[2])


def with_floor(log_density: Data, floor: float, volume: float) -> Data:
    """Log of (1 - floor) density + floor / volume."""
    if floor == 0.0:
        return log_density
    return np.logaddexp(math.log1p(-floor) + log_density, math.log(floor / volume))


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
