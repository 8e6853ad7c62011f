"""Rows that lack values count by what they have; numbers that stand for missing values are refused."""

import itertools
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from density.blends import random_kernels
from orbiflow.arrays import Array
from orbiflow.density import (
    DensityEstimator,
    DensitySettings,
    Torus,
    density_to_bytes,
    fit_automatic,
)
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.kernels import fit_mixture
from orbiflow.density.fitting.rows import with_incomplete
from orbiflow.density.inference import at_observed, log_prob_observed
from orbiflow.errors import DataWarning, SettingError
from refusals import refused, warned

seeds = st.integers(0, 2**31)
BOTH = DensitySettings(components=("kernels", "mixture"))


def two_clusters(seed: int, count: int, share: float = 0.5) -> Array:
    """Angles about (0, 1) and (2, -1), the latter of a share."""
    rng = np.random.default_rng(seed)
    at = np.array([[0.0, 1.0], [2.0, -1.0]])[(rng.uniform(size=count) < share).astype(int)]
    return rng.vonmises(at, 30.0)


@given(seeds)
@settings(deadline=None, max_examples=5)
def test_em_climbs_on_the_likelihood_of_what_is_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    space = Torus(3)
    points = torch.tensor(rng.uniform(size=(80, 3)) * 0.5)
    points[torch.tensor(rng.uniform(size=(80, 3)) < 0.3)] = torch.nan
    points = points[~points.isnan().all(dim=1)]
    scores = []
    for iterations in (1, 2, 4, 8, 16):
        part = fit_mixture(
            space,
            Rows(points),
            2,
            iterations=iterations,
            generator=torch.Generator().manual_seed(seed),
        )
        scores.append(float(at_observed(part, points).mean()))
    # but for the imaginary points that hold concentrations finite
    assert all(b > a - 5e-3 for a, b in itertools.pairwise(scores))


@given(seeds)
@settings(deadline=None, max_examples=5)
def test_kernels_take_over_what_incomplete_rows_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kernels = random_kernels(rng, Torus(2))
    points = torch.tensor(rng.uniform(size=(50, 2)))
    points[:, 1] = torch.nan
    before = at_observed(kernels, points)
    after = at_observed(with_incomplete(kernels, Rows(points), 1.0), points)
    # a step of EM raises the likelihood of the rows that it is of
    assert float(after.mean()) >= float(before.mean()) - 0.05


def test_rows_that_lack_angles_tell_how_common_places_are() -> None:
    """Whole rows have one cluster too rarely; rows that know the first angle alone make up for it."""
    whole, rest = two_clusters(0, 200, 0.1), two_clusters(1, 600, 0.6)
    rest[:, 1] = np.nan
    density = DensityEstimator("torus", missing="marginalise", components="kernels,mixture").fit(
        np.concatenate([whole, rest])
    )
    drawn = density.sample(4000, random_state=0)
    share = (np.cos(drawn[:, 0] - 2) > np.cos(drawn[:, 0])).mean()
    assert share == pytest.approx((0.1 * 200 + 0.6 * 600) / 800, abs=0.05)
    # and the second angle still goes with the first
    assert np.cos(drawn[np.cos(drawn[:, 0] - 2) > 0.9][:, 1] + 1).mean() > 0.8
    assert any("600 of 800 rows lack some angles" in note for note in density.report_.notes)


def test_whole_rows_are_fitted_as_ever() -> None:
    angles = two_clusters(2, 120)
    one, other = (
        DensityEstimator("torus", components="kernels,mixture", missing=missing).fit(angles)
        for missing in ("refuse", "marginalise")
    )
    assert density_to_bytes(one.density_) == density_to_bytes(other.density_)


def test_weights_and_rows_without_any_angle() -> None:
    angles = two_clusters(3, 90)
    angles[:30, 1] = np.nan
    angles[5] = np.nan
    weights = np.linspace(1, 2, 90)
    space = Torus(2)
    points = torch.tensor(angles / (2 * np.pi))
    found, report = fit_automatic(space, points, BOTH, missing="marginalise", weights=weights)
    again, _ = fit_automatic(
        space,
        points[np.arange(90) != 5],
        BOTH,
        missing="marginalise",
        weights=weights[np.arange(90) != 5],
    )
    assert density_to_bytes(found) == density_to_bytes(again)
    assert report.points == 89
    assert any("1 row lacks all angles" in note for note in report.notes)


def test_scores_are_of_the_angles_that_are_there() -> None:
    fit = DensityEstimator("torus", components="kernels", missing="marginalise").fit(
        two_clusters(4, 60)
    )
    rows = np.array([[0.1, np.nan], [np.nan, 1.1], [0.1, 1.1], [np.nan, np.nan]])
    found = fit.score_samples(rows)
    first, second = fit.marginal("angle1"), fit.marginal(1)
    assert found[0] == pytest.approx(first.score_samples([[0.1]])[0])
    assert found[1] == pytest.approx(second.score_samples([[1.1]])[0])
    assert found[2] == pytest.approx(fit.score_samples(rows[2:3])[0])
    assert found[3] == 0
    chart = torch.tensor(rows / (2 * np.pi))
    assert found == pytest.approx(log_prob_observed(fit.density_, chart, measure="natural").numpy())


def test_mistakes_are_named() -> None:
    angles = two_clusters(5, 60)
    angles[0, 1] = np.nan
    for options, message in (
        ({}, "missing"),
        ({"missing": "marginalise", "components": "chains"}, "chains"),
        ({"missing": "marginalise", "components": "flow"}, "missing marginalise"),
        ({"missing": "guess"}, "missing"),
        ({"missing": "marginalise", "space": "klein-bottle"}, "missing"),
    ):
        with refused(*message.split()):
            DensityEstimator(**{"space": "torus", **options}).fit(angles)  # type: ignore[arg-type]
    angles[5:, 1] = np.nan
    with refused("different", "10", "4"):
        DensityEstimator("torus", missing="marginalise").fit(angles)
    angles[7, 0] = np.inf
    with refused("infinite"):
        DensityEstimator("torus", missing="marginalise").fit(angles)


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
        estimator = DensityEstimator(columns=columns, components="mixture", effort="fast")
        estimator.fit(table, None, none, given={"x": "linear"})
    else:
        DensityEstimator(columns=roles, components="mixture").fit(table, sample_weight=none)


ROLES = st.sampled_from(["covariate", "column"])


@pytest.mark.filterwarnings("ignore::orbiflow.errors.DataWarning")
@settings(max_examples=20)
@given(columns(), ROLES)
def test_ordinary_columns_raise_no_alarm(column: np.ndarray, role: str) -> None:
    assume(len(np.unique(column)) > 2)
    with refused("weights"):
        read(column, role)


@pytest.mark.filterwarnings("ignore::orbiflow.errors.DataWarning")
@settings(max_examples=20)
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
    how = {"unit": "degrees", "components": "mixture", "effort": "fast"}
    model = DensityEstimator(columns=columns, **how).fit(
        ANGLES[:120, None], given={"p": PRESSURE, "tide": RNG.uniform(0, 12.4, 120)}
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
