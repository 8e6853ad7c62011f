"""Marginal and conditional densities against the joint one, how exact, saved and stopped."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st

import orbiflow.density as od
from density.blends import (
    even_grid,
    identity_flow,
    kernels_of,
    random_blend,
    random_chains,
    random_network,
    stored,
)
from orbiflow.density.inference import log_prob_observed
from orbiflow.density.models import LEVELS, Split, kernels_for
from refusals import refused

seeds = st.integers(0, 2**31)
few = settings(deadline=None, max_examples=6)
GRID = {2: 256, 3: 64}
"""Points an angle that resolve what `random_blend` makes."""


def integrated(density: od.Density, points: torch.Tensor, kept: list[int]) -> torch.Tensor:
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
    found = od.marginal(density, kept)
    points = torch.tensor(np.random.default_rng(seed).uniform(size=(20, len(kept))))
    expected = integrated(density, points, list(kept))
    assert (found.log_prob(points) - expected).abs().max() < 1e-5 + 2 * found.largest_error
    assert float(found.log_prob(even_grid(128, len(kept))).exp().mean()) == pytest.approx(
        1, abs=1e-6
    )


@given(seeds, st.lists(st.integers(0, 2), min_size=1, max_size=2, unique=True))
@example(1560450, [0, 1])  # these were off by up to 130 times what was stated
@example(17, [1])
@settings(deadline=None, max_examples=3)
def test_conditional_times_marginal_is_joint(seed: int, known: list[int]) -> None:
    density = random_blend(seed, 3)
    left = [axis for axis in range(3) if axis not in known]
    rng = np.random.default_rng(seed)
    at = rng.uniform(-1, 2, len(known))
    found = od.conditional(density, dict(zip(known, at.tolist(), strict=True)))
    points = torch.tensor(rng.uniform(size=(20, 3)))
    points[:, known] = torch.tensor(at)
    other = od.marginal(density, known)
    product = found.log_prob(points[:, left]) + other.log_prob(points[:, known])
    off = found.largest_error + other.largest_error
    assert (product - density.log_prob(points)).abs().max() < 1e-5 + 2 * off
    mass = float(found.log_prob(even_grid(128, len(left))).exp().mean())
    assert mass == pytest.approx(1, abs=1e-6)


@given(seeds)
@settings(deadline=None, max_examples=1)
def test_flows_are_integrated(seed: int) -> None:
    density = random_blend(seed, 2, flow=True)
    points = even_grid(7, 1)
    with pytest.MonkeyPatch.context() as patch:  # of what is smooth
        patch.setattr("orbiflow.density.models.kernels.FIRST_GRID", {1: 64})
        patch.setattr("orbiflow.density.inference.partial.CHECKED", 40)
        found = od.marginal(density, 1, accuracy=0.01)
        slice_ = od.conditional(density, {0: 0.3}, accuracy=0.01)
    assert (found.log_prob(points) - integrated(density, points, [1])).abs().max() < 1e-4
    whole = torch.cat([torch.full_like(points, 0.3), points], dim=1)
    with torch.no_grad():
        expected = density.log_prob(whole) - integrated(density, points[:1] * 0 + 0.3, [0])
    assert (slice_.log_prob(points) - expected).abs().max() < 1e-4
    assert max(found.error, slice_.error) < 2e-4


@given(seeds, st.data())
@few
def test_many_angles_without_tables(seed: int, data: st.DataObject) -> None:
    """Kernels are closed in any number of angles."""
    density = random_blend(seed, 6, chains=False)
    known = data.draw(st.permutations(range(6)))[:3]
    at = {axis: 0.1 * (axis + 1) for axis in known}
    left = [axis for axis in range(6) if axis not in at]
    found = od.conditional(density, at)
    points = torch.tensor(np.random.default_rng(seed).uniform(size=(9, 6)))
    for axis, value in at.items():
        points[:, axis] = value
    product = found.log_prob(points[:, left]) + od.marginal(density, known).log_prob(
        points[:, known]
    )
    # a part keeps a share of 1e-9 where what is known leaves it less, and adds as much of its density
    own = points[:, left]
    assert isinstance(found, od.Mixture)
    added = (kernels_of(found).log_prob(own) - found.log_prob(own)).exp()
    added = added + (-found.log_prob(own)).exp()
    assert ((product - density.log_prob(points)).abs() < 1e-9 * (1 + 2 * added)).all()
    assert found.error == 0


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


def test_mistakes_are_named() -> None:
    density = random_blend(0, 3)
    for axes in ([], [3], [0, 0], ["phi"], [-1], [True], None):
        with refused("axes"):
            od.marginal(density, axes)  # type: ignore[arg-type]
    with refused("given"):
        od.conditional(density, {})
    with refused("nothing", "left"):
        od.conditional(density, {0: 0.1, 1: 0.1, 2: 0.1})
    with refused("finite", "0"):
        od.conditional(density, {0: math.nan})
    with refused("infinite"):
        log_prob_observed(density, torch.tensor([[0.1, math.inf, 0.2]]))
    for name in ("sphere", "projective-plane", "klein-bottle"):
        space = od.make_space(name)
        other = od.FlowDensity(space, identity_flow(space))
        with refused(name):
            od.marginal(other, 0)
        with refused(name):
            od.conditional(other, {0: 0.5})
        with refused(name):
            log_prob_observed(other, torch.tensor([[0.5, torch.nan]]))


SHARP_GRID = 48
"""Points an angle that resolve what `sharp` makes."""


def sharp(seed: int, dim: int, kind: str) -> od.Density:
    """Chains in any order, or a network, of deviations down to a sixth of a radian."""
    rng, space = np.random.default_rng(seed), od.Torus(dim)
    if kind == "network":
        return random_network(rng, space)
    own = random_chains(rng, space, 4)
    sharper = own.concentrations * (3 if dim < 4 else 1)
    return od.VonMisesChains(space, own.log_weights, own.means, sharper, own.order)


def true_log(
    density: od.Density, points: torch.Tensor, kept: list[int], known: dict[int, float]
) -> torch.Tensor:
    """Log density of what is kept, at points (N, k), and of what is known, by quadrature."""
    hidden = [axis for axis in range(density.space.dim) if axis not in kept and axis not in known]
    nodes = even_grid(SHARP_GRID, len(hidden)) if hidden else torch.zeros(1, 0).double()
    whole = points.new_empty(len(points), len(nodes), density.space.dim)
    whole[:, :, kept], whole[:, :, hidden] = points[:, None], nodes
    for axis, value in known.items():
        whole[:, :, axis] = value
    return density.log_prob(whole).logsumexp(dim=1) - math.log(len(nodes))


def off(found: od.Density, density: od.Density, kept: list[int], known: dict[int, float]) -> float:
    """Root mean square error of a derived density, in nats, at its own samples."""
    points = found.sample(60, torch.Generator().manual_seed(7))
    none = torch.zeros(1, 0, dtype=torch.float64)
    evidence = true_log(density, none, [], known) if known else 0.0
    truth = true_log(density, points, kept, known) - evidence
    return float((found.log_prob(points) - truth).square().mean().sqrt())


@given(seeds, st.sampled_from(["chains", "network"]), st.integers(0, 1), st.data())
@settings(deadline=None, max_examples=3)
def test_tables_are_the_integral_at_every_level(seed, kind, known, data: st.DataObject) -> None:
    """What is kept and given together: its density, and so what the given angle says of components.

    What is stated is a root mean square over the density's own rows, found from the change between two
    levels; places in tails, which few rows meet, may be off by several times that.
    """
    density = sharp(seed, 3, kind)
    one, other, _ = data.draw(st.permutations(range(3)))
    values = {other: 0.37} if known else {}
    split = Split(3, (one,), tuple(values), tuple(values.values()))
    points = even_grid(SHARP_GRID, 1)
    truth = true_log(density, points, [one], values)
    found: list[torch.Tensor] = []
    for level in range(LEVELS - 1):
        parts = kernels_for(density, split, od.Torus(1), level, lambda: None)
        found.append(
            torch.stack([log + own.log_prob(points) for log, own in parts]).logsumexp(dim=0)
        )

    def nats(change: torch.Tensor) -> float:
        return float((torch.softmax(truth, dim=0) @ change.square()).sqrt())

    errors = [nats(logs - truth) for logs in found]
    for error, before, after in zip(errors[1:], found, found[1:], strict=False):
        assert error < 1.1 * nats(after - before) + 5e-4
    assert errors[0] < 0.2
    assert errors[-1] < 0.01


def test_even_chains_need_no_fine_grid() -> None:
    logs, means = torch.full((1, 3), -math.log(3)).double(), torch.zeros(1, 3, 7).double()
    even = od.VonMisesChains(od.Torus(3), logs, means, torch.zeros(1, 3).double())
    split = Split(3, (1, 2), (), ())
    ((log, found),) = even.approximated(split, od.Torus(2), 0, lambda: None)
    assert log == pytest.approx(0, abs=1e-6)
    assert len(found.centers) <= 24**2  # pyright: ignore[reportAttributeAccessIssue]


@given(seeds, st.sampled_from([{}, {3: 0.1}]))
@settings(deadline=None, max_examples=3)
def test_few_nodes_do_where_hidden_angles_move_others_far(seed, known: dict[int, float]) -> None:
    """By six deviations of their own noise, so that the nodes alone leave bumps apart."""
    rng = np.random.default_rng(seed)
    means = torch.zeros(1, 4, 9).double()
    means[0, 2, 1:3] = means[0, 3, 1:3] = torch.tensor(rng.uniform(0.7, 1.3, 2))
    means[0, 3, 1] *= -1
    kappa = torch.tensor([[30.0, 30.0, 900.0, 900.0]]).double()
    logs = torch.tensor([[0.98, 0.01, 0.01]]).double().log()
    chains = od.VonMisesChains(od.Torus(4), logs, means, kappa)
    kept = [axis for axis in (2, 3) if axis not in known]
    split = Split(4, tuple(kept), tuple(known), tuple(known.values()))
    parts = chains.approximated(split, od.Torus(len(kept)), 1, lambda: None)
    points = chains.sample(10, torch.Generator().manual_seed(seed % 100))[:, kept]
    found = torch.stack([log + own.log_prob(points) for log, own in parts]).logsumexp(dim=0)
    line = torch.arange(240, dtype=torch.float64) / 240
    nodes = torch.cartesian_prod(line, line)
    whole = points.new_empty(len(points), len(nodes), 4)
    whole[:, :, :2], whole[:, :, kept] = nodes, points[:, None]
    for axis, value in known.items():
        whole[:, :, axis] = value
    truth = chains.log_prob(whole).logsumexp(dim=1) - math.log(len(nodes))
    assert float((found - truth).square().mean().sqrt()) < 0.8  # nodes alone: 1 to 5


@given(seeds, st.data())
@settings(deadline=None, max_examples=4)
def test_an_error_is_at_least_the_true_one(seed: int, data: st.DataObject) -> None:
    """Also that of a density which is derived from a derived one, where both are asked for roughly."""
    kind, dim = data.draw(st.sampled_from([("chains", 4), ("chains", 4), ("network", 3)]))
    density = sharp(seed, dim, kind)
    first, second, third, *_ = data.draw(st.permutations(range(dim)))
    at, accuracy = data.draw(st.floats(0, 1)), data.draw(st.sampled_from([0.3, 0.02]))
    both = od.marginal(density, [first, second], accuracy=accuracy)
    for found, kept, known in (
        (both, [first, second], {}),
        (od.marginal(both, 1, accuracy=accuracy), [second], {}),
        (od.conditional(both, {0: at}, accuracy=accuracy), [second], {first: at}),
        (od.conditional(density, {third: at}, first, accuracy=accuracy), [first], {third: at}),
    ):
        assert found.error < accuracy * (1 + 2 * (kept == [second]))
        if dim == 3 or [*kept, *known] != [second]:  # no quadrature over three hidden angles
            assert off(found, density, kept, known) < 1.1 * found.error + 5e-4


@pytest.mark.parametrize("seed", [1])
def test_a_rough_error_is_seen(seed: int) -> None:
    """Quasi-random nodes of two hidden angles are few at first."""
    density = sharp(seed, 4, "chains")
    found = od.marginal(density, [0, 1], accuracy=0.3)
    assert 1e-3 < found.error < 0.3
    assert 0.1 * found.error < off(found, density, [0, 1], {}) < 1.1 * found.error


def test_the_error_of_the_first_step_is_kept(tmp_path: Path) -> None:
    first = od.marginal(random_blend(1, 3, network=False), [0, 1])
    first.error, first.largest_error = 0.02, 0.03
    one, other = od.marginal(first, 0), od.conditional(first, {1: 0.3})
    assert one.error >= 0.02
    assert other.error > 0.01
    assert one.largest_error >= 0.03
    assert other.largest_error >= 0.06  # of the joint density and of what is given
    again = stored(first, tmp_path)
    assert (again.error, again.largest_error) == (0.02, 0.03)
    assert again.space == first.space


@pytest.mark.parametrize("given", [None, {1: 0.3}])
def test_three_angles_ask_the_whole(tmp_path: Path, given: dict[int, float] | None) -> None:
    density = random_blend(2, 4, network=True)
    found = od.marginal(density, [0, 2, 3]) if given is None else od.conditional(density, given)
    again = stored(found, tmp_path)
    drawn = again.sample(200, torch.Generator().manual_seed(0))
    assert torch.equal(again.log_prob(drawn[:5]), found.log_prob(drawn[:5]))
    assert drawn.shape == (200, 3)
    axis = od.marginal(density, 2) if given is None else od.conditional(density, given, 2)
    twice, line = od.marginal(again, 1), even_grid(16, 1)
    assert float((twice.log_prob(line) - axis.log_prob(line)).abs().max()) < 0.05


def test_samples_are_of_what_is_given() -> None:
    """They are chosen among weighed draws: mean sines and cosines against quadrature."""
    network = random_network(np.random.default_rng(4), od.Torus(3))
    density = od.Mixture([network, sharp(4, 3, "chains")], [0.5, 0.5])
    last = network.factors[-1].axes[-1]  # so that neither has a closed form
    kept = [axis for axis in range(3) if axis != last]
    drawn = od.conditional(density, {last: 0.6}).sample(4000, torch.Generator().manual_seed(1))
    grid = even_grid(SHARP_GRID, 2)
    weights = torch.softmax(true_log(density, grid, kept, {last: 0.6}), dim=0)
    for function in (torch.sin, torch.cos):
        expected = weights @ function(2 * math.pi * grid)
        found = function(2 * math.pi * drawn)
        assert (
            (found.mean(dim=0) - expected).abs() < 4 * found.std(dim=0) / 4000**0.5 + 0.01
        ).all()
