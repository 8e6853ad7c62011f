"""Log densities of rows that lack some of their angles: of the others alone."""

from __future__ import annotations

import torch
from torch import Tensor

from orbiflow.density.arguments import check_kind, float_tensor
from orbiflow.density.inference.axes import check_torus
from orbiflow.density.inference.chains import chains_at
from orbiflow.density.inference.flows import flow_at, kernels_at
from orbiflow.density.inference.network import network_at
from orbiflow.density.models import (
    AdaptiveKernels,
    Base,
    BlendedDensity,
    SymmetricDensity,
    UniformBase,
    VonMisesChains,
    VonMisesNetwork,
)
from orbiflow.density.spaces import CHART, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread
from orbiflow.typed_torch import listed, unique

Part = Base | SymmetricDensity
"""What a density is made of."""


def parts_of(density: SymmetricDensity) -> list[tuple[float, Part]]:
    """A density's parts with a share, each with it; a flow alone is its only one."""
    if not isinstance(density, BlendedDensity):
        return [(1.0, density)]
    shares: list[float] = listed(density.shares)
    parts = zip(shares, density.parts.values(), strict=True)
    return [(share, part) for share, part in parts if share > 0]


def part_at(part: Part, points: Tensor, observed: list[int], seed: int = 0) -> Tensor:
    """Log density (N,) of the `observed` angles alone, at points (N, len(observed)) of the chart.

    Raises:
        OrbiflowError: for a part whose other angles cannot be integrated out.
    """
    if isinstance(part, UniformBase):
        return torch.zeros(len(points), dtype=torch.float64)
    if isinstance(part, AdaptiveKernels):
        return kernels_at(part, points, observed)
    if isinstance(part, VonMisesChains):
        return chains_at(part, points, observed, seed)
    if isinstance(part, VonMisesNetwork):
        return network_at(part, points, observed, seed)
    if isinstance(part, SymmetricDensity):
        return flow_at(part, points, observed)
    raise OrbiflowError(f"a {type(part).__name__} cannot be integrated over some of its angles")


def density_at(
    density: SymmetricDensity, points: Tensor, observed: list[int], seed: int = 0
) -> Tensor:
    """`part_at` of a whole density."""
    parts = parts_of(density)
    shares = torch.tensor([share for share, _ in parts], dtype=torch.float64)
    table = torch.stack([part_at(part, points, observed, seed) for _, part in parts])
    return (table + shares.log()[:, None]).logsumexp(dim=0)


def _some_at(part: Part, points: Tensor, observed: list[int]) -> Tensor:
    if isinstance(part, BlendedDensity):
        return density_at(part, points, observed)
    return part_at(part, points, observed)


@one_thread()
@torch.no_grad()
def log_prob_observed(density: SymmetricDensity, points: Tensor, *, measure: str = CHART) -> Tensor:
    """Log density (N,) at points (N, d) of a torus some of whose angles are missing (NaN).

    A row's is that of the angles that it has, integrated over the others; with respect to `measure` of
    those. Of a row that has none it is 0: it says nothing.

    Raises:
        OrbiflowError: for another space or shape, infinite angles, or a part that cannot be integrated.
    """
    space = check_torus(
        check_kind(density, SymmetricDensity, "density").space, "densities at missing angles"
    )
    points = float_tensor(points, "points").double()
    if points.dim() != 2 or points.shape[1] != space.dim:
        raise OrbiflowError(f"expected points (N, {space.dim}), got {tuple(points.shape)}")
    if bool(points.isinf().any()):
        raise OrbiflowError("angles may be missing (NaN), but not infinite")
    return at_observed(density, points, measure=measure)


def at_observed(part: Part, points: Tensor, *, measure: str = CHART) -> Tensor:
    """As `log_prob_observed`, of a part or a density, at float64 points (N, d) that are checked."""
    found = torch.zeros(len(points), dtype=torch.float64)
    patterns, number = unique(~points.isnan(), dim=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        observed: list[int] = listed(torch.nonzero(pattern)[:, 0])
        rows = torch.nonzero(number == k)[:, 0]
        if not observed:
            continue
        some = points[rows][:, observed]
        own = Torus(len(observed), unit=str(part.space.unit))
        whole = len(observed) == part.space.dim
        value = part.log_prob(some) if whole else _some_at(part, some, observed)
        found[rows] = value + own.log_density_factor(some, measure)
    return found
