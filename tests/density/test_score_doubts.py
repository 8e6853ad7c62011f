"""Scoring and conditionals refuse codes, and warn of data in another unit than the model's."""

from __future__ import annotations

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


OTHERS = {
    ("degrees", "radians"): ANGLES,
    ("radians", "degrees"): np.degrees(ANGLES),
    ("turns", "radians"): ANGLES,
    ("turns", "degrees"): np.degrees(ANGLES),
    ("sphere", "radians"): np.radians(PLACES),
    ("plane", "radians"): np.radians(PLACES),
}


@pytest.mark.parametrize("method", ["score_samples", "score", "score_gradient"])
@pytest.mark.parametrize("case", OTHERS)
def test_data_in_another_unit_are_doubted(
    case: tuple[str, str], method: str, models: dict[str, DensityEstimator]
) -> None:
    model, unit = case
    with warned(unit, kind=DataWarning) as caught:
        getattr(models[model], method)(OTHERS[case])
    assert caught[0].filename == __file__


def test_codes_are_refused(models: dict[str, DensityEstimator]) -> None:
    for model, data in (("degrees", np.degrees(ANGLES)), ("radians", ANGLES)):
        for rows in (np.vstack([data, [[999, 1.0]]]), [[999, 1.0]]):
            with refused("column1", "999", "1", kind=SettingError):
                models[model].score_samples(rows)
    with refused("column2", "-9999", "1", kind=SettingError):
        models["sphere"].score_samples(np.vstack([PLACES, [[48, -9999]]]))


EDGE = np.linspace(-5, 5, 50)
RIGHT = {
    "one small row": ("degrees", np.array([[-1.1, 2.0]])),
    "a small place": ("sphere", np.array([[0.8, 0.2]])),
    "its own data": ("degrees", np.degrees(ANGLES)),
    "few of them": ("degrees", np.degrees(ANGLES[:3])),
    "those of a compass": ("degrees", np.degrees(ANGLES) % 360),
    "radians": ("radians", ANGLES),
    "radians that turn": ("radians", ANGLES + 20 * math.pi),
    "a row that turns": ("radians", ANGLES[:1] + 10 * math.pi),
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


def test_known_angles_beyond_a_turn_are_doubted(models: dict[str, DensityEstimator]) -> None:
    for model, value, words in (
        ("degrees", 400, "400 360 degrees 40"),
        ("radians", 45, "45 2 radians"),
        ("turns", 1.5, "1 turns"),
    ):  # fmt: skip
        with warned(*words.split(), kind=DataWarning) as caught:
            models[model].conditional({1: value})
        assert caught[0].filename == __file__
        with refused("999", kind=SettingError):
            models[model].conditional({0: 999})


@pytest.mark.parametrize(("model", "value"), [("degrees", -45), ("radians", 6.2), ("turns", 0.9)])
def test_known_angles_within_a_turn_are_not_doubted(
    model: str, value: float, models: dict[str, DensityEstimator]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        models[model].conditional({1: value})
