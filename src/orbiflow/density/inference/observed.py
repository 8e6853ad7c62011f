"""Log densities of rows that lack some of a torus' angles."""

from __future__ import annotations

from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arguments import as_instance, as_tensor
from orbiflow.density.inference.angles import check_torus
from orbiflow.density.models import Density
from orbiflow.density.spaces import CHART, Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import listed, unique


def log_prob_observed(density: Density, points: Tensor, *, measure: str = CHART) -> Tensor:
    """Return log densities (N,) at points (N, d) of a torus some of whose angles are missing (NaN).

    The density of a row is that of the angles that it has, integrated over the others, with respect to
    `measure` of those. Of a row that has none its logarithm is 0.
    """
    space = check_torus(
        as_instance(density, Density, "density").space, "densities at missing angles"
    )
    return at_observed(density, observed_rows(points, "points", space), measure=measure)


def observed_rows(values: Any, name: str, space: Space) -> Tensor:
    """Return a float64 table of angles (N, d), some of which may be missing."""
    rows = as_tensor(values, name).double()
    if rows.dim() != 2 or rows.shape[1] != space.dim:
        raise OrbiflowError(f"expected {name} (N, {space.dim}), got {tuple(rows.shape)}")
    if bool(rows.isinf().any()):
        raise OrbiflowError("angles may be missing (NaN), but not infinite")
    return rows


@one_thread()
@torch.no_grad()
def at_observed(density: Density, points: Tensor, *, measure: str = CHART) -> Tensor:
    """Return what `log_prob_observed` does, at points (N, d) of any space if none lacks anything."""
    if not bool(points.isnan().any()):
        return density.log_prob(points, measure=measure)
    found = torch.zeros(len(points), dtype=torch.float64)
    patterns, number = unique(~points.isnan(), dim=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        observed: list[int] = listed(torch.nonzero(pattern)[:, 0])
        rows = torch.nonzero(number == k)[:, 0]
        if not observed:
            continue
        some = points[rows][:, observed]
        own = Torus(len(observed), unit=str(density.space.unit))
        whole = len(observed) == density.space.dim
        value = density.log_prob(some) if whole else density.log_marginal(some, observed)
        found[rows] = value + own.log_density_factor(some, measure)
    return found


def chart_of_observed(space: Space, data: ArrayLike) -> Tensor:
    """Return angles (N, k) in the space's unit, missing ones NaN, as points (N, k) of the torus."""
    torus = check_torus(space, "densities of rows that lack angles")
    values = observed_rows(data, "data", torus)
    return torus.project(torch.as_tensor(values / torus.period))


def chart_of_rows(space: Space, data: ArrayLike, *, may_lack: bool) -> Tensor:
    """Return data (N, k) of any space as points, with missing angles if they `may_lack` some."""
    return chart_of_observed(space, data) if may_lack else space.to_chart(data)
