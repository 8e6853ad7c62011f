"""Data as tables of finite numbers of the columns that a space takes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.density.data import as_data
from orbiflow.errors import OrbiflowError


def row_count(count: int) -> str:
    """Return how many rows are as wrong as the one that a message names, if there are others.

    >>> row_count(1), row_count(3)
    ('', ' (3 such rows)')
    """
    return f" ({count} such rows)" if count > 1 else ""


def checked_table(data: ArrayLike, widths: tuple[int, ...], what: str) -> Array:
    """Return data as a finite float64 array (N, k)."""
    table = as_data(data, what).values
    if table.ndim != 2 or table.shape[1] not in widths:
        expected = " or ".join(f"(N, {k})" for k in widths)
        raise OrbiflowError(f"{what}: expected an array {expected}, got shape {table.shape}")
    bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(bad):
        raise OrbiflowError(
            f"{what}: row {bad[0] + 1} has a missing or infinite value{row_count(len(bad))}: remove "
            f"{'it' if len(bad) == 1 else 'them'} first"
        )
    return table
