"""Marginal and conditional densities: against the joint density, integrated on a grid."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from density.blends import even_grid, identity_flow, kernels_of, random_blend
from orbiflow.density import (
    Density,
    DensityEstimator,
    FlowDensity,
    Mixture,
    Torus,
    conditional,
    density_to_bytes,
    make_space,
    marginal,
    read_density,
)
from orbiflow.density.inference import log_prob_observed
from refusals import refused

seeds = st.integers(0, 2**31)
few = settings(deadline=None, max_examples=6)
GRID = {2: 256, 3: 64}
"""Points an angle that resolve what `random_blend` makes."""


def integrated(density: Density, points: torch.Tensor, kept: list[int]) -> torch.Tensor:
    """Log of the joint density integrated over the angles that are not kept, at points (N, r)."""
    d = density.space.dim
    hidden = [axis for axis in range(d) if axis not in kept]
    nodes = even_grid(GRID[d], len(hidden))
    whole = points.new_empty(len(points), len(nodes), d)
    whole[:, :, kept], whole[:, :, hidden] = points[:, None], nodes
    with torch.no_grad():
        return density.log_prob(whole).logsumexp(dim=1) - math.log(len(nodes))


@given(seeds, st.integers(2, 3), st.data())
@few
def test_a_marginal_is_the_integral_of_the_joint(seed: int, dim: int, data: st.DataObject) -> None:
    density = random_blend(seed, dim)
    kept = data.draw(st.permutations(range(dim)))[: data.draw(st.integers(1, dim - 1))]
    found = marginal(density, kept)
    points = torch.tensor(np.random.default_rng(seed).uniform(size=(20, len(kept))))
    expected = integrated(density, points, list(kept))
    assert (found.log_prob(points) - expected).abs().max() < 1e-5 + 2 * found.largest_error
    assert float(found.log_prob(even_grid(128, len(kept))).exp().mean()) == pytest.approx(
        1, abs=1e-6
    )


@given(seeds, st.integers(2, 3), st.data())
@few
def test_conditional_times_marginal_is_joint(seed: int, dim: int, data: st.DataObject) -> None:
    order = data.draw(st.permutations(range(dim)))
    check_product(seed, dim, order[: data.draw(st.integers(1, dim - 1))])


@pytest.mark.parametrize(
    ("seed", "dim", "known"),
    [(1560450, 3, [0, 1]), (1560450, 3, [1, 0]), (0, 3, [2]), (10, 3, [0, 2]), (17, 3, [1])],
)
def test_what_is_stated_holds(seed: int, dim: int, known: list[int]) -> None:
    """Blends whose worst point was off by up to 130 times what was stated."""
    check_product(seed, dim, known)


def check_product(seed: int, dim: int, known: list[int]) -> None:
    """Compare a conditional density times the marginal one of what is known with the joint density."""
    density = random_blend(seed, dim)
    left = [axis for axis in range(dim) if axis not in known]
    rng = np.random.default_rng(seed)
    at = rng.uniform(-1, 2, len(known))
    found = conditional(density, dict(zip(known, at.tolist(), strict=True)))
    points = torch.tensor(rng.uniform(size=(20, dim)))
    points[:, known] = torch.tensor(at)
    other = marginal(density, known)
    product = found.log_prob(points[:, left]) + other.log_prob(points[:, known])
    off = found.largest_error + other.largest_error
    assert (product - density.log_prob(points)).abs().max() < 1e-5 + 2 * off
    assert float(found.log_prob(even_grid(128, len(left))).exp().mean()) == pytest.approx(
        1, abs=1e-6
    )


@given(seeds)
@settings(deadline=None, max_examples=1)
def test_flows_are_integrated(seed: int) -> None:
    density = random_blend(seed, 2, flow=True)
    points = even_grid(7, 1)
    found = marginal(density, 1)
    assert (found.log_prob(points) - integrated(density, points, [1])).abs().max() < 1e-4
    slice_ = conditional(density, {0: 0.3})
    whole = torch.cat([torch.full_like(points, 0.3), points], dim=1)
    with torch.no_grad():
        expected = density.log_prob(whole) - integrated(density, points[:1] * 0 + 0.3, [0])
    assert (slice_.log_prob(points) - expected).abs().max() < 1e-4
    assert max(found.error, slice_.error) < 1e-4


@given(seeds, st.data())
@few
def test_many_angles_without_tables(seed: int, data: st.DataObject) -> None:
    """Kernels are closed in any number of angles."""
    density = random_blend(seed, 6, chains=False)
    known = data.draw(st.permutations(range(6)))[:3]
    at = {axis: 0.1 * (axis + 1) for axis in known}
    left = [axis for axis in range(6) if axis not in at]
    found = conditional(density, at)
    points = torch.tensor(np.random.default_rng(seed).uniform(size=(9, 6)))
    for axis, value in at.items():
        points[:, axis] = value
    product = found.log_prob(points[:, left]) + marginal(density, known).log_prob(points[:, known])
    # a part keeps a share of 1e-9 where what is known leaves it less, and adds as much of its density
    own = points[:, left]
    assert isinstance(found, Mixture)
    added = (kernels_of(found).log_prob(own) - found.log_prob(own)).exp()
    added = added + (-found.log_prob(own)).exp()
    assert ((product - density.log_prob(points)).abs() < 1e-9 * (1 + 2 * added)).all()
    assert found.error == 0


@pytest.mark.parametrize("given_", [None, {0: 0.2}])
def test_samples_are_of_the_density(given_: dict[int, float] | None) -> None:
    density = random_blend(3, 2)
    found = marginal(density, [1]) if given_ is None else conditional(density, given_)
    drawn = found.sample((4000,), torch.Generator().manual_seed(0)).flatten().numpy()
    line = even_grid(8192, 1)
    cumulative = np.concatenate([[0], np.cumsum(found.log_prob(line).exp().numpy()) / len(line)])
    test = stats.kstest(
        drawn, lambda x: np.interp(x, np.arange(len(line) + 1) / len(line), cumulative)
    )
    assert test[1] > 0.01  # type: ignore[operator]
    if given_ is None:
        joint = density.sample((4000,), torch.Generator().manual_seed(1))[:, 1].numpy()
        assert stats.ks_2samp(drawn, joint)[1] > 0.01  # type: ignore[operator]


@given(seeds)
@few
def test_rows_that_lack_angles_have_their_marginal_density(seed: int) -> None:
    density = random_blend(seed, 3)
    rng = np.random.default_rng(seed)
    points = torch.tensor(rng.uniform(size=(7, 3)))
    points[torch.tensor(rng.uniform(size=(7, 3)) < 0.4)] = torch.nan
    found = log_prob_observed(density, points, measure="natural")
    for row, value in zip(points, found.tolist(), strict=True):
        kept = torch.nonzero(~row.isnan())[:, 0].tolist()
        if not kept:
            assert value == 0
        elif len(kept) == 3:
            assert value == pytest.approx(float(density.log_prob(row, measure="natural")), abs=1e-9)
        else:
            own = float(integrated(density, row[kept][None], kept)) - len(kept) * math.log(360)
            # several hidden angles may have quasi-random nodes
            assert value == pytest.approx(own, abs=1e-5 if len(kept) == 2 else 2e-3)


@pytest.mark.parametrize("seed", [0, 7, 11, 1560450])
def test_the_usual_error_is_that_of_samples(seed: int) -> None:
    density = random_blend(seed, 3)
    found = marginal(density, [0, 2])
    points = found.sample((300,), torch.Generator().manual_seed(7))
    off = found.log_prob(points) - integrated(density, points, [0, 2])
    assert float(off.square().mean().sqrt()) < 2 * found.error
    assert found.error <= found.largest_error < 0.01


def test_what_comes_out_is_saved(tmp_path) -> None:
    found = conditional(random_blend(5, 3), {1: 0.4})
    (tmp_path / "d").write_bytes(density_to_bytes(found))
    again, _ = read_density(tmp_path / "d")
    points = even_grid(9, 2)
    assert torch.equal(again.log_prob(points), found.log_prob(points))
    assert (again.error, again.largest_error) == (found.error, found.largest_error)
    assert isinstance(again.space, Torus)
    assert again.space.unit == "degrees"


@pytest.mark.parametrize("name", ["sphere", "projective-plane", "klein-bottle"])
def test_other_spaces_are_refused(name: str) -> None:
    space = make_space(name)
    density = FlowDensity(space, identity_flow(space))
    for call in (lambda: marginal(density, 0), lambda: conditional(density, {0: 0.5})):
        with refused(name):
            call()
    with refused(name):
        log_prob_observed(density, torch.tensor([[0.5, torch.nan]]))


def test_columns_that_are_not_there() -> None:
    fit = DensityEstimator("torus", components=("kernels",))
    fit.fit(np.random.default_rng(0).vonmises(0.0, 4.0, (40, 2)))
    for number in (2, -1, 10**9):
        with refused("0", "1", "angle1", "angle2"):
            fit.conditional({number: 1.0})
        with refused("columns", "numbered"):
            fit.marginal(number)


def test_mistakes_are_named() -> None:
    density = random_blend(0, 3)
    for axes in ([], [3], [0, 0], ["phi"], [-1], [True], None):
        with refused("axes"):
            marginal(density, axes)  # type: ignore[arg-type]
    with refused("given"):
        conditional(density, {})
    with refused("nothing", "left"):
        conditional(density, {0: 0.1, 1: 0.1, 2: 0.1})
    with refused("finite", "0"):
        conditional(density, {0: math.nan})
    with refused("infinite"):
        log_prob_observed(density, torch.tensor([[0.1, math.inf, 0.2]]))
