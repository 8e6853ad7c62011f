"""Parametric families as fits: parameters, their intervals, the test of the family, what is refused."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import special_ortho_group, vonmises, vonmises_fisher

import orbiflow
import orbiflow.density as od
from orbiflow.density.fitting import goodness, parametric
from orbiflow.density.fitting.forms import FORMS, Cloud, Start
from orbiflow.density.fitting.intervals import concentration_interval
from orbiflow.density.models import AdaptiveKernels
from orbiflow.errors import SettingError
from refusals import refused

SPACES = {
    "von-mises-fisher": ("sphere", "hypersphere"),
    "kent": ("sphere",),
    "watson": ("projective-plane", "projective-space"),
    "bingham": ("projective-plane", "projective-space"),
    "angular-central-gaussian": ("projective-plane", "projective-space"),
    "matrix-fisher": ("rotation-space",),
}


@pytest.fixture(autouse=True, scope="module")
def _few_draws() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parametric, "DRAWS", 1_000)
        patch.setattr(goodness, "RESAMPLES", 119)
        yield


def parametric_of(report: od.FitReport) -> od.ParametricFit:
    """Return what a report says of a family."""
    assert report.parametric is not None
    return report.parametric


def found_by(space: od.Space, points: torch.Tensor, name: str, **how: Any) -> od.ParametricFit:
    """Fit a family and return its parameters."""
    return parametric_of(od.fit_parametric(space, points, name, **how)[1])


def p_of(found: od.ParametricFit) -> float:
    """Return p of the smooth test."""
    assert found.goodness is not None
    return found.goodness.p


def spread(one: od.Parameter) -> tuple[float, float, float]:
    """Return an estimate's standard error and the ends of its interval."""
    assert one.error is not None
    assert one.low is not None
    assert one.high is not None
    return one.error, one.low, one.high


def shape_of(name: str, width: int, rng: np.random.Generator) -> list[float]:
    """Return random shape parameters of a family."""
    if name == "von-mises-fisher":
        return [float(rng.uniform(2, 60))]
    if name == "watson":
        return [float(rng.choice([-1, 1]) * rng.uniform(4, 40))]
    if name == "kent":
        kappa = rng.uniform(8, 80)
        return [float(kappa), float(rng.uniform(0.15, 0.4) * kappa)]
    if name == "angular-central-gaussian":
        return sorted(-rng.uniform(0.8, 1.6, width - 1).cumsum())[::-1]
    return sorted(-rng.uniform(3, 12, width - 1).cumsum())[::-1]


def drawn(name: str, space_name: str, rows: int, seed: int) -> tuple[od.Space, torch.Tensor, Start]:
    """Return a space, points from a random density of a family there, and its frame and shape."""
    rng = np.random.default_rng(seed)
    space = od.make_space(
        space_name, **({"dim": 4} if space_name in ("hypersphere", "projective-space") else {})
    )
    width = space.dim + 1
    frame = torch.tensor(special_ortho_group.rvs(width, random_state=rng))
    truth = Start(frame, torch.tensor(shape_of(name, width, rng), dtype=torch.float64))
    if name == "von-mises-fisher":
        center = space.from_features(frame[:1])
        density = AdaptiveKernels(space, center, truth.shape[None], torch.ones(1))
    else:
        density = FORMS[name].density(space, truth)
    return space, density.sample((rows,), torch.Generator().manual_seed(seed)), truth


@given(st.sampled_from([(n, s) for n, own in SPACES.items() for s in own]), st.integers(0, 10**6))
@settings(max_examples=5, deadline=None)
def test_parameters_are_found_again(which: tuple[str, str], seed: int) -> None:
    name, where = which
    space, points, truth = drawn(name, where, 800, seed)
    density, report = od.fit_parametric(space, points, name)
    found, form = parametric_of(report), FORMS[name]
    reported = form.reported(truth.shape, truth.frame).tolist()
    for own, exact in zip(found.parameters[-len(reported) :], reported, strict=True):
        error, low, high = spread(own)
        assert abs(own.value - exact) < 5.5 * error
        assert low < own.value < high
    # the likelihood is at its maximum: no lower than that of the truth, by chance's chi-square half
    at_truth = form.mean_log(truth.shape, truth.frame, Cloud(space.features(points)[0], None))
    images = 1 if where in ("sphere", "hypersphere") else 2
    gained = float(density.log_prob(points, measure="natural").mean() - at_truth - np.log(images))
    assert -1e-9 < 2 * 800 * gained < 60
    assert found.aic == pytest.approx(2 * found.free - 2 * found.log_likelihood)


def test_agrees_with_scipy() -> None:
    rng = np.random.default_rng(3)
    angles = rng.vonmises(2.0, 1.5, 400)
    own = od.DensityEstimator("torus", components="von-mises").fit(angles[:, None])
    kappa, mean, _ = vonmises.fit(angles, fscale=1)
    assert own.parameters()["mean_angle1"].value == pytest.approx(mean, abs=1e-6)
    assert own.parameters()["concentration_angle1"].value == pytest.approx(kappa, rel=1e-4)
    at = np.linspace(-3, 3, 9)
    logs = vonmises.logpdf(at, kappa, mean)
    assert own.score_samples(at[:, None]) == pytest.approx(logs, abs=1e-4)
    vectors = vonmises_fisher([0, 0.6, 0.8], 20).rvs(300, random_state=rng)
    mean, kappa = vonmises_fisher.fit(vectors)
    found = od.DensityEstimator("sphere", components="von-mises-fisher").fit(vectors)
    three = [found.parameters()[f"mean_{axis}"].value for axis in "xyz"]
    assert three == pytest.approx(mean, abs=1e-9)
    assert found.parameters()["concentration"].value == pytest.approx(kappa, rel=1e-6)


def test_matrix_fisher_is_the_trace_of_a_matrix_times_a_rotation() -> None:
    space, points, _ = drawn("matrix-fisher", "rotation-space", 200, 1)
    density, report = od.fit_parametric(space, points, "matrix-fisher")
    found = parametric_of(report)
    f = np.array([found[f"f{i}{j}"].value for i in "123" for j in "123"]).reshape(3, 3)
    turns = Rotation.random(20, random_state=0)
    traces = np.einsum("ij,nij->n", f, turns.as_matrix())
    logs = density.log_prob(torch.tensor(turns.as_quat())).numpy()
    assert np.ptp(logs - traces) < 1e-9
    values = np.linalg.svd(f, compute_uv=False) * [1, 1, np.sign(np.linalg.det(f))]
    singular = [found[f"singular_{k}"].value for k in "123"]
    assert singular == pytest.approx(values.tolist(), abs=1e-8)
    u, _, v = np.linalg.svd(f)
    mean = Rotation.from_matrix(u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v).as_quat()
    own = [found[f"mean_{axis}"].value for axis in "xyzw"]
    assert abs(float(mean @ np.array(own))) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(("kappa", "rows"), [(0.0, 20), (0.5, 40), (3.0, 15), (25.0, 8)])
def test_concentration_is_in_its_interval_as_often_as_said(kappa: float, rows: int) -> None:
    rng = np.random.default_rng(5)
    angles = rng.vonmises(0, kappa, (25, rows))
    lengths = abs(np.exp(1j * angles).mean(axis=1))
    ends = np.array([concentration_interval(1 - one, rows, 2) for one in lengths])
    inside = ((ends[:, 0] <= kappa) & (kappa <= ends[:, 1])).mean()
    assert inside > 0.82  # three standard errors of 25 trials below 0.95


@pytest.mark.parametrize("name", ["kent", "bingham"])
def test_intervals_cover_and_the_smooth_test_keeps_its_level(name: str) -> None:
    inside: list[bool] = []
    cones = small = 0
    for seed in range(8):
        space, points, truth = drawn(name, SPACES[name][0], 100, seed)
        found = found_by(space, points, name)
        shapes = found.parameters[-2:]
        inside += [
            spread(a)[1] <= b <= spread(a)[2]
            for a, b in zip(shapes, truth.shape.tolist(), strict=True)
        ]
        label = next(iter(found.cones))
        written = [one.value for one in found.parameters if one.name.startswith(f"{label}_")]
        axis = space.features(space.to_chart([written]))[0][0]
        apart = np.degrees(np.arccos(min(1.0, abs(float(axis @ truth.frame[0])))))
        cones += apart <= (found.cones[label] or 90)
        small += p_of(found) < 0.05
    assert np.mean(inside) > 0.8
    assert cones >= 6
    assert small <= 2


def test_smooth_test_sees_what_is_not_of_the_family() -> None:
    space, points, _ = drawn("kent", "sphere", 400, 2)
    assert p_of(found_by(space, points, "kent")) > 0.01
    assert p_of(found_by(space, points, "von-mises-fisher")) < 0.01
    rng = np.random.default_rng(0)
    both = rng.vonmises(0, 4, 300)
    pair = np.stack([both, both + rng.vonmises(0, 8, 300)], axis=1)  # they go together
    fit = od.DensityEstimator("torus", components="von-mises").fit(pair)
    assert p_of(parametric_of(fit.report_)) < 0.01


def test_weights_count_rows_and_groups_widen_intervals() -> None:
    space, points, _ = drawn("von-mises-fisher", "sphere", 120, 3)
    plain = found_by(space, points, "von-mises-fisher")
    twice = torch.cat([points, points[:40]])
    weights = np.where(np.arange(120) < 40, 2.0, 1.0)
    weighted = found_by(space, points, "von-mises-fisher", weights=weights)
    repeated = found_by(space, twice, "von-mises-fisher")
    for one, other in zip(weighted.parameters, repeated.parameters, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
    assert weighted.goodness is None
    copies = points.repeat(4, 1)
    groups = np.tile(np.arange(120), 4)
    grouped = found_by(space, copies, "von-mises-fisher", groups=groups)
    for one, other in zip(grouped.parameters, plain.parameters, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
        assert spread(one)[0] == pytest.approx(spread(other)[0], rel=0.25)


def test_beside_others_it_is_a_candidate() -> None:
    rng = np.random.default_rng(1)
    angles = rng.vonmises([0.5, 1.0], [2.0, 6.0], (400, 2))
    fit = od.DensityEstimator("torus", components=("kernels", "von-mises")).fit(angles)
    shares = {one.name: one.share for one in fit.report_.components}
    assert shares["von-mises"] > 0.8
    with refused("parametric", "family"):
        fit.parameters()


def test_a_saved_fit_keeps_its_parameters(tmp_path: Path) -> None:
    angles = np.random.default_rng(0).vonmises([0.2, -1.0], 3.0, (80, 2))
    fit = od.DensityEstimator(columns="phi,psi", components="von-mises").fit(angles)
    orbiflow.save(fit, tmp_path / "fit")
    again = orbiflow.load(tmp_path / "fit")
    assert isinstance(again, od.DensityEstimator)
    assert again.parameters() == fit.parameters()
    assert list(again.parameters())[:2] == ["mean_phi", "concentration_phi"]


def test_two_modes_and_very_close_rows() -> None:
    rng, sphere = np.random.default_rng(0), od.make_space("hypersphere", dim=2)
    both = rng.normal(0, 0.1, (200, 3)) + np.where(np.arange(200) < 100, 1, -1)[:, None] * [1, 0, 0]
    both[:, 2] += 0.3
    both /= np.linalg.norm(both, axis=1, keepdims=True)
    density, report = od.fit_parametric(sphere, torch.tensor(both), "kent")
    assert any("two modes" in note for note in parametric_of(report).notes)
    drawn_ones = density.sample((2000,), torch.Generator().manual_seed(0)).numpy()
    assert np.abs(drawn_ones.T @ drawn_ones / 2000 - both.T @ both / 200).max() < 0.05
    close = np.array([0, 0, 1]) + rng.normal(0, 1e-5, (100, 3))
    close /= np.linalg.norm(close, axis=1, keepdims=True)
    found = found_by(sphere, torch.tensor(close), "von-mises-fisher")
    error, low, high = spread(found["concentration"])
    assert low < 1e10 < high
    assert error == pytest.approx(found["concentration"].value / 10, rel=1e-6)  # k sqrt(2 / (2 n))
    assert spread(found["mean_x1"])[0] == pytest.approx(1e-6, rel=0.2)
    with refused("few", "digits"):
        od.fit_parametric(sphere, torch.tensor(close), "kent")


def test_too_few_groups_have_no_intervals() -> None:
    space, points, _ = drawn("von-mises-fisher", "sphere", 60, 3)
    found = found_by(space, points, "von-mises-fisher", groups=np.arange(60) % 3)
    assert all(one.error is None for one in found.parameters)
    assert "3 groups are too few for intervals of 3 parameters" in found.notes


def test_refusals() -> None:
    sphere = od.make_space("sphere")
    same = sphere.to_chart([[10.0, 20.0]] * 9)
    with refused("rows", "direction"):
        od.fit_parametric(sphere, same, "von-mises-fisher")
    flat = sphere.to_chart([[0.0, 20.0 * k] for k in range(9)])
    for name in ("bingham", "angular-central-gaussian", "watson"):
        with refused("through", "origin"):
            od.fit_parametric(sphere, flat, name)
    with refused("kent"):
        od.fit_parametric(sphere, flat[:3], "kent")
    with refused("bingham"):
        od.fit_parametric(od.make_space("projective-plane"), flat, "von-mises-fisher")
    with refused("coordinates", "16"):
        od.fit_parametric(od.make_space("projective-space", dim=16), torch.eye(17), "bingham")
    with refused("parametric", "family"):
        od.fit_parametric(od.make_space("klein-bottle"), flat, "von-mises")
    angles = np.random.default_rng(0).vonmises(0, 1, (50, 2))
    angles[0, 0] = np.nan
    with refused("angles", kind=SettingError):
        od.DensityEstimator("torus", components="von-mises", missing="marginalise").fit(angles)
