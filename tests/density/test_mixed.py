"""Angles beside real columns, and lines: exactly normalised, in the data's own units."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from density.blends import stored
from orbiflow.density import DensityEstimator, Role, Torus, UniformDensity, conditional, marginal
from orbiflow.density.spaces import Line
from orbiflow.errors import OrbiflowError, SettingError
from refusals import refused, warned

reals = st.floats(-1e4, 1e4)
scales = st.floats(1e-3, 1e3)


def data_of(count: int, seed: int = 0) -> np.ndarray:
    """An angle in degrees, a length that follows it, a temperature with heavy tails."""
    rng = np.random.default_rng(seed)
    angle = rng.vonmises(0.5, 2.0, count)
    length = 1.5 + 0.02 * np.cos(angle) + 0.01 * rng.normal(size=count)
    return np.column_stack(
        [np.degrees(angle), length, 290 + 8 * np.sin(angle) + rng.standard_t(3, size=count)]
    )


@pytest.fixture(scope="module", name="fit")
def fit_fixture() -> DensityEstimator:
    settings = {"components": "mixture,chains", "unit": "degrees", "columns": {1: "linear"}}
    return DensityEstimator("torus", **settings).fit(data_of(400)[:, :2])


@given(reals, scales, st.lists(st.tuples(st.floats(-7, 7), st.floats(-50, 50)), min_size=1))
def test_data_come_back_and_areas_are_those_of_the_map(
    centre: float, scale: float, rows: list[tuple[float, float]]
) -> None:
    space = Torus([None, (centre, scale)])
    data = np.array([[angle, centre + scale * z] for angle, z in rows])
    points = space.to_chart(data)
    again = space.from_chart(points)
    turns = (again[:, 0] - data[:, 0]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    np.testing.assert_allclose((again[:, 1] - data[:, 1]) / scale, 0, atol=1e-6)
    # the derivative of the turns by the data is the density of Student's t
    student = stats.t.logpdf(data[:, 1], 4, centre, scale)
    logs = UniformDensity(space).log_prob(points, measure="natural").numpy() + np.log(2 * np.pi)
    np.testing.assert_allclose(logs, student, rtol=1e-5, atol=1e-5)


def test_a_conditional_is_a_ratio(fit: DensityEstimator) -> None:
    lengths = np.linspace(1.47, 1.53, 9)[:, None]
    at = np.column_stack([np.full(9, 40.0), lengths])
    ratio = fit.score_samples(at) - fit.marginal(0).score_samples([[40.0]])
    found = fit.conditional({0: 40.0})
    assert not found.space_.is_of_angles
    np.testing.assert_allclose(found.score_samples(lengths), ratio, atol=2e-3)
    assert isinstance(fit.conditional({1: 1.5}).space_, Torus)
    mean = found.sample(4000, random_state=0).mean()
    assert mean == pytest.approx(1.5 + 0.02 * np.cos(np.radians(40)), abs=0.003)


def test_a_part_of_many_columns_is_saved_with_its_lines(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    data = np.column_stack([rng.vonmises(0, 2, (300, 4)), rng.normal(size=300)])
    space = Torus.for_columns(data, [Role("angle")] * 4 + [Role("linear")], "abcde")
    whole = DensityEstimator(space, components="chains").fit(data).density_
    for part in (whole, marginal(whole, [1, 2, 4]), conditional(whole, {0: 0.1})):
        points = part.space.to_chart(np.full((3, part.space.dim), 0.3))
        again = stored(part, tmp_path)
        assert again.space == part.space
        assert not again.space.is_of_angles
        assert torch.allclose(again.log_prob(points), part.log_prob(points))


def test_rows_that_lack_a_value_count_by_the_others() -> None:
    data = data_of(300)
    data[::3, 1], data[1::3, 2] = np.nan, np.nan
    how: Any = {"unit": "degrees", "missing": "marginalise", "components": "kernels,mixture"}
    fit = DensityEstimator("torus", columns={1: "linear", 2: "linear"}, **how).fit(data)
    some = data[:6].copy()
    scores = fit.score_samples(some)
    alone = fit.marginal(0, 2).score_samples(some[[0]][:, [0, 2]])
    assert scores[0] == pytest.approx(alone[0], abs=2e-3)


@pytest.mark.parametrize(
    ("columns", "words"),
    [({"speed": "linear"}, "speed"), ("a=linear", "2"), ({5: "linear"}, "5"), ("a=lin,b", "lin")],
)
def test_columns_that_cannot_be_real(columns: Any, words: str) -> None:
    with refused(*words.split(), kind=SettingError):
        DensityEstimator(columns=columns).fit(np.ones((50, 2)))


def test_a_column_of_one_value_and_lines_that_are_none() -> None:
    data = data_of(50)[:, :2]
    data[:, 1] = 1.5
    with refused("one value"):
        DensityEstimator("torus", unit="degrees", columns={1: "linear"}).fit(data)
    wrongs: list[Any] = [[(1.0, 0.0)], [(np.nan, 1.0)], [(1.0,)], ["ab"]]
    for wrong in wrongs:
        with pytest.raises(OrbiflowError):
            Torus(wrong)
    with refused("2", "3", kind=SettingError):
        DensityEstimator(Torus([None, (0, 1)])).fit(np.ones((50, 3)))


def test_warnings_are_where_the_data_are_given() -> None:
    rng = np.random.default_rng(0)
    data = np.column_stack([rng.uniform(-3, 3, 60), rng.normal(size=60)])
    data[:20, 1] = 50.0
    columns = {1: "linear"}
    with warned("column2", "50", "20") as found:
        DensityEstimator(columns=columns, components="mixture").fit(data)
    assert {Path(one.filename).name for one in found} == {Path(__file__).name}


KINDS: st.SearchStrategy[Any] = st.sampled_from(
    [("linear",), ("positive",), ("bounded", -3.0, 7.0)]
)
LINES = st.tuples(st.floats(-3, 3), st.floats(1e-2, 2), KINDS).map(
    lambda own: Line(*own[:2], *own[2])
)
TRUE: dict[str, tuple[Any, float]] = {
    "positive": (stats.lognorm(2.5), 0.03),
    "bounded:0:1": (stats.beta(0.5, 2), 0.04),
    "linear": (stats.norm(3, 0.2), 0.03),
}


@given(LINES, st.lists(st.floats(0.02, 0.98), min_size=1, max_size=9))
def test_turns_and_values_are_inverse(line: Line, shares: list[float]) -> None:
    space = Torus([line.to_json()])
    assert space.axes == (line,)
    turns = torch.tensor(shares, dtype=torch.float64)[:, None]
    values = space.from_chart(turns)
    torch.testing.assert_close(space.to_chart(values), turns, rtol=0, atol=1e-9)
    assert line.role == Role.of(str(line.role))
    # the measure is the derivative of the values by the turns
    step = 1e-6
    slope = (space.from_chart(turns + step) - space.from_chart(turns - step)) / (2 * step)
    np.testing.assert_allclose(np.log(slope[:, 0]), space.log_area(turns), atol=1e-4)


def test_even_values_of_large_numbers_keep_their_digits() -> None:
    assert np.ptp(Line(1.7e9, 2.5).even(9)) == pytest.approx(8)


@pytest.mark.parametrize("role", TRUE)
def test_densities_are_near_the_truth_and_end_where_columns_do(role: str) -> None:
    true, bound = TRUE[role]
    rows = true.rvs(600, random_state=1)[:, None]
    fit = DensityEstimator(columns=["x=" + role], components="kernels").fit(rows)
    unseen = true.rvs(3000, random_state=2)
    regret = true.logpdf(unseen).mean() - fit.score(unseen[:, None])
    assert 0 <= regret + 0.02 < bound + 0.02
    drawn = fit.sample(2000, 0)[:, 0]
    low, high = true.support()
    assert ((drawn >= low) & (drawn <= high)).all()
    ends = [-1e300 if role == "linear" else 0.0, 1e300 if role != "bounded:0:1" else 1.0]
    turns = fit.space_.to_chart([[end] for end in (*ends, float(np.median(rows)))])
    below, above, half = fit.density_.cdf(turns).tolist()
    assert below == pytest.approx(0, abs=1e-6)
    assert above == pytest.approx(1, abs=1e-6)
    assert half == pytest.approx(0.5, abs=0.05)
    assert fit.mean()[0] == pytest.approx(rows.mean(), rel=1.5)


@pytest.mark.parametrize(
    "wrong", [[0, 1, "square"], [0, 0, "positive"], [0, 1, "bounded", 2, 1], [0]]
)
def test_lines_that_there_are_not(wrong: list[Any]) -> None:
    with refused():
        Torus([wrong])
