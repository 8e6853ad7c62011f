"""Rows that belong together are found by their labels, or by place; what has no label is refused."""

from typing import Any

import numpy as np
import pytest

from orbiflow.density import (
    AngleRegressor,
    ConditionalEstimator,
    DataComparisonSettings,
    DensityEstimator,
    NamedTestSettings,
    RotationSpace,
    compare_models,
    compare_samples,
    compare_scores,
    fit_automatic,
    make_space,
    named_tests,
    summarize_angles,
    summarize_axes,
    summarize_directions,
    summarize_orientations,
)
from refusals import refused

pandas = pytest.importorskip("pandas")
RNG = np.random.default_rng(0)
ROWS = 60
NAMES = [f"r{k}" for k in range(ROWS)]
SHUFFLED = RNG.permutation(ROWS)
ANGLES = pandas.DataFrame(np.degrees(RNG.vonmises(0, 2, (ROWS, 2))), NAMES, ["phi", "psi"])
PLACES = pandas.DataFrame(
    np.stack([RNG.normal(48, 9, ROWS), RNG.normal(9, 9, ROWS)], 1), NAMES, ["lat", "lon"]
)
TURNS = pandas.DataFrame(RNG.normal(0, 0.5, (ROWS, 3)), NAMES, ["rx", "ry", "rz"])
WEIGHTS = pandas.Series(RNG.uniform(0, 3, ROWS), NAMES)
GROUPS = pandas.Series(RNG.integers(0, 12, ROWS), NAMES)
KIND: Any = {"unit": "degrees", "components": "mixture"}
MODEL = DensityEstimator(**KIND).fit(ANGLES)
OTHER = DensityEstimator(**KIND).fit(ANGLES + 30)
SCORES = {
    "a": pandas.Series(MODEL.score_samples(ANGLES), NAMES),
    "b": pandas.Series(OTHER.score_samples(ANGLES), NAMES),
}
TORUS = make_space("torus", axes=2, unit="degrees")
POINTS = pandas.DataFrame(TORUS.to_chart(ANGLES).numpy(), NAMES)


def summarized(weights: Any, groups: Any) -> Any:
    both = {"weights": weights, "groups": groups}
    space = RotationSpace(form="vector")
    return [
        summarize_angles(ANGLES, unit="degrees", **both),
        summarize_directions(PLACES, **both),
        summarize_axes(PLACES, **both),
        summarize_orientations(space, TURNS, **both),
    ]


def fitted(weights: Any, groups: Any) -> Any:
    model = DensityEstimator(**KIND).fit(ANGLES, sample_weight=weights, groups=groups)
    return model.score(ANGLES, sample_weight=weights)


def fitted_in_the_chart(weights: Any, groups: Any) -> Any:
    found, _ = fit_automatic(TORUS, POINTS, weights=weights, groups=groups)
    return found.log_prob(TORUS.to_chart(ANGLES)).sum().item()


def compared(weights: Any, groups: Any) -> Any:
    moved = {name: one if name == "a" else one[weights.index] for name, one in SCORES.items()}
    found = compare_scores(moved, weights=weights + 0.1, groups=groups)
    return found, compare_models({"a": MODEL, "b": OTHER}, ANGLES, groups=groups)


def sampled(weights: Any, groups: Any) -> Any:
    del weights
    other = pandas.Series([f"o{k}" for k in groups], groups.index)
    samples, labels = {"a": ANGLES[["phi"]], "b": ANGLES[["psi"]]}, {"a": groups, "b": other}
    samples["b"] = samples["b"].set_axis(["phi"], axis=1)
    how: Any = {"unit": "degrees", "groups": labels}
    return (
        compare_samples(samples, settings=DataComparisonSettings(permutations=99), **how),
        named_tests(samples, settings=NamedTestSettings(permutations=99), **how),
    )


CALLS = [summarized, fitted, fitted_in_the_chart, compared, sampled]


@pytest.mark.parametrize("call", CALLS)
def test_labels_are_aligned_or_refused(call: Any) -> None:
    right = call(WEIGHTS, GROUPS)
    assert call(WEIGHTS.iloc[SHUFFLED], GROUPS.iloc[SHUFFLED]) == right
    others = GROUPS.set_axis([*NAMES[3:], "x", "y", "z"])
    with refused("groups", "6"):
        call(WEIGHTS, others)
    twice = GROUPS.set_axis([*NAMES[1:], "r1"])
    with refused("groups", "repeat"):
        call(WEIGHTS, twice)


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("gap", [np.nan, None, pandas.NA, ""])
def test_rows_without_a_group_are_refused(call: Any, gap: Any) -> None:
    groups = GROUPS.astype(object)
    groups.iloc[[4, 9]] = gap
    with refused("groups", "2", "5"):
        call(WEIGHTS, groups)


def test_what_has_no_labels_goes_by_place() -> None:
    right = fitted(WEIGHTS, GROUPS)
    assert fitted(WEIGHTS.to_numpy(), GROUPS.tolist()) == right
    bare = DensityEstimator(**KIND).fit(ANGLES.to_numpy(), sample_weight=WEIGHTS, groups=GROUPS)
    assert bare.score(ANGLES.to_numpy(), sample_weight=WEIGHTS) == right
    polars = pytest.importorskip("polars")
    by_place = polars.Series(WEIGHTS.to_numpy()), polars.Series(GROUPS.to_numpy())
    assert fitted(*by_place) == right


def test_labels_of_xarray() -> None:
    xarray = pytest.importorskip("xarray")
    right = fitted(WEIGHTS, GROUPS)
    weights = xarray.DataArray(WEIGHTS.to_numpy(), {"row": NAMES}, "row")
    assert fitted(weights[SHUFFLED], GROUPS) == right
    rows = ANGLES.rename_axis("row").to_xarray()
    model = DensityEstimator(**KIND).fit(
        rows, sample_weight=weights[SHUFFLED], groups=GROUPS.iloc[SHUFFLED]
    )
    assert model.score(rows, sample_weight=weights[SHUFFLED]) == right


def test_covariates_have_labels() -> None:
    x = pandas.DataFrame({"warm": RNG.uniform(0, 90, ROWS), "side": [*"ab"] * 30}, NAMES)
    y = pandas.DataFrame({"phi": np.degrees(RNG.vonmises(np.radians(x["warm"]), 9))}, NAMES)
    mixed = x.iloc[SHUFFLED]
    real: Any = {**KIND, "columns": {"warm": "linear"}}
    model = ConditionalEstimator(**real).fit(y, x)
    right = model.score_samples(y, x)
    columns = {"warm": mixed["warm"], "side": x["side"]}
    for given in (mixed, columns):
        assert np.array_equal(model.score_samples(y, given), right)
        assert model.score(y, given) == pytest.approx(right.mean())
    assert np.array_equal(ConditionalEstimator(**real).fit(y, columns).score_samples(y, x), right)
    weighed = model.score(y, mixed, WEIGHTS.iloc[SHUFFLED])
    assert weighed == pytest.approx(np.average(right, weights=WEIGHTS))
    for call in (model.fit, model.score, model.score_samples):
        with refused("given", "2"):
            call(y, x.set_axis([*NAMES[1:], "new"]))


def test_targets_of_regressions_have_labels() -> None:
    x = pandas.DataFrame({"x": RNG.uniform(0, 90, ROWS)}, NAMES)
    y = pandas.Series(np.degrees(RNG.vonmises(np.radians(x["x"]), 9)), NAMES, name="phi")
    real: Any = {**KIND, "columns": {"x": "linear"}}
    one, other = (AngleRegressor(**real).fit(x, own) for own in (y, y.iloc[SHUFFLED]))
    assert np.array_equal(one.predict(x), other.predict(x))
    assert one.predict(x).shape == (ROWS,)
    assert one.score(x, y.iloc[SHUFFLED], WEIGHTS.iloc[SHUFFLED]) == one.score(x, y, WEIGHTS)
    with refused("y", "2"):
        one.score(x, y.set_axis([*NAMES[1:], "new"]))


def test_a_time_that_is_none_is_no_group() -> None:
    days = pandas.Series(pandas.date_range("2020-01-01", periods=ROWS))
    days[3] = pandas.NaT
    with refused("groups", "row 4"):
        DensityEstimator(**KIND).fit(RNG.uniform(0, 90, (ROWS, 1)), groups=days)
