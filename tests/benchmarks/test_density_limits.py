"""What the record of published figures rests on: known densities, groups, integrals, entropies."""

import importlib
import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from density.quick_fits import quick_fits
from orbiflow.density import DensityEstimator, Mixture

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(name="module")
def module_fixture(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module


@pytest.mark.parametrize("dim", range(4, 15))
def test_side_chains_of_all_dimensions_are_in_the_repository(module, dim: int) -> None:
    drawn = module("density_data").sidechains(dim)
    assert drawn.data.shape[1] == dim
    assert len(drawn.data) == len(drawn.group) > 1_000
    assert abs(drawn.data).max() <= math.pi
    assert len(np.unique(drawn.data, axis=0)) > 0.99 * len(drawn.data)


def test_the_known_density_is_a_sum_over_paths(module) -> None:
    drawn = module("density_known").hidden_markov_chain(2)
    grid = (np.arange(96) + 0.5) / 96 * 2 * np.pi - np.pi
    points = np.array(list(itertools.product(grid, grid)))
    assert np.exp(drawn.log_density(points)).mean() * 4 * np.pi**2 == pytest.approx(1, abs=1e-6)
    shares = np.exp(drawn.log_density(points)).reshape(96, 96).sum(axis=1)
    counts = np.histogram(drawn.data[:, 0], 96, (-np.pi, np.pi))[0]
    assert abs(shares / shares.sum() - counts / counts.sum()).sum() < 0.2


@pytest.mark.parametrize("seed", range(5))
def test_groups_stay_on_one_side(module, seed: int) -> None:
    halves, drawn = module("density_default").halves, module("density_data").Drawn
    group = np.random.default_rng(seed).integers(60, size=900)
    rows = np.stack([np.arange(900.0), group], axis=1)
    train, test = halves(drawn(rows, "torus"), seed, group)
    assert len(train) + len(test) == 900
    assert 90 <= len(test) < 150
    assert not set(train[:, 1]) & set(test[:, 1])


def test_narrow_kernels_are_those_of_the_kernel_estimate(module) -> None:
    limits, kde = module("density_limits"), module("density_kde")
    rng = np.random.default_rng(0)
    train = rng.vonmises(0.0, 3e4, (400, 3))
    test = rng.vonmises(0.0, 3e4, (50, 3))
    for round_, rows, places in (
        (False, train, test),
        (True, np.degrees(train[:, :2]), np.degrees(test[:, :2])),
    ):
        own = limits.narrow_log_density(rows, places, 1e5, round_=round_)
        other = kde.KernelDensity(rows, 1e5, round_=round_).score_samples(places)
        assert own == pytest.approx(other, abs=1e-3)


def test_repeated_rows_are_worth_any_number_of_nats(module) -> None:
    limits = module("density_limits")
    rng = np.random.default_rng(1)
    places = rng.uniform(-np.pi, np.pi, (300, 2))
    parts = [places[rng.integers(300, size=n)] for n in (600, 200, 200)]
    kappas = np.array([1e6, 1e10])
    _, found = limits.with_narrow(*parts, kappas, round_=False)
    assert found[1][0] < found[0][0] - 1
    parts = [rng.uniform(-np.pi, np.pi, (n, 2)) for n in (600, 200, 200)]
    bare, found = limits.with_narrow(*parts, kappas, round_=False)
    assert [nll for nll, _ in found] == pytest.approx([bare, bare], abs=0.02)


def test_entropy_by_neighbours(module) -> None:
    rng = np.random.default_rng(2)
    found = module("density_limits").neighbour_entropy(rng.uniform(-9, 9, (20_000, 2)) * np.pi / 9)
    assert found == pytest.approx(2 * math.log(2 * math.pi), abs=0.05)


@pytest.mark.parametrize("dim", [2, 4])
def test_the_integral_is_seen_from_values(module, dim: int, monkeypatch) -> None:
    quick_fits(monkeypatch)
    monkeypatch.setattr(module("density_integral"), "GRID", 128)
    monkeypatch.setattr(module("density_integral"), "LOOKED_AT", 20)
    integral = module("density_integral").integral
    rng = np.random.default_rng(4)
    rows = rng.vonmises(rng.uniform(-3, 3, (3, dim))[rng.integers(3, size=240)], 20.0)
    rows[:40] = rows[40:80]  # so that there are narrow kernels
    density = (
        DensityEstimator("torus", components="kernels,mixture,chains", seed=0).fit(rows).density_
    )
    assert isinstance(density, Mixture)
    found = integral(density)
    assert found.value == pytest.approx(1, abs=1e-4)
    assert found.worst < 1e-6
    # and it would be seen if a constant were wrong
    for part, weight in zip(density.components, density.weights.tolist(), strict=True):
        if part.kind == "uniform" or weight < 0.01:
            continue
        method = "log_chart" if part.kind == "chains" else "log_density"
        right = getattr(type(part), method)
        with monkeypatch.context() as patched:
            patched.setattr(type(part), method, lambda self, *x, own=right: own(self, *x) + 0.1)
            off = 0.1 * weight
            assert integral(density).value - found.value == pytest.approx(off, rel=0.1)
