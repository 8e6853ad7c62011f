"""The scaling of parameters that makes descent in them Sobolev descent."""

from __future__ import annotations

import numpy as np

from orbiflow.fields.invariants import InvariantBasis
from orbiflow.symmetry import CrystallographicGroup


def sobolev_weights(
    group: CrystallographicGroup, basis: InvariantBasis, smoothness: float
) -> np.ndarray:
    """(P,) factors (1 + |kappa|^2 vol^(2/d))^(-smoothness / 2), free of the unit of length."""
    size = group.cell_volume ** (1 / group.dim)
    return (1.0 + (basis.magnitude * size) ** 2) ** (-smoothness / 2)
