"""Tests by name of several samples: published examples, other formulas, levels, refusals."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation
from scipy.stats import f_oneway, vonmises_fisher

from orbiflow.density import NamedTestSettings, RotationSpace, named_tests
from orbiflow.density.comparing import statistics
from orbiflow.errors import SettingError
from refusals import refused

QUICK = NamedTestSettings(permutations=99)
DIRECTIONS = [94, 65, 45, 52, 38, 47, 73, 82, 90, 40, 87], [77, 70, 61, 45, 50, 35, 48, 65, 36]
HEADINGS = (
    [35, 45, 50, 55, 60, 70, 85, 95, 105, 120],
    [75, 80, 90, 100, 110, 130, 135, 140, 150, 155, 165],
)


def vectors_of(angles: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def samples(pair: tuple[list[int], list[int]]) -> dict[str, np.ndarray]:
    return {name: np.array(own, float)[:, None] for name, own in zip("ab", pair, strict=True)}


def test_published_examples() -> None:
    """Zar, Biostatistical Analysis (5th edition), examples 27.7 and 27.10."""
    found = named_tests(samples(DIRECTIONS), settings=QUICK, unit="degrees")
    assert found["watson-williams"].statistic == pytest.approx(1.61, abs=0.005)
    assert found["watson-williams"].degrees == (1, 18)
    found = named_tests(samples(HEADINGS), settings=QUICK, unit="degrees")
    assert found["watson-u2"].statistic == pytest.approx(0.1458, abs=1e-4)
    assert 0.1 < named_tests(samples(HEADINGS), unit="degrees")["watson-u2"].p < 0.2


def of_two(rng: np.random.Generator, spread: float, ties: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return angles and samples of two densities that differ a little."""
    angles = np.concatenate([rng.normal(0, spread, 17), rng.normal(0.5 * spread, spread, 12)])
    return (np.round(angles, 1) if ties else angles), np.repeat([0, 1], [17, 12])


@given(st.integers(0, 10**6), st.booleans(), st.floats(0.3, 3.0))
@settings(max_examples=30, deadline=None)
def test_statistics_of_distributions_by_their_definitions(seed, ties, spread) -> None:
    angles, labels = of_two(np.random.default_rng(seed), spread, ties)
    vectors, table = vectors_of(angles), labels[:, None]
    turns = np.round(np.mod(angles / (2 * np.pi), 1), 11) % 1
    one, other = turns[labels == 0], turns[labels == 1]
    steps = np.array([(one <= x).mean() - (other <= x).mean() for x in turns])
    u2 = 17 * 12 / 29**2 * ((steps - steps.mean()) ** 2).sum()
    assert statistics.watson_u2(vectors, table)[0] == pytest.approx(u2, abs=1e-12)
    range_of = max(0.0, steps.max()) - min(0.0, steps.min())
    found = statistics.kuiper(vectors, table)[0]
    assert found == pytest.approx(range_of * np.sqrt(17 * 12 / 29), abs=1e-12)
    ranks = np.array([((turns < x).sum() + 1 + (turns <= x).sum()) / 2 for x in turns])
    waves = np.exp(2j * np.pi * ranks / 29)
    w = sum(2 * abs(waves[labels == k].sum()) ** 2 / n for k, n in ((0, 17), (1, 12)))
    assert statistics.mardia_watson_wheeler(vectors, table)[0] == pytest.approx(w, abs=1e-9)
    distances = cdist(vectors, vectors)
    within = sum(
        distances[labels == k][:, labels == k].sum() / (2 * n) for k, n in ((0, 17), (1, 12))
    )
    ratio = (distances.sum() / 58 - within) / (within / 27)
    assert statistics.energy(vectors, table)[0] == pytest.approx(ratio, rel=1e-9)


@given(st.integers(0, 10**6), st.floats(-3, 3))
@settings(max_examples=10, deadline=None)
def test_rotations_change_no_statistic(seed: int, turn: float) -> None:
    angles, labels = of_two(np.random.default_rng(seed), 0.8, False)
    for test in (
        statistics.watson_williams, statistics.common_mean, statistics.common_median,
        statistics.common_concentration,
    ):  # fmt: skip
        before, after = (test(vectors_of(own), labels) for own in (angles, angles + turn))
        assert after.statistic == pytest.approx(before.statistic, abs=1e-9)
    for test in (statistics.watson_u2, statistics.kuiper):
        before, after = (test(vectors_of(own), labels[:, None]) for own in (angles, angles + turn))
        assert after[0] == pytest.approx(before[0], abs=1e-9)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=12))
@settings(max_examples=50, deadline=None)
def test_median_direction_is_nearest_on_average(turns: list[float]) -> None:
    angles = np.array(turns)

    def mean(at: float) -> float:
        away = (angles - at) % 1.0
        return float(np.minimum(away, 1 - away).mean())

    found = statistics.median_direction(angles)
    assert mean(found) <= min(map(mean, np.arange(400) / 400)) + 1e-9


def test_close_directions_are_tested_as_numbers() -> None:
    """Within a thousandth of a radian a sphere is flat: these are analyses of variance there."""
    rng = np.random.default_rng(1)
    sizes = (12, 20, 9)
    labels = np.repeat(range(3), sizes)
    x = (
        rng.normal(0, 1, (41, 2)) * np.array([1.0, 1.5, 0.8])[labels][:, None]
        + 0.2 * labels[:, None]
    )
    tiny = 1e-4 * x
    groups = [tiny[labels == k] for k in range(3)]
    found = statistics.watson_williams(vectors_of(tiny[:, 0]), labels)
    exact, p = f_oneway(*(own[:, 0] for own in groups))
    assert found.statistic == pytest.approx(exact, rel=1e-4)
    assert found.p == pytest.approx(p, rel=1e-4)
    north = np.stack([tiny[:, 0], tiny[:, 1], np.sqrt(1 - (tiny**2).sum(axis=1))], axis=1)
    mean = tiny.mean(axis=0)
    between = sum(len(own) * ((own.mean(axis=0) - mean) ** 2).sum() for own in groups)
    within = sum(((own - own.mean(axis=0)) ** 2).sum() for own in groups)
    found = statistics.watson_williams(north, labels)
    assert found.degrees == (4, 76)
    assert found.statistic == pytest.approx(between / 2 / (within / 38), rel=1e-4)
    weights = np.array([len(own) / own[:, 0].var() for own in groups])
    means = np.array([own[:, 0].mean() for own in groups])
    welch = weights @ (means - weights @ means / weights.sum()) ** 2
    found = statistics.common_mean(vectors_of(tiny[:, 0]), labels)
    assert found.statistic == pytest.approx(welch, rel=1e-3)
    away = [abs(own[:, 0] - own[:, 0].mean()) for own in groups]
    found = statistics.common_concentration(vectors_of(tiny[:, 0]), labels)
    assert found.statistic == pytest.approx(f_oneway(*away)[0], rel=1e-4)


def share_of_small(
    draw: Callable[[np.random.Generator], dict[str, np.ndarray]], space: str, trials: int
) -> dict[str, float]:
    """Return how often each test has p at most 0.05."""
    small: dict[str, int] = {}
    rng = np.random.default_rng(7)
    for _ in range(trials):
        for one in named_tests(draw(rng), space, NamedTestSettings(permutations=19)).tests:
            small[one.name] = small.get(one.name, 0) + (one.p <= 0.05)
    return {name: count / trials for name, count in small.items()}


def test_levels_and_power_on_the_circle() -> None:
    def two(means: tuple[float, float], kappas: tuple[float, float]) -> Any:
        sizes = [(30, 1), (40, 1)]
        own = list(zip(means, kappas, sizes, strict=True))
        return lambda rng: {name: rng.vonmises(*one) for name, one in zip("ab", own, strict=True)}

    levels = share_of_small(two((1, 1), (2, 2)), "torus", 30)
    assert len(levels) == 8
    assert all(share <= 0.15 for share in levels.values()), levels  # 0.05 and 3.5 standard errors
    power = share_of_small(two((1, 2), (2, 2)), "torus", 20)
    assert all(power[name] >= 0.8 for name in power if name != "common-concentration"), power
    wider = share_of_small(two((1, 1), (8, 1)), "torus", 10)
    assert wider["common-concentration"] >= 0.8


def test_levels_and_power_on_spheres_and_of_axes() -> None:
    def three(rng: np.random.Generator, turn: float = 0.0) -> dict[str, np.ndarray]:
        tilt = Rotation.from_rotvec([turn, 0, 0]).as_matrix()
        drawn = (vonmises_fisher([0, 0, 1], 5).rvs(30, random_state=rng) for _ in "abc")
        first, *others = drawn
        return dict(zip("abc", [first @ tilt.T, *others], strict=True))

    levels = share_of_small(three, "sphere", 8)
    assert set(levels) == {"watson-williams", "common-mean", "common-concentration", "energy"}
    assert all(share <= 0.2 for share in levels.values()), levels
    assert share_of_small(three, "projective-plane", 4)["bingham"] <= 0.3
    for space in ("sphere", "projective-plane"):
        power = share_of_small(lambda rng: three(rng, 0.6), space, 2)
        assert all(power[name] >= 0.75 for name in power if name != "common-concentration"), power


def test_either_end_of_an_axis_is_the_same() -> None:
    rng = np.random.default_rng(0)
    one, other = (vonmises_fisher([0, 0.6, 0.8], 5).rvs(20, random_state=rng) for _ in "ab")
    signs = rng.choice([-1, 1], (20, 1))
    before = named_tests({"a": one, "b": other}, "projective-plane", QUICK)
    after = named_tests({"a": one * signs, "b": other}, "projective-plane", QUICK)
    for name in ("bingham", "energy"):
        assert after[name].statistic == pytest.approx(before[name].statistic, rel=1e-6)


def test_doubts_and_refusals() -> None:
    rng = np.random.default_rng(0)
    pair = {"a": rng.uniform(-3, 3, (9, 1)), "b": rng.uniform(-3, 3, (9, 1))}
    found = named_tests(pair, settings=QUICK)
    assert "below 1" in found["watson-williams"].doubt
    assert "fewer than 25" in found["common-mean"].doubt
    assert any("p may be wrong" in str(line) for line in found.words())
    with refused("bingham", kind=SettingError):
        named_tests(pair, settings=NamedTestSettings(tests=("bingham",)))
    with refused("kuiper", "3", kind=SettingError):
        named_tests({**pair, "c": pair["a"]}, settings=NamedTestSettings(tests=("kuiper",)))
    with refused("sample", "b", "3", "5"):
        named_tests({"a": pair["a"], "b": pair["b"][:3]})
    with refused("data", "sets"):
        named_tests({"a": pair["a"]})
    turns = Rotation.random(10, random_state=0).as_quat()
    with refused("rotation-space"):
        named_tests({"a": turns, "b": turns}, RotationSpace(symmetry="O"))
    assert len(named_tests({"a": turns, "b": turns}, "rotation-space", QUICK).tests) == 2


@pytest.mark.parametrize("statistic", ["energy", "watson_u2", "kuiper", "mardia_watson_wheeler"])
def test_samples_of_a_permutation_may_have_other_sizes(statistic: str) -> None:
    rng = np.random.default_rng(3)
    vectors = vectors_of(rng.vonmises(0, 1, 30))
    table = np.stack([np.arange(30) % 2, (np.arange(30) < 7).astype(int)], axis=1)
    call = getattr(statistics, statistic)
    alone = [float(call(vectors, table[:, [k]])[0]) for k in range(2)]
    assert call(vectors, table) == pytest.approx(alone)
