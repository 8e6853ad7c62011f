"""Neural vector fields on a periodic space."""

from __future__ import annotations

import itertools
import math

import numpy as np
import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields.symmetrization import Symmetrized
from orbiflow.symmetry import CrystallographicGroup, checked_group
from orbiflow.typed_torch import random


class PeriodicFeatures(nn.Module):
    """Periodic features of points (..., d): cosines and sines of low frequencies, (..., 2 M).

    Args:
        group: The group whose lattice is the period.
        max_frequency: The largest frequency. If d <= 3, all k in [-max, max]^d are taken up to sign,
            without 0; in higher dimensions only the multiples 1..max of each axis.

    Raises:
        OrbiflowError: if `max_frequency` < 1 or `group` is no group.
    """

    frequencies: Tensor

    def __init__(self, group: CrystallographicGroup, max_frequency: int = 1) -> None:
        super().__init__()
        if max_frequency < 1:
            raise OrbiflowError(f"max_frequency must be at least 1, got {max_frequency}")
        d = checked_group(group).dim
        if d <= 3:
            box = itertools.product(range(-max_frequency, max_frequency + 1), repeat=d)
            k = np.array([v for v in box if v > (0,) * d], dtype=np.float64)
        else:
            k = np.concatenate([m * np.eye(d) for m in range(1, max_frequency + 1)])
        with torch.inference_mode(False):  # otherwise it could never be differentiated
            waves = torch.tensor(k @ group.inverse_lattice)
        self.group, self.max_frequency = group, max_frequency
        self.register_buffer("frequencies", waves, persistent=False)

    @property
    def size(self) -> int:
        """Number of features 2 M."""
        return 2 * self.frequencies.shape[0]

    def forward(self, points: Tensor) -> Tensor:
        """Return features of shape (..., 2 M)."""
        phase = 2.0 * math.pi * points @ self.frequencies.to(points).mT
        return torch.cat([phase.cos(), phase.sin()], dim=-1)


@torch.inference_mode(False)  # its divergence is taken by autograd
def neural_field(
    group: CrystallographicGroup,
    *,
    hidden: tuple[int, ...] = (64, 64),
    max_frequency: int = 1,
    seed: int = 0,
    dtype: torch.dtype = torch.float64,
) -> Symmetrized:
    """Return a multilayer perceptron on periodic features, symmetrized over `group`.

    The last layer starts at zero, so the flow starts at the identity. The same seed gives the same
    weights; the global random state does not change.
    """
    features = PeriodicFeatures(group, max_frequency)
    sizes = (features.size, *hidden, group.dim)
    layers: list[nn.Module] = [features]
    with random.fork_rng(devices=[]):
        random.manual_seed(seed)
        for i, (a, b) in enumerate(itertools.pairwise(sizes)):
            layers.append(nn.Linear(a, b, dtype=dtype))
            if i < len(sizes) - 2:
                layers.append(nn.Tanh())
    last = layers[-1]
    assert isinstance(last, nn.Linear)  # by construction
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return Symmetrized(nn.Sequential(*layers), group, periodic=True)
