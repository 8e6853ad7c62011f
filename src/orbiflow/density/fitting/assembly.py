"""One density of what a fit by evidence has chosen."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor

from orbiflow.density.fitting.evidence import Candidates
from orbiflow.density.fitting.families import Family
from orbiflow.density.fitting.kernels import even_kernels, joined
from orbiflow.density.fitting.rows import Rows
from orbiflow.density.models import (
    AdaptiveKernels,
    Base,
    BlendedDensity,
    SymmetricDensity,
    UniformBase,
    VonMisesChains,
    VonMisesNetwork,
    still_flow,
)
from orbiflow.density.spaces import Space

FLAT = 1e-6
"""Concentration of a kernel that is as good as uniform."""


def assembled(
    space: Space,
    families: list[Family],
    candidates: Candidates,
    weights: Tensor,
    rows: Rows,
    flow: SymmetricDensity | None,
    share: float,
) -> BlendedDensity:
    """The candidates in proportions (P,), made final with all rows; a flow of a share beside them."""
    sorted_ = _Sorted()
    for family in families:
        chosen = [
            (name, float(weight))
            for own, name, weight in zip(
                candidates.families, candidates.names, weights, strict=True
            )
            if own == family.name and weight > 0
        ]
        found = family.final(rows, candidates.fitted[family.name], [name for name, _ in chosen])
        for part, (_, weight) in zip(found, chosen, strict=True):
            sorted_.take(part, weight)
    floor = float(weights[candidates.floor].sum())
    if not sorted_.kernels:  # a blend has some: half of the floor, as one
        center = rows.points.new_full((1, space.dim), 0.5)
        floor /= 2
        sorted_.take(even_kernels(space, center, FLAT), floor)
    own = (sorted_.kernels, sorted_.chains, sorted_.networks)
    sizes = [[weight for _, weight in part] for part in own]
    broad = [sum(part) for part in sizes[1:] if part]
    shares = torch.tensor([0.0, sum(sizes[0]), floor, *broad], dtype=torch.float64)
    shares = (1 - share) * shares / shares.sum()
    shares[0] = share
    proportions = [torch.tensor(part, dtype=torch.float64) for part in sizes]
    carried = still_flow(space) if flow is None else flow.flow
    return BlendedDensity(
        space,
        carried,
        UniformBase(space) if flow is None else flow.base,
        joined([part for part, _ in sorted_.kernels], proportions[0]),
        shares,
        chains=mixed([part for part, _ in sorted_.chains], proportions[1]) if sizes[1] else None,
        network=sorted_.networks[0][0] if sizes[2] else None,
    )


@dataclass
class _Sorted:
    """Parts that have been chosen, and their weights, by their kind; one network at most."""

    kernels: list[tuple[AdaptiveKernels, float]] = field(
        default_factory=list[tuple[AdaptiveKernels, float]]
    )
    chains: list[tuple[VonMisesChains, float]] = field(
        default_factory=list[tuple[VonMisesChains, float]]
    )
    networks: list[tuple[VonMisesNetwork, float]] = field(
        default_factory=list[tuple[VonMisesNetwork, float]]
    )

    def take(self, part: Base, weight: float) -> None:
        if isinstance(part, VonMisesChains):
            self.chains.append((part, weight))
        elif isinstance(part, VonMisesNetwork):
            self.networks.append((part, weight))
        else:
            assert isinstance(part, AdaptiveKernels)  # families have no others
            self.kernels.append((part, weight))


def mixed(parts: list[VonMisesChains], shares: Tensor) -> VonMisesChains:
    """The mixture of mixtures of chains on one torus, in proportions (P,)."""
    logs = (shares.double() / shares.sum()).log()
    return VonMisesChains(
        parts[0].space,
        torch.cat([part.log_weights + log for part, log in zip(parts, logs, strict=True)]),
        torch.cat([part.means for part in parts]),
        torch.cat([part.concentrations for part in parts]),
        torch.cat([part.order for part in parts]),
    )
