"""Strikes beside dips are directions of dip by the right-hand rule, on every path."""

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from orbiflow.density import DensityEstimator, compare_samples, summarize_axes
from orbiflow.density.operations.queries import score
from orbiflow.density.operations.summary import summary
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.errors import DataWarning, SettingError
from orbiflow.loading import save
from orbiflow.runtime import Event, Note
from refusals import refused, warned

RNG = np.random.default_rng(0)
DIP, STRIKE = RNG.normal(30, 4, 40).round(1), (RNG.normal(5, 8, 40) % 360).round(1)
DIRECTION = (STRIKE + 90) % 360
BY_STRIKE = pd.DataFrame({"dip": DIP, "strike": STRIKE})
BY_DIRECTION = pd.DataFrame({"dip": DIP, "dipdir": DIRECTION})


def principal(path: Path, columns: tuple[str, ...] | None = None) -> tuple[tuple[float, ...], str]:
    events: list[Event] = []
    found = summary(
        path,
        SpaceSettings(space="projective-plane"),
        reading=RowSettings(columns=columns),
        on_event=events.append,
    )
    told = " ".join(event.text for event in events if isinstance(event, Note))
    return found.summary["axes"][0]["principal"], told


@pytest.mark.parametrize("header", ["strike,dip,rake", "Strike (deg),Dip (deg),rake"])
@pytest.mark.parametrize("is_asked", [False, True])
def test_tables_with_strikes(header: str, is_asked: bool, tmp_path: Path) -> None:
    path = tmp_path / "planes.csv"
    path.write_text(f"{header}\n0,30,10\n0,30,20\n0,30,99\n")
    strike, dip, _ = header.split(",")
    found, told = principal(path, (dip, strike) if is_asked else None)
    assert found == pytest.approx((30.0, 90.0))
    assert "by the right-hand rule" in told
    path.write_text("dip,dipdir\n30,90\n30,90\n30,90\n")
    found, told = principal(path)
    assert found == pytest.approx((30.0, 90.0))
    assert "right-hand rule" not in told


def test_frames_with_strikes() -> None:
    with warned("right-hand", "rule", kind=DataWarning) as caught:
        by_strike = summarize_axes(BY_STRIKE)
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert summarize_axes(BY_DIRECTION) == by_strike
    with pytest.warns(DataWarning):
        assert summarize_axes(BY_STRIKE[["strike", "dip"]]) == by_strike


def test_codes_among_strikes_are_refused() -> None:
    coded = BY_STRIKE.copy()
    coded.loc[3, "strike"] = 999
    with refused("999", "row 4", kind=SettingError):
        summarize_axes(coded)


@pytest.mark.filterwarnings("ignore::orbiflow.errors.DataWarning")
def test_models_are_of_directions_of_dip(tmp_path: Path) -> None:
    of_strike, of_direction = (
        DensityEstimator("projective-plane", components="mixture").fit(frame)
        for frame in (BY_STRIKE, BY_DIRECTION)
    )
    assert list(of_strike.feature_names_in_) == ["dip", "dip_direction"]
    wanted = of_direction.score_samples(BY_DIRECTION)
    np.testing.assert_array_equal(of_strike.score_samples(BY_STRIKE), wanted)
    np.testing.assert_array_equal(of_strike.score_samples(BY_STRIKE[["strike", "dip"]]), wanted)
    table = tmp_path / "planes.csv"
    BY_STRIKE[["strike", "dip"]].to_csv(table, index=False)
    for model in (of_strike, of_direction):
        for columns in (None, ("dip", "strike")):
            save(model, tmp_path / "model")
            reading = RowSettings(columns=columns)
            score(table, reading=reading, model=tmp_path / "model", out=tmp_path / "scored.csv")
            scored = pd.read_csv(tmp_path / "scored.csv")
            assert list(scored.columns) == ["strike", "dip", "log_prob"]
            np.testing.assert_allclose(scored["log_prob"], wanted)
            np.testing.assert_array_equal(scored["strike"], STRIKE)
        BY_DIRECTION.to_csv(tmp_path / "other.csv", index=False)
        score(tmp_path / "other.csv", model=tmp_path / "model", out=tmp_path / "scored.csv")
        np.testing.assert_allclose(pd.read_csv(tmp_path / "scored.csv")["log_prob"], wanted)


def test_data_sets_with_strikes_and_directions_are_alike() -> None:
    with warned("right-hand", "rule", kind=DataWarning):
        found = compare_samples({"a": BY_STRIKE, "b": BY_DIRECTION}, "projective-plane")
    assert not found.differ


def test_a_strike_on_a_torus_is_an_angle(tmp_path: Path) -> None:
    path = tmp_path / "planes.csv"
    path.write_text("dip,strike\n30,0\n30,0\n30,0\n")
    events: list[Event] = []
    reading = RowSettings(columns=("dip=angle:degrees", "strike=angle:degrees"))
    summary(path, SpaceSettings(space="torus"), reading=reading, on_event=events.append)
    assert not any("right-hand" in str(event) for event in events)
