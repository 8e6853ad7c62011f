"""Spaces beside real and periodic columns, and chains on them: normalised, closed, fitted."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import orbiflow.density as od
from density.blends import random_kernels as kernels_on
from density.blends import random_product_chains, stored
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.kernels import fit_mixture
from orbiflow.density.fitting.product_chains import fit_product_chains
from orbiflow.density.fitting.tuned_widths import tuned_concentrations
from orbiflow.density.models import ProductChains
from orbiflow.errors import SettingError
from refusals import refused

BASES: dict[str, od.Space] = {
    "sphere": od.make_space("sphere", form="vector"),
    "axes": od.make_space("projective-plane"),
    "bottle": od.make_space("klein-bottle", unit="degrees"),
    "rotations": od.make_space("rotation-space", form="quaternion", symmetry="222"),
    "orbifold": od.make_space("p4"),
    "hypersphere": od.make_space("hypersphere", dim=4),
}
AXES = [(3.0, 2.0), 24.0]
names = st.sampled_from(sorted(BASES))
seeds = st.integers(0, 2**31)


def random_kernels(name: str, seed: int, count: int = 12) -> tuple[od.Mixture, torch.Tensor]:
    """Kernels and a uniform part on a product, and some points of it."""
    space = od.ProductSpace(BASES[name], AXES)
    kernels = kernels_on(np.random.default_rng(seed), space, count, 1.0, 31.0)
    points = space.uniform(8, torch.Generator().manual_seed(seed))
    return od.Mixture([kernels, od.UniformDensity(space)], [0.8, 0.2]), points


@given(names, seeds)
def test_a_kernel_is_the_product_of_those_of_the_parts(name: str, seed: int) -> None:
    mixture, points = random_kernels(name, seed)
    whole = mixture.components[0]
    assert isinstance(whole, od.AdaptiveKernels)
    space = whole.space
    assert isinstance(space, od.ProductSpace)
    chart, first = space.base.chart_dim, len(space.base.spheres)
    tables: list[torch.Tensor] = []
    for k, weight in enumerate(whole.weights):
        one = torch.ones(1, dtype=torch.float64)
        kappa, center = whole.concentrations[k : k + 1], whole.centers[k : k + 1]
        base = od.AdaptiveKernels(space.base, center[:, :chart], kappa[:, :first], one)
        rest = od.AdaptiveKernels(space.beside, center[:, chart:], kappa[:, first:], one)
        logs = base.log_prob(points[:, :chart], measure="natural")
        tables.append(logs + rest.log_prob(points[:, chart:], measure="natural") + weight.log())
    expected = torch.stack(tables).logsumexp(dim=0)
    np.testing.assert_allclose(whole.log_prob(points, measure="natural"), expected, atol=1e-9)


@given(names, seeds)
def test_a_conditional_is_the_ratio_of_joint_and_marginal(name: str, seed: int) -> None:
    mixture, points = random_kernels(name, seed)
    space, width = mixture.space, len(mixture.space.columns)
    estimator = od.DensityEstimator.fitted(mixture)
    rows = space.from_chart(points)
    joint = estimator.score_samples(rows)
    own = list(space.columns[: width - 2])
    for kept, known in (([*own, "beside1"], ["beside2"]), (["beside2", "beside1"], own)):
        where = [space.columns.index(one) for one in known]
        alone = estimator.marginal(*known).score_samples(rows[:, where])
        for row, expected in zip(rows, joint - alone, strict=True):
            part = estimator.conditional(dict(zip(known, row[where], strict=True)))
            at = [space.columns.index(one) for one in part.feature_names_in_]
            assert sorted(part.feature_names_in_) == sorted(kept)
            assert part.score_samples(row[None, at])[0] == pytest.approx(expected, abs=1e-7)


def place_and_season(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions that go with the day, a depth that goes with the height; and their log density."""
    rng = np.random.default_rng(seed)
    day = rng.uniform(0, 365.0, count)
    turn = 2 * np.pi * day / 365
    mean = np.column_stack([np.cos(turn), np.sin(turn), np.full(count, 0.5)]) / np.sqrt(1.25)
    kappa = 20
    vectors = np.array([stats.vonmises_fisher(m, kappa).rvs(1, random_state=rng)[0] for m in mean])
    depth = 10 + 4 * vectors[:, 2] + rng.normal(size=count)
    logs = np.log(kappa / (4 * np.pi * np.sinh(kappa))) + kappa * (vectors * mean).sum(axis=1)
    logs += stats.norm.logpdf(depth, 10 + 4 * vectors[:, 2]) - np.log(365)
    return np.column_stack([vectors, depth, day]), logs


def test_a_fit_is_near_the_truth() -> None:
    rows, _ = place_and_season(400, 0)
    unseen, truth = place_and_season(400, 1)
    how: Any = {"columns": {3: "linear", 4: "cycle:365"}, "components": "kernels,mixture"}
    fit = od.DensityEstimator("sphere", **how).fit(rows)
    regret = float((truth - fit.score_samples(unseen)).mean())
    assert 0 < regret < 0.35
    # what leaves the day out cannot know where it is
    apart = fit.marginal("x", "y", "z", "beside1").score_samples(unseen[:, :4]) - np.log(365)
    assert float((truth - apart).mean()) > regret + 0.5


def test_columns_beside_come_last_or_have_names() -> None:
    rows, _ = place_and_season(60, 0)
    frame = {name: rows[:, k] for k, name in enumerate(("x", "y", "z", "depth", "day"))}
    order = ["day", "x", "y", "z", "depth"]
    structured = np.zeros(len(rows), dtype=[(name, "f8") for name in order])
    for name in order:
        structured[name] = frame[name]
    how: dict[str, Any] = {"components": "mixture", "seed": 0}
    columns = "depth=linear,day=cycle:365"
    fit = od.DensityEstimator("sphere", columns=columns, **how).fit(structured)
    assert list(fit.feature_names_in_) == ["x", "y", "z", "depth", "day"]
    plain = fit.score_samples(rows)
    np.testing.assert_allclose(fit.score_samples(structured), plain)
    with refused("3", "2", kind=SettingError):
        od.DensityEstimator("sphere", columns=dict.fromkeys((0, 1), "linear"), **how).fit(
            rows[:, :3]
        )
    with refused("meaning", "together"):
        fit.conditional(x=1.0)
    with refused("marginal", "densities"):
        fit.mean()
    assert fit.marginal("depth").mean().shape == (1,)
    for base, beside, about in (("sphere", -1.0, "period"), ("torus", 24.0, "torus")):
        with refused(about):
            od.ProductSpace(od.make_space(base), [beside])


@given(st.floats(0.1, 1e4), seeds)
def test_a_period_of_its_own_is_a_unit(period: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    space, radians = od.Torus([period]), od.Torus([None])
    values = rng.uniform(-2 * period, 2 * period, (20, 1))
    back = space.from_chart(space.to_chart(values))
    assert ((back >= 0) & (back < period)).all()
    turns = (back - values) / period
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    kernels = torch.tensor([[0.3]]), torch.tensor([[4.0]]), torch.ones(1)
    one, other = (od.AdaptiveKernels(own, *kernels) for own in (space, radians))
    points = space.to_chart(values)
    ratio = one.log_prob(points, measure="natural") - other.log_prob(points, measure="natural")
    np.testing.assert_allclose(ratio, np.log(2 * np.pi / period), atol=1e-9)


def test_widths_are_tuned_where_columns_have_nothing_in_common() -> None:
    rng = np.random.default_rng(0)
    rows, _ = place_and_season(200, 0)
    rows[:, 3] = rng.integers(0, 5, 200) + 0.01 * rng.normal(size=200)  # five narrow layers
    fit = od.DensityEstimator(
        "sphere", columns={3: "linear", 4: "cycle:365"}, components="kernels"
    ).fit(rows)
    points = fit.space_.to_chart(rows)
    found = tuned_concentrations(fit.space_, Rows(points), 1e7)
    assert found is not None
    assert found.shape == (3,)
    assert float(found[1]) > 50 * float(found[0])
    assert tuned_concentrations(od.make_space("sphere"), Rows(points[:, :2]), 1e7) is None
    few = tuned_concentrations(fit.space_, Rows(points[:5]), 1e7)
    assert few is not None
    assert bool(few.isfinite().all())


def random_chains(name: str, seed: int, beside: int = 2) -> ProductChains:
    """Chains on a product."""
    space = od.ProductSpace(BASES[name], [(3.0, 2.0), 24.0, (0.0, 1.0)][:beside])
    return random_product_chains(space, seed)


@given(names, seeds)
def test_each_conditional_on_the_base_integrates_to_one(name: str, seed: int) -> None:
    chains = random_chains(name, seed)
    space = chains.space
    assert isinstance(space, od.ProductSpace)
    noise = torch.Generator().manual_seed(seed)
    turns = space.beside.uniform(1, noise)
    own = space.base.uniform(5_000, noise)
    points = torch.cat([own, turns.expand(len(own), -1)], dim=1)
    joint = chains.log_prob(points, measure="uniform")
    lines = od.marginal(chains, range(space.base.chart_dim, space.chart_dim))
    alone = lines.log_prob(turns, measure="uniform")
    ratio = (joint - alone).exp()
    assert float(ratio.mean()) == pytest.approx(1, abs=6 * float(ratio.std()) / 70 + 1e-9)


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
        found = od.marginal(chains, kept).log_prob(points[:, kept]).exp()
        np.testing.assert_allclose(found, expected, rtol=2e-3)
    lines = od.marginal(chains, [chart + 1, chart])
    assert lines.space == space.of_axes([chart + 1, chart])
    base = od.marginal(chains, range(chart))
    assert all(isinstance(part, od.AdaptiveKernels) for part in base.components)
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
    whole = od.Mixture([chains, od.UniformDensity(chains.space)], [0.9, 0.1])
    space, chart = chains.space, chains.base.chart_dim
    points = space.uniform(2, torch.Generator().manual_seed(2))
    every = list(range(space.chart_dim))
    for known in ([chart], every[:chart], every[chart:], [*every[:chart], chart]):
        left = [axis for axis in every if axis not in known]
        alone = od.marginal(whole, known).log_prob(points[:, known])
        for row, expected in zip(points, whole.log_prob(points) - alone, strict=True):
            part = od.conditional(whole, {axis: float(row[axis]) for axis in known}, accuracy=1e-4)
            assert float(part.log_prob(row[left])) == pytest.approx(float(expected), abs=5e-3)


def test_three_columns_beside_a_given_place(tmp_path: Path) -> None:
    chains = random_chains("sphere", 3, beside=3)
    point = chains.sample((1,), torch.Generator().manual_seed(0))[0]
    part = od.conditional(chains, {0: float(point[0]), 1: float(point[1])})
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
    again = stored(part, tmp_path)
    np.testing.assert_allclose(again.log_prob(even[:9]), part.log_prob(even[:9]))


def test_em_finds_a_direction_that_goes_with_the_day() -> None:
    rows, _ = place_and_season(400, 0)
    unseen, truth = place_and_season(400, 1)
    how: Any = {"columns": {3: "linear", 4: "cycle:365"}, "components": "mixture"}
    space = od.DensityEstimator("sphere", **how).fit(rows[:60]).space_
    points = space.to_chart(rows)
    start = od.AdaptiveKernels(
        space, points[:1], torch.full((1, 3), 5.0).double(), torch.ones(1).double()
    )
    found = fit_product_chains(start, Rows(points))
    regret = truth - found.log_prob(space.to_chart(unseen), measure="natural").numpy()
    assert 0 < regret.mean() < 0.2
    heavy = fit_product_chains(start, Rows(points, torch.ones(400).double()))
    assert torch.allclose(heavy.slopes, found.slopes, atol=1e-8)
    with refused("columns", "3"):
        ProductChains(od.ProductSpace(space.parts[0], [24.0] * 4), *found.tensors().values())
    with refused("fit"):
        ProductChains(space, found.weights, *list(found.tensors().values())[:4])


@given(seeds)
def test_an_elongated_bump_on_an_orbifold_is_fitted_along_its_own_axis(seed: int) -> None:
    space, noise = BASES["orbifold"], torch.Generator().manual_seed(seed)
    center, one = space.uniform(1, noise), torch.ones(1, dtype=torch.float64)
    truth = od.AdaptiveKernels(space, center, torch.tensor([[300.0, 4.0]]).double(), one)
    rows, unseen = truth.sample((400,), noise), truth.sample((400,), noise)
    found = fit_mixture(space, Rows(rows), 1, generator=noise)
    regret = truth.log_prob(unseen) - found.log_prob(unseen)
    assert float(regret.mean()) < 0.1
