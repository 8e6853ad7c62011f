"""The estimator: scikit-learn's conventions, the user's units, samples anew at every call."""

import math
from typing import Any

import numpy as np
import pytest
import torch
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV

from orbiflow.density import DensityEstimator, Sphere
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
    estimator = DensityEstimator(space, max_frequency=2, segments=1, iterations=3)
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
    small: dict[str, Any] = {"max_frequency": 2, "segments": 2, "iterations": 5}
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
    search = GridSearchCV(
        DensityEstimator("torus", segments=2, iterations=3), {"max_frequency": [1, 2]}, cv=2
    ).fit(DATA["torus"][:120])
    assert search.best_params_["max_frequency"] in (1, 2)
    assert math.isfinite(search.best_score_)


@pytest.fixture(name="fitted", scope="module")
def fitted_fixture() -> DensityEstimator:
    estimator = DensityEstimator("torus", max_frequency=1, segments=1, iterations=0)
    return estimator.fit(DATA["torus"])


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


def test_an_integer_gives_the_same_points(fitted: DensityEstimator) -> None:
    same = [fitted.sample(4, random_state=seed) for seed in (7, np.int64(7), 8)]
    assert np.array_equal(same[0], same[1])
    assert not np.array_equal(same[0], same[2])


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
