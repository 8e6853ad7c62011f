"""Splits of a cross-validation: partitions that keep together what belongs together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import ComparisonSettings, compare_scores, cross_validation_folds
from refusals import refused

labels = st.lists(st.integers(0, 30), min_size=2, max_size=200)
seeds = st.integers(0, 2**63 - 1)


@given(labels, st.integers(2, 12), seeds, st.integers(0, 50))
def test_folds_are_a_partition_that_splits_no_group(
    together: list[int], folds: int, seed: int, split: int
) -> None:
    units = len(set(together))
    if units < folds:
        with refused(units):
            cross_validation_folds(len(together), folds, together=together, seed=seed, split=split)
        return
    found = cross_validation_folds(len(together), folds, together=together, seed=seed, split=split)
    assert set(found.tolist()) == set(range(folds))  # none is empty
    for label in set(together):
        assert len(set(found[np.array(together) == label].tolist())) == 1
    rows = np.bincount(found)
    assert rows.max() - rows.min() <= np.unique(together, return_counts=True)[1].max()
    again = cross_validation_folds(len(together), folds, together=together, seed=seed, split=split)
    assert (found == again).all()


@given(st.integers(2, 500), st.integers(2, 12), seeds)
def test_single_rows_are_dealt_out_evenly(rows: int, folds: int, seed: int) -> None:
    if rows < folds:
        with refused("rows", rows):
            cross_validation_folds(rows, folds, seed=seed)
        return
    counts = np.bincount(cross_validation_folds(rows, folds, seed=seed), minlength=folds)
    assert counts.sum() == rows
    assert counts.max() - counts.min() <= 1


def test_each_repetition_and_each_seed_is_another_split() -> None:
    found = [
        cross_validation_folds(100, 5, seed=seed, split=split).tolist()
        for seed in range(3)
        for split in range(3)
    ]
    assert len({tuple(one) for one in found}) == 9


@pytest.mark.parametrize("folds", [1, 0, -3, 2.5, True, 10**9])
def test_no_number_of_folds(folds: object) -> None:
    with refused("folds"):
        cross_validation_folds(100, folds)  # type: ignore[arg-type]


@given(st.integers(0, 2**31), st.integers(6, 40))
def test_whole_weights_of_scores_are_copies_of_rows(seed: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    table = {name: rng.normal(size=rows) for name in "ab"}
    weights = rng.integers(1, 4, size=rows)
    weighed = compare_scores(
        table, weights=weights, settings=ComparisonSettings(bootstrap=100, seed=1)
    )
    copied = compare_scores(
        {name: np.repeat(value, weights) for name, value in table.items()},
        groups=np.repeat(np.arange(rows), weights),
        settings=ComparisonSettings(bootstrap=100, seed=1),
    )
    for one, other in zip(weighed.scores, copied.scores, strict=True):
        assert one.name == other.name
        assert one.mean == pytest.approx(other.mean)
        assert one.error == pytest.approx(other.error)
    one, other = weighed.differences[0], copied.differences[0]
    assert (one.low, one.high, one.p) == pytest.approx((other.low, other.high, other.p))
    assert one.share == pytest.approx(other.share)


@pytest.mark.parametrize("weights", [[1.0] * 7, [0.0, *[1.0] * 7], [-1.0, *[1.0] * 7]])
def test_no_weights_of_scores(weights: list[float]) -> None:
    with refused("weights", "8", "0"):
        compare_scores({"a": np.arange(8.0), "b": np.ones(8)}, weights=weights)
