"""Real columns as lines: no mass where nothing can be, tails that decay, a cdf up to the last float."""

from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from orbiflow.density import DensityEstimator, Role, Torus
from orbiflow.density.spaces import Line
from refusals import refused

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
    drawn = fit.sample(5000, 0)[:, 0]
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
