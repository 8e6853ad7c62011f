"""Random states as scikit-learn has them, turned into seeds."""

from __future__ import annotations

import numbers
from typing import TypeAlias

import numpy as np

from orbiflow.errors import OrbiflowError

RandomState: TypeAlias = int | np.integer | np.random.RandomState | np.random.Generator | None
"""As scikit-learn has it, and NumPy's newer generators."""


def seed_of(random_state: RandomState) -> int:
    """A seed; None and generators give another one at every call.

    Raises:
        OrbiflowError: for another thing.
    """
    if random_state is None:
        return int(np.random.randint(2**31))  # noqa: NPY002  scikit-learn's convention
    if isinstance(random_state, np.random.RandomState):
        return int(random_state.randint(2**31))
    if isinstance(random_state, np.random.Generator):
        return int(random_state.integers(2**31))
    if not isinstance(random_state, bool) and isinstance(random_state, numbers.Integral):
        return int(random_state) % 2**63
    raise OrbiflowError(
        "random_state must be None, an integer, a NumPy RandomState or Generator, got "
        f"{random_state!r}"
    )
