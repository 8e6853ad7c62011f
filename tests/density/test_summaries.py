"""Summaries and tests of uniformity: published examples, closed forms, and levels by simulation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats
from scipy.stats import kstest

from orbiflow.density import summarize_angles, summarize_axes, summarize_directions, uniformity
from orbiflow.density.summaries import kuiper_p, watson_p
from orbiflow.density.uniformity import rao_p
from refusals import refused

SIX = [356, 97, 211, 232, 343, 292, 157, 302, 335, 302, 324, 85, 324, 340, 157, 238, 254, 146]
NOON = [119, 162, 221, 259, 270, 29, 97, 292, 40, 313, 94, 45, 47, 108, 221, 270, 119, 248]
WIND = np.transpose([[*SIX, 232, 122, 329], [*NOON, 270, 45, 23]])
"""Wind directions in Milwaukee at 6 and 12 o'clock, Johnson and Wehrly (1977)."""

PIGEONS = [55, 60, 65, 95, 100, 110, 260, 275, 285, 295]
"""Vanishing angles of pigeons, Schmidt-Koenig (1963); Mardia and Jupp (2000), page 93."""

TREES = [45, 55, 81, 96, 110, 117, 132, 154]
"""Directions in which trees lean, Zar, Biostatistical Analysis (2010), example 26.2."""


def test_published_means() -> None:
    (roulette,), _ = summarize_angles([43, 45, 52, 61, 75, 88, 88, 279, 357], unit="degrees")
    assert roulette.mean == pytest.approx(51, abs=0.1)  # Mardia and Jupp (2000), example 1.1
    assert roulette.resultant == pytest.approx(0.711, abs=5e-4)
    (six,), _ = summarize_angles([51, 67, 40, 109, 31, 358], unit="degrees")
    assert six.mean is not None  # Jammalamadaka and SenGupta (2001), page 23
    assert math.radians(six.mean) == pytest.approx(0.8487044, abs=1e-6)
    assert 1 - six.resultant == pytest.approx(0.1635635, abs=1e-6)
    (trees,), _ = summarize_angles(TREES, unit="degrees")
    assert (round(trees.mean or 0), round(trees.resultant, 5)) == (99, 0.82522)
    assert trees.rayleigh_p is not None
    assert 0.001 < trees.rayleigh_p < 0.002  # Zar (2010), example 27.1
    half = math.acos(0.2370)  # Fisher (1993), example 4.11
    (one,), _ = summarize_angles([half, -half] * 30)
    assert one.rayleigh_p == pytest.approx(0.034, abs=5e-4)
    found = summarize_directions([[21, 140], [23, 127], [19, 142], [22, 136]])
    # PmagPy's worked example, `ipmag.fisher_mean`
    assert found.mean == pytest.approx((21.347784026899987, 136.30838974272072))
    assert found.resultant * 4 == pytest.approx(3.9812138971889026)
    assert found.k == pytest.approx(159.69251473636305)
    assert found.fisher_cone == pytest.approx(7.292891411309177)


def test_rayleighs_probability_is_the_share_of_uniform_draws_that_are_farther() -> None:
    draws = np.random.default_rng(0).normal(size=(20_000, 5, 3))
    draws /= np.linalg.norm(draws, axis=2, keepdims=True)
    order = np.argsort(np.linalg.norm(draws.mean(axis=1), axis=1))
    for share in (0.5, 0.05):
        rayleigh = summarize_directions(draws[order[-int(share * 20_000)]]).rayleigh_p
        assert rayleigh == pytest.approx(share, abs=0.012)


def test_correlations() -> None:
    _, (pair,) = summarize_angles(WIND, columns="six,noon", unit="degrees")
    # Jammalamadaka and SenGupta (2001), example 8.1; Fisher (1993), example 6.8
    assert pair.sine == pytest.approx(0.2704648, abs=1e-7)
    assert pair.sine_p == pytest.approx(0.2247383, abs=1e-7)
    assert pair.pairs == pytest.approx(0.191, abs=5e-4)


def statistics(turns: np.ndarray) -> tuple[float, float]:
    """Stephens' modified V and U^2, as Mardia and Jupp (2000) write them, (6.3.27) and (6.3.36)."""
    x, n = np.sort(turns), len(turns)
    i = np.arange(1, n + 1)
    v = (x - i / n).max() - (x - i / n).min() + 1 / n
    u = ((x - x.mean() - (2 * i - 1) / (2 * n) + 0.5) ** 2).sum() + 1 / (12 * n)
    root = math.sqrt(n)
    return v * (root + 0.155 + 0.24 / root), (u - 0.1 / n + 0.1 / n**2) * (1 + 0.8 / n)


def test_kuiper_and_watson() -> None:
    """The upper quantiles of Stephens (1970): Mardia and Jupp (2000), pages 100 and 105."""
    pigeons = np.array(PIGEONS) / 360
    assert statistics(pigeons) == pytest.approx((1.5175, 0.11536), abs=1e-4)
    quantiles = {0.10: (1.620, 0.152), 0.05: (1.747, 0.187), 0.01: (2.001, 0.267)}
    even = (np.arange(40) + 0.5) / 40
    for p, values in quantiles.items():
        for k, test in enumerate((kuiper_p, watson_p)):

            def excess(share: float, k: int = k, value: float = values[k]) -> float:
                return statistics(share * even)[k] - value

            share = optimize.brentq(
                excess, 0.3, 1.0
            )  # so crowded that the statistic is the quantile
            assert test(share * even) == pytest.approx(p, rel=0.03)
    assert 0.15 < kuiper_p(pigeons) < 0.2  # 1.537 is the quantile of 15 %
    assert 0.15 < watson_p(pigeons) < 0.25


@pytest.mark.parametrize("count", [5, 10, 50])
def test_levels_of_tests(count: int) -> None:
    rng = np.random.default_rng(count)
    draws = rng.uniform(size=(1500, count))
    for test in (kuiper_p, watson_p):
        found = np.array([test(row) for row in draws])
        for level in (0.05, 0.2, 0.5):
            assert (found <= level).mean() == pytest.approx(level, abs=0.035)


def test_axes() -> None:
    """Poles of the coordinate axes are a uniform sample as far as the tensor tells."""
    even = summarize_axes(np.concatenate([np.eye(3), -np.eye(3)]))
    assert even.eigenvalues == pytest.approx([1 / 3] * 3)
    assert (even.cone, even.bingham_p) == (None, 1.0)
    crowd = summarize_axes([[80, 0], [80, 180], [-80, 90], [-80, 270]])
    assert crowd.principal[0] == pytest.approx(90)
    assert crowd.eigenvalues[0] == pytest.approx(math.sin(math.radians(80)) ** 2)
    shape = 7.5 * 4 * (sum(v**2 for v in crowd.eigenvalues) - 1 / 3)  # Mardia and Jupp, 10.7.3
    assert crowd.bingham_p == pytest.approx(stats.chi2.sf(shape, 5))


@pytest.mark.filterwarnings("ignore:.*others hardly repeat")
@settings(max_examples=15)
@given(st.lists(st.floats(-3.1, 3.1), min_size=2, max_size=40), st.floats(-3, 3))
def test_against_scipy_and_turned(angles: list[float], turn: float) -> None:
    (one,), _ = summarize_angles(angles, unit="radians")
    expected = stats.directional_stats(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    assert one.resultant == pytest.approx(float(expected.mean_resultant_length), abs=1e-9)
    if one.mean is not None and one.resultant > 1e-6:
        assert math.cos(one.mean - stats.circmean(angles)) == pytest.approx(1)
        assert one.deviation == pytest.approx(stats.circstd(angles), rel=1e-4, abs=1e-6)
    (other,), _ = summarize_angles(np.add(angles, turn) % (2 * np.pi), unit="radians")
    for name in ("resultant", "rayleigh_p"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), abs=1e-9)
    for name in ("kuiper_p", "watson_p"):  # they are rotation invariant, too
        assert getattr(other, name) == pytest.approx(getattr(one, name), abs=1e-6)


def test_intervals_hold() -> None:
    """Of rows and of groups, intervals of 90 % hold the truth in about 90 % of cases."""
    rng, held, trials = np.random.default_rng(1), np.zeros(2), 40
    labels = np.arange(100) // 5
    for _ in range(trials):
        rows = rng.vonmises(1.0, 1.5, 100)
        grouped = (rng.vonmises(1.0, 2.0, 20)[:, None] + rng.normal(0, 0.2, (20, 5))).ravel()
        for k, (angles, groups) in enumerate([(rows, None), (grouped, labels)]):
            (one,), _ = summarize_angles(angles % (2 * np.pi), groups=groups, level=0.9)
            assert one.mean is not None
            assert one.half_width is not None
            held[k] += abs(math.remainder(one.mean - 1, 2 * math.pi)) < one.half_width
    assert (abs(held / trials - 0.9) < 0.1).all(), held


def test_groups_are_no_evidence_of_a_direction() -> None:
    rng, naive, right = np.random.default_rng(2), 0, 0
    labels = np.arange(120) // 6
    for _ in range(30):
        angles = np.repeat(rng.uniform(0, 2 * np.pi, 20), 6) + rng.normal(0, 0.1, 120)
        angles %= 2 * np.pi
        (alone,), _ = summarize_angles(angles, unit="radians")
        (grouped,), _ = summarize_angles(angles, unit="radians", groups=labels)
        assert (grouped.kuiper_p, grouped.watson_p) == (None, None)
        naive += (alone.rayleigh_p or 0) < 0.05
        right += (grouped.rayleigh_p or 0) < 0.05
    assert naive > 10
    assert right < 5


def test_weights_are_repeated_rows() -> None:
    """Whole weights give the means of repeated rows; errors are those of rows, not of repeats."""
    rng = np.random.default_rng(3)
    data, weights = rng.vonmises(0, 2, (30, 2)), rng.integers(1, 4, 30)
    columns, (pair,) = summarize_angles(data, weights=weights)
    repeated, (twin,) = summarize_angles(np.repeat(data, weights, axis=0))
    for one, other in zip(columns, repeated, strict=True):
        assert one.mean == pytest.approx(other.mean)
        assert one.resultant == pytest.approx(other.resultant)
        assert (one.half_width or 0) > (other.half_width or 9)
        assert one.kuiper_p is None
    assert (pair.sine, pair.pairs) == pytest.approx((twin.sine, twin.pairs))
    kept, _ = summarize_angles(data[weights > 1], weights=weights[weights > 1])
    zero, _ = summarize_angles(data, weights=np.where(weights > 1, weights, 0))
    assert kept == zero


def test_what_cannot_be_told() -> None:
    (even,), _ = summarize_angles([0, 90, 180, 270], unit="degrees")
    assert (even.mean, even.half_width, even.deviation) == (None, None, None)
    (one,), _ = summarize_angles([1.0, 1.0])
    assert (one.mean, one.concentration) == (pytest.approx(1.0), None)
    columns, _ = summarize_angles([[0.0, math.nan], [1.0, 2.0], [1.0, 3.0]])
    assert [column.rows for column in columns] == [3, 2]


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"weights": [1, -1]}, "weights 2 0"), ({"weights": [0, 0]}, "value weight"),
        ({"groups": ["a"]}, "groups 2"), ({"level": 2}, "level"), ({"unit": "hours"}, "unit"),
    ],
)  # fmt: skip
def test_mistakes(given_: dict, message: str) -> None:
    with refused(*message.split()):
        summarize_angles([0.0, 1.0], **given_)


def test_summaries_in_python_ask_as_the_command_line_does() -> None:
    degrees = np.random.default_rng(0).normal(307, 20, 80) % 360
    with refused("unit", "2"):
        summarize_angles(degrees)
    coded = np.where(np.arange(80) % 8, degrees, 999.0)
    with refused("999"):
        summarize_angles(coded, unit="degrees")
    hidden = np.ma.masked_array(np.ones(80), np.arange(80) == 3)
    hidden.data[3] = 1e6
    with refused("weights"):
        summarize_angles(degrees, unit="degrees", weights=hidden)
    with refused("weights"):
        summarize_angles(degrees, unit="degrees", weights=np.ones(80) * 1j)


def with_excess(degrees: float, count: int) -> np.ndarray:
    """Angles in turns of which gaps exceed 360 / n by so much in all, one gap alone."""
    gaps = np.full(count, (1 - 1 / count - degrees / 360) / (count - 1))
    gaps[0] = 1 / count + degrees / 360
    return np.cumsum(gaps)


@pytest.mark.parametrize(
    ("count", "degrees", "p"),
    [  # Batschelet, Circular Statistics in Biology (1981), table L
        (4, 221.14, 0.01), (4, 186.45, 0.05), (5, 211.93, 0.01), (5, 183.44, 0.05), (5, 168.66, 0.1),
    ],
)  # fmt: skip
def test_critical_values_are_those_of_tables(count: int, degrees: float, p: float) -> None:
    assert rao_p(with_excess(degrees, count)) == pytest.approx(p, abs=2e-4)


@pytest.mark.parametrize("count", [4, 30])
def test_p_of_even_angles_is_even(count: int) -> None:
    rng = np.random.default_rng(count)
    found = [rao_p(rng.uniform(-3, 3, count)) for _ in range(150)]
    assert kstest(np.array(found, dtype=float), "uniform").pvalue > 1e-3


@pytest.mark.parametrize("score", [-2.0, 0.0, 1.0, 2.3, 3.5])
def test_both_forms_agree(score: float, monkeypatch: pytest.MonkeyPatch) -> None:
    mean = (1 - 1 / 200) ** 200
    turns = with_excess(360 * (mean + score * 0.0173), 200)
    exact = rao_p(turns)
    monkeypatch.setattr(uniformity, "MOST_EXACT", 10)
    assert rao_p(turns) == pytest.approx(exact, abs=2e-4, rel=0.06)


def test_gaps_of_even_and_of_rounded_angles() -> None:
    assert rao_p(np.arange(12) / 12 + 0.01) == pytest.approx(1)
    rng = np.random.default_rng(0)
    assert rao_p(rng.integers(0, 72, 60) / 72) is None
    assert rao_p(np.array([0.1, 0.2, 0.3])) is None
    # four modes a quarter apart: the mean is nowhere, and the gaps are uneven
    angles = (np.degrees(rng.vonmises(0, 200, 48)) + 90 * np.arange(48)) % 360
    (found,), _ = summarize_angles(angles, unit="degrees")
    assert found.rao_p is not None
    assert found.rao_p < 1e-6
    assert (found.rayleigh_p or 0) > 0.5
    (weighed,), _ = summarize_angles(angles, unit="degrees", weights=1 + np.arange(48))
    assert weighed.rao_p is None
