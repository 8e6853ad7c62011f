"""Recognisability: invariances, and limbs lost, grown, moved and merged; the score that ranks."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Point, Polygon, box

from orbiflow.tiles import Recogniser, diverse, iou, rank_score, recognisability
from refusals import refused

Ring = NDArray[np.float64]


def creature(limbs: dict[float, float], width: float = 0.16) -> Polygon:
    """A round body of radius 0.5 with limbs: angle in degrees to length beyond the body."""
    parts = [Point(0, 0).buffer(0.5)]
    for angle, length in limbs.items():
        limb = box(0.3, -width / 2, 0.5 + length, width / 2)
        parts.append(shapely.affinity.rotate(limb, angle, origin=(0, 0)))
    return shapely.unary_union(parts)  # pyright: ignore[reportReturnType]


def bent(shape: Polygon, amount: float) -> Polygon:
    """`shape` under a smooth map that moves points by at most `amount`."""
    fine = shapely.segmentize(shape, 0.02)
    wave = lambda xy: xy + amount / 2 * np.sin(4 * xy[:, ::-1] + [0.3, 1.1]) * [1, -1]  # noqa: E731
    return shapely.transform(fine, wave)


LIMBS = {0.0: 0.8, 40.0: 0.6, 110.0: 0.7, 200.0: 0.8, 250.0: 0.5, 300.0: 0.7}
SPIDER = creature(LIMBS)


@st.composite
def star_shapes(draw: st.DrawFn) -> Ring:
    """A star polygon with one far vertex, so that no symmetry leaves its first point open."""
    n = draw(st.integers(5, 20))
    radii = np.array([1.6, *draw(st.lists(st.floats(0.3, 1.0), min_size=n - 1, max_size=n - 1))])
    angle = 2 * np.pi * np.arange(n) / n
    return radii[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)


@given(star_shapes(), star_shapes())
@settings(max_examples=20, deadline=None)
def test_range_and_identity(a: Ring, b: Ring) -> None:
    values = recognisability(a, b)
    assert all(0 <= value <= 1 for value in values.as_dict().values())
    assert min(values.kept, values.clean) <= values.score <= max(values.kept, values.clean)
    mean = 2 * values.kept * values.clean / max(values.kept + values.clean, 1e-12)
    assert values.score == pytest.approx(mean, abs=1e-9)
    assert recognisability(a, a).score == pytest.approx(1, abs=1e-9)
    assert recognisability(a, a).limbs == pytest.approx(1, abs=1e-9)


@given(
    star_shapes(), star_shapes(), st.floats(0, 6.3), st.floats(0.01, 100), st.floats(-9, 9),
    st.booleans(),
)  # fmt: skip
@settings(max_examples=20, deadline=None)
def test_similarities_of_both_change_nothing(a: Ring, b: Ring, angle, scale, shift, mirror) -> None:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    linear = scale * turn @ np.diag([1, -1 if mirror else 1])
    moved = recognisability(a @ linear.T + shift, b @ linear.T + shift)
    expected = recognisability(a, b)
    assert moved.as_dict() == pytest.approx(expected.as_dict(), abs=1e-6)


@given(st.sampled_from(sorted(LIMBS)), st.floats(0.12, 0.24))
@settings(max_examples=6, deadline=None)
def test_cutting_a_limb_costs_more_and_more(angle: float, width: float) -> None:
    target = creature(LIMBS, width)
    recognise = Recogniser(target)
    lengths = LIMBS[angle] * np.linspace(1, 0, 6)
    cut = [recognise(creature({**LIMBS, angle: length}, width)) for length in lengths]
    share = 2 * LIMBS[angle] / target.exterior.length
    for part in ("score", "kept", "limbs"):
        values = np.array([getattr(values, part) for values in cut])
        assert (np.diff(values) < 0.01).all()
        assert values[0] == pytest.approx(1, abs=1e-9)
    assert 1 - cut[-1].kept > 0.8 * share
    assert cut[-1].clean > 0.95


@given(st.sampled_from(sorted(LIMBS)))
@settings(max_examples=4, deadline=None)
def test_a_spurious_limb_costs_as_a_lost_one_does(angle: float) -> None:
    without = creature({at: length for at, length in LIMBS.items() if at != angle})
    grown, lost = recognisability(SPIDER, without), recognisability(without, SPIDER)
    assert grown.kept > 0.95 > grown.clean
    assert grown.score == pytest.approx(lost.score, abs=0.03)


def test_small_deformations_cost_little_and_steadily() -> None:
    recognise = Recogniser(SPIDER)
    scores = [recognise(bent(SPIDER, amount)).score for amount in (0, 0.02, 0.05, 0.1, 0.2, 0.4)]
    assert (np.diff(scores) < 0.01).all()
    assert scores[2] > 0.98
    assert scores[3] > 0.95


def test_a_blob_falls_below_a_tile_with_limbs() -> None:
    blob = creature({})
    limbed = bent(SPIDER, 0.3)
    assert iou(blob, SPIDER) > iou(limbed, SPIDER)
    assert recognisability(blob, SPIDER).score < recognisability(limbed, SPIDER).score - 0.2


def test_merged_limbs_are_not_found() -> None:
    hand = creature(dict.fromkeys((-40.0, -20.0, 0.0, 20.0, 40.0), 0.8), 0.12)
    mitten = hand.union(hand.convex_hull.intersection(box(0.4, -2, 2, 2)))
    assert isinstance(mitten, Polygon)
    assert recognisability(mitten, hand).kept < 0.7
    # Each finger has a neighbour that is near and alike: that neighbour is found once, not twice.
    fewer = creature(dict.fromkeys((-40.0, -20.0, 20.0, 40.0), 0.8), 0.12)
    assert recognisability(fewer, hand).kept < 0.88


def test_holes_and_parts() -> None:
    ring = Polygon(box(0, 0, 3, 3).exterior, [box(1, 1, 2, 2).exterior])
    assert recognisability(ring, ring).score == pytest.approx(1, abs=1e-9)
    assert recognisability(box(0, 0, 3, 3), ring).kept < 0.8
    pair = MultiPolygon([box(0, 0, 1, 1), box(2, 0, 3, 1)])
    assert recognisability(pair, pair).score == pytest.approx(1, abs=1e-9)
    assert recognisability(box(0, 0, 1, 1), pair).kept == pytest.approx(0.5, abs=0.01)


def test_a_very_long_outline() -> None:
    teeth = np.linspace(0, 1, 4001)[:, None] * [4, 0] + np.arange(4001)[:, None] % 2 * [0, 4]
    comb = np.concatenate([teeth, [[4, 4.1], [0, 4.1]]])
    assert recognisability(comb, box(0, 0, 4, 4)).clean < 0.3


BOWTIE = [[0, 0], [2, 2], [2, 0], [0, 2]]


@pytest.mark.parametrize("bad", [BOWTIE, [[0, 0], [1, 1]], [[0, 0], [1, 1], [np.nan, 0]], "x"])
def test_the_bad_argument_is_named(bad: object) -> None:
    with refused("tile"):
        recognisability(bad, SPIDER)  # type: ignore[arg-type]
    with refused("target"):
        Recogniser(bad)  # type: ignore[arg-type]


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
