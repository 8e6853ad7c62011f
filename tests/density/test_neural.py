"""Neural flows and mixtures of von Mises chains on tori of many angles."""

import json
import math
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import (
    NeuralFlow,
    NeuralSettings,
    Sphere,
    SymmetricDensity,
    Torus,
    VonMisesChains,
    fit_chains,
    fit_neural,
    midpoints,
)
from orbiflow.density.fitting.chains import concentration
from orbiflow.density.models import SCALES, chained
from orbiflow.density.storage.components import (
    chains_from_header,
    chains_header,
    chains_tensors,
    neural_from_header,
    neural_header,
    neural_tensors,
)
from orbiflow.errors import OrbiflowError
from orbiflow.fields import (
    NeuralTorusField,
    speed,
    way,
)

seeds = st.integers(0, 2**31 - 1)
dims = st.integers(1, 5)


def random_flow(dim: int, seed: int, *, size: float = 0.3, **options: Any) -> NeuralFlow:
    """A flow whose last layer is not zero."""
    field = NeuralTorusField(dim, **{"width": 16, "depth": 3, **options}, seed=seed)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        field.last.weight.normal_(0.0, size / 16, generator=generator)
        field.last.bias.normal_(0.0, 0.05, generator=generator)
    return NeuralFlow(field, steps=12)


def random_mixture(dim: int, seed: int, count: int = 4, most: float = 30.0) -> VonMisesChains:
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.ones(count * len(SCALES))).reshape(count, -1)
    order = torch.tensor(rng.permuted(np.tile(np.arange(dim), (count, 1)), axis=1))
    means = torch.tensor(rng.normal(size=(count, dim, 1 + 2 * dim))) * chained(order)
    kappa = torch.tensor(rng.uniform(0, most, (count, dim)))
    return VonMisesChains(Torus(dim), torch.tensor(np.log(weights)), means, kappa, order)


def random_density(dim: int, seed: int) -> SymmetricDensity:
    return SymmetricDensity(Torus(dim), random_flow(dim, seed), random_mixture(dim, seed))


def points(count: int, dim: int, seed: int) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(seed).random((count, dim)))


@settings(max_examples=6)
@given(dims, seeds)
def test_log_prob_is_periodic(dim: int, seed: int) -> None:
    density, at = random_density(dim, seed), points(7, dim, seed)
    shift = torch.tensor(np.random.default_rng(seed).integers(-3, 4, (7, dim)), dtype=at.dtype)
    assert torch.allclose(density.log_prob(at + shift), density.log_prob(at), atol=1e-9)
    assert torch.allclose(density.flow(at + shift), density.flow(at) + shift, atol=1e-9)
    assert torch.equal(density.flow.trajectories(at)[-1], density.flow(at))


@settings(max_examples=6)
@given(dims, seeds)
def test_inverse_undoes_forward(dim: int, seed: int) -> None:
    flow, at = random_flow(dim, seed).with_steps(48), points(7, dim, seed)
    with torch.no_grad():
        moved, log_det = flow.forward_and_log_det(at)
        back, minus = flow.inverse_and_log_det(moved)
        assert torch.allclose(back, at, atol=1e-6)
        assert torch.allclose(log_det, -minus, atol=1e-5)
        assert torch.allclose(flow(at), moved, atol=1e-12)
        assert torch.allclose(flow.inverse(moved), back, atol=1e-12)


@settings(max_examples=6)
@given(dims, seeds, st.integers(1, 3), st.integers(1, 3))
def test_divergence_is_the_trace(dim: int, seed: int, depth: int, waves: int) -> None:
    field = random_flow(dim, seed, depth=depth, waves=waves).field
    at, now = points(3, dim, seed), torch.tensor(0.3, dtype=torch.float64)
    value, trace = field.with_divergence(at, now)
    assert torch.allclose(value, field(at, now))
    for k in range(3):
        table = torch.autograd.functional.jacobian(lambda x: field(x, now), at[k])
        assert torch.allclose(torch.as_tensor(table).trace(), trace[k])
    many = torch.full((3, 1), 0.3, dtype=torch.float64)
    assert torch.allclose(field.with_divergence(at, many)[1], trace)


@settings(max_examples=6)
@given(st.integers(1, 4), seeds)
def test_log_det_is_that_of_the_jacobian(dim: int, seed: int) -> None:
    flow, at = random_flow(dim, seed).with_steps(32), points(2, dim, seed)
    log_det = flow.forward_and_log_det(at)[1]
    for k in range(2):
        table = torch.autograd.functional.jacobian(flow, at[k])
        assert torch.allclose(torch.linalg.slogdet(table).logabsdet, log_det[k], atol=1e-5)


@settings(max_examples=6)
@given(st.integers(1, 2), seeds)
def test_density_integrates_to_one(dim: int, seed: int) -> None:
    density = random_density(dim, seed)
    density = density.with_steps(6)
    with torch.no_grad():
        if dim == 2:
            grid = midpoints(density.space, 96)
        else:
            grid = (torch.arange(400, dtype=torch.float64)[:, None] + 0.5) / 400
        assert float(density.log_prob(grid).exp().mean()) == pytest.approx(1.0, abs=2e-3)


def test_the_clock_slows_down() -> None:
    now = torch.linspace(0, 1, 11, dtype=torch.float64, requires_grad=True)
    gone = way(now)
    assert float(gone[0].detach()) == 0
    assert float(gone[-1].detach()) == pytest.approx(1.0)
    assert torch.allclose(torch.autograd.grad(gone.sum(), now)[0], speed(now))


@settings(max_examples=5)
@given(seeds)
def test_mixture_samples_follow_its_density(seed: int) -> None:
    mixture = random_mixture(2, seed, most=5.0)
    drawn = mixture.sample(20_000, torch.Generator().manual_seed(seed))
    assert torch.equal(drawn, mixture.sample(20_000, torch.Generator().manual_seed(seed)))
    cells = 8
    grid = midpoints(mixture.space, 160)
    number = lambda x: ((x * cells).long() % cells) @ torch.tensor([cells, 1])  # noqa: E731
    expected = torch.zeros(cells**2, dtype=torch.float64)
    expected.index_add_(0, number(grid), mixture.log_prob(grid).exp() / len(grid))
    found = torch.bincount(number(drawn), minlength=cells**2) / len(drawn)
    assert float((found - expected).abs().sum()) < 0.1


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
        with pytest.raises(OrbiflowError, match="order"):
            VonMisesChains(*parts, bad)
    with pytest.raises(OrbiflowError, match="chained"):
        VonMisesChains(*parts, good.order.flip(1))


@given(st.lists(st.floats(0.01, 0.9999), min_size=1, max_size=5))
def test_concentration_inverts_the_bessel_ratio(resultants: list[float]) -> None:
    r = torch.tensor(resultants, dtype=torch.float64)
    kappa = concentration(r)
    assert torch.allclose(torch.special.i1e(kappa) / torch.special.i0e(kappa), r, atol=1e-6)


@settings(max_examples=6)
@given(dims, seeds, st.integers(1, 3))
def test_storage_is_bit_equal(dim: int, seed: int, depth: int) -> None:
    flow, base, space = random_flow(dim, seed, depth=depth), random_mixture(dim, seed), Torus(dim)
    header = json.loads(json.dumps([neural_header(flow), chains_header(base)]))
    tensors = {**neural_tensors(flow), **chains_tensors(base)}
    again = SymmetricDensity(
        space,
        neural_from_header(header[0], tensors, space),  # type: ignore[arg-type]
        chains_from_header(header[1], tensors, space),
    )
    at = points(9, dim, seed)
    density = SymmetricDensity(space, flow, base)  # type: ignore[arg-type]
    assert torch.equal(again.log_prob(at), density.log_prob(at))


@pytest.mark.parametrize(
    "change",
    [
        {"width": 10**9},
        {"width": 17},
        {"width": True},
        {"depth": 0},
        {"depth": 2},
        {"depth": "3"},
        {"waves": 3},
        {"waves": None},
        {"dim": 4},
        {"dim": 2},
        {"steps": 0},
        {"steps": 10**7},
        {"method": "exact"},
        {"method": 4},
    ],
)
def test_hostile_flow_headers_are_rejected(change: dict[str, Any]) -> None:
    flow = random_flow(3, 0)
    with pytest.raises(OrbiflowError):
        neural_from_header({**neural_header(flow), **change}, neural_tensors(flow), Torus(3))


@pytest.mark.parametrize("change", [{"components": 5}, {"components": -1}, {"scales": [1.0]}])
def test_hostile_mixture_headers_are_rejected(change: dict[str, Any]) -> None:
    base = random_mixture(3, 0)
    with pytest.raises(OrbiflowError):
        chains_from_header({**chains_header(base), **change}, chains_tensors(base), Torus(3))


def test_hostile_tensors_are_rejected() -> None:
    flow, base, space = random_flow(3, 0), random_mixture(3, 0), Torus(3)
    weights = neural_tensors(flow)
    for value in (torch.full((3,), math.nan), torch.zeros(4), torch.zeros(3, dtype=torch.long)):
        with pytest.raises(OrbiflowError):
            neural_from_header(neural_header(flow), {**weights, "flow.last.bias": value}, space)
    with pytest.raises(OrbiflowError):
        neural_from_header(neural_header(flow), {**weights, "flow.more": torch.zeros(1)}, space)
    parts, header = chains_tensors(base), chains_header(base)
    for name in parts:
        with pytest.raises(OrbiflowError):
            chains_from_header(header, {k: v for k, v in parts.items() if k != name}, space)
        with pytest.raises(OrbiflowError):
            chains_from_header(header, {**parts, name: parts[name] + math.nan}, space)
        with pytest.raises(OrbiflowError):
            chains_from_header(header, {**parts, name: 1 - 2 * parts[name].abs() - 9}, space)


def test_arguments_are_checked() -> None:
    with pytest.raises(OrbiflowError, match="width"):
        NeuralTorusField(3, width=0)
    with pytest.raises(OrbiflowError, match="steps"):
        NeuralFlow(NeuralTorusField(3), steps=0)
    with pytest.raises(OrbiflowError, match="for tori"):
        fit_neural(Sphere(), torch.rand(20, 2))
    with pytest.raises(OrbiflowError, match="10 different"):
        fit_neural(Torus(4), torch.zeros(20, 4))
    for bad in (
        {"components": 0},
        {"batch": 0},
        {"validation": 1.0},
        {"base": "flat"},
        {"seconds": math.nan},
        {"matching": -1},
    ):
        with pytest.raises(OrbiflowError, match=next(iter(bad))):
            NeuralSettings(**bad)  # type: ignore[arg-type]


def chained_angles(count: int, seed: int = 0) -> torch.Tensor:
    """Four angles, each near a function of the one before; two clusters."""
    rng = np.random.default_rng(seed)
    first = np.where(rng.random(count) < 0.6, 0.1, 0.6) + 0.05 * rng.normal(size=count)
    columns = [first]
    for _ in range(3):
        wave = 0.1 * np.sin(2 * np.pi * columns[-1])
        columns.append(columns[-1] + wave + 0.03 * rng.normal(size=count))
    return Torus(4).project(torch.tensor(np.stack(columns, axis=1)))


QUICK = NeuralSettings(components=8, members=2, width=16, depth=2, refinement=20, batch=64)


def test_small_fit_beats_uniform_and_repeats() -> None:
    space, data = Torus(4), chained_angles(500)
    density, report = fit_neural(space, torch.cat([data, data[:20]]), QUICK)
    again, _ = fit_neural(space, torch.cat([data, data[:20]]), QUICK)
    fresh = chained_angles(500, seed=1)
    with torch.no_grad():
        assert torch.equal(density.log_prob(fresh), again.log_prob(fresh))
        assert float(density.log_prob(fresh).mean()) > 2.0  # uniform has 0
    assert report.duplicates == 20
    assert "20 of 520 points repeat another" in report.notes[0]
    assert report.validation_nll <= report.start_nll + 1e-2
    assert report.integration_error < 1e-3
    assert report.mass is None


def test_flow_matching_alone_beats_uniform() -> None:
    options = NeuralSettings(
        base="uniform", width=24, depth=2, matching=300, refinement=10, batch=128, steps=4
    )
    density, report = fit_neural(Torus(4), chained_angles(500), options)
    with torch.no_grad():
        assert float(density.log_prob(chained_angles(300, seed=1)).mean()) > 0.5
    assert report.validation_nll < -0.5
    assert report.integration_error < 1e-3


def test_mixture_finds_correlations() -> None:
    data = chained_angles(800)
    found = fit_chains(Torus(4), data[:700], data[700:], components=16, members=2)
    # of the data's own chain: three normals of width 0.03 and a mixture of two of width 0.05
    fresh = chained_angles(2000, seed=1)
    entropy = sum(0.5 * math.log(2 * math.pi * math.e * s**2) for s in (0.03, 0.03, 0.03, 0.05))
    best = -entropy + 0.6 * math.log(0.6) + 0.4 * math.log(0.4)
    assert float(found.mixture.log_prob(fresh).mean()) > best - 0.2
