"""Columns are what is declared, or what their names say; other columns are asked for."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import DensityEstimator, Role, RotationSpace, Torus, UndeclaredError
from orbiflow.density.data import Declaration, asked_roles, proposed_role, role_named
from orbiflow.density.tables import RowSettings, SpaceSettings, read_rows
from orbiflow.errors import DataWarning, InputFileError, SettingError
from orbiflow.runtime import ignore
from refusals import refused

pandas = pytest.importorskip("pandas")
UNITS = st.sampled_from(["degrees", "radians", "turns"])
WORDS = st.one_of(
    st.builds("{}:{}".format, st.sampled_from(["angle", "axial"]), UNITS),
    st.builds("cycle:{:.15g}".format, st.floats(1e-3, 1e6)),
    st.builds("bounded:{:.15g}:{:.15g}".format, st.floats(-1e3, 0), st.floats(1e-3, 1e3)),
    st.sampled_from(["linear", "positive", "word", "weight", "count", "group", "ignore", "angle"]),
)


@given(WORDS)
def test_a_role_is_its_word(word: str) -> None:
    role = Role.of(word)
    assert str(role) == word
    assert Role.of(str(role)) == role
    assert role.is_round + role.is_real + role.is_side == (role.kind != "word")


OTHER_WORDS = """angel angle:grad cycle cycle:0 cycle:-1 cycle:nan cycle:inf bounded:0 bounded:1:0
bounded:0:inf positive:0 linear:1 angle:degrees:2"""


@pytest.mark.parametrize("word", OTHER_WORDS.split())
def test_other_words_are_refused(word: str) -> None:
    with refused("columns", repr(word), kind=SettingError):
        asked_roles({"x": word})


@given(st.dictionaries(st.sampled_from(["dir", "wind speed", "Größe", "a"]), st.none() | WORDS))
def test_text_and_mapping_say_the_same(roles: dict[str, str | None]) -> None:
    text = ",".join(name if role is None else f"{name}={role}" for name, role in roles.items())
    asked = asked_roles(roles)
    assert asked == (asked_roles(text) if text else {})
    assert asked == asked_roles([word for word in text.split(",") if word])


def test_a_column_is_named_once() -> None:
    for wrong in ("a,a", ["a", "a=linear"], 3, [None]):
        with refused("columns", kind=SettingError):
            asked_roles(wrong)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("phi", "angle"), ("phi_deg", "angle:degrees"), ("Wind Dir (deg)", "angle:degrees"),
        ("x_rad", "angle:radians"), ("hour", "cycle:24"), ("month", "cycle:12"), ("id", "ignore"),
        ("dayOfYear", "cycle:365.25"), ("speed", None), ("ra_hours", None), ("azimuth [gon]", None),
        ("temperature", None), ("radius", None), ("phase", "angle"), ("county", None),
        ("turn_angle", "angle"), ("dir (tens of deg)", None), ("heading (tenths °)", None),
    ],
)  # fmt: skip
def test_names_have_roles(name: str, role: str | None) -> None:
    found = role_named(name)
    assert (None if found is None else str(found)) == role


RNG = np.random.default_rng(0)
TURN = RNG.vonmises(0.4, 1.0, 60)
DEGREES = np.degrees(TURN)
SPEED = RNG.lognormal(1, 1.5, 60)
LAT, LON = RNG.normal(48, 3, 60), RNG.normal(10, 5, 60)
CODED = np.where(np.arange(60) % 20 == 3, 999.0, DEGREES % 360)

# tables of people's kinds, the space, and what their columns are once the printed words are pasted
TABLES: dict[str, tuple[dict[str, Any], str, str]] = {
    "tens of degrees, by name": (
        {"Wind Dir (10s deg)": np.ceil(DEGREES % 360 / 10)}, "torus", "Wind Dir (10s deg)=cycle:36"
    ),
    "turning angles": ({"turn_angle": TURN}, "torus", "turn_angle=angle:radians"),
    "wind in degrees": ({"dir": DEGREES % 360, "speed": SPEED}, "torus",
                        "dir=angle:degrees,speed=positive"),
    "wind in tens": ({"dir": (DEGREES % 360 / 10).round()}, "torus", "dir=cycle:36"),
    "phases": ({"phase": TURN / 2 / np.pi % 1}, "torus", "phase=angle:turns"),
    "radians": ({"phi": TURN, "psi": TURN[::-1]}, "torus", "phi=angle:radians,psi=angle:radians"),
    "protein": ({"residue": ["GLY"] * 60, "phi": DEGREES, "psi": DEGREES[::-1]}, "torus",
                "phi=angle:degrees,psi=angle:degrees"),
    "units in names": ({"phi_deg": DEGREES, "chi_rad": TURN}, "torus",
                       "phi_deg=angle:degrees,chi_rad=angle:radians"),
    "hours and counts": ({"hour": np.arange(24.0), "n": RNG.integers(1, 9, 24)}, "torus",
                         "hour=cycle:24,n=count"),
    "months and rain": ({"month": RNG.integers(1, 13, 60), "rain": SPEED - SPEED.min()}, "torus",
                        "month=cycle:12,rain=linear"),
    "numbered without a name": ({"record": np.arange(1, 61), "heading": DEGREES}, "torus",
                                "heading=angle:degrees,record=ignore"),
    "gon": ({"az_gon": DEGREES / 0.9 % 400}, "torus", "az_gon=cycle:400"),
    "axes": ({"fibre orientation": DEGREES % 180}, "torus", "fibre orientation=axial:degrees"),
    "axes in degrees": ({"orientation_deg": DEGREES % 180}, "torus",
                        "orientation_deg=axial:degrees"),
    "a lineament that turned out to be a bearing": ({"strike (deg)": DEGREES % 360}, "torus",
                                                    "strike (deg)=angle:degrees"),
    "strange names": ({"a": DEGREES, "b": DEGREES % 360}, "torus",
                      "a=angle:degrees,b=angle:degrees"),
    "vectors of wind": ({"u": LON, "v": -LON, "dir_deg": DEGREES}, "torus",
                        "dir_deg=angle:degrees,u=linear,v=linear"),
    "sines": ({"sin_phi": np.sin(TURN), "phi_deg": DEGREES}, "torus",
              "sin_phi=ignore,phi_deg=angle:degrees"),
    "places": ({"lon": LON, "lat": LAT, "depth": SPEED}, "sphere", "lat,lon"),
    "vectors": ({"t": LAT, "x": np.cos(TURN), "y": np.sin(TURN), "z": 0 * TURN}, "sphere",
                "x,y,z"),
    "no names of places": ({"p": LAT, "q": LON}, "sphere", "p,q"),
    "galactic places": ({"l": LON % 360, "b": LAT}, "sphere", "b,l"),
    "planes": ({"strike": LON % 360, "dip": LAT}, "projective-plane", "dip,dip_direction"),
    "patches": ({"phi": TURN, "theta": TURN[::-1]}, "klein-bottle", "theta,phi"),
    "Euler angles": ({"phi1": DEGREES, "Phi": LAT, "phi2": LON}, "rotation-space",
                     "phi1,Phi,phi2"),
    "quaternions": ({"w": np.cos(TURN), "x": np.sin(TURN), "y": 0 * TURN, "z": 0 * TURN},
                    "rotation-space", "x,y,z,w"),
    "a cell": ({"x": LON, "y": LAT}, "p4m", "x,y"),
}  # fmt: skip


def pasted(data: Any, space: str) -> str:
    """The declaration of a fit once what is asked for was answered with the printed words."""
    columns = None
    for _ in range(3):
        estimator = DensityEstimator(space, columns=columns)
        try:
            rows = estimator._columns().read(data)
        except UndeclaredError as error:
            columns = error.proposal
        else:
            sides = {k: str(r) for k, r in asked_roles(columns).items() if r and r.is_side}
            return ",".join([rows.declaration, *(f"{k}={r}" for k, r in sides.items())])
    raise AssertionError(columns)


@pytest.mark.filterwarnings("ignore::orbiflow.errors.DataWarning")
@pytest.mark.parametrize("case", TABLES)
def test_tables_are_right_or_asked_for(case: str, tmp_path: Path) -> None:
    columns, space, wanted = TABLES[case]
    frame = pandas.DataFrame(columns)
    found = pasted(frame, space)
    assert sorted(found.split(",")) == sorted(wanted.split(","))
    path = tmp_path / "table.csv"
    frame.to_csv(path, index=False)
    where = SpaceSettings(space=space)
    reading = RowSettings()
    for _ in range(2):
        try:
            rows = read_rows(path, reading, ignore, where=where)
            break
        except UndeclaredError as error:
            reading = RowSettings(columns=tuple(error.proposal.split(",")))
    else:
        raise AssertionError(case)
    sides = {f"{k}={r}" for k, r in asked_roles(reading.columns).items() if r and r.is_side}
    assert {*rows.declaration.split(","), *sides} == set(found.split(","))


REFUSED: dict[str, tuple[dict[str, Any], str, str, str]] = {
    "a code among angles": ({"dir": CODED}, "torus", "dir=angle:degrees", "999"),
    "360 for unknown": ({"phi": np.append(DEGREES, 360.0)}, "torus", "phi=angle:degrees", "360"),
    "degrees as radians": ({"phi": DEGREES}, "torus", "phi=angle:radians", "turn"),
    "an hour that is none": ({"hour": [*range(24), 99.0]}, "torus", "hour", "99"),
    "an hour before midnight": ({"hour": [*range(24), -1.0]}, "torus", "hour", "-1"),
    "no rain": ({"rain": [0.0, 1.0, 2.5]}, "torus", "rain=positive", "mass"),
    "a share of two": ({"share": [0.1, 0.4, 2.0]}, "torus", "share=bounded:0:1", "2"),
    "words": ({"phi": ["a", "b", "c"]}, "torus", "phi=angle:degrees", "phi"),
    "a latitude beyond": ({"lat": [*LAT, 95.0], "lon": [*LON, 0.0]}, "sphere", "lat,lon", "95"),
    "radians for places": ({"lat": TURN / 2, "lon": np.linspace(-3.1, 3.1, 60)}, "sphere",
                           "lat,lon", "radians"),
    "the wrong order": ({"lon": LON, "lat": LAT}, "sphere", "lon,lat", "lat,lon"),
    "radians by name": ({"lat_rad": TURN / 4, "lon_rad": TURN}, "sphere", "lat_rad,lon_rad",
                        "radians"),
    "hours for stars": ({"ra": DEGREES % 360 / 15, "dec": LAT}, "sphere", "dec,ra", "hours"),
    "an angle from the pole": ({"theta": 90 - LAT, "phi": LON}, "sphere", "theta,phi", "theta"),
    "radians from the pole": ({"p": TURN / 2 + 1.57, "q": np.linspace(0, 6.28, 60)}, "sphere",
                              "p,q", "radians"),
    "a strange number": ({"phi_deg": DEGREES, "p": [*LON[:59], 9999.0]}, "torus",
                         "phi_deg,p=linear", "9999"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_values_that_contradict_what_is_declared_are_refused(case: str, tmp_path: Path) -> None:
    columns, space, declared, about = REFUSED[case]
    frame = pandas.DataFrame(columns)
    with refused(about) as caught:
        DensityEstimator(space, columns=declared).fit(frame)
    for option in ("missing_codes", "drop_missing"):  # which are of files alone
        assert option not in str(caught.value)
    frame.to_csv(tmp_path / "table.csv", index=False)
    reading = RowSettings(columns=tuple(declared.split(",")))
    with refused(about, "table.csv"):
        read_rows(tmp_path / "table.csv", reading, ignore, where=SpaceSettings(space=space))


@pytest.mark.parametrize("case", ["a latitude beyond", "no one turn"])
def test_only_what_seems_to_be_a_code_is_proposed_as_one(case: str, tmp_path: Path) -> None:
    columns = {"lat": [*LAT, 95.3], "lon": [*LON, 0.0]}
    if case == "no one turn":  # -1 stands for flat ground
        columns = {"aspect_deg": np.where(np.arange(60) % 9 == 0, -1.0, DEGREES % 360)}
        columns["aspect_deg"][5] = 359.9
    pandas.DataFrame(columns).to_csv(tmp_path / "table.csv", index=False)
    where = SpaceSettings(space="sphere" if case == "a latitude beyond" else "torus")
    with refused("table.csv") as caught:
        read_rows(tmp_path / "table.csv", RowSettings(), ignore, where=where)
    codes = str(caught.value).partition("missing_codes ")[2].split(" ")[0]
    assert codes == ("" if case == "a latitude beyond" else "-1")


def test_numbers_that_are_text_in_a_frame_are_refused() -> None:
    frame = pandas.DataFrame({"DRCT": ["030", "VRB"] + ["120"] * 58, "speed": SPEED})
    with refused("DRCT", "'030'"):
        DensityEstimator(columns="DRCT=angle:degrees,speed=positive").fit(frame)
    with refused("DRCT"):
        DensityEstimator().fit(frame)


@pytest.mark.parametrize(
    "columns", [{"phi_deg": TURN}, {"c": np.cos(TURN).round(3), "s": np.sin(TURN).round(3)}]
)
def test_what_seems_to_be_something_else_is_doubted(columns: dict[str, Any]) -> None:
    roles = "phi_deg" if "phi_deg" in columns else "c=linear,s=linear"
    with pytest.warns(DataWarning):
        DensityEstimator(columns=roles)._columns().read(pandas.DataFrame(columns))


def test_weights_and_groups_are_columns() -> None:
    table = {"dir": DEGREES, "speed": SPEED, "n": RNG.integers(1, 4, 60), "site": ["a", "b"] * 30}
    frame = pandas.DataFrame(table)
    how: dict[str, Any] = {"components": "mixture", "seed": 0}
    declared = "speed=positive,dir=angle:degrees,n=weight,site=group"
    fit = DensityEstimator(columns=declared, **how).fit(frame)
    assert list(fit.feature_names_in_) == ["speed", "dir"]
    apart = DensityEstimator(columns="speed=positive,dir=angle:degrees", **how)
    apart.fit(frame[["speed", "dir"]], sample_weight=table["n"], groups=table["site"])
    np.testing.assert_array_equal(fit.score_samples(frame), apart.score_samples(frame))
    with refused("weight"):
        DensityEstimator(columns=declared, **how).fit(frame, sample_weight=table["n"])


@given(st.floats(0.05, 3.0), st.integers(0, 2**31))
def test_a_proposal_is_a_role(scale: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for name in ("phi", "speed", "x", "id", "hour", "count", "lat", "phi_deg", "az_gon"):
        values = rng.normal(0, 10**scale, 20)
        assert str(Role.of(proposed_role(name, values))) == proposed_role(name, values)


def test_a_space_takes_columns_beside_it_as_its_name_does() -> None:
    frame = pandas.DataFrame({"lon": LON, "depth": SPEED, "lat": LAT})
    how: dict[str, Any] = {"columns": "lat,lon,depth=positive", "components": "kernels"}
    by_name = DensityEstimator("sphere", **how).fit(frame)
    by_space = DensityEstimator(getattr(by_name.space_, "base"), **how).fit(frame)  # noqa: B009
    assert by_space.space_ == by_name.space_
    np.testing.assert_array_equal(by_space.score_samples(frame), by_name.score_samples(frame))


def test_quaternions_of_an_array_beside_a_real_column_say_their_form() -> None:
    quaternions = RNG.normal([3.0, 0, 0, 0], 0.3, (60, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    first = np.column_stack([quaternions, SPEED])
    last = np.column_stack([np.roll(quaternions, -1, axis=1), SPEED])
    scores = [
        DensityEstimator(RotationSpace(form=form), columns={4: "positive"}, components="kernels")
        .fit(data)
        .score_samples(data)
        for form, data in (("scalar-first", first), ("quaternion", last))
    ]
    np.testing.assert_allclose(scores[0], scores[1])


@pytest.mark.parametrize(
    ("space", "kind"),
    [("torus", "weight"), (Torus(1, unit="degrees"), "count"), ("fitted", "group")],
)
def test_two_columns_of_one_side_are_refused(space: Any, kind: str, tmp_path: Path) -> None:
    table = {"phi_deg": DEGREES, "a": np.ones(60), "b": np.ones(60)}
    columns = f"phi_deg,a={kind},b={kind}"
    with refused("columns", kind, kind=SettingError):
        if space != "fitted":
            DensityEstimator(space, columns=columns).fit(pandas.DataFrame(table))
        pandas.DataFrame(table).to_csv(tmp_path / "a.csv", index=False)
        reading = RowSettings(columns=tuple(columns.split(",")))
        roles = (Role.of("angle:degrees"),)
        said = Declaration("torus", roles=lambda _: roles, names=("phi_deg",))
        read_rows(tmp_path / "a.csv", reading, ignore, fitted=said)


@pytest.mark.parametrize(("kind", "wrong"), [("weight", -1.0), ("count", -1), ("count", 1.5)])
def test_weights_and_counts_are_refused_by_their_row(kind: str, wrong: float, tmp_path) -> None:
    frame = pandas.DataFrame({"phi_deg": DEGREES, "n": np.where(np.arange(60) == 3, wrong, 1)})
    columns = f"phi_deg,n={kind}"
    with refused("n", kind, "row 4", kind=SettingError):
        DensityEstimator(columns=columns).fit(frame)
    frame.to_csv(tmp_path / "a.csv", index=False)
    reading = RowSettings(columns=tuple(columns.split(",")))
    with refused("a.csv", "n", kind, "line 5", kind=InputFileError):
        read_rows(tmp_path / "a.csv", reading, ignore, where=SpaceSettings(space="torus"))


def test_two_columns_of_one_name_are_refused() -> None:
    frame = pandas.DataFrame(np.stack([DEGREES, DEGREES], 1), columns=["phi_deg", "phi_deg"])
    with refused("phi_deg", "1 and 2", kind=SettingError):
        DensityEstimator().fit(frame)


def test_times_of_day_are_told_to_be_written_as_hours(tmp_path: Path) -> None:
    table, where = tmp_path / "hours.csv", SpaceSettings(space="torus")
    table.write_text("time,minutes\n" + "".join(f"{k % 24}:30,{7 * k}\n" for k in range(20)))
    for columns in (None, ("time=cycle:24",)):
        with refused("time", "18.5 for 18:30", "cycle:24"):
            read_rows(table, RowSettings(columns=columns), ignore, where=where)


def test_a_frame_without_rows_is_asked_about() -> None:
    frame = pandas.DataFrame({"time": pandas.Series([], dtype=str), "v": np.zeros(0)})
    with refused("v", "time", kind=UndeclaredError):
        DensityEstimator("torus").fit(frame)
