"""Bayesian networks of angles: exact, found where there is one."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import vonmises

import orbiflow.density as od
from density.blends import even_grid, random_chains, random_network
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.chains import Screen, fit_network, network_shapes
from orbiflow.density.models import averaged_networks, log_conditional
from orbiflow.density.models import network as drawing
from orbiflow.errors import OrbiflowError
from refusals import refused

seeds = st.integers(0, 2**31)
few = settings(deadline=None, max_examples=4)


def network_of(seed: int, dim: int, parents: int = 2) -> od.VonMisesNetwork:
    return random_network(np.random.default_rng(seed), od.Torus(dim), parents)


def at_random(seed: int, count: int, dim: int) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(seed).uniform(size=(count, dim)))


@given(seeds, st.integers(2, 4))
@few
def test_a_factor_is_the_joint_density_over_that_of_the_parents(seed: int, dim: int) -> None:
    chains = random_chains(np.random.default_rng(seed), od.Torus(dim), natural=True)
    points = at_random(seed, 9, dim)
    others = points[:, None].repeat(1, 400, 1)
    others[..., -1] = torch.arange(400) / 400
    expected = chains.log_prob(points) - chains.log_prob(others).exp().mean(dim=1).log()
    assert torch.allclose(log_conditional(chains, points), expected, atol=1e-9)


def without(header: dict[str, Any], **changes: Any) -> dict[str, Any]:
    factors = [dict(own) for own in header["factors"]]
    factors[-1] |= changes
    return {"factors": factors}


BROKEN: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "no factors": lambda _: {},
    "a factor too few": lambda header: {"factors": header["factors"][:-1]},
    "no axes": lambda header: without(header, axes=[]),
    "axes no list": lambda header: without(header, axes=3),
    "an axis too large": lambda header: without(header, axes=[0, 7]),
    "an axis no number": lambda header: without(header, axes=[0, "x"]),
    "an axis true": lambda header: without(header, axes=[0, True]),
    "components": lambda header: without(header, components=10**9),
    "another order": lambda header: {"factors": header["factors"][::-1]},
    "factors of numbers": lambda _: {"factors": [1, 2, 3]},
}


@pytest.mark.parametrize("case", BROKEN)
def test_damaged_headers_are_refused(case: str) -> None:
    network = network_of(0, 3)
    with pytest.raises(OrbiflowError):
        od.VonMisesNetwork.from_header(
            od.Torus(3), BROKEN[case](network.header()), network.tensors()
        )


def test_what_is_no_network_is_refused() -> None:
    rng, space = np.random.default_rng(0), od.Torus(2)
    one, two = (random_chains(rng, od.Torus(d), natural=True) for d in (1, 2))
    backwards = random_chains(rng, od.Torus(2), natural=True)
    backwards.order = backwards.order.flip(1)
    with refused("sphere"):
        od.VonMisesNetwork(od.make_space("sphere"), [])
    for factors, message in (
        ([od.Factor((0,), one)], "angles 2"),
        ([od.Factor((0, 1), two), od.Factor((0,), one)], "before parents"),
        ([od.Factor((0,), one), od.Factor((0,), one)], "second angle"),
        ([od.Factor((0,), two), od.Factor((1,), one)], "chains 2"),
        ([od.Factor((0,), one), od.Factor((0, 1), backwards)], "end angle"),
    ):
        with refused(*message.split()):
            od.VonMisesNetwork(space, factors)
    first, second = (
        od.VonMisesNetwork(space, [od.Factor((a,), one), od.Factor((a, 1 - a), two)])
        for a in (0, 1)
    )
    with refused("arrows"):
        averaged_networks([first, second])


@given(seeds, st.integers(2, 4), st.data())
@few
def test_some_angles_without_hidden_parents_are_exact(seed, dim, data: st.DataObject) -> None:
    network = network_of(seed, dim)
    order = [axes[-1] for axes, _ in network.factors]
    seen = order[: data.draw(st.integers(1, dim))]
    points = at_random(seed, 5, len(seen))
    hidden = [axis for axis in range(dim) if axis not in seen]
    grid = even_grid(24, len(hidden)) if hidden else torch.zeros(1, 0).double()
    whole = torch.zeros(5, len(grid), dim, dtype=torch.float64)
    whole[..., seen], whole[..., hidden] = points[:, None], grid
    expected = network.log_prob(whole).exp().mean(dim=1).log()
    assert torch.allclose(network.log_marginal(points, seen), expected, atol=1e-6)


@given(seeds, st.integers(2, 3), st.data())
@few
def test_hidden_parents_are_integrated_by_draws(seed: int, dim: int, data: st.DataObject) -> None:
    network = network_of(seed, dim)
    seen = data.draw(st.permutations(range(dim)))[: dim - 1]
    points = at_random(seed, 5, len(seen))
    hidden = [axis for axis in range(dim) if axis not in seen]
    whole = torch.zeros(5, 256, dim, dtype=torch.float64)
    whole[..., seen], whole[..., hidden] = points[:, None], even_grid(256, 1)
    expected = network.log_prob(whole).exp().mean(dim=1).log()
    found = torch.stack([network.log_marginal(points, list(seen), seed=k) for k in range(4)])
    assert float((found.exp().mean(dim=0).log() - expected).abs().max()) < 0.1
    assert torch.equal(found[0], network.log_marginal(points, list(seen), seed=0))


def sharp_links(
    sharpness: float,
) -> tuple[od.VonMisesChains, od.VonMisesChains, od.VonMisesNetwork]:
    """A first angle, a link, and four angles, each of which is linked to the one before."""
    pair = od.Torus(2)
    means = torch.zeros(1, 2, 5, dtype=torch.float64)
    means[0, 1, 1] = 1.0
    weights = torch.tensor([[0.0, -math.inf, -math.inf]], dtype=torch.float64)
    link = od.VonMisesChains(
        pair, weights, means, torch.tensor([[0.1, sharpness]], dtype=torch.float64)
    )
    first = od.VonMisesChains(
        od.Torus(1), weights, means[:, :1, [0, 1, 3]] * 0, torch.full((1, 1), 0.1).double()
    )
    links = [od.Factor((k, k + 1), link) for k in range(3)]
    return first, link, od.VonMisesNetwork(od.Torus(4), [od.Factor((0,), first), *links])


def test_sharp_links_are_eliminated() -> None:
    """Both hidden angles are sharp, given those before them."""
    first, link, network = sharp_links(3000.0)
    found = od.marginal(network, [0, 3])
    assert found.error < 0.01
    # the same by products of matrices on a grid that is no part of its own
    line, points = even_grid(500, 1), found.sample(20, torch.Generator().manual_seed(0))
    pairs = torch.cartesian_prod(line[:, 0], line[:, 0])
    step = log_conditional(link, pairs).exp().reshape(500, 500)
    into = log_conditional(link, torch.cartesian_prod(points[:, 0], line[:, 0])).exp()
    out = log_conditional(link, torch.cartesian_prod(line[:, 0], points[:, 1])).exp()
    hidden = torch.einsum(
        "pa,ab,bp->p", into.reshape(20, 500), step, out.reshape(500, 20)
    ).log() - 2 * math.log(500)
    expected = hidden + first.log_prob(points[:, :1])
    assert float((found.log_prob(points) - expected).abs().max()) < 0.01


def test_what_cannot_be_had_well_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Links too sharp for any grid, of which a few draws say too little."""
    monkeypatch.setattr(drawing, "DRAWS", 16)  # all of them do little better, and take seconds
    network = sharp_links(3e7)[2]
    with refused("better", "angle"):
        od.marginal(network, [0, 3])
    assert od.marginal(network, 0).error < 0.01


def states(seed: int, count: int, dim: int) -> np.ndarray:
    """A chain of angles, each in one of three states that the one before speaks for; shuffled."""
    rng = np.random.default_rng(seed)
    state = rng.integers(0, 3, count)
    columns: list[np.ndarray] = []
    for _ in range(dim):
        state = np.where(rng.uniform(size=count) < 0.85, state, rng.integers(0, 3, count))
        columns.append(rng.vonmises(2.1 * state, 12.0))
    return np.stack(columns, axis=1)


def test_arrows_are_along_the_chain() -> None:
    angles = torch.tensor(states(0, 600, 6)) / (2 * math.pi) % 1
    generator = torch.Generator().manual_seed(0)
    shuffled = torch.randperm(6, generator=generator)
    rows = Rows(angles[:, shuffled])
    shapes = list(network_shapes(rows[:500], rows[500:], generator))
    assert sorted(shape.axes[-1] for shape in shapes) == list(range(6))
    ends = [(shape.axes[0], shape.axes[-1]) for shape in shapes if len(shape.axes) > 1]
    assert [abs(int(shuffled[a]) - int(shuffled[b])) for a, b in ends] == [1] * 5
    network = fit_network(od.Torus(6), rows[:500], rows[500:], shapes, generator)
    alone = math.log(2 * math.pi / 3) - vonmises.entropy(12.0)  # an angle of three states
    assert float(network.log_prob(rows.points[500:]).mean()) > 6 * alone + 5 * 0.4


def test_the_default_takes_a_network_where_states_multiply() -> None:
    angles = states(5, 150, 6)
    fit = od.DensityEstimator("torus", components="auto", seed=1).fit(angles[:120])
    evidence = {part.name: part for part in fit.report_.components}
    assert evidence.keys() == {"kernels", "mixture", "chains", "network"}
    best = max(part.alone for name, part in evidence.items() if name != "network")
    assert evidence["network"].alone > best + 0.5
    assert evidence["network"].share > 0.5
    small = np.random.default_rng(0).vonmises(0, 2, (50, 2))
    with refused("network"):
        od.DensityEstimator("torus", components="network").fit(small)


@given(seeds)
@few
def test_what_angles_say_of_each_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    free = rng.uniform(-np.pi, np.pi, (800, 3))
    tied = np.concatenate([free, free[:, :1] + rng.vonmises(0, 8, (800, 1))], axis=1)
    screen = Screen(torch.tensor(tied / (2 * np.pi)))
    assert screen.between(0, 3) == pytest.approx(screen.between(3, 0), abs=1e-9)
    assert screen.between(0, 3) > 0.5 > 0.15 > abs(screen.between(0, 1))
    assert screen.parents(3, (), [0, 1, 2])[0] == 0
    assert set(screen.order()[:2]) == {0, 3}
