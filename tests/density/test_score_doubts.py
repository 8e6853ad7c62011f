"""Scoring and conditionals refuse codes, and warn of data in another unit than the model's."""

import math
import warnings
from typing import Any

import numpy as np
import pytest

from orbiflow.density import DensityEstimator
from orbiflow.errors import DataWarning, SettingError
from refusals import refused, warned

RNG = np.random.default_rng(0)
ANGLES = RNG.vonmises([-1.1, 2.0], 6.0, (60, 2))
PLACES = np.stack([RNG.normal(48, 3, 60), RNG.normal(10, 3, 60)], axis=1)


def made(space: str, data: np.ndarray, **settings: Any) -> DensityEstimator:
    return DensityEstimator(space, components="mixture", **settings).fit(data)


@pytest.fixture(scope="module")
def models() -> dict[str, DensityEstimator]:
    turns = {"radians": 2 * math.pi, "degrees": 360.0, "turns": 1.0}
    found = {
        unit: made("torus", ANGLES * turn / turns["radians"], unit=unit)
        for unit, turn in turns.items()
    }
    return {**found, "sphere": made("sphere", PLACES), "plane": made("projective-plane", PLACES)}


METHODS = ["score_samples", "score", "score_gradient"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("model", "data"),
    [("degrees", ANGLES), ("sphere", np.radians(PLACES)), ("plane", np.radians(PLACES))],
)
def test_radians_in_the_place_of_degrees_are_doubted(
    model: str, data: np.ndarray, method: str, models: dict[str, DensityEstimator]
) -> None:
    with warned("radians", kind=DataWarning) as caught:
        getattr(models[model], method)(data)
    assert caught[0].filename == __file__


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("model", "data"),
    [
        ("radians", np.degrees(ANGLES)), ("turns", ANGLES), ("turns", np.degrees(ANGLES)),
        ("degrees", np.vstack([np.degrees(ANGLES), [[999, 1.0]]])), ("degrees", [[999, 1.0]]),
        ("sphere", np.vstack([PLACES, [[48, -9999]]])), ("radians", ANGLES + 20 * math.pi),
    ],
)  # fmt: skip
def test_data_beyond_a_turn_are_refused(
    model: str, data: Any, method: str, models: dict[str, DensityEstimator]
) -> None:
    with refused("turn", kind=SettingError):
        getattr(models[model], method)(data)


EDGE = np.linspace(-5, 5, 50)
RIGHT = {
    "one small row": ("degrees", np.array([[-1.1, 2.0]])),
    "a small place": ("sphere", np.array([[0.8, 0.2]])),
    "its own data": ("degrees", np.degrees(ANGLES)),
    "few of them": ("degrees", np.degrees(ANGLES[:3])),
    "those of a compass": ("degrees", np.degrees(ANGLES) % 360),
    "radians": ("radians", ANGLES),
    "places": ("sphere", PLACES),
    "a profile": ("sphere", np.stack([48 + 0 * EDGE, 10 + EDGE], axis=1)),
}


@pytest.mark.parametrize("case", RIGHT)
def test_usual_data_are_not_doubted(case: str, models: dict[str, DensityEstimator]) -> None:
    model, data = RIGHT[case]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        models[model].score_samples(data)


def test_small_angles_in_degrees_are_not_doubted() -> None:
    tilts = RNG.uniform(-2, 2, (60, 2))
    model = made("torus", tilts, unit="degrees")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.score_samples(tilts)
        model.score_samples(np.stack([EDGE, EDGE], axis=1))


@pytest.mark.parametrize(
    ("model", "value"), [("degrees", 400), ("degrees", 999), ("radians", 45), ("turns", 1.5)]
)
def test_known_angles_beyond_a_turn_are_refused(
    model: str, value: float, models: dict[str, DensityEstimator]
) -> None:
    with refused("turn", value, kind=SettingError):
        models[model].conditional({1: value})


@pytest.mark.parametrize(("model", "value"), [("degrees", -45), ("radians", 6.2), ("turns", 0.9)])
def test_known_angles_within_a_turn_are_not_doubted(
    model: str, value: float, models: dict[str, DensityEstimator]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        models[model].conditional({1: value})
