"""Columns that number the rows and measure nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NAMES = frozenset({"", "#", "id", "idx", "index", "key", "no", "no.", "nr", "number", "row"})
"""Of columns that may hold any different whole numbers."""


def is_identifier(name: str, values: NDArray[np.float64]) -> bool:
    """Whether a column (N,) counts the rows, or is named so and has a whole number for each.

    >>> is_identifier("phi", np.arange(5.0)), is_identifier("phi", np.array([1.0, 1.0, 2.0]))
    (True, False)
    """
    if len(values) < 3 or not bool((values == np.round(values)).all()):
        return False
    if bool((np.diff(values) == 1).all()):
        return True
    word = name.strip().casefold()
    named = word in NAMES or word.endswith(("_id", " id"))
    return named and len(np.unique(values)) == len(values)
