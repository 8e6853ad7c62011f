"""Scoring asks the same of columns as fitting, and refuses or doubts what the fit would."""

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from orbiflow.density import DensityEstimator
from orbiflow.density.operations.queries import conditional, score
from orbiflow.density.tables import RowSettings
from orbiflow.errors import DataWarning, SettingError
from orbiflow.loading import save
from orbiflow.runtime import Event, Note
from refusals import refused, warned

RNG = np.random.default_rng(0)
PLACES = np.stack([RNG.normal(30, 8, 60), RNG.uniform(5, 350, 60)], axis=1)
SKY = pd.DataFrame({"dec": PLACES[:, 0], "ra": PLACES[:, 1]})
ANGLES = pd.DataFrame({"phi": RNG.normal(-60, 9, 60), "psi": RNG.normal(-45, 9, 60)})


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("models")
    how: dict[str, Any] = {"components": "mixture"}
    places = pd.DataFrame(PLACES, columns=["lat", "lon"])
    made = {
        "places": DensityEstimator("sphere", **how).fit(places),
        "sky": DensityEstimator("sphere", **how).fit(SKY),
        "angles": DensityEstimator("torus", unit="degrees", **how).fit(ANGLES),
    }
    return {name: save(model, folder / name) for name, model in made.items()}


def told(model: Path, frame: pd.DataFrame, folder: Path, columns: str | None) -> str:
    table, events = folder / "rows.csv", list[Event]()
    frame.to_csv(table, index=False)
    reading = RowSettings(columns=tuple(columns.split(",")) if columns else None)
    score(table, reading=reading, model=model, out=folder / "scored.csv", on_event=events.append)
    return " ".join(event.text for event in events if isinstance(event, Note))


USUAL = [
    ("places", SKY.set_axis(["lat", "lon"], axis=1), None),
    ("places", SKY.set_axis(["LAT", "Lon"], axis=1)[["Lon", "LAT"]], None),
    ("places", SKY, "dec,ra"),
    ("sky", SKY, None),
    ("angles", ANGLES.set_axis(["Phi", "PSI"], axis=1), None),
    ("angles", ANGLES.set_axis(["chi1", "chi2"], axis=1), "chi1,chi2"),
    ("angles", ANGLES.assign(other=1.0), None),
    ("angles", ANGLES.set_axis(["a_deg", "b_deg"], axis=1), "a_deg,b_deg"),
]


@pytest.mark.parametrize(("model", "frame", "columns"), USUAL)
def test_usual_columns_are_not_doubted(
    model: str, frame: pd.DataFrame, columns: str | None, models: dict[str, Path], tmp_path: Path
) -> None:
    assert "WARNING" not in told(models[model], frame, tmp_path, columns)


def test_a_second_column_of_scores_is_told(models: dict[str, Path], tmp_path: Path) -> None:
    assert "already" not in told(models["angles"], ANGLES, tmp_path, None)
    scored = pd.read_csv(tmp_path / "scored.csv")
    found = told(models["angles"], scored, tmp_path, None)
    assert "has a column log_prob already: the new one is log_prob_2" in found
    assert list(pd.read_csv(tmp_path / "scored.csv"))[-2:] == ["log_prob", "log_prob_2"]


def test_one_flat_row_is_refused_with_its_cure() -> None:
    model = DensityEstimator("torus", unit="degrees", components="mixture").fit(ANGLES)
    for ask in (model.score_samples, model.score_gradient, model.score, model.fit):
        with refused("write", "2"):
            ask([-60, -40])
    assert model.score_samples([[-60, -40]]).shape == (1,)


def test_what_is_given_may_have_a_typographic_minus(models: dict[str, Path], tmp_path) -> None:
    found = [
        conditional(model=models["angles"], at=(text,), out=tmp_path / str(k)).summary
        for k, text in enumerate(("psi=−45", "psi = -45"))
    ]
    assert found[0]["columns"] == found[1]["columns"] == ["phi"]
    one, other = ((tmp_path / name / "density.csv").read_text() for name in "01")
    assert one == other


TURNING = RNG.vonmises([-1.1, 2.0], 6.0, (60, 2))
SPOTS = np.stack([RNG.normal(48, 3, 60), RNG.normal(10, 3, 60)], axis=1)


def made(space: str, data: np.ndarray, **settings: Any) -> DensityEstimator:
    return DensityEstimator(space, components="mixture", **settings).fit(data)


@pytest.fixture(scope="module")
def models_of_doubts() -> dict[str, DensityEstimator]:
    turns = {"radians": 2 * math.pi, "degrees": 360.0, "turns": 1.0}
    found = {
        unit: made("torus", TURNING * turn / turns["radians"], unit=unit)
        for unit, turn in turns.items()
    }
    return {**found, "sphere": made("sphere", SPOTS), "plane": made("projective-plane", SPOTS)}


@pytest.mark.parametrize(
    ("model", "data", "method"),
    [
        ("degrees", TURNING, "score_samples"),
        ("sphere", np.radians(SPOTS), "score"),
        ("plane", np.radians(SPOTS), "score_gradient"),
    ],
)
def test_radians_in_the_place_of_degrees_are_doubted(
    model: str, data: np.ndarray, method: str, models_of_doubts: dict[str, DensityEstimator]
) -> None:
    with warned("radians", kind=DataWarning) as caught:
        getattr(models_of_doubts[model], method)(data)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    ("model", "data", "method"),
    [
        ("radians", np.degrees(TURNING), "score"), ("turns", TURNING, "score_samples"),
        ("degrees", [[999, 1.0]], "score_gradient"), ("radians", TURNING + 20 * math.pi, "score"),
        ("sphere", np.vstack([SPOTS, [[48, -9999]]]), "score_samples"),
    ],
)  # fmt: skip
def test_data_beyond_a_turn_are_refused(
    model: str, data: Any, method: str, models_of_doubts: dict[str, DensityEstimator]
) -> None:
    with refused("turn", kind=SettingError):
        getattr(models_of_doubts[model], method)(data)


EDGE = np.linspace(-5, 5, 50)
RIGHT = {
    "one small row": ("degrees", np.array([[-1.1, 2.0]])),
    "a small place": ("sphere", np.array([[0.8, 0.2]])),
    "its own data": ("degrees", np.degrees(TURNING)),
    "few of them": ("degrees", np.degrees(TURNING[:3])),
    "those of a compass": ("degrees", np.degrees(TURNING) % 360),
    "radians": ("radians", TURNING),
    "places": ("sphere", SPOTS),
    "a profile": ("sphere", np.stack([48 + 0 * EDGE, 10 + EDGE], axis=1)),
}


@pytest.mark.parametrize("case", RIGHT)
def test_usual_data_are_not_doubted(
    case: str, models_of_doubts: dict[str, DensityEstimator]
) -> None:
    model, data = RIGHT[case]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        models_of_doubts[model].score_samples(data)


@pytest.mark.parametrize(("model", "value"), [("degrees", 400), ("radians", 45), ("turns", 1.5)])
def test_known_angles_beyond_a_turn_are_refused(
    model: str, value: float, models_of_doubts: dict[str, DensityEstimator]
) -> None:
    with refused("turn", value, kind=SettingError):
        models_of_doubts[model].conditional({1: value})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        models_of_doubts[model].conditional({1: value / 12})
