"""Chains on products: normalised whatever their slopes, with marginals by nodes that resolve them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from density.test_products import BASES, place_and_season
from orbiflow.density import (
    AdaptiveKernels,
    DensityEstimator,
    Mixture,
    ProductSpace,
    UniformDensity,
    conditional,
    density_to_bytes,
    marginal,
    read_density,
)
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.kernels import fit_mixture
from orbiflow.density.fitting.product_chains import fit_product_chains
from orbiflow.density.models import ProductChains
from refusals import refused

names = st.sampled_from(sorted(BASES))
seeds = st.integers(0, 2**31)


def random_chains(name: str, seed: int, beside: int = 2, count: int = 3) -> ProductChains:
    """Chains whose middles move with the other columns."""
    space = ProductSpace(BASES[name], [(3.0, 2.0), 24.0, (0.0, 1.0)][:beside])
    noise = torch.Generator().manual_seed(seed)

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


@given(names, seeds)
def test_each_conditional_on_the_base_integrates_to_one(name: str, seed: int) -> None:
    chains = random_chains(name, seed)
    space = chains.space
    assert isinstance(space, ProductSpace)
    noise = torch.Generator().manual_seed(seed)
    turns = space.beside.uniform(1, noise)
    own = space.base.uniform(20_000, noise)
    points = torch.cat([own, turns.expand(len(own), -1)], dim=1)
    joint = chains.log_prob(points, measure="uniform")
    lines = marginal(chains, range(space.base.chart_dim, space.chart_dim))
    alone = lines.log_prob(turns, measure="uniform")
    ratio = (joint - alone).exp()
    assert float(ratio.mean()) == pytest.approx(1, abs=6 * float(ratio.std()) / 141 + 1e-9)


@given(names, seeds)
def test_hidden_columns_are_integrated(name: str, seed: int) -> None:
    chains = random_chains(name, seed)
    space, chart = chains.space, chains.base.chart_dim
    points = space.uniform(4, torch.Generator().manual_seed(seed))
    grid = (torch.arange(400, dtype=torch.float64) + 0.5) / 400
    for kept, hidden in (([*range(chart), chart], chart + 1), ([*range(chart), chart + 1], chart)):
        rows = points[:, None].repeat(1, 400, 1)
        rows[:, :, hidden] = grid
        expected = chains.log_chart(rows).exp().mean(dim=1)
        found = marginal(chains, kept).log_prob(points[:, kept]).exp()
        np.testing.assert_allclose(found, expected, rtol=2e-3)
    lines = marginal(chains, [chart + 1, chart])
    assert lines.space == space.of_axes([chart + 1, chart])
    base = marginal(chains, range(chart))
    assert all(isinstance(part, AdaptiveKernels) for part in base.components)
    rows = points[:, None, None].repeat(1, 100, 100, 1)
    rows[..., chart] = grid[::4, None]
    rows[..., chart + 1] = grid[::4]
    expected = chains.log_chart(rows).exp().mean(dim=(1, 2))
    np.testing.assert_allclose(
        base.log_prob(points[:, :chart]).exp(), expected, rtol=2e-2, atol=1e-4
    )


@pytest.mark.parametrize("name", ["sphere", "bottle", "rotations"])
def test_conditionals_are_ratios(name: str) -> None:
    chains = random_chains(name, 1)
    whole = Mixture([chains, UniformDensity(chains.space)], [0.9, 0.1])
    space, chart = chains.space, chains.base.chart_dim
    points = space.uniform(2, torch.Generator().manual_seed(2))
    every = list(range(space.chart_dim))
    for known in ([chart], every[:chart], every[chart:], [*every[:chart], chart]):
        left = [axis for axis in every if axis not in known]
        alone = marginal(whole, known).log_prob(points[:, known])
        for row, expected in zip(points, whole.log_prob(points) - alone, strict=True):
            part = conditional(whole, {axis: float(row[axis]) for axis in known}, accuracy=1e-4)
            assert float(part.log_prob(row[left])) == pytest.approx(float(expected), abs=5e-3)


def test_three_columns_beside_a_given_place(tmp_path: Path) -> None:
    chains = random_chains("sphere", 3, beside=3)
    point = chains.sample((1,), torch.Generator().manual_seed(0))[0]
    part = conditional(chains, {0: float(point[0]), 1: float(point[1])})
    drawn = part.sample((4000,), torch.Generator().manual_seed(0))
    # the mean over even points is the mass, and the samples have the marginal's median
    even = torch.rand(4000, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    values = part.log_prob(even).exp()
    assert float(values.mean()) == pytest.approx(1, abs=6 * float(values.std()) / 63)
    wave = torch.stack([(2 * np.pi * even).cos().T @ values, (2 * np.pi * even).sin().T @ values])
    own = torch.stack(
        [(2 * np.pi * drawn).cos().mean(dim=0), (2 * np.pi * drawn).sin().mean(dim=0)]
    )
    np.testing.assert_allclose(own, wave / 4000, atol=0.15)
    path = tmp_path / "part.safetensors"
    path.write_bytes(density_to_bytes(part))
    again, _ = read_density(path)
    np.testing.assert_allclose(again.log_prob(even[:9]), part.log_prob(even[:9]))


@given(names, seeds)
def test_samples_have_the_entropy_of_the_density(name: str, seed: int) -> None:
    chains = random_chains(name, seed, count=2)
    noise = torch.Generator().manual_seed(seed % 1000)
    drawn = chains.log_prob(chains.sample((4000,), noise), measure="uniform")
    even = chains.log_prob(chains.space.uniform(40_000, noise), measure="uniform")
    parts = even.exp() * even
    error = float(parts.std()) / 200 + float(drawn.std()) / 63
    assert float(drawn.mean()) == pytest.approx(float(parts.mean()), abs=5 * error)
    copied = ProductChains.from_header(chains.space, chains.header(), chains.tensors())
    points = chains.sample((9,), noise)
    assert torch.equal(copied.log_prob(points), chains.log_prob(points))


def test_em_finds_a_direction_that_goes_with_the_day() -> None:
    rows, _ = place_and_season(600, 0)
    unseen, truth = place_and_season(600, 1)
    how: Any = {"columns": {3: "linear", 4: "cycle:365"}, "components": "kernels"}
    space = DensityEstimator("sphere", **how).fit(rows).space_
    points = space.to_chart(rows)
    start = AdaptiveKernels(
        space, points[:1], torch.full((1, 3), 5.0).double(), torch.ones(1).double()
    )
    found = fit_product_chains(start, Rows(points))
    regret = truth - found.log_prob(space.to_chart(unseen), measure="natural").numpy()
    assert 0 < regret.mean() < 0.2
    heavy = fit_product_chains(start, Rows(points, torch.ones(600).double()))
    assert torch.allclose(heavy.slopes, found.slopes, atol=1e-8)
    with refused("columns", "3"):
        ProductChains(ProductSpace(space.parts[0], [24.0] * 4), *found.tensors().values())
    with refused("fit"):
        ProductChains(space, found.weights, *list(found.tensors().values())[:4])


@given(seeds)
def test_an_elongated_bump_on_an_orbifold_is_fitted_along_its_own_axis(seed: int) -> None:
    space, noise = BASES["orbifold"], torch.Generator().manual_seed(seed)
    center, one = space.uniform(1, noise), torch.ones(1, dtype=torch.float64)
    truth = AdaptiveKernels(space, center, torch.tensor([[300.0, 4.0]]).double(), one)
    rows, unseen = truth.sample((400,), noise), truth.sample((400,), noise)
    found = fit_mixture(space, Rows(rows), 1, generator=noise)
    regret = truth.log_prob(unseen) - found.log_prob(unseen)
    assert float(regret.mean()) < 0.1
