"""Values say what they are: codes for missing ones, radians, fractions of a cell."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import to_vectors
from orbiflow.density.data import check_unit, check_values, codes_among, fraction_doubts
from orbiflow.errors import SettingError
from refusals import refused

RNG = np.random.default_rng(0)
WIND = RNG.integers(0, 36, 80) * 10.0
FINE = RNG.uniform(-180, 180, 80)
CODED = [
    (WIND, [999.0], 360.0),
    (WIND, [990.0, 999.0], 360.0),
    (WIND, [-99.0], 360.0),
    (WIND, [-9999.0], 360.0),
    (WIND, [99.9], 360.0),
    (WIND, [32767.0], 360.0),
    (WIND, [9.96921e36], 360.0),
    (FINE, [-999.0], 360.0),
    (FINE, [9999.0], 360.0),
    (FINE % 360, [-99.9], 360.0),
    (np.radians(FINE), [-999.0], 2 * math.pi),
    (np.radians(FINE), [99.0], 2 * math.pi),
    (WIND, [361.0, 361.0], 360.0),
    (WIND, [511.0, 511.0], 360.0),
]  # fmt: skip


@pytest.mark.parametrize(("angles", "codes", "turn"), CODED)
def test_codes_are_seen(angles: np.ndarray, codes: list[float], turn: float) -> None:
    column = np.array([*angles, *codes, np.nan])
    assert codes_among(column, turn) == sorted(set(codes))


TURNING = np.cumsum(RNG.normal(3, 20, 500))
GOOD = [
    (WIND, 360.0), (FINE, 360.0), (np.array([0.0, 360.0, 350, 10]), 360.0), (TURNING, 360.0),
    (np.arange(0, 2000, 7.0), 360.0), (np.array([-99.0, 20, -30, 150, 170]), 360.0),
    (np.array([400.0, 10.0, 20.0]), 360.0), (FINE + 200, 360.0), (np.array([99.0, 77.0, 88.0]), 360.0),
    (np.array([355.0, 361.0, 362.0, 10.0]), 360.0), (np.radians(TURNING), 2 * math.pi),
    (np.array([]), 360.0), (np.array([np.nan]), 360.0), (np.arange(990.0, 1010.0), 360.0),
]  # fmt: skip


@pytest.mark.parametrize(("angles", "turn"), GOOD)
def test_angles_are_no_codes(angles: np.ndarray, turn: float) -> None:
    assert codes_among(angles, turn) == []


@given(st.lists(st.floats(-360, 360).map(lambda v: round(v, 3)), min_size=1), st.integers(1, 9))
def test_angles_of_both_signs_within_a_turn_are_no_codes(angles: list[float], times: int) -> None:
    column = np.array([*angles, -200.5, 200.25] * times)
    assert codes_among(column, 360.0) == []


def unit_of(space: str, values: np.ndarray, unit: str | None = None, *names: str) -> str:
    return check_values(space, values, names or None, unit, "cure")[0]


def doubts_of(space: str, values: np.ndarray, unit: str | None = None, *names: str) -> list[bool]:
    doubts = check_values(space, values, names or None, unit, "cure")[1]
    return [doubt.is_serious for doubt in doubts]


def test_units_are_those_of_names_and_values() -> None:
    small = RNG.uniform(-1, 1, (40, 2))
    assert unit_of("torus", small) == "radians"
    assert unit_of("torus", small, None, "phi_deg", "psi_deg") == "degrees"
    assert unit_of("torus", 200 * small, None, "phi (°)", "psi (°)") == "degrees"
    assert unit_of("torus", np.array([[6.2832, 0.0]])) == "radians"  # 2 pi, rounded
    with refused("degrees", "2", kind=SettingError):
        unit_of("torus", np.array([[6.3, 0.0]]))
    with refused("2", kind=SettingError):
        unit_of("klein-bottle", 200 * small)
    with refused("different", "units", kind=SettingError):
        unit_of("torus", small, None, "phi_rad", "psi_deg")
    assert True in doubts_of("torus", small, "radians", "phi_deg", "psi_deg")


def test_radians_among_degrees_and_degrees_among_radians_are_doubted() -> None:
    radians, degrees = RNG.uniform(-3.1, 3.1, (40, 2)), RNG.uniform(-180, 180, (40, 2))
    assert doubts_of("torus", radians, "degrees") == [True]
    assert doubts_of("torus", degrees, "radians")[0]
    assert doubts_of("torus", degrees, "degrees") == []
    assert doubts_of("torus", radians, "radians") == []
    assert doubts_of("torus", 0.3 * radians, "degrees") == []  # small angles
    assert True not in doubts_of("torus", 200 * np.pi + radians.cumsum(axis=0), "radians")


def places(north: float, east: float, rows: int = 60) -> np.ndarray:
    vectors = RNG.normal(size=(rows, 3))
    lat = np.arcsin(vectors[:, 2] / np.linalg.norm(vectors, axis=1))
    return np.stack([lat * north, np.arctan2(vectors[:, 1], vectors[:, 0]) * east], axis=1)


@pytest.mark.parametrize("space", ["sphere", "projective-plane"])
def test_radians_on_the_sphere_are_refused(space: str) -> None:
    turned = places(1, 1)
    turned[:, 1] %= 2 * np.pi
    for radians in (places(1, 1), places(0.4, 1), turned):
        with refused("radians", "numpy.degrees", kind=SettingError):
            unit_of(space, radians)
        assert True not in doubts_of(space, radians, "degrees")
    assert True in doubts_of(space, places(0.5, 0.3))
    assert True not in doubts_of(space, places(57, 57))
    assert True not in doubts_of(space, places(0.5, 0.3) + np.array([48, 11]))
    assert True not in doubts_of(space, places(1, 1, rows=5))


def test_it_is_said_what_columns_without_names_are_taken_for() -> None:
    (doubt,) = check_values("sphere", places(57, 57), None, None, "cure")[1]
    assert doubt == ("took column1 as latitude and column2 as longitude, in degrees", False)
    assert doubts_of("sphere", RNG.normal(size=(9, 3))) == []


def test_right_ascension_in_hours_is_doubted() -> None:
    sky = places(50, 24 / 2 / np.pi) + np.array([0, 12])
    assert doubts_of("sphere", sky, None, "dec", "ra") == [True]
    assert doubts_of("sphere", sky, None, "lat", "lon") == []
    assert doubts_of("sphere", sky * np.array([1, 15]), None, "dec", "ra") == []


def test_longitudes_to_the_west_are_doubted() -> None:
    west = np.abs(places(50, 50))
    assert doubts_of("sphere", west, None, "lat_n", "lon_w") == [True]
    assert doubts_of("sphere", west, None, "Latitude (S)", "Longitude (W)") == [True, True]
    assert doubts_of("sphere", west * [1, -1], None, "lat", "lon_w") == []
    assert doubts_of("sphere", west, None, "lat_n", "lon_e") == []


def test_quantities_that_are_no_angles_are_doubted() -> None:
    table = RNG.uniform(-180, 180, (30, 2))
    for name in ("temperature", "bond length", "count", "windSpeed", "B-factor resolution"):
        assert doubts_of("torus", table, "degrees", "phi", name) == [True]
    for name in ("bond angle", "chi1", "wind direction", "a", "tempo", "phase_of_temperature"):
        assert True not in doubts_of("torus", table, "degrees", "phi", name)


def test_units_are_refused_where_there_are_none() -> None:
    for space in ("sphere", "projective-plane", "hypersphere"):
        with refused("latitude", "longitude", kind=SettingError):
            check_unit(space, "radians")
    with refused("points", "quotient", kind=SettingError):
        check_unit("p4m", "degrees")
    with refused("grad", kind=SettingError):
        check_unit("torus", "grad")


def test_places_on_a_torus_are_doubted() -> None:
    table = RNG.uniform(-80, 80, (30, 2))
    assert doubts_of("torus", table, "degrees", "lat", "lon") == [True]
    for names in (("phi", "psi"), ("azimuth", "altitude"), ("lon", "phi"), ("dip", "dipdir")):
        assert True not in doubts_of("torus", table, "degrees", *names)


def test_fractions_of_a_cell_are_doubted() -> None:
    inside = RNG.uniform(0, 1, (30, 3))
    assert fraction_doubts(inside, (8.0, 9.0, 10.0))[0].is_serious
    assert fraction_doubts(inside, (1.0, 1.0, 1.0)) == []
    assert fraction_doubts(inside + np.array([0, 0, 4]), (8.0, 9.0, 10.0)) == []


def test_rounding_may_take_a_latitude_beyond_the_pole() -> None:
    pole = np.degrees(float(np.float32(np.pi / 2)))
    assert pole > 90
    assert to_vectors([[pole, 50.0], [-pole, 50.0]])[:, 2].tolist() == [1.0, -1.0]
    assert to_vectors([[0.0, float(np.float32(360.00003))]]).round(4).tolist() == [[1.0, 0.0, 0.0]]
    with refused("90.01", "90"):
        to_vectors([[90.01, 0.0]])
    with refused("-999"):
        to_vectors([[-999.0, 0.0]])
    with refused("999", "360"):
        to_vectors([[9.0, 999.0]])


NUMBERED = np.column_stack([RNG.permutation(90)[:30], RNG.uniform(-180, 180, (30, 2))])


@pytest.mark.parametrize("name", ["Unnamed: 0", "index", "level_0", "resid", "id", "site_id", "#"])
def test_columns_that_number_the_rows_are_doubted(name: str) -> None:
    assert doubts_of("torus", NUMBERED, "degrees", name, "phi", "psi") == [True]
    assert True in doubts_of("p1", NUMBERED, None, name, "a", "b")
    repeated = NUMBERED // np.array([5, 1, 1])
    if name not in ("site_id", "#"):
        assert doubts_of("torus", repeated, "degrees", name, "phi", "psi") == [True]


def test_rows_that_are_numbered_without_a_name_are_doubted() -> None:
    ordered = np.column_stack([np.arange(30), NUMBERED[:, 1:]])
    assert doubts_of("torus", ordered, "degrees") == [True]


@pytest.mark.parametrize("name", ["a", "x", "wind", "phi", "indexed", "idle", "angle id"])
def test_whole_angles_number_no_rows(name: str) -> None:
    assert doubts_of("torus", NUMBERED, "degrees", name, "phi", "psi") == []
    assert doubts_of("torus", np.arange(0, 360.0)[:, None], "degrees", name) == []
    ordered = np.column_stack([np.arange(-90, 90.0), np.zeros(180)])
    assert doubts_of("sphere", ordered, None, "lat", "lon") == []


def test_one_is_an_angle_among_whole_tens() -> None:
    assert codes_among(np.array([*WIND, 1.0]), 360.0) == []
    assert codes_among(np.array([*WIND, -1.0]), 360.0) == [-1.0]


@pytest.mark.parametrize(
    ("code", "step"), [(-1.0, 1.0), (99.0, 10.0), (-999.25, 0.1), (-888.8, 0.1), (-555.5, 0.1)]
)
def test_more_codes(code: float, step: float) -> None:
    angles = np.round(np.random.default_rng(0).uniform(0, 359, 60) / step) * step
    assert codes_among(np.where(np.arange(60) % 7, angles, code), 360.0) == [code]
    assert codes_among(angles, 360.0) == []
