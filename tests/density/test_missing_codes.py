"""Numbers that stand for missing values: refused in every column, and what is data is taken."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from orbiflow.density import ConditionalEstimator, DensityEstimator
from orbiflow.errors import DataWarning, SettingError
from refusals import refused, warned

pandas = pytest.importorskip("pandas")
RNG = np.random.default_rng(0)
ANGLES = np.degrees(RNG.vonmises(0, 3, 300))
PRESSURE = RNG.normal(1005, 9, 120).round(1)
PRESSURE[:3] = 999.9

FAMILIES: dict[str, Any] = {
    "normal": lambda rng, n: rng.normal(rng.normal(), 1, n),
    "log-normal": lambda rng, n: rng.lognormal(0, rng.uniform(0.3, 2.5), n),
    "heavy": lambda rng, n: rng.standard_t(rng.choice([2, 3, 5]), n),
    "uniform": lambda rng, n: rng.uniform(-1, 1, n),
    "counts": lambda rng, n: rng.poisson(rng.uniform(0.5, 100), n),
    "whole": lambda rng, n: rng.integers(-100, 1100, n),
}


@st.composite
def columns(draw: st.DrawFn) -> np.ndarray:
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    made = FAMILIES[draw(st.sampled_from(sorted(FAMILIES)))](rng, draw(st.integers(20, 250)))
    made = made * 10 ** draw(st.floats(-1, 3)) + draw(st.sampled_from([0.0, 0.0, 273.15, 1000.0]))
    digits = draw(st.sampled_from([None, 0, 1]))
    return made if digits is None else made.round(digits)


def read(column: np.ndarray, role: str) -> None:
    """Read a column as `fit` does, which then ends because no row counts."""
    none = np.zeros(len(column))
    table = pandas.DataFrame({"phi": ANGLES[: len(column)], "x": column})
    roles = {"phi": "angle:degrees", "x": "linear"}
    if role == "covariate":
        columns = {"phi": "angle:degrees"}
        estimator = ConditionalEstimator(columns=columns, components="mixture")
        estimator.fit(table, {"x": "linear"}, none)
    else:
        DensityEstimator(columns=roles, components="mixture").fit(table, sample_weight=none)


ROLES = st.sampled_from(["covariate", "column"])


@pytest.mark.filterwarnings("ignore::orbiflow.errors.DataWarning")
@settings(max_examples=60)
@given(columns(), ROLES)
def test_ordinary_columns_raise_no_alarm(column: np.ndarray, role: str) -> None:
    assume(len(np.unique(column)) > 2)
    with refused("weights"):
        read(column, role)


@pytest.mark.filterwarnings("ignore::orbiflow.errors.DataWarning")
@settings(max_examples=60)
@given(
    columns(),
    st.sampled_from([999.0, -999.9, 9999.0, -9999.0, 99999.0, -32768.0, 1e20, 9.96921e36, 99.0]),
    st.integers(1, 3),
    ROLES,
)
def test_codes_are_refused(column: np.ndarray, code: float, count: int, role: str) -> None:
    assume(len(np.unique(column)) > 5)
    column = (column - column.mean()) / np.ptp(column) * min(abs(code), 1e6) / 4
    column[: count + (abs(code) < 999)] = code
    with refused("x", kind=SettingError):
        read(column, role)


@pytest.mark.parametrize("role", ["covariate", "column"])
def test_a_pressure_may_be_999_9(role: str) -> None:
    with refused("weights"):
        read(PRESSURE, role)
    with refused("-999.9", "1", kind=SettingError):
        read(np.append(PRESSURE, -999.9), role)


@pytest.mark.parametrize("role", ["covariate", "column"])
def test_codes_below_all_others(role: str) -> None:
    """However far positive numbers reach."""
    rain = RNG.lognormal(2, 2, 200)
    rain[[5, 9]] = -99.9
    with refused("rows", "2", kind=SettingError):
        read(rain, role)
    with refused("weights"):
        read(np.where(rain < 0, 1.0, rain), role)


@pytest.mark.parametrize("role", ["covariate", "column"])
def test_other_numbers_far_from_all_are_doubted(role: str) -> None:
    with warned("rows", "x", "0", "2", kind=DataWarning), refused("weights"):
        read(np.append(PRESSURE, [0.0, 0.0]), role)


def test_points_of_a_cell() -> None:
    points = RNG.normal(0, 0.1, (60, 2))
    points[7, 1] = -9999
    with refused("-9999", "row 8", kind=SettingError):
        DensityEstimator("p4m", components="kernels").fit(points)


def test_columns_beside_a_sphere() -> None:
    table = pandas.DataFrame({"lat": RNG.normal(48, 3, 60), "lon": RNG.normal(9, 3, 60)})
    table["depth"], table["hour"] = RNG.gamma(2, 5, 60), RNG.uniform(0, 24, 60)
    columns = "lat,lon,depth=linear,hour"
    model = DensityEstimator("sphere", columns=columns, components="kernels").fit(table)
    for name, code in (("depth", -9999), ("depth", 999.9), ("hour", 99), ("lat", -99.9)):
        wrong = table.copy()
        wrong.loc[3, name] = code
        for call in (model.fit, model.score_samples):
            with refused(*name.split(), kind=SettingError):
                call(wrong)
        with refused(*name.split(), kind=SettingError):
            model.score_samples(wrong[3:4])  # a row alone, beside those of the fit


def test_codes_are_refused_where_covariates_are_given() -> None:
    columns = {"p": "linear", "tide": "cycle:12.4"}
    model = ConditionalEstimator(unit="degrees", components="mixture", columns=columns).fit(
        ANGLES[:120, None], {"p": PRESSURE, "tide": RNG.uniform(0, 12.4, 120)}
    )
    model.at(p=999.9, tide=3.0)
    for values in ({"p": -9999, "tide": 3.0}, {"p": 1000, "tide": 99}):
        with refused("missing", kind=SettingError):
            model.at(values)


def test_prices_are_no_codes() -> None:
    prices = RNG.choice([9.99, 19.99, 99.99, 999.99], 120)
    table = pandas.DataFrame({"phi": ANGLES[:120], "price": prices})
    columns = "phi=angle:degrees,price=linear"
    model = DensityEstimator("torus", columns=columns, components="kernels")
    assert np.isfinite(model.fit(table).score(table))
