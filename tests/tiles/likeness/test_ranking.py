"""The ranking score, and short lists without twins."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from orbiflow.tiles import diverse, rank_score
from refusals import refused

SHARES = st.floats(0, 1)


@given(SHARES, SHARES, SHARES)
def test_rank_score_rises_with_both(iou: float, found: float, more: float) -> None:
    value = rank_score(iou, found)
    assert 0 <= value <= 1
    assert min(iou, found) - 1e-12 <= value <= max(iou, found) + 1e-12
    assert rank_score(max(iou, more), found) >= value
    assert rank_score(iou, max(found, more)) >= value
    assert rank_score(iou, 0) == rank_score(0, found) == 0


@pytest.mark.parametrize("bad", [-0.1, 1.1, np.nan])
def test_rank_score_names_what_is_out_of_range(bad: float) -> None:
    with refused("iou"):
        rank_score(bad, 0.5)
    with refused("recognisability"):
        rank_score(0.5, bad)


@st.composite
def pools(draw: st.DrawFn) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Scores (n,) and a symmetric matrix (n, n) of similarities."""
    n = draw(st.integers(1, 10))
    scores = draw(st.lists(SHARES, min_size=n, max_size=n))
    upper = np.array(draw(st.lists(SHARES, min_size=n * n, max_size=n * n))).reshape(n, n)
    return np.array(scores), np.maximum(upper, upper.T)


@given(pools(), st.integers(1, 12), SHARES, st.floats(0, 2))
def test_the_best_is_first_and_no_two_are_twins(
    pool: tuple[NDArray[np.float64], NDArray[np.float64]], count: int, twin: float, variety: float
) -> None:
    scores, alike = pool
    chosen = diverse(scores, count, lambda i, j: alike[i, j], twin=twin, variety=variety)
    assert chosen[0] == np.argmax(scores)
    assert len(set(chosen)) == len(chosen) <= count
    assert all(alike[i, j] <= twin for k, i in enumerate(chosen) for j in chosen[:k])
    if len(chosen) < count:  # then every other one is the twin of a chosen one
        rest = set(range(len(scores))) - set(chosen)
        assert all(max(alike[i, j] for j in chosen) > twin for i in rest)


@given(pools(), st.integers(1, 12))
def test_without_variety_and_twins_it_is_a_sort(
    pool: tuple[NDArray[np.float64], NDArray[np.float64]], count: int
) -> None:
    scores, alike = pool
    chosen = diverse(scores, count, lambda i, j: alike[i, j], twin=1, variety=0)
    assert chosen == list(np.argsort(-scores, kind="stable")[:count])


def test_variety_is_weighed_against_the_score() -> None:
    alike = np.array([[1, 0.9, 0.4], [0.9, 1, 0.4], [0.4, 0.4, 1]])
    scores = [0.8, 0.79, 0.75]
    assert diverse(scores, 2, lambda i, j: alike[i, j], variety=0.05) == [0, 1]
    assert diverse(scores, 2, lambda i, j: alike[i, j], variety=0.1) == [0, 2]


@pytest.mark.parametrize(
    ("change", "name"),
    [
        *(({"scores": [[0.1]]}, "scores"), ({"scores": [np.nan]}, "scores")),
        *(({"scores": ["best"]}, "scores"), ({"count": 0}, "count"), ({"twin": 1.5}, "twin")),
        *(({"variety": -1.0}, "variety"), ({"variety": np.inf}, "variety")),
    ],
)
def test_bad_arguments(change: dict[str, object], name: str) -> None:
    arguments: dict[str, object] = {"scores": [0.5], "count": 1, "similarity": lambda _i, _j: 0.0}
    with refused(name):
        diverse(**(arguments | change))  # type: ignore[arg-type]


def test_no_candidates() -> None:
    assert diverse([], 3, lambda _i, _j: 0.0) == []
