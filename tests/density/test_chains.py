"""Mixtures of von Mises chains: orders, sums of components, what they refuse, fits by EM."""

import math
from typing import Any

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from density.blends import random_chains
from orbiflow.density import Torus, VonMisesChains
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.chains import fit_chain_mixture, spread_chains
from orbiflow.density.models import SCALES
from refusals import refused

seeds = st.integers(0, 2**31 - 1)
dims = st.integers(1, 5)


def random_mixture(dim: int, seed: int, most: float = 30.0) -> VonMisesChains:
    """Components in random orders, some of which are almost even."""
    chains = random_chains(np.random.default_rng(seed), Torus(dim), 4)
    kappa = chains.concentrations * most / 12
    return VonMisesChains(chains.space, chains.log_weights, chains.means, kappa, chains.order)


def points(count: int, dim: int, seed: int) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(seed).random((count, dim)))


@given(dims, seeds)
def test_renaming_the_angles_renames_those_of_the_chains(dim: int, seed: int) -> None:
    mixture, at = random_mixture(dim, seed), points(20, dim, seed)
    name = torch.tensor(np.random.default_rng(seed).permutation(dim))  # of the new angle i
    used = torch.cat([torch.tensor([0]), 1 + name, 1 + dim + name])
    renamed = VonMisesChains(
        mixture.space,
        mixture.log_weights,
        mixture.means[:, name][:, :, used],
        mixture.concentrations[:, name],
        name.argsort()[mixture.order],
    )
    assert torch.allclose(renamed.log_prob(at[:, name]), mixture.log_prob(at), atol=1e-9)


def test_orders_are_checked() -> None:
    good = random_mixture(3, 0)
    parts = (good.space, good.log_weights, good.means, good.concentrations)
    for bad in (good.order[:, :2], good.order + 1, 0 * good.order, good.order + 0.5):
        with refused("order"):
            VonMisesChains(*parts, bad)
    with refused("chained"):
        VonMisesChains(*parts, good.order.flip(1))


def test_hostile_headers_are_refused() -> None:
    mixture, space = random_mixture(3, 0), Torus(3)
    changes: list[dict[str, Any]] = [{"components": 5}, {"components": -1}, {"scales": [1.0]}]
    for change in changes:
        with refused():
            VonMisesChains.from_header(space, {**mixture.header(), **change}, mixture.tensors())


def chained_angles(count: int, seed: int = 0) -> torch.Tensor:
    """Four angles, each near a function of the one before; two clusters."""
    rng = np.random.default_rng(seed)
    first = np.where(rng.random(count) < 0.6, 0.1, 0.6) + 0.05 * rng.normal(size=count)
    columns = [first]
    for _ in range(3):
        wave = 0.1 * np.sin(2 * np.pi * columns[-1])
        columns.append(columns[-1] + wave + 0.03 * rng.normal(size=count))
    return Torus(4).project(torch.tensor(np.stack(columns, axis=1)))


def test_a_fit_finds_correlations_and_repeats() -> None:
    data, space = chained_angles(800), Torus(4)
    train, held = Rows(data[:700]), Rows(data[700:])

    def fitted() -> VonMisesChains:
        generator = torch.Generator().manual_seed(0)
        start = spread_chains(space, train, 16, torch.arange(4), generator)
        return fit_chain_mixture(start, train, held, 60)

    # of the data's own chain: three normals of width 0.03 and a mixture of two of width 0.05
    fresh = chained_angles(2000, seed=1)
    entropy = sum(0.5 * math.log(2 * math.pi * math.e * s**2) for s in (0.03, 0.03, 0.03, 0.05))
    best = -entropy + 0.6 * math.log(0.6) + 0.4 * math.log(0.4)
    found = fitted()
    assert float(found.log_prob(fresh).mean()) > best - 0.2
    assert torch.equal(found.log_prob(fresh), fitted().log_prob(fresh))


@given(dims, seeds, st.sampled_from([1.0, 1e3, 1e8]))
def test_products_of_matrices_are_sums_of_components(dim: int, seed: int, most: float) -> None:
    mixture, at = random_mixture(dim, seed, most=most), points(50, dim, seed)
    residual = mixture.residuals(at)
    fit = -2 * ((residual / 2).sin() ** 2 * mixture.concentrations).sum(dim=2)
    scale = torch.tensor(SCALES, dtype=torch.float64)[:, None]
    normal = torch.special.i0e(mixture.concentrations / scale[..., None]).log().sum(dim=2)
    logs = fit[:, None] / scale + mixture.log_weights.mT - normal
    expected = logs.flatten(1).logsumexp(dim=1)
    assert torch.allclose(mixture.log_prob(at), expected, rtol=1e-12, atol=1e-12 * max(most, 1))
