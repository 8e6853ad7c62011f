"""Columns whose values or names say that they are not what they are taken for."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from orbiflow.density import DensityEstimator, summarize_directions
from orbiflow.density.data import check_columns, check_values, codes_among
from orbiflow.density.operations.summary import summary
from orbiflow.density.tables import CountedRowSettings, SpaceSettings
from orbiflow.errors import DataWarning, SettingError
from orbiflow.runtime import Event, Note
from refusals import refused, warned

RNG = np.random.default_rng(5)
PHI = RNG.normal(-63, 10, 300).round(1)
BACKBONE = np.where(RNG.uniform(size=300) < 0.9, PHI, RNG.normal(60, 10, 300).round(1))
WIND = RNG.integers(1, 37, 120) * 10.0
ROUNDED = (RNG.uniform(0, 360, 3000) / 10).round() * 10
AXES = (RNG.normal(0, 15, 60) % 180).round()
SPREAD = RNG.uniform(0, 180, 60).round()
BOND = np.degrees(np.arccos(RNG.uniform(-1, 1, 60))).round(1)


def with_values(column: np.ndarray, value: float, rows: int) -> np.ndarray:
    found = column.copy()
    found[: rows * 7 : 7] = value
    return found


def told(
    space: str, values: np.ndarray, unit: str | None = None, *names: str
) -> list[tuple[bool, str]]:
    data = values.reshape(len(values), -1)
    doubts = check_values(space, data, names or None, unit, "cure")[1]
    return [(doubt.is_serious, doubt.text) for doubt in doubts]


@pytest.mark.parametrize(
    ("column", "code"),
    [
        (with_values(BACKBONE, 360.0, 1), 360.0),
        (with_values(BACKBONE, 360.0, 6), 360.0),
        (with_values(BACKBONE, -99.0, 10), -99.0),
        (with_values(BACKBONE, 99.0, 6), 99.0),
    ],
)
def test_codes_within_a_turn_are_seen(column: np.ndarray, code: float) -> None:
    assert codes_among(column, 360.0) == [code]


@pytest.mark.parametrize(
    "column",
    [
        BACKBONE, BACKBONE.round(), with_values(BACKBONE, -99.0, 1), WIND,
        with_values(BACKBONE % 360, 360.0, 6), np.append(BACKBONE, [360.0, 270.5]),
        np.array([-10.0, 350.0, 360.0, 20.0, 30.0, 40.0]), RNG.normal(-99, 1, 300).round(1),
        np.where(RNG.uniform(size=300) < 0.5, (PHI / 3).round() * 3, PHI),
        np.repeat([-99.0, -60.5, 60.5, 61.5, 170.5, 10.5], 50),
    ],
)  # fmt: skip
def test_angles_within_a_turn_are_no_codes(column: np.ndarray) -> None:
    assert codes_among(column, 360.0) == []


def test_zeros_among_fractions_are_doubted() -> None:
    ((serious, text),) = told("torus", with_values(BACKBONE, 0.0, 6), "degrees", "phi")
    assert serious
    assert "'phi' is exactly 0 in 6 rows" in text
    planar = with_values(with_values(BACKBONE, 0.0, 6)[::-1], 180.0, 6)
    for usual in (
        BACKBONE,
        RNG.normal(0, 3, 300).round(1),
        with_values(BACKBONE.round(), 0.0, 6),
        with_values(BACKBONE, 0.0, 2),
        planar,
    ):
        assert told("torus", usual, "degrees", "phi") == []
    assert told("rotation-space", with_values(np.tile(PHI / 99, (3, 1)).T, 0.0, 9), "radians") == []


def test_calm_and_north_are_doubted() -> None:
    ((serious, text),) = told("torus", np.append(WIND, [0] * 9), "degrees", "dir")
    assert serious
    assert "0, in 9 rows, and 360: of winds, 0 usually means calm" in text
    for usual in (WIND, WIND % 360, np.append(WIND % 350 + 1, [0.0, 360.0]), ROUNDED):
        assert told("torus", usual, "degrees", "dir") == []


AXIAL = [
    (AXES, "phi", True), (AXES, "orientation", True), (SPREAD, "strike", True), (AXES + 0.0, "a", True),
    (np.array([10.0, 170, 175, 5]), "strike", True), (SPREAD - 90, "fibre_angle", True),
    (RNG.uniform(60, 120, 60), "axis", False),
]  # fmt: skip


@pytest.mark.parametrize(("column", "name", "serious"), AXIAL)
def test_axes_on_a_torus_are_doubted(column: np.ndarray, name: str, serious: bool) -> None:
    ((found, text),) = told("torus", column, "degrees", name)
    assert found == serious
    assert "fills half a turn alone" in text
    assert "double the angles" in text
    ((found, _),) = told("torus", np.radians(column), "radians", name)
    assert found == serious


@pytest.mark.parametrize(
    ("column", "name"),
    [
        (BOND, "angle"), (SPREAD, "phi"), (2 * SPREAD, "strike"), (AXES * 2, "orientation"),
        (RNG.normal(90, 20, 60), "theta"), (np.abs(RNG.normal(175, 4, 60) % 360), "omega"),
        (SPREAD - 90, "pitch"), (np.abs(RNG.normal(0, 20, 60)), "error angle"),
    ],
)  # fmt: skip
def test_angles_of_half_a_turn_are_not_doubted(column: np.ndarray, name: str) -> None:
    assert told("torus", column, "degrees", name) == []


FOREIGN = {
    "azimuth_gon": "multiply by 0.9", "Hz [gon]": "multiply by 0.9", "gradians": "multiply by 0.9",
    "theta_arcmin": "divide by 60", "theta_arcsec": "divide by 3600", "a_mrad": "divide by 1000",
    "azimuth_mil": "by 0.05625", "phase_cycles": "give unit turns", "ra_hours": "multiply by 15",
    "RA (h)": "multiply by 15", "hour": "multiply by 15",
}  # fmt: skip


@pytest.mark.parametrize("name", FOREIGN)
@pytest.mark.parametrize("unit", [None, "degrees", "radians"])
def test_units_that_are_not_read_are_refused_by_cause(name: str, unit: str | None) -> None:
    column = np.array([[0.5, 10.0, 20.0]]).T
    with refused(FOREIGN[name], kind=SettingError):
        check_values("torus", column, [name], unit, "cure")


@pytest.mark.parametrize(
    ("name", "unit", "most"),
    [
        ("Winkel [Grad]", "degrees", 360), ("phase_cycles", "turns", 1), ("hour", "turns", 1),
        ("hour", "degrees", 350), ("h", "degrees", 24), ("hour_angle", "radians", 6),
        ("dragon", "degrees", 300), ("gradient direction", "degrees", 300), ("phi_deg", None, 300),
        ("mile", "degrees", 300),
    ],
)  # fmt: skip
def test_names_like_units_pass(name: str, unit: str | None, most: float) -> None:
    check_values("torus", np.linspace(0, most, 50)[:, None], [name], unit, "cure")


def test_grad_is_asked_about() -> None:
    column = np.linspace(0, 390, 50)[:, None]
    with refused("0.9", kind=SettingError):
        check_values("torus", column, ["azimuth [grad]"], None, "cure")
    with refused("gon", kind=SettingError):
        check_values("torus", column, ["azimuth [grad]"], "degrees", "cure")
    with refused("Lat_gon", kind=SettingError):
        check_columns("sphere", ["Lat_gon", "Lon_gon"])


@pytest.mark.parametrize("names", ["SZA,SAA", "polar,azimuthal", "Polar angle,Azimuth", "vza,vaa"])
def test_angles_from_the_pole_are_refused(names: str) -> None:
    with refused("less", "90", kind=SettingError):
        check_columns("sphere", names.split(","))


def test_angles_from_the_vertical_are_doubted() -> None:
    places = np.stack([RNG.uniform(10, 80, 30), RNG.uniform(0, 360, 30)], axis=1)
    for names in ("tilt,azimuth", "inc,azi", "Inclination,Azimuth"):
        ((serious, text),) = told("sphere", places, None, *names.split(","))
        assert serious
        assert "90 less it" in text
    for names in ("inc,dec", "alt,az", "plunge,trend", "lat,lon", "elevation,azimuth"):
        assert told("sphere", places, None, *names.split(",")) == []


def test_null_island_is_doubted() -> None:
    places = np.stack([RNG.normal(48, 3, 60), RNG.normal(10, 3, 60)], axis=1)
    gaps = np.vstack([places, np.zeros((4, 2))])
    ((serious, text),) = told("sphere", gaps, None, "lat", "lon")
    assert serious
    assert "both exactly 0 in 4 rows" in text
    with warned("exactly", "0", "4", kind=DataWarning):
        summarize_directions(gaps)
    with warned("exactly", "0", "4", kind=DataWarning):
        DensityEstimator("sphere", components="mixture").fit(gaps)
    whole = RNG.integers(-8, 8, (300, 2)) * 10.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for usual in (gaps - [48, 10], whole, np.vstack([places, [[0.0, 0.0]]]), 20 * places % 50):
            summarize_directions(usual)
    assert all("exactly 0" not in text for _, text in told("projective-plane", gaps))


def notes(path: Path, **settings: object) -> str:
    events: list[Event] = []
    reading = CountedRowSettings(**settings)  # pyright: ignore[reportArgumentType]
    where = SpaceSettings(space="torus", unit="degrees")
    summary(path, where, reading=reading, on_event=events.append)
    return " ".join(event.text for event in events if isinstance(event, Note))


@pytest.mark.parametrize("speed", ["sknt", "wind_speed", "WSPD"])
def test_calm_rows_are_told_by_their_speed(speed: str, tmp_path: Path) -> None:
    path = tmp_path / "wind.csv"
    rows = [*zip(WIND.tolist(), (WIND % 7 + 1).tolist(), strict=True), (0, 0), (0, 0)]
    text = "\n".join(f"{direction:g},{own:g}" for direction, own in rows)
    path.write_text(f"wind_dir,{speed}\n{text.replace('360,', '350,')}\n")
    assert "'wind_dir' is 0 in just the 2 rows in which" in notes(path)
    assert "WARNING" not in notes(path, missing_codes=(0.0,), drop_missing=True)
    for usual in ("0,3\n20,4\n40,5", "0,0\n20,0\n40,5", "0,3\n0,0\n40,5", "10,0\n20,4\n40,5"):
        path.write_text(f"wind_dir,{speed}\n{usual}\n")
        assert "WARNING" not in notes(path)
