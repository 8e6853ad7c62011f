"""What an estimator takes: frames by the names of their columns, units, and what may be doubted."""

from typing import Any

import numpy as np
import pytest

import orbiflow.density as od
from orbiflow.errors import DataWarning, SettingError
from refusals import refused, warned

pandas = pytest.importorskip("pandas")
RNG = np.random.default_rng(0)
PLACES = np.stack([RNG.normal(48, 3, 40), RNG.normal(10, 3, 40)], axis=1)
ANGLES = np.degrees(RNG.vonmises([0.0, 1.0], [2.0, 9.0], (40, 2)))


def made(space: Any, **settings: Any) -> od.DensityEstimator:
    return od.DensityEstimator(space, components="mixture", **settings)


def frame(values: np.ndarray, names: str) -> Any:
    return pandas.DataFrame(values, columns=names.split(","))


def frames_of(values: np.ndarray, names: str) -> list[Any]:
    """The same table in several libraries."""
    found = [frame(values, names)]
    columns = {name: values[:, k] for k, name in enumerate(names.split(","))}
    for library, call in (("polars", "DataFrame"), ("pyarrow", "table")):
        try:
            module = pytest.importorskip(library)
        except pytest.skip.Exception:
            continue
        found.append(getattr(module, call)(columns))
    return found


@pytest.fixture(scope="module")
def fitted() -> od.DensityEstimator:
    return made("torus", unit="degrees").fit(frame(ANGLES, "phi,psi"))


def test_frames_are_scored_by_name(fitted: od.DensityEstimator) -> None:
    right = fitted.score_samples(ANGLES)
    slope = fitted.score_gradient(ANGLES)
    for table in [*frames_of(ANGLES, "phi,psi"), *frames_of(ANGLES[:, ::-1], "psi,phi")]:
        assert np.array_equal(fitted.score_samples(table), right)
        assert np.array_equal(fitted.score_gradient(table), slope)
        assert fitted.score(table) == pytest.approx(right.mean())
    more = frame(ANGLES, "phi,psi").assign(site="north", speed=1.0)[["speed", "psi", "site", "phi"]]
    assert np.array_equal(fitted.score_samples(more), right)


@pytest.mark.parametrize(
    ("names", "words"), [("phi,chi", "phi chi"), ("a,b", "phi psi"), ("phi,phi", "psi")]
)
def test_frames_of_other_columns_are_refused(names: str, words: str, fitted) -> None:
    with refused(*words.split()):
        fitted.score_samples(frame(ANGLES, names))


def test_fits_without_names_take_frames_by_position() -> None:
    estimator = made("torus", unit="degrees").fit(ANGLES)
    right = estimator.score_samples(ANGLES)
    assert np.array_equal(estimator.score_samples(frame(ANGLES, "phi,psi")), right)
    unnamed = od.DensityEstimator.fitted(estimator.density_, columns=["column2", "column3"])
    assert np.array_equal(unnamed.score_samples(frame(ANGLES, "phi,psi")), right)
    sphere = made("sphere").fit(PLACES)
    with warned("lat", "lon", kind=DataWarning):
        found = sphere.score_samples(frame(PLACES[:, ::-1], "lon,lat"))
    assert np.array_equal(found, sphere.score_samples(PLACES))


def test_names_are_of_the_last_fit(fitted: od.DensityEstimator) -> None:
    estimator = made("torus", unit="degrees").fit(frame(ANGLES, "phi,psi"))
    assert list(estimator.feature_names_in_) == ["phi", "psi"]
    assert not hasattr(estimator.fit(ANGLES), "feature_names_in_")
    assert not hasattr(estimator.fit(pandas.DataFrame(ANGLES)), "feature_names_in_")
    assert fitted.marginal("psi").feature_names_in_.tolist() == ["psi"]


ORDERS = {
    ("sphere", "lon,lat"): "lat,lon",
    ("sphere", "z,y,x"): "x,y,z",
    ("rotation-space", "q0,q1,q2,q3"): "q1,q2,q3,q0",
    ("rotation-space", "phi2,Phi,phi1"): "phi1,Phi,phi2",
    ("klein-bottle", "phi,theta"): "theta,phi",
}


@pytest.mark.parametrize(("space", "names"), ORDERS)
def test_names_say_the_order(space: str, names: str) -> None:
    values = RNG.normal(size=(40, names.count(",") + 1))
    values /= np.linalg.norm(values, axis=1, keepdims=True)
    if names.count(",") == 1 and space != "klein-bottle":
        values *= 60  # degrees that are no radians
    unit = "radians" if "phi" in names else None
    right, mixed = ORDERS[space, names], frame(values, names)
    ordered = mixed[right.split(",")]
    with warned(*right.split(","), kind=DataWarning):
        fitted = od.DensityEstimator(space, components="kernels", unit=unit).fit(mixed)
    assert list(fitted.feature_names_in_) == right.split(",")
    want = od.DensityEstimator(space, components="kernels", unit=unit).fit(ordered)
    want = want.score_samples(ordered)
    assert np.array_equal(fitted.score_samples(mixed), want)
    assert np.array_equal(fitted.score_samples(ordered), want)


def test_units_are_known_or_refused() -> None:
    with refused("turn", kind=SettingError):
        made("torus").fit(ANGLES)
    with refused("phi=angle:degrees,psi=angle:degrees", kind=od.UndeclaredError) as caught:
        made("torus").fit(frame(ANGLES, "phi,psi"))
    again = made("torus", columns=caught.value.proposal).fit(frame(ANGLES, "phi,psi"))
    assert again.space_ == od.Torus(2, unit="degrees")
    with refused("space sphere columns lat,lon", kind=od.UndeclaredError):
        made("torus").fit(frame(ANGLES, "lat,lon"))
    assert made("torus").fit(np.radians(ANGLES)).space_ == od.Torus(2, unit="radians")
    assert made("torus").fit(frame(ANGLES, "phi_deg,psi_deg")).space_ == od.Torus(2, unit="degrees")
    with refused("unit", "radians", kind=SettingError):
        made("sphere", unit="radians").fit(np.radians(PLACES))
    with refused("unit", "degrees", kind=SettingError):
        made(od.Torus(2), unit="degrees").fit(ANGLES)
    turning = np.degrees(RNG.uniform(-3, 3, (40, 2)).cumsum(axis=0)) + 2000
    for data in (RNG.uniform(-180, 180, (40, 2)), turning):
        with refused("turn", kind=SettingError):
            made("torus", unit="radians").fit(data)


def test_radians_on_the_sphere_are_refused_or_doubted() -> None:
    vectors = RNG.normal(size=(80, 3))
    even = np.stack([np.arcsin(vectors[:, 2] / np.linalg.norm(vectors, axis=1)), vectors[:, 1]], 1)
    even[:, 1] = np.arctan2(vectors[:, 1], vectors[:, 0])
    for call in (made("sphere").fit, od.summarize_directions, od.summarize_axes):
        with refused("radians", kind=SettingError):
            call(even)
    with warned("radians", kind=DataWarning):
        od.summarize_directions(np.radians(PLACES))
    assert od.summarize_directions(even, unit="degrees").resultant > 0.99
    with refused("radians", kind=SettingError):
        od.compare_samples({"a": even, "b": even + 0.01}, "sphere")


@pytest.mark.parametrize("code", [999, -9999.0])
def test_codes_for_missing_values_are_refused(code: float) -> None:
    values = np.vstack([ANGLES, [[code, 20.0]] * 3])
    with refused("column1", "3", "NaN", kind=SettingError):
        made("torus", unit="degrees").fit(values)
    names = frame(values, "phi,psi")
    kept = names.replace(code, np.nan)
    estimator = made("torus", unit="degrees", missing="marginalise").fit(kept)
    assert np.isfinite(estimator.score_samples(kept)).all()


def test_missing_values_are_named() -> None:
    holes = frame(ANGLES, "phi,psi").astype(object)
    holes.iloc[2, 0] = pandas.NA
    with refused("infinite", "3"):
        made("torus", unit="degrees").fit(holes)
    masked = np.ma.masked_array(ANGLES, mask=ANGLES > 100)
    masked[4, 1] = np.ma.masked
    with refused("missing", "infinite"):
        made("torus", unit="degrees").fit(masked)
    estimator = made("torus", unit="degrees", missing="marginalise")
    assert np.isfinite(estimator.fit(holes).score_samples(holes)).all()
    with refused("psi"):
        estimator.fit(frame(ANGLES, "phi,psi").assign(psi=None))
    with refused("numpy.angle"):
        made("torus").fit(np.exp(1j * ANGLES))


def test_fractions_are_doubted_or_read() -> None:
    inside = RNG.uniform(0, 1, (40, 2))
    with warned("cell", kind=DataWarning):
        made(od.QuotientSpace("p4g", cell=(10.0, 10.0))).fit(inside)
    estimator = made(od.QuotientSpace("p4g", cell=(10.0, 10.0), fractional=True)).fit(inside)
    drawn = estimator.sample(200, random_state=0)
    assert np.ptp(drawn, axis=0).max() < 2
    with refused("cell", "well"):
        od.QuotientSpace("p4g", fractional=True)


@pytest.mark.parametrize("number", [2, -1, 10**9])
def test_numbers_of_columns_that_there_are_not(number: int, fitted: od.DensityEstimator) -> None:
    with refused("column", number, "phi", "psi"):
        fitted.conditional({number: 1.0})
    with refused("column", number, "phi", "psi"):
        fitted.marginal(number)


def test_pictures_of_fractions_are_of_the_plane() -> None:
    places = 10 * RNG.normal(0.3, 0.05, (40, 2))
    spaces = [od.QuotientSpace("p4g", cell=(10.0, 10.0), fractional=own) for own in (False, True)]
    assert spaces[1].cartesian == spaces[0] != spaces[1]
    density = made(spaces[0]).fit(places).density_
    other = made(spaces[1]).fit(places / 10).density_
    drawn = [
        next(
            axes.images[0].get_array()
            for axes in od.density_picture(own).figure.axes
            if axes.images
        )
        for own in (density, other)
    ]
    assert np.abs(np.asarray(drawn[0]) - np.asarray(drawn[1])).max() < 0.05
