"""Seeds, as scikit-learn has them, and NumPy's newer generators."""

from __future__ import annotations

import numbers
from typing import TypeAlias

import numpy as np

from orbiflow.settings import refusal

RandomState: TypeAlias = int | np.integer | np.random.RandomState | np.random.Generator | None
"""As scikit-learn has it, and NumPy's newer generators."""


def seed_of(random_state: RandomState) -> int:
    """A seed; None and generators give another one at every call."""
    if random_state is None:
        return int(np.random.randint(2**31))  # noqa: NPY002  scikit-learn's convention
    if isinstance(random_state, np.random.RandomState):
        return int(random_state.randint(2**31))
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(2**31))
    if not isinstance(random_state, bool) and isinstance(random_state, numbers.Integral):
        return int(random_state) % 2**63
    wanted = "None, an integer, or a NumPy RandomState or Generator"
    raise refusal("random_state", wanted, random_state)
