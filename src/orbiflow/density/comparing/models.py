"""Comparing fitted densities at data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike

from orbiflow.arguments import is_a
from orbiflow.density.arguments import check_kind
from orbiflow.density.comparing.paired import LEVEL, RESAMPLES, ModelComparison, compare_scores
from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.models.symmetric import SymmetricDensity
from orbiflow.density.spaces.space import Space
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.isometry import Array

BLOCK = 65_536
"""Rows scored between two looks at whether to stop."""


def compare_models(
    models: Mapping[str, SymmetricDensity | DensityEstimator],
    data: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
    seed: int = 0,
) -> ModelComparison:
    """Which of several densities suits held-out data (N, k) best; see `compare_scores`.

    Args:
        models: by their names, all of one space and unit.
        data: rows that none of them was fitted to, in the space's own units.

    Raises:
        OrbiflowError: for models of different spaces or units, or data that are not of the space; and
            as `compare_scores`.
    """
    if not is_a(models, Mapping) or len(models) < 2:
        raise OrbiflowError("give two models or more, by their names")
    densities = {name: density_of(model, name) for name, model in models.items()}
    require_one_space({name: density.space for name, density in densities.items()})
    scores = {name: scores_of(density, data) for name, density in densities.items()}
    return compare_scores(scores, groups=groups, resamples=resamples, level=level, seed=seed)


def density_of(
    model: SymmetricDensity | DensityEstimator, name: str = "the model"
) -> SymmetricDensity:
    """The density of a fitted estimator, or itself.

    Raises:
        OrbiflowError: for another thing, or an estimator that is not fitted.
    """
    if isinstance(model, DensityEstimator):
        density = getattr(model, "density_", None)
        if density is None:
            raise OrbiflowError(f"{name} is not fitted yet: call fit first")
        return density
    return check_kind(model, SymmetricDensity, name, "or a fitted DensityEstimator")


def require_one_space(spaces: Mapping[str, Space]) -> None:
    """
    Raises:
        OrbiflowError: unless log densities on all of them are with respect to one measure.
    """
    (first, one), *others = spaces.items()
    for name, other in others:
        if (one.name, one.dim) != (other.name, other.dim):
            raise OrbiflowError(
                f"{first} is on the {_said(one)}, {name} on the {_said(other)}: their densities "
                "have no common measure; compare models of one space"
            )
        if one.unit != other.unit:
            raise OrbiflowError(
                f"{first} has angles in {one.unit}, {name} in {other.unit}: their densities are per "
                "other units; fit both with one --unit"
            )


def scores_of(
    density: SymmetricDensity, data: ArrayLike, told: Callable[[float], None] = lambda _: None
) -> Array:
    """Log densities (N,) at data (N, k), in natural measure; `told` the share of rows done."""
    points = density.space.to_chart(data)
    found: list[Sequence[float] | np.ndarray] = []
    with torch.no_grad():
        for start in range(0, len(points), BLOCK):
            told(start / len(points))
            found.append(density.log_prob(points[start : start + BLOCK], measure="natural").numpy())
    return np.concatenate(found) if found else np.zeros(0)


def _said(space: Space) -> str:
    return f"torus of {space.dim} angles" if space.is_torus else space.name
