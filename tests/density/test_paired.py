"""Paired comparisons: standard errors, intervals that keep their promise, groups, and mistakes."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import (
    ComparisonSettings,
    DensityEstimator,
    ModelComparison,
    compare_models,
    compare_scores,
)
from orbiflow.density.comparing.resampling import Groups, resampled_sums
from orbiflow.runtime import to_json
from refusals import names, refused

seeds = st.integers(0, 2**31)


def few(bootstrap: int, seed: int = 0) -> ComparisonSettings:
    return ComparisonSettings(bootstrap=bootstrap, seed=seed)


def scores(rng: np.random.Generator, rows: int, *shifts: float) -> dict[str, np.ndarray]:
    base = 3 * rng.normal(size=rows)
    return {f"m{k}": base + shift + rng.normal(size=rows) for k, shift in enumerate(shifts)}


@given(seeds, st.integers(5, 60))
@settings(max_examples=15, deadline=None)
def test_the_standard_error_is_that_of_the_paired_differences(seed: int, rows: int) -> None:
    table = scores(np.random.default_rng(seed), rows, 0.0, 0.3)
    found = compare_scores(table, settings=few(100))
    one = found.differences[0]
    difference = table[one.first] - table[one.second]
    assert one.mean == pytest.approx(difference.mean())
    assert one.error == pytest.approx(difference.std(ddof=1) / np.sqrt(rows))
    assert one.low <= one.mean <= one.high
    assert one.mean >= 0
    assert found.scores[0].mean >= found.scores[1].mean


@given(seeds, st.integers(5, 40), st.integers(2, 6))
@settings(max_examples=15, deadline=None)
def test_copies_of_rows_in_one_group_add_no_evidence(seed: int, rows: int, copies: int) -> None:
    table = scores(np.random.default_rng(seed), rows, 0.0, 0.3)
    labels = [f"group {k}" for k in range(rows)] * copies
    alone = compare_scores(table, settings=few(200, seed))
    copied = compare_scores(
        {name: np.tile(value, copies) for name, value in table.items()},
        groups=labels,
        settings=few(200, seed),
    )
    assert copied.groups == rows
    one, other = alone.differences[0], copied.differences[0]
    assert other.error == pytest.approx(one.error)
    # groups are numbered by their labels, so that other ones are drawn: the same up to chance
    assert other.high - other.low == pytest.approx(one.high - one.low, rel=0.8)


def test_intervals_hold_what_they_promise() -> None:
    rng = np.random.default_rng(0)
    held = 0
    for trial in range(150):
        table = {"a": rng.exponential(size=30) ** 1.5, "b": np.zeros(30)}
        one = compare_scores(table, few(200, trial)).differences[0]
        truth = 1.3293403881791372 * (1 if one.first == "a" else -1)  # gamma(2.5)
        held += one.low <= truth <= one.high
    # a skewed density and 30 rows: short of 95 %, as any bootstrap
    assert 0.84 * 150 <= held <= 150 - 1


def test_all_intervals_hold_at_once() -> None:
    rng = np.random.default_rng(1)
    wrong = 0
    for trial in range(120):
        found = compare_scores(scores(rng, 40, 0, 0, 0, 0), few(200, trial))
        wrong += any(d.better for d in found.differences)
    assert 1 <= wrong <= 14  # 6 expected; six intervals of their own would give about 24


def test_groups_keep_chance_from_being_taken_for_a_difference() -> None:
    rng = np.random.default_rng(2)
    labels = np.repeat(np.arange(12), 20)
    fooled, kept = 0, 0
    for trial in range(30):
        shared = 0.5 * rng.normal(size=12)[labels]
        table = {"a": shared + 0.1 * rng.normal(size=240), "b": np.zeros(240)}
        fooled += compare_scores(table, few(100, trial)).best is not None
        kept += compare_scores(table, few(100, trial), groups=labels).best is None
    assert fooled > 15
    assert kept > 24


def test_notes_on_groups_that_are_few_unequal_or_of_single_rows() -> None:
    table = scores(np.random.default_rng(7), 200, 0, 0)
    sizes = {"equal": [8] * 25, "few": [20] * 10, "unequal": [100] + [4] * 25}
    groups = {name: np.repeat(np.arange(len(own)), own) for name, own in sizes.items()}
    groups |= {"lone": np.arange(200), "none": None}
    notes = {
        name: compare_scores(table, few(100), groups=labels).notes
        for name, labels in groups.items()
    }
    assert notes["equal"] == notes["none"] == ()
    names(notes["few"][0], "10 groups")
    names(notes["unequal"][0], "26 groups", "3.8 equal")
    names(notes["lone"][0], "group of its own")


def test_a_fit_says_that_groups_are_of_single_rows() -> None:
    data = np.random.default_rng(8).vonmises(0, 1, (60, 2))
    fits = {
        count: DensityEstimator(components="kernels").fit(data, groups=np.arange(60) % count)
        for count in (60, 30)
    }
    said = {n: any("group of its own" in x for x in f.report_.notes) for n, f in fits.items()}
    assert said == {60: True, 30: False}


def test_the_best_is_named_only_if_it_beats_all() -> None:
    rng = np.random.default_rng(3)
    base = rng.normal(size=400)
    noise = 0.3 * rng.normal(size=400)
    found = compare_scores({"c": base - 1 + noise, "a": base, "b": base + 1e-3 * noise})
    assert found.best is None
    assert "a and b" in found.verdict or "b and a" in found.verdict
    clear = compare_scores({"c": base - 1 + noise, "a": base, "d": base - 0.5 + noise})
    assert clear.best == "a"
    assert clear.verdict == "a is better than d and c"
    assert [s.name for s in clear.scores] == ["a", "d", "c"]
    assert json.loads(json.dumps(to_json(clear), allow_nan=False))["best"] == "a"


def test_equal_models_and_a_single_row_of_difference() -> None:
    rng = np.random.default_rng(4)
    base = rng.normal(size=50)
    same = compare_scores({"a": base, "b": base.copy()})
    assert same.best is None
    assert same.differences[0].p == 1
    assert same.notes == ("a and b are equal at every row",)
    one = base.copy()
    one[7] += 100
    found = compare_scores({"a": one, "b": base})
    assert found.best is None
    json.dumps(to_json(found), allow_nan=False)
    always = compare_scores({"a": base + 0.25, "b": base})
    assert always.best == "a"


def test_blocks_of_resamples_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    table = np.column_stack([np.eye(30), np.ones(30)])
    monkeypatch.setattr("orbiflow.density.comparing.resampling.BLOCK_ENTRIES", 300)
    sums = resampled_sums(table, 64, np.random.default_rng(1))
    assert sums[:, -1].tolist() == [30] * 64
    assert sums[:, :-1].mean(axis=0) == pytest.approx(np.ones(30), abs=0.6)  # each row once


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: compare_scores({"a": [1.0] * 9}), "two models"),
        (lambda: compare_scores({"a": [1.0] * 4, "b": [2.0] * 4}), "rows 4"),
        (lambda: compare_scores({"a": [1.0] * 9, "b": [np.nan] * 9}), "scores b"),
        (lambda: compare_scores({"a": [1.0] * 9, "b": [2.0] * 9}, groups=[1] * 8), "rows 9"),
        (lambda: compare_scores({"a": [1.0] * 9, "b": [2.0] * 9}, groups=[1] * 9), "1 groups"),
        (lambda: compare_models({"a": DensityEstimator(), "b": DensityEstimator()}, []), "fitted"),
        (lambda: Groups.of("abc", 4), "label 4"),
        (lambda: ComparisonSettings(bootstrap=10), "bootstrap"),
    ],
)
def test_mistakes(call: Any, message: str) -> None:
    with refused(*message.split()):
        call()


def test_models_are_compared_in_one_measure() -> None:
    rng = np.random.default_rng(6)
    angles = rng.vonmises([0.0, 1.0], 4.0, (160, 2))
    good = DensityEstimator(components="mixture").fit(angles[:80])
    poor = DensityEstimator(components="mixture").fit(rng.uniform(-3, 3, (80, 2)))
    found = compare_models({"good": good, "poor": poor.density_}, angles[80:])
    assert isinstance(found, ModelComparison)
    assert found.best == "good"
    assert found.scores[0].mean == pytest.approx(good.score(angles[80:]))
    degrees = DensityEstimator(unit="degrees", components="mixture").fit(np.degrees(angles[:80]))
    with refused("deg", "degrees"):
        compare_models({"rad": good, "deg": degrees}, angles)
    globe = DensityEstimator("sphere", unit="degrees", components="mixture").fit(angles[:80])
    with refused("2", "angles", "globe"):
        compare_models({"flat": good, "globe": globe}, angles)
