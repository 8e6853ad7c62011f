"""Rows with weights, of which some belong together, and how sure a direction estimated from them is.

Errors count rows, or groups where there are any: rows of one group are not independent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from orbiflow.arrays import Array
from orbiflow.density.data import as_numbers, group_numbers
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_number

CLOSEST = 1e-9
"""Difference of the two largest eigenvalues up to which axes have no principal one."""


@dataclass(frozen=True, eq=False)
class WeighedRows:
    """Weights (n,) of sum 1, and the number of each row's group (n,), None if all are independent.

    - `even`: Whether all rows count the same. `level`: The level of intervals.
    """

    weights: Array
    groups: NDArray[np.int64] | None
    even: bool
    level: float

    def mean(self, values: Array) -> Array:
        return self.weights @ values

    def sums(self, values: Array) -> Array:
        """Return weighted sums (G, q) of values (n, q) over what is independent."""
        weighted = self.weights[:, None] * values
        if self.groups is None:
            return weighted
        sums = np.zeros((int(self.groups.max()) + 1, values.shape[1]))
        np.add.at(sums, self.groups, weighted)
        return sums

    @property
    def units(self) -> int:
        """The number of rows or groups."""
        return len(self.weights) if self.groups is None else int(self.groups.max()) + 1

    @property
    def alike(self) -> bool:
        """Whether rows are independent and count the same."""
        return self.groups is None and self.even


def chosen_rows(
    values: Array, weights: ArrayLike | None, groups: ArrayLike | None, level: float
) -> tuple[Array, WeighedRows]:
    """Return the rows that have all values and a weight."""
    whole = np.isfinite(values).all(axis=1)
    counts = np.ones(len(values)) if weights is None else as_numbers(weights, "weights")
    if counts.shape != whole.shape or not (np.isfinite(counts).all() and (counts >= 0).all()):
        raise OrbiflowError(f"weights must be {len(values)} numbers, none below 0")
    whole &= counts > 0
    if not whole.any():
        raise OrbiflowError("there is no row with a value and a weight")
    kept, numbers = counts[whole], None
    if groups is not None:
        numbers = group_numbers(group_numbers(groups, len(values))[whole], len(kept))
    even = bool((kept == kept[0]).all())
    level = as_number(level, "level", 0.5, 0.999)
    return values[whole], WeighedRows(kept / kept.sum(), numbers, even, level)


def tail(of: Any, *arguments: float) -> float:
    """Return a value of a distribution, from a function of SciPy's."""
    return float(of(*arguments))


def half_angle(errors: Array, rows: WeighedRows) -> float | None:
    """Return the half angle in radians of a cone that holds the true direction, None if none does.

    `errors` (n, p) are each row's part in the error of the estimate, across it: their linearised sum
    is the error. For independent rows these are Fisher (1993), equation 4.22, and Fisher, Lewis and
    Embleton (1987), section 5.3.1; for groups the sums over a group take the place of rows.
    """
    free, units = errors.shape[1] - 1, rows.units
    variance = float((rows.sums(errors) ** 2).sum()) / free
    if units < 2:
        return None
    if rows.groups is None:
        quantile = tail(special.chdtri, free, 1 - rows.level)
    else:
        variance *= units / (units - 1)
        quantile = free * tail(special.fdtri, free, units - 1, rows.level)
    sine = math.sqrt(quantile * variance)
    return math.asin(sine) if sine < 1 else None


def principal_axes(vectors: Array, rows: WeighedRows) -> tuple[Array, Array, float | None]:
    """Return the eigenvalues (p,) of the mean square of unit vectors (n, p), and their axes as rows.

    The largest comes first. Last comes the half angle in radians of a cone that holds the true first
    axis (Fisher, Lewis and Embleton, 1987, section 6.3.1), None if none does.
    """
    tensor = np.einsum("n,ni,nj->ij", rows.weights, vectors, vectors)
    values, axes = np.linalg.eigh(tensor)
    values, axes = np.clip(values[::-1], 0.0, 1.0), axes.T[::-1]
    along, gaps = vectors @ axes.T, values[0] - values[1:]
    if gaps[0] <= CLOSEST:
        return values, axes, None
    errors = np.zeros_like(along)
    errors[:, 1:] = along[:, :1] * along[:, 1:] / gaps
    return values, axes, half_angle(errors, rows)
