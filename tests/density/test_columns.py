"""Names of columns say which they are and in which order; strikes beside dips."""

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import DensityEstimator, summarize_axes
from orbiflow.density.data import arrangements, check_columns, chosen_arrangement
from orbiflow.density.operations.queries import score
from orbiflow.density.operations.summary import summary
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.errors import DataWarning, SettingError
from orbiflow.loading import save
from orbiflow.runtime import Event, Note
from refusals import refused, warned

PLACES = [
    "lon,lat", "LON_deg,LAT_deg", "pickup_longitude,pickup_latitude", "GPSLongitude,GPSLatitude",
    "Long.,Lat.", "Länge,Breite", "RAJ2000,DEJ2000", "Right Ascension,Declination", "dec,inc",
    "dir_dec,dir_inc", "az,alt", "trend,plunge", "dip direction,dip", "strike,dip", "glon,glat",
]  # fmt: skip


@pytest.mark.parametrize("names", PLACES)
def test_latitude_is_first_and_another_order_is_refused_if_chosen(names: str) -> None:
    east, north = names.split(",")
    for order in ([east, north], [north, east], ["depth", east, "mag", north]):
        for space in ("sphere", "projective-plane"):
            found = chosen_arrangement(space, order)
            assert found is not None
            assert [order[k] for k in found.columns] == [north, east]
    check_columns("sphere", [north, east])
    with refused("order", f"'{north},{east}'", kind=SettingError):
        check_columns("sphere", [east, north])


ROTATIONS = {
    "t,w,x,y,z": "x,y,z,w", "q0,q1,q2,q3": "q1,q2,q3,q0", "scalar,i,j,k": "i,j,k,scalar",
    "q_w,q_x,q_y,q_z": "q_x,q_y,q_z,q_w", "z,y,x,w": "x,y,z,w", "rz,ry,rx": "rx,ry,rz",
    "r11,r21,r31,r12,r22,r32,r13,r23,r33": "r11,r12,r13,r21,r22,r23,r31,r32,r33",
}  # fmt: skip


@pytest.mark.parametrize(("names", "right"), ROTATIONS.items(), ids=list(ROTATIONS))
def test_rotations_are_read_by_the_names_of_their_numbers(names: str, right: str) -> None:
    columns = names.split(",")
    found = chosen_arrangement("rotation-space", columns)
    assert found is not None
    assert [columns[k] for k in found.columns] == right.split(",")
    assert check_columns("rotation-space", right.split(",")) is not None


@pytest.mark.parametrize("names", ["phi2,Phi,phi1", "φ2,Φ,φ1", "euler3,euler1,euler2"])
def test_euler_angles_are_read_by_name(names: str) -> None:
    columns = names.split(",")
    found = chosen_arrangement("rotation-space", columns)
    assert found is not None
    ends = [columns[k][-1] for k in found.columns]
    assert (ends[0], ends[2]) in (("1", "2"), ("1", "3"))
    with refused("Bunge's", "angles", kind=SettingError):
        check_columns("rotation-space", columns)


MUST_BE_CONVERTED = {
    ("sphere", "colatitude,longitude"): "90", ("sphere", "zenith,azimuth"): "90",
    ("sphere", "lat_rad,lon_rad"): "radians degrees", ("sphere", "dec,ra_hours"): "ra_hours 24",
    ("sphere", "lat,lon,mag"): "lat,lon",
}  # fmt: skip


@pytest.mark.parametrize(("space", "names"), MUST_BE_CONVERTED)
def test_what_must_be_converted_is_refused(space: str, names: str) -> None:
    with refused(*MUST_BE_CONVERTED[space, names].split(), kind=SettingError):
        check_columns(space, names.split(","))


def test_several_pairs_are_asked_about() -> None:
    names = ["lat", "lon", "vgp_lat", "vgp_lon"]
    assert len(arrangements("sphere", names)) == 2
    with refused("vgp_lat", "vgp_lon", kind=SettingError):
        chosen_arrangement("sphere", names)
    with_errors = ["lat", "lon", "lat_err", "lon_err", "ra_pm"]
    assert arrangements("sphere", with_errors) == arrangements("sphere", ["lat", "lon"])


@pytest.mark.parametrize(
    ("space", "names"),
    [
        ("sphere", "x,y,z"), ("sphere", "a,b"), ("sphere", "column1,column2"), ("torus", "lon,lat"),
        ("sphere", "lat,lon"), ("rotation-space", "a,b,c,d"), ("rotation-space", "q1,q2,q3,q4"),
        ("klein-bottle", "theta,phi"), ("p4m", "x,y"), ("hypersphere", "x2,x1,x3"),
        ("rotation-space", "phi1,Phi,phi2"), ("sphere", "late,lone"), ("sphere", "dec,temperature"),
    ],
)  # fmt: skip
def test_good_orders_pass(space: str, names: str) -> None:
    check_columns(space, names.split(","))


@given(st.permutations(["lon", "lat", "x", "id", "w", "y", "z", "theta", "phi", "temp"]))
def test_the_order_of_other_columns_does_not_matter(names: list[str]) -> None:
    for space, right in (
        ("sphere", ["lat", "lon"]),
        ("klein-bottle", ["theta", "phi"]),
        ("rotation-space", ["x", "y", "z", "w"]),
        ("P 21 21 21", ["x", "y", "z"]),
    ):
        (found,) = arrangements(space, names)
        assert [names[k] for k in found.columns] == right


@given(st.lists(st.text(max_size=12), max_size=6), st.sampled_from(["sphere", "torus", "p4"]))
def test_any_names_are_arranged_or_refused(names: list[str], space: str) -> None:
    for way in arrangements(space, names):
        assert len(set(way.columns)) == len(way.columns)
        assert max(way.columns) < len(names)


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


@pytest.mark.parametrize(
    ("header", "is_asked"), [("strike,dip,rake", False), ("Strike (deg),Dip (deg),rake", True)]
)
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
    for model, rows, columns in (
        (of_direction, BY_STRIKE[["strike", "dip"]], ("dip", "strike")),
        (of_direction, BY_STRIKE[["strike", "dip"]], None),
        (of_strike, BY_DIRECTION, None),
    ):
        save(model, tmp_path / "model")
        rows.to_csv(table, index=False)
        reading = RowSettings(columns=columns)
        score(table, reading=reading, model=tmp_path / "model", out=tmp_path / "scored.csv")
        scored = pd.read_csv(tmp_path / "scored.csv")
        assert list(scored.columns) == [*rows.columns, "log_prob"]
        np.testing.assert_allclose(scored["log_prob"], wanted)


def test_a_strike_on_a_torus_is_an_angle(tmp_path: Path) -> None:
    path = tmp_path / "planes.csv"
    path.write_text("dip,strike\n30,0\n30,0\n30,0\n")
    events: list[Event] = []
    reading = RowSettings(columns=("dip=angle:degrees", "strike=angle:degrees"))
    summary(path, SpaceSettings(space="torus"), reading=reading, on_event=events.append)
    assert not any("right-hand" in str(event) for event in events)
