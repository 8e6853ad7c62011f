"""Kernel density estimates with von Mises and von Mises-Fisher kernels, for comparison."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import ive

from orbiflow.density import to_vectors
from orbiflow.density.models import log_sum_exp
from orbiflow.density.models.terms import BLOCK_ENTRIES

Data = NDArray[np.float64]
WIDTHS = np.geomspace(2.0, 1e7, 48)
FLOORS = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1)


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
        return torch.tensor(np.concatenate([np.cos(data), np.sin(data)], axis=1))

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
