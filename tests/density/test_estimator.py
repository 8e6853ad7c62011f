"""The estimator: scikit-learn's conventions, the user's units, marginals, and many angles."""

import math
from typing import Any

import numpy as np
import pandas
import pytest
import torch
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV

from orbiflow.density import DensityEstimator, Mixture, Sphere, Torus
from orbiflow.density.models import midpoints
from refusals import refused


def entropy(estimator: DensityEstimator) -> float:
    """By quadrature, in natural measure."""
    grid = midpoints(estimator.space_, 80)
    with torch.no_grad():
        square, natural = (
            estimator.density_.log_prob(grid, measure=m) for m in ("square", "natural")
        )
    return -float((square.exp() * natural).mean())


DATA = {
    "torus": np.random.default_rng(0).vonmises([0.0, 1.0], 3.0, (300, 2)),
    "sphere": np.random.default_rng(1).normal(20, 10, (300, 2)),
    "klein-bottle": np.random.default_rng(2).vonmises([0.5, 0.0], 3.0, (300, 2)),
    "projective-plane": np.random.default_rng(3).normal([60, 30], 10, (300, 2)).clip(-90, 90),
}


@pytest.mark.parametrize("space", DATA)
def test_the_estimator(space: str) -> None:
    estimator = DensityEstimator(space, components="kernels")
    with refused("fitted", "yet"):
        estimator.sample()
    assert estimator.fit(DATA[space]) is estimator
    scores = estimator.score_samples(DATA[space])
    assert scores.shape == (300,)
    assert estimator.score(DATA[space]) == pytest.approx(scores.mean())
    even = -math.log(estimator.space_.volume)
    assert estimator.score(DATA[space]) > even + 0.3
    relative = estimator.score_samples(DATA[space], measure="uniform")
    assert np.allclose(relative, scores - even)
    draws = estimator.sample(500, random_state=4)
    assert draws.shape == (500, 2)
    assert np.array_equal(draws, estimator.sample(500, random_state=4))
    assert estimator.score(draws) == pytest.approx(-entropy(estimator), abs=0.3)


def test_units_change_the_density_by_their_ratio() -> None:
    small: dict[str, Any] = {"max_frequency": 1, "segments": 1, "iterations": 1}
    small["components"] = "flow,mixture"
    radians = DensityEstimator("torus", **small).fit(DATA["torus"])
    degrees = DensityEstimator("torus", unit="degrees", **small).fit(np.degrees(DATA["torus"]))
    shift = radians.score_samples(DATA["torus"]) - degrees.score_samples(np.degrees(DATA["torus"]))
    assert np.allclose(shift, 2 * math.log(180 / math.pi), atol=1e-3)


def test_parameters_of_the_estimator() -> None:
    estimator = DensityEstimator("sphere", max_frequency=3)
    assert estimator.get_params()["max_frequency"] == 3
    assert estimator.set_params(max_frequency=5).max_frequency == 5
    assert repr(estimator) == "DensityEstimator(space='sphere', max_frequency=5)"
    with refused("depth"):
        estimator.set_params(depth=1)
    with refused("moebius"):
        DensityEstimator("moebius").fit(DATA["torus"])


def test_a_grid_search() -> None:
    choices = {"components": ["kernels", "mixture"]}
    search = GridSearchCV(DensityEstimator("torus"), choices, cv=2).fit(DATA["torus"][:60])
    assert search.best_params_["components"] in choices["components"]
    assert math.isfinite(search.best_score_)


@pytest.fixture(name="fitted", scope="module")
def fitted_fixture() -> DensityEstimator:
    return DensityEstimator("torus", components="kernels").fit(DATA["torus"])


def test_samples_are_new_at_every_call(fitted: DensityEstimator) -> None:
    assert not np.array_equal(fitted.sample(5), fitted.sample(5))
    drawn = []
    for _ in range(2):
        np.random.seed(3)  # noqa: NPY002  as scikit-learn has it
        drawn.append(np.concatenate([fitted.sample(5), fitted.sample(5)]))
    assert np.array_equal(*drawn)


@pytest.mark.parametrize("kind", [np.random.RandomState, np.random.default_rng])
def test_random_states_go_on(kind, fitted: DensityEstimator) -> None:
    state, again = kind(1), kind(1)
    first, second = (fitted.sample(4, random_state=state) for _ in range(2))
    assert not np.array_equal(first, second)
    assert np.array_equal(first, fitted.sample(4, random_state=again))


@pytest.mark.parametrize("wrong", ["seed", 1.5, True, [1]])
def test_other_random_states_are_refused(wrong, fitted: DensityEstimator) -> None:
    with refused("random_state"):
        fitted.sample(2, random_state=wrong)
    for count in (0, 1.5, "2"):
        with refused("n_samples"):
            fitted.sample(count)  # type: ignore[arg-type]


def test_clones_are_unfitted_and_equal(fitted: DensityEstimator) -> None:
    space = Sphere()
    for estimator in (fitted, DensityEstimator(space, seed=3, evaluations=5)):
        again = clone(estimator)
        assert repr(again) == repr(estimator)
        assert not hasattr(again, "density_")


@pytest.fixture(scope="module")
def fitted_of_parts() -> DensityEstimator:
    rng = np.random.default_rng(0)
    first = rng.vonmises(0.5, 3.0, 150)
    angles = np.degrees(np.stack([first, first + rng.vonmises(0, 9.0, 150)], axis=1))
    return DensityEstimator("torus", unit="degrees", components="kernels,chains").fit(
        pandas.DataFrame(angles, columns=["phi", "psi"])
    )


def test_conditional_times_marginal_is_joint_per_degree(fitted_of_parts: DensityEstimator) -> None:
    phi = np.linspace(-170, 170, 9)
    slice_ = fitted_of_parts.conditional(psi=-45)
    joint = fitted_of_parts.score_samples(np.stack([phi, np.full(9, -45.0)], axis=1))
    at = fitted_of_parts.marginal("psi").score_samples([[-45.0]])
    assert slice_.score_samples(phi[:, None]) + at == pytest.approx(joint, abs=1e-3)
    assert list(slice_.feature_names_in_) == ["phi"]
    assert slice_.conditional is not None
    line = np.arange(-180, 180, 0.5)[:, None]
    assert np.exp(slice_.score_samples(line)).sum() * 0.5 == pytest.approx(1, abs=1e-6)
    assert slice_.sample(5, random_state=0).shape == (5, 1)


def test_columns_by_name_number_or_case(fitted_of_parts: DensityEstimator) -> None:
    same = [
        fitted_of_parts.marginal(column).score_samples([[10.0]])[0] for column in ("psi", "PSI", 1)
    ]
    assert len(set(same)) == 1
    turned = fitted_of_parts.marginal("psi", "phi")
    assert turned.score_samples([[20.0, 10.0]]) == pytest.approx(
        fitted_of_parts.score_samples([[10.0, 20.0]]), abs=1e-4
    )


def test_mistakes_are_named(fitted_of_parts: DensityEstimator) -> None:
    with refused("chi"):
        fitted_of_parts.marginal("chi")
    with refused("twice"):
        fitted_of_parts.conditional({1: 3.0}, psi=2.0)
    with refused("number"):
        fitted_of_parts.conditional(psi="left")  # type: ignore[arg-type]
    with refused("fitted"):
        DensityEstimator("torus").marginal("phi")
    sphere = DensityEstimator("sphere", components="kernels").fit(
        np.random.default_rng(0).uniform(-60, 60, (40, 2))
    )
    with refused("sphere"):
        sphere.conditional(lat=3.0)


def test_five_angles() -> None:
    """The fourth and fifth are tied to the first; there is no flow, and no setting of one."""
    rng = np.random.default_rng(0)
    x = rng.vonmises([0.0, 1.0, -2.0, 0.0, 0.0], [2.0, 4.0, 8.0, 20.0, 20.0], (300, 5))
    x[:, 3:] += 0.7 * np.sin(x[:, :1])
    points = np.degrees(x)
    estimator = DensityEstimator("torus", unit="degrees").fit(points[:120])
    assert isinstance(estimator.density_, Mixture)
    assert "chains" in estimator.density_.weight_of_kind
    assert estimator.report_.mass is None
    assert estimator.score(points[120:]) > -5 * np.log(360) + 3
    without: list[dict[str, Any]] = [{"max_frequency": 16, "segments": 2}, {"iterations": 3}]
    for settings in without:
        with refused(*settings, "torus", 5):
            DensityEstimator("torus", unit="degrees", **settings).fit(points)
        with refused(*settings):
            DensityEstimator(Torus(5, unit="degrees"), **settings).fit(points)
