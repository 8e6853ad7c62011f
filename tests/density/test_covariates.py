"""Densities where covariates are known: mass, truth, useless covariates, files, scikit-learn."""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from orbiflow.density import DensityEstimator, UniformDensity, make_space
from orbiflow.density.cross_validation import cross_validate
from orbiflow.density.data import given_roles
from orbiflow.density.fitting import GivenReport
from orbiflow.density.models import (
    AdaptiveKernels,
    CircularRegression,
    ConditionalDensity,
    ConditionalKernels,
    JointDensity,
    KnownRows,
    NeuralMixture,
    Unconditional,
    density_to_bytes,
    joint_torus,
    read_density,
)
from orbiflow.density.spaces import Covariates, ProductSpace, Torus
from orbiflow.errors import DataWarning, InputFileError
from orbiflow.loading import load, save
from refusals import refused, warned

WORDS = {"GLY": 0.0, "PRO": 2.0}
QUICK: dict[str, Any] = {"unit": "radians", "components": "kernels", "effort": "fast"}


def drawn(count: int, seed: int = 0) -> tuple[Any, dict[str, Any], Any]:
    """Angles (N, 1), what is known of them, and their true log densities."""
    rng = np.random.default_rng(seed)
    cells = {
        "temperature": rng.standard_t(4, count),
        "hour": rng.uniform(0, 24, count),
        "residue": rng.choice(list(WORDS), count),
    }
    mean = 0.8 * np.tanh(cells["temperature"]) + 0.6 * np.sin(2 * np.pi * cells["hour"] / 24)
    mean += np.array([WORDS[word] for word in cells["residue"]])
    angles = rng.vonmises(mean, 10.0)
    return angles[:, None], cells, stats.vonmises.logpdf(angles, 10.0, loc=mean)


@pytest.fixture(scope="module")
def fit() -> DensityEstimator:
    angles, cells, _ = drawn(350)
    whole = {**QUICK, "effort": "normal"}
    return DensityEstimator(**whole, columns={"hour": "cycle:24"}).fit(angles, given=cells)


def report_of(fit: DensityEstimator) -> GivenReport:
    """How it was chosen."""
    assert fit.report_.given is not None
    return fit.report_.given


def random_density(seed: int, space: Any, dims: int) -> ConditionalDensity:
    """A mixture of all parts with random parameters, where a number, a cycle and a word are known."""
    rng = np.random.default_rng(seed)
    cells = {
        "x": rng.normal(size=40) * 10.0 ** rng.integers(-3, 4),
        "hour": rng.uniform(0, 24, 40),
        "kind": rng.choice(["a", "b", "c"], 40),
    }
    cells["kind"][:3] = ["a", "b", "c"]
    if isinstance(space, Torus):
        del cells["kind"]  # there is a joint density, which takes none
    covariates = Covariates.of(cells, given_roles(list(cells), cells, {}, are_asked=False))
    x = covariates.features(cells)
    points = space.to_chart(rng.uniform(-1, 1, (40, dims)))
    wide = torch.tensor(rng.uniform(0.05, 3, len(covariates.columns)))
    width = len(space.spheres)
    kappa = torch.tensor(rng.uniform(0.5, 30, width))
    rows = KnownRows(points, None, x, covariates.number)
    kernels = ConditionalKernels(space, rows, wide, kappa, torch.tensor(rng.dirichlet([1] * 3)))
    hidden, out = 8, 3 * (space.features(points).shape[-1] + width + 1)
    sizes = pairwise((x.shape[1], hidden, hidden, out))
    shapes = [shape for a, b in sizes for shape in ((a, b), (1, b))]
    layers = [torch.tensor(rng.normal(size=(2, *shape))) / shape[0] ** 0.5 for shape in shapes]
    networks = NeuralMixture(space, layers)
    parts: list[Any] = [Unconditional(UniformDensity(space)), kernels, networks]
    if isinstance(space, Torus):
        shape = (dims, x.shape[1])
        slopes, spreads = (
            torch.tensor(rng.normal(size=(a, b))) for a, b in (shape, (dims, 1 + shape[1]))
        )
        means = torch.tensor(rng.uniform(-4, 4, dims))
        parts.append(CircularRegression(space, means, slopes, spreads / 2))
        joint = joint_torus(space, 2)
        centers = torch.tensor(rng.uniform(size=(20, dims + 2)))
        sharp = torch.tensor(rng.uniform(0.5, 20, (20, dims + 2)))
        density = AdaptiveKernels(joint, centers, sharp, torch.full((20,), 0.05))
        parts.append(JointDensity(space, density, covariates.number))
    weights = rng.dirichlet([2.0] * len(parts)).tolist()
    return ConditionalDensity(covariates, parts, weights)


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10**6), st.floats(-1e3, 1e3), st.floats(-50, 50))
def test_each_density_is_normalised_and_what_it_is_at_its_covariates(
    seed: int, value: float, hour: float
) -> None:
    for space, dims in ((make_space("torus", axes=1), 1), (make_space("klein-bottle"), 2)):
        density = random_density(seed, space, dims)
        cells = {"x": np.array([value]), "hour": np.array([hour]), "kind": np.array(["b"])}
        cells = {name: cells[name] for name in density.covariates.names}
        x = density.covariates.features(cells)
        points = space.midpoints(512 if dims == 1 else 96)
        logs = density.log_prob(points, x.expand(len(points), -1))
        assert float(logs.exp().mean()) == pytest.approx(1, abs=2e-3)
        assert torch.allclose(density.at(x[0]).log_prob(points), logs, atol=1e-6)


@pytest.mark.parametrize("beside", [False, True])
def test_rows_on_a_sphere_and_beside_a_number_have_densities_too(beside: bool) -> None:
    space = make_space("sphere")
    space = ProductSpace(space, [(0.0, 1.0)]) if beside else space
    density = random_density(1, space, space.chart_dim)
    cells = {"x": np.array([0.0]), "hour": np.array([3.0]), "kind": np.array(["c"])}
    x = density.covariates.features(cells)
    count = 40 if beside else 128
    line = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    points = torch.cartesian_prod(*[line] * space.chart_dim)
    logs = density.log_prob(points, x.expand(len(points), -1))
    assert float(logs.exp().mean()) == pytest.approx(1, abs=5e-3)
    assert torch.allclose(density.at(x[0]).log_prob(points), logs, atol=1e-6)


def test_truth_is_found_with_numbers_cycles_and_words_together(fit: DensityEstimator) -> None:
    angles, cells, truth = drawn(600, seed=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        regret = float((truth - fit.score_samples(angles, given=cells)).mean())
    assert 0 < regret < 0.25
    assert fit.score(angles) < truth.mean() - 0.8  # without covariates
    report = report_of(fit)
    assert report.gain > 5 * report.error > 0
    shares = {one.kind: one.share for one in report.parts}
    assert sum(shares.values()) == pytest.approx(1)
    assert shares["all"] < 0.1


def test_densities_take_a_context_as_features_or_by_name(fit: DensityEstimator) -> None:
    angles, cells, _ = drawn(20, seed=2)
    density, points = fit.conditional_density_, fit.points_of(angles)
    x = density.covariates.features(cells)
    logs = density.log_prob(points, cells, measure="natural")
    assert np.allclose(logs.numpy(), fit.score_samples(angles, given=cells))
    assert torch.equal(
        density.log_prob(points, x[0]), density.log_prob(points, x[:1].expand(20, -1))
    )
    one = {name: cell[0] for name, cell in cells.items()}
    assert torch.equal(density.at(one).log_prob(points), density.at(x[0]).log_prob(points))


def test_a_fast_fit_says_what_it_left_out() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(-1, 1, 200)
    fit = DensityEstimator(unit="radians", effort="fast")
    angles = rng.vonmises(2 * x, 8.0)[:, None]
    fit.fit(angles, given={"x": x})
    assert fit.score(angles, given={"x": x}) > fit.score(angles) + 0.5
    assert fit.sample(3, 0, given={"x": 0.5}).shape == (3, 1)
    assert fit.at(x=0.5).mean()[0] == pytest.approx(1, abs=0.2)
    report = report_of(fit)
    assert {part.kind for part in report.parts} == {"all", "kernels", "regression"}
    assert report.untried == ("network", "joint")
    assert set(fit.report_.weights or {}) <= {"kernels", "uniform"}
    assert any("effort fast" in str(text) for text in fit.report_.words())
    assert any("flow, chains, network" in text for text in fit.report_.notes)
    with refused("effort", "components"):
        DensityEstimator(components="flow", effort="fast").fit(rng.vonmises(0, 1, (40, 1)))


@pytest.mark.parametrize("declared", [False, True])
def test_an_estimator_is_cross_validated(declared: bool) -> None:
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, 60)
    angles = rng.vonmises(2 * x, 8.0)
    estimator = DensityEstimator(unit="radians", components="kernels", effort="fast")
    label = np.arange(60) // 2
    if declared:
        frame = pd.DataFrame({"dir": angles, "x": x, "site": label})
        estimator.columns = {"dir": "angle:radians", "site": "group"}
        found = cross_validate(estimator, frame, {"x": "linear"}, folds=2)
    else:
        found = cross_validate(estimator, angles[:, None], {"x": x}, folds=2, groups=label)
    assert not hasattr(estimator, "density_")
    assert np.array_equal(found.fold[::2], found.fold[1::2])
    assert sorted(np.unique(found.fold)) == [0, 1]
    plain = cross_validate(DensityEstimator(components="kernels"), angles[:, None], folds=2)
    assert found.mean > plain.mean + 0.3


def test_samples_are_of_the_density_at_the_covariates(fit: DensityEstimator) -> None:
    known = {"temperature": 0.5, "hour": 6.0, "residue": "PRO"}
    samples = fit.sample(4000, 0, given=known)
    at = fit.at(known)
    assert stats.kstest(at.cdf(samples), "uniform").pvalue > 1e-3
    assert at.mean()[0] == pytest.approx(2 + 0.8 * np.tanh(0.5) + 0.6, abs=0.25)
    whole = fit.score_samples(samples[:5], given={name: [v] * 5 for name, v in known.items()})
    assert np.allclose(at.score_samples(samples[:5]), whole, atol=1e-6)


def test_a_useless_covariate_leaves_the_density_of_all_rows() -> None:
    rng = np.random.default_rng(0)
    angles, new = rng.vonmises(0, 2, (300, 1)), rng.vonmises(0, 2, (500, 1))
    how = {**QUICK, "components": "mixture"}
    fit = DensityEstimator(**how).fit(angles, given={"noise": rng.normal(size=300)})
    assert [(one.kind, one.share) for one in report_of(fit).parts if one.share] == [("all", 1.0)]
    assert np.allclose(
        fit.score_samples(new, given={"noise": rng.normal(size=500)}), fit.score_samples(new)
    )


def test_intervals_hold_the_shares_that_they_say() -> None:
    rng = np.random.default_rng(4)
    x, new = rng.uniform(-1, 1, 400), rng.uniform(-0.9, 0.9, 2000)
    fit = DensityEstimator(**QUICK).fit(rng.vonmises(2 * x, 8.0)[:, None], given={"x": x})
    angles = rng.vonmises(2 * new, 8.0)
    grid = np.linspace(-0.9, 0.9, 31)
    trend = fit.trend_along("x", grid, levels=(0.5, 0.9))
    assert np.abs(trend.mean - 2 * grid).max() < 0.2
    for level, mass in enumerate(trend.levels):
        low, high = (np.interp(new, grid, end[:, level]) for end in (trend.low, trend.high))
        assert ((low < angles) & (angles < high)).mean() == pytest.approx(mass, abs=0.05)


def test_a_file_makes_the_same_density_again(fit: DensityEstimator, tmp_path: Path) -> None:
    for number, density in enumerate((
        fit.conditional_density_, random_density(5, make_space("torus", axes=1), 1)
    )):  # fmt: skip
        path = tmp_path / f"{number}.safetensors"
        whole = UniformDensity(density.space)
        whole.given = density
        path.write_bytes(density_to_bytes(whole, columns=["phi"]))
        saved, extra = read_density(path)
        assert extra == {"columns": ["phi"]}
        again = saved.given
        assert again is not None
        points = density.space.midpoints(50)
        x = torch.randn(50, density.covariates.width, dtype=torch.float64).clamp(-1, 1)
        assert torch.equal(again.log_prob(points, x), density.log_prob(points, x))
        data = path.read_bytes()
        path.write_bytes(data[:-9] + bytes([data[-9] ^ 1]) + data[-8:])
        with pytest.raises(InputFileError):
            read_density(path)


def test_what_is_given_must_be_known(fit: DensityEstimator) -> None:
    angles, cells, _ = drawn(40)
    lacking = {**cells, "temperature": np.append(cells["temperature"][:-1], np.nan)}
    other = {**cells, "residue": np.array(["TRP"] * 40)}
    wrong: list[tuple[Any, str]] = [
        (lacking, "40 temperature"),
        (other, "residue TRP fit GLY"),
        ({"hour": cells["hour"]}, "hour"),
        ({name: own[:5] for name, own in cells.items()}, "rows 40 5"),
    ]
    for given_cells, message in wrong:
        with refused(*message.split()):
            fit.score_samples(angles, given=given_cells)
    with refused("speed"):
        fit.at(speed=3)
    with refused("hour", "residue"):
        fit.at(temperature=3)
    with refused("value", "x"):
        DensityEstimator(**QUICK).fit(angles, given={"x": np.ones(40)})
    with refused("rows", "30", "20"):
        DensityEstimator(**QUICK).fit(angles[:20], given={"x": np.arange(20.0)})
    with warned("temperature", "1000", kind=DataWarning):
        fit.at(temperature=1000, hour=3, residue="GLY")


def test_weights_and_groups_count() -> None:
    rng = np.random.default_rng(6)
    x = rng.uniform(-1, 1, 240)
    angles = np.where(np.arange(240) % 2, rng.vonmises(2 * x, 9.0), rng.vonmises(3, 9.0, 240))
    weights = np.where(np.arange(240) % 2, 1.0, 1e-3)
    how = {"sample_weight": weights, "groups": np.arange(240) // 4}
    fit = DensityEstimator(**QUICK).fit(angles[:, None], given={"x": x}, **how)
    assert fit.at(x=0.5).mean()[0] == pytest.approx(1.0, abs=0.25)


def test_a_saved_estimator_knows_its_covariates(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    length = rng.uniform(0, 2, 80)
    angles = rng.vonmises(length, 8.0)[:, None]
    fit = DensityEstimator(**QUICK).fit(angles, given={"length": length})
    again = load(save(fit, tmp_path / "fit"))
    assert isinstance(again, DensityEstimator)
    known = {"length": length[:9]}
    right = fit.score_samples(angles[:9], given=known)
    np.testing.assert_allclose(again.score_samples(angles[:9], given=known), right)


def test_rows_that_lack_angles_are_refused_before_the_fit() -> None:
    angles = np.full((40, 2), np.nan)
    fit = DensityEstimator(unit="radians", missing="marginalise")
    with refused("marginalise", "densities"):
        fit.fit(angles, given={"length": np.arange(40.0)})
    assert not hasattr(fit, "density_")
