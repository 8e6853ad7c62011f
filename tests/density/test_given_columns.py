"""What covariates and columns are by their types and names: categories, cycles, dates, words."""

import warnings
from typing import Any

import numpy as np
import pytest

from orbiflow.density import DensityEstimator, Role, UndeclaredError, fit_parametric, make_space
from orbiflow.density.data import given_roles
from orbiflow.errors import DataWarning, OrbiflowError, SettingError
from refusals import refused, warned

pandas = pytest.importorskip("pandas")
polars = pytest.importorskip("polars")
arrow = pytest.importorskip("pyarrow")
RNG = np.random.default_rng(0)
ROWS = 60
ANGLES = np.degrees(RNG.vonmises(0, 2, (ROWS, 1)))
PAIRS = np.degrees(RNG.vonmises(0, 2, (ROWS, 2)))
KIND: Any = {"unit": "degrees", "components": "mixture", "effort": "fast"}
LEVELS = RNG.integers(1, 4, ROWS)
WORDS = LEVELS.astype(str)

CATEGORIES: dict[str, Any] = {
    "Categorical": pandas.Categorical(LEVELS),
    "Series": pandas.Series(LEVELS, dtype="category"),
    "CategoricalIndex": pandas.CategoricalIndex(LEVELS),
    "polars": polars.Series(WORDS).cast(polars.Categorical),
    "enum": polars.Series(WORDS, dtype=polars.Enum(["1", "2", "3"])),
    "dictionary": arrow.array(LEVELS).dictionary_encode(),
    "words": WORDS,
}


def fit(given: Any, **settings: Any) -> DensityEstimator:
    return DensityEstimator(**KIND, **settings).fit(ANGLES, given=given)


def kinds(given: Any, **settings: Any) -> list[str]:
    """What makes one doubt covariates, of a fit that ends with them, because no row counts."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            DensityEstimator(**KIND, **settings).fit(ANGLES, None, np.zeros(ROWS), given=given)
        except OrbiflowError as error:
            if "weights are 0" not in str(error):
                raise
    return [str(one.message) for one in caught if one.category is DataWarning]


@pytest.fixture(scope="module", name="by_word")
def by_word_fixture() -> DensityEstimator:
    return fit({"level": WORDS})


@pytest.mark.parametrize("kind", CATEGORIES)
def test_categories_are_words(kind: str, by_word: DensityEstimator) -> None:
    given = {"level": CATEGORIES[kind]}
    right = by_word.score_samples(ANGLES, given={"level": WORDS})
    assert np.array_equal(by_word.score_samples(ANGLES, given=given), right)
    with refused("level", "7"):
        by_word.at(level=7)


def test_fits_to_categories_know_no_others() -> None:
    model = fit(pandas.DataFrame({"level": CATEGORIES["Categorical"]}))
    with refused("level", "7"):
        model.score_samples(ANGLES[:1], given={"level": [7]})
    gap = pandas.Categorical([None, *LEVELS[1:]])
    with refused("1", "level"):
        fit({"level": gap})
    with refused("numbers"):
        DensityEstimator(**KIND).fit(pandas.DataFrame({"phi": CATEGORIES["Series"]}))


@pytest.mark.parametrize("gap", [pandas.NA, None, np.nan, " "])
def test_gaps_among_words(gap: Any) -> None:
    words = WORDS.astype(object)
    words[3] = gap
    with refused("4", "level"):
        fit({"level": pandas.Series(words, dtype="string") if gap is pandas.NA else words})


HOURS = RNG.uniform(0, 24, ROWS)


@pytest.mark.parametrize(
    ("name", "values", "role"),
    [
        ("hour", HOURS, "cycle:24"), ("month", RNG.integers(1, 13, ROWS), "cycle:12"),
        ("weekday", RNG.integers(0, 7, ROWS), "cycle:7"),
        ("heading", RNG.uniform(0, 360, ROWS), "angle:degrees"), ("warm", HOURS, None),
        ("hour", HOURS * 20, None),
    ],
)  # fmt: skip
def test_numbers_have_the_role_of_their_name_or_are_asked_for(
    name: str, values: np.ndarray, role: str | None
) -> None:
    given = {name: values}
    if role is None:
        with refused(name, kind=SettingError):
            kinds(pandas.DataFrame(given))
    else:
        turn = Role.of(role).turn
        found = given_roles([name], given, {}, "degrees")[name]
        assert (str(found), found.turn) == (role, turn)
        assert kinds(given) == []
    assert kinds(given, columns={name: "cycle:480"}) == []
    assert kinds(given, columns={name: "linear"}) == []


def test_both_ends_of_a_day_are_one() -> None:
    model = fit({"hour": HOURS})
    same = fit({"hour": HOURS}, columns={"hour": "cycle:24"})
    plain = fit({"hour": HOURS}, columns={"hour": "linear"})
    scores = [own.score_samples(ANGLES, given={"hour": HOURS}) for own in (model, same, plain)]
    assert np.array_equal(scores[0], scores[1])
    assert model.at(hour=0).score(ANGLES) == pytest.approx(model.at(hour=24).score(ANGLES))
    assert [own.period for own in plain.conditional_density_.covariates.columns] == [None]


def test_dates_are_no_numbers() -> None:
    dates = pandas.date_range("2026-01-01", periods=ROWS, freq="h")
    for given in (
        {"time": dates},
        {"time": dates.to_numpy()},
        pandas.DataFrame({"time": dates.tz_localize("UTC")}),
        polars.DataFrame({"time": dates.to_numpy()}),
        arrow.table({"time": arrow.array(dates.to_numpy())}),
        {"time": dates - dates[0]},
    ):
        with refused("'time'"):
            kinds(given)
    with refused("phi"):
        DensityEstimator(**KIND).fit(pandas.DataFrame({"phi": dates}))


@pytest.mark.parametrize("spread", [1, 1_000])
def test_large_whole_numbers_lose_their_differences(spread: int) -> None:
    numbers = 2**62 + spread * np.arange(ROWS)
    real = {"columns": {"key": "linear"}}
    with refused("key"):
        kinds({"key": numbers}, **real)
    assert kinds({"key": numbers - 2**62}, **real) == []
    with refused("key"):
        kinds({"key": np.full(ROWS, 7)}, **real)


def test_a_series_is_a_column() -> None:
    phi, warm = pandas.Series(ANGLES[:, 0], name="phi"), pandas.Series(HOURS, name="warm")
    model = DensityEstimator(**KIND).fit(phi)
    assert list(model.feature_names_in_) == ["phi"]
    right = DensityEstimator(**KIND).fit(ANGLES).score_samples(ANGLES)
    for column in (phi, polars.Series("phi", phi.to_numpy()), ANGLES):
        assert np.array_equal(model.score_samples(column), right)
    with refused("phi"):
        model.score_samples(warm)
    real = {"columns": {"warm": "linear"}}
    assert kinds(warm, **real) == kinds({"warm": HOURS}, **real)
    with refused("shape"):
        DensityEstimator(**KIND).fit(phi.rename(None))


def test_whole_hours_with_gaps() -> None:
    hours = RNG.integers(0, 24, 240).astype(float)
    table = pandas.DataFrame({"phi": np.degrees(RNG.vonmises(hours / 4, 5)), "hour": hours})
    table.loc[[2, 5], "hour"] = np.nan
    table.loc[7, "phi"] = np.nan
    with warned("rounded", 1, kind=DataWarning):
        model = DensityEstimator(**KIND, missing="marginalise").fit(table)
    assert np.isfinite(model.score_samples(table)).all()
    assert float(model.marginal("hour").score(table[["hour"]].dropna())) == pytest.approx(
        -np.log(24), abs=0.2
    )


def test_arguments_are_used_or_refused() -> None:
    model = DensityEstimator(**KIND)
    for wrong in (["phi"], ["phi", "psi", "chi"], "ab", 3):
        with refused("columns", kind=SettingError):
            model.set_params(columns=wrong).fit(PAIRS)
    model.set_params(columns=["phi", "psi"])
    assert list(model.fit(PAIRS).feature_names_in_) == ["phi", "psi"]
    assert model.conditional(psi=10).feature_names_in_.tolist() == ["phi"]
    for call in (model.fit, model.score):
        with refused("None", kind=SettingError):
            call(PAIRS, np.ones(ROWS))
    torus = make_space("torus", axes=2, unit="degrees")
    with refused("columns", kind=SettingError):
        fit_parametric(torus, torus.to_chart(PAIRS), "von-mises", columns=["phi"])


def test_words_that_do_not_recur_are_refused() -> None:
    dates = pandas.date_range("2026-01-01", periods=ROWS, freq="h").astype(str)
    with refused("when", ROWS, kind=SettingError):
        kinds({"when": np.array(dates)})


def test_columns_of_the_frame_are_given() -> None:
    table = pandas.DataFrame({"phi": ANGLES[:, 0], "hour": HOURS, "site": WORDS, "level": LEVELS})
    how = {"components": "mixture", "effort": "fast"}
    model = DensityEstimator(columns="phi=angle:degrees", **how)
    model.fit(table, given={"hour": "cycle:24", "level": "word"})
    apart = DensityEstimator(**KIND, columns={"level": "word"})
    apart.fit(ANGLES, given=table[["hour", "level"]])
    right = apart.score_samples(ANGLES, given=table[["hour", "level"]])
    for given in (table, table[["hour", "level"]], ["hour", "level"]):
        assert np.array_equal(model.score_samples(table, given=given), right)
    with refused("site", "cycle:24"):
        model.fit(table, given={"site": "cycle:24"})
    with refused("level", kind=UndeclaredError) as caught:
        model.fit(table, given=["hour", "level"])
    model.fit(table, given=caught.value.proposal)
    assert model.conditional_density_.covariates.names == ["hour", "level"]


def test_a_whole_number_is_the_same_word_as_a_float() -> None:
    model = DensityEstimator(**KIND).fit(
        ANGLES, given={"site": pandas.Series(pandas.Categorical(LEVELS))}
    )
    assert model.at(site=2.0).mean() == pytest.approx(model.at(site="2").mean())
    with refused("site", 5):
        model.at(site=5.0)
