"""Random densities on tori, of all parts that a fit may find."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from orbiflow.density import (
    AdaptiveKernels,
    Density,
    Factor,
    FlowDensity,
    Mixture,
    ProductSpace,
    Space,
    Torus,
    UniformDensity,
    VonMisesChains,
    VonMisesNetwork,
    density_to_bytes,
    read_density,
)
from orbiflow.density.models import SCALES, ProductChains, chained
from orbiflow.fields import SplineField
from orbiflow.flows import Flow


def bump(space: Space, kappa: float = 1.0, at: Sequence[float] = ()) -> AdaptiveKernels:
    """One kernel about a place of the chart, its middle if there is none."""
    center = torch.tensor([list(at) or [0.5] * space.chart_dim], dtype=torch.float64)
    width = 1 if space.is_round else space.dim
    sharp = torch.full((1, width), kappa, dtype=torch.float64)
    return AdaptiveKernels(space, center, sharp, torch.ones(1, dtype=torch.float64))


def identity_flow(space: Space) -> Flow:
    """A flow on the space that is the identity, since a new field is zero."""
    return Flow([SplineField(space.group, 1)], steps=1, warn=False)


def random_chains(
    rng: np.random.Generator, space: Torus, count: int = 3, *, natural: bool = False
) -> VonMisesChains:
    """Components in random orders, bent by the angles before."""
    d = space.dim
    orders = [np.arange(d) if natural else rng.permutation(d) for _ in range(count)]
    order = torch.tensor(np.array(orders))
    means = torch.tensor(0.6 * rng.normal(size=(count, d, 1 + 2 * d))) * chained(order)
    weights = torch.tensor(rng.dirichlet(np.ones(count * len(SCALES)))).reshape(count, -1)
    concentrations = torch.tensor(rng.uniform(0.5, 12.0, (count, d)))
    return VonMisesChains(space, weights.log(), means, concentrations, order)


def random_network(rng: np.random.Generator, space: Torus, parents: int = 2) -> VonMisesNetwork:
    """Angles in a random order, each with as many of those before as parents, where there are any."""
    order: list[int] = rng.permutation(space.dim).tolist()
    factors: list[Factor] = []
    for place, axis in enumerate(order):
        chosen = rng.permutation(order[:place])[:parents].tolist()
        own = random_chains(rng, Torus(len(chosen) + 1), natural=True)
        factors.append(Factor((*chosen, axis), own))
    return VonMisesNetwork(space, factors)


def random_product_chains(space: ProductSpace, seed: int, count: int = 3) -> ProductChains:
    """Chains on a product whose middles move with the other columns."""
    noise, beside = torch.Generator().manual_seed(seed % 2**63), space.beside.dim

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, dtype=torch.float64, generator=noise)

    spheres = space.base.spheres
    width = (1 + spheres[0]) * len(spheres)
    weights = torch.softmax(normal(count), dim=0)
    centers = torch.rand(count, beside, dtype=torch.float64, generator=noise)
    slopes = normal(count, 1 + 2 * beside, width)
    slopes[:, 1:] *= 0.1  # hardly any middle jumps from one side to the other
    kappa = (1.5 + normal(count, len(spheres))).exp()
    return ProductChains(space, weights, centers, (1 + normal(count, beside)).exp(), slopes, kappa)


def random_kernels(
    rng: np.random.Generator, space: Space, count: int = 4, low: float = 0.5, high: float = 15.0
) -> AdaptiveKernels:
    """Kernels about places anywhere, of concentrations between two numbers."""
    if space.is_torus:
        places = torch.tensor(rng.uniform(size=(count, space.dim)))
    else:
        places = space.uniform(count, torch.Generator().manual_seed(int(rng.integers(2**31))))
    kappa = torch.tensor(rng.uniform(low, high, (count, len(space.spheres))))
    return AdaptiveKernels(space, places, kappa, torch.tensor(rng.dirichlet(np.ones(count))))


def blended(
    space: Space,
    flow: Flow | None,
    base: Density,
    kernels: AdaptiveKernels,
    weights: torch.Tensor,
    *,
    chains: VonMisesChains | None = None,
    network: VonMisesNetwork | None = None,
) -> Mixture:
    """A mixture of these, of a uniform floor, and of chains and a network; of no weight: none."""
    moved = None if flow is None else FlowDensity(space, flow, base)
    parts = [moved, kernels, UniformDensity(space), chains, network]
    there = [part for part in parts if part is not None]
    shares = [w for w in weights.tolist() if w > 0 or flow is not None]
    kept = [(part, w) for part, w in zip(there, shares, strict=True) if w > 0]
    return Mixture([part for part, _ in kept], [w for _, w in kept])


def stored(density: Density, folder: Path) -> Density:
    """The same, from a file in the folder."""
    path = folder / "density.safetensors"
    path.write_bytes(density_to_bytes(density))
    return read_density(path)[0]


def flow_of(density: Density) -> FlowDensity:
    """The density of its flow."""
    return next(part for _, part in density.parts() if isinstance(part, FlowDensity))


def kernels_of(density: Density) -> AdaptiveKernels:
    """The kernels that it contains."""
    return next(part for _, part in density.parts() if isinstance(part, AdaptiveKernels))


def random_blend(
    seed: int, dim: int, *, chains: bool = True, flow: bool = False, network: bool = False
) -> Mixture:
    rng = np.random.default_rng(seed)
    space = Torus(dim, unit="degrees")
    moving = None
    if flow:
        field = SplineField(space.group, 2)
        with torch.no_grad():
            field.parameters_.copy_(
                torch.tensor(0.01 * rng.normal(size=tuple(field.parameters_.shape)))
            )
        moving = Flow([field], steps=2, warn=False)
    shares = torch.tensor(rng.dirichlet(3 * np.ones(3 + chains + network)))
    if not flow:
        shares[0] = 0
        shares = shares / shares.sum()
    return blended(
        space,
        moving,
        UniformDensity(space),
        random_kernels(rng, space),
        shares,
        chains=random_chains(rng, space) if chains else None,
        network=random_network(rng, space) if network else None,
    )


def numbers(*values: float) -> torch.Tensor:
    """Numbers of double precision."""
    return torch.tensor(values, dtype=torch.float64)


def two_clusters(space: Space, count: int, seed: int = 0) -> torch.Tensor:
    """Canonical points (count, 2) about two places, of which the first has seven of ten."""
    rng = np.random.default_rng(seed)
    centers = np.where(rng.random((count, 1)) < 0.7, [[0.3, 0.6]], [[0.8, 0.15]])
    return space.project(torch.tensor(centers + 0.1 * rng.normal(size=(count, 2))))


def even_grid(count: int, dim: int) -> torch.Tensor:
    """(count^dim, dim) points of the cube, a period apart at its sides."""
    line = torch.arange(count, dtype=torch.float64) / count
    return torch.cartesian_prod(*[line] * dim).reshape(-1, dim)
