"""Two data sets: a test that is exact, powerful and mindful of groups; divergences; row sketches."""

import json
import math
from typing import Any

import numpy as np
import pytest
import torch
from scipy.stats import binom, vonmises

import orbiflow.density as od
from orbiflow.density.comparing import RowSketch, mmd_test
from orbiflow.density.comparing.resampling import Groups, chosen_rows
from orbiflow.runtime import from_json, to_json
from refusals import refused

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")


@pytest.fixture(autouse=True)
def _fewer_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a hundred rows the widths of kernels need no half a million pairs."""
    monkeypatch.setattr("orbiflow.density.comparing.resampling.PAIRS", 20_000)


def p_of(space: str, points: torch.Tensor, first: np.ndarray, labels: Any, seed: int) -> float:
    groups = Groups.of(labels, len(points))
    return mmd_test(od.make_space(space), points, first, groups, permutations=99, seed=seed).p


@pytest.mark.parametrize("space", SPACES)
def test_p_is_even_without_a_difference_and_small_with_one(space: str) -> None:
    made = od.make_space(space)
    none, some = [], []
    for trial in range(16):
        torch.manual_seed(trial)
        points = made.project(0.4 + 0.15 * torch.randn(60, 2, dtype=torch.float64))
        first = np.arange(60) < 25
        none.append(p_of(space, points, first, None, trial))
        moved = made.project(points + 0.2 * torch.as_tensor(first)[:, None])
        some.append(p_of(space, moved, first, None, trial))
    assert 0.3 < np.mean(none) < 0.7
    assert np.mean(np.array(none) <= 0.1) < 0.3
    assert np.mean(np.array(some) <= 0.05) > 0.8


DESIGNS = {
    "20 of 10 rows, 20 of 1": ([(10, 0)] * 20 + [(0, 1)] * 20, False),
    "30 shared, 8 rows and 1": ([(8, 1)] * 30, False),
    "6 of 8 rows, 6 of 1": ([(8, 0)] * 6 + [(0, 1)] * 6, False),
    "shared and not": ([(7, 2)] * 8 + [(3, 0)] * 9 + [(0, 6)] * 12, False),
    "8 of 4 rows, 8 of 4": ([(4, 0)] * 8 + [(0, 4)] * 8, True),
}
"""Rows of each group in the first data set and in the second, and whether p is exact."""


@pytest.mark.parametrize("design", DESIGNS)
def test_the_level_holds_whatever_the_sizes_of_groups(design: str) -> None:
    sizes, exact = DESIGNS[design]
    labels = np.repeat(np.arange(len(sizes)), np.sum(sizes, axis=1))
    first = np.concatenate([np.arange(own + other) < own for own, other in sizes])
    groups, space, wrong, trials = Groups.of(labels, len(labels)), od.make_space("torus"), 0, 30
    for trial in range(trials):
        rng = np.random.default_rng(trial)
        normal = rng.normal(size=(len(labels), 2)), rng.normal(size=(len(sizes), 2))
        angles = np.sqrt(0.4) * normal[0] + np.sqrt(0.6) * normal[1][labels]
        points = torch.as_tensor((angles / 8) % 1)
        found = mmd_test(space, points, first, groups, permutations=59, seed=trial)
        assert found.exact is exact
        wrong += found.p <= 0.05
    assert wrong <= binom.isf(1e-3, trials, 0.05)


def test_a_difference_between_groups_of_different_sizes_is_found() -> None:
    sizes, _ = DESIGNS["20 of 10 rows, 20 of 1"]
    labels = np.repeat(np.arange(40), np.sum(sizes, axis=1))
    rng = np.random.default_rng(0)
    points = torch.as_tensor(rng.normal(0.1 + 0.15 * (labels < 20)[:, None], 0.1, (220, 2)) % 1)
    assert p_of("torus", points, labels < 20, labels, 0) <= 0.05


@pytest.mark.parametrize(
    ("own", "other", "both", "enough"),
    [
        ([4] * 3, [4] * 3, [], False), ([4] * 4, [4] * 4, [], True), ([4] * 3, [4] * 4, [], True),
        ([4] * 2, [4] * 40, [], False), ([4] * 5, [2] * 50, [], False),
        ([4] * 6, [2] * 6, [], True), ([], [], [(3, 3)] * 5, False), ([], [], [(3, 1)] * 5, False),
        ([], [], [(3, 1)] * 6, True), ([4] * 2, [3] * 2, [(2, 1)] * 4, True),
    ],
)  # fmt: skip
def test_too_few_groups_are_refused(
    own: list[int], other: list[int], both: list[tuple[int, int]], enough: bool
) -> None:
    sizes = [(rows, 0) for rows in own] + [(0, rows) for rows in other] + both
    labels = np.repeat(np.arange(len(sizes)), np.sum(sizes, axis=1))
    first = np.concatenate([np.arange(one + two) < one for one, two in sizes])
    points = (
        torch.rand(len(labels), 2, dtype=torch.float64) / 20 + 0.4 * torch.as_tensor(first)[:, None]
    )
    if not enough:
        with refused("0.95"):
            p_of("torus", points, first, labels, 0)
        return
    # far apart, and as clearly as so few can tell
    assert p_of("torus", points, first, labels, 0) <= 0.06
    space, none = od.make_space("torus"), Groups.of(None, len(first))
    with refused("99", "permutations"):
        mmd_test(space, points, first, none, permutations=99, level=0.999)


def test_whole_groups_are_drawn() -> None:
    labels = np.random.default_rng(0).integers(0, 40, 1000)
    groups = Groups.of(labels, 1000)
    kept = chosen_rows(labels < 15, groups, 300)
    assert 200 < len(kept) <= 300
    for label in np.unique(labels[kept]):
        assert (labels[kept] == label).sum() == (labels == label).sum()
    assert chosen_rows(labels < 15, groups, 5000).tolist() == list(range(1000))


def test_divergences_are_near_those_of_the_densities() -> None:
    rng = np.random.default_rng(0)
    kappa, shift, rows = 3.0, 1.2, 500
    one = rng.vonmises([0.0, 0.0], kappa, (rows, 2))
    other = rng.vonmises([0.0, shift], kappa, (rows, 2))
    found = od.compare_samples(
        {"a": one, "b": other},
        settings=od.DataComparisonSettings(permutations=99, bootstrap=150, divergence=True),
    ).divergence
    assert found is not None
    t = (np.arange(4000) + 0.5) / 4000 * 2 * math.pi - math.pi
    p, q = vonmises.pdf(t, kappa), vonmises.pdf(t, kappa, loc=shift)
    step = 2 * math.pi / 4000
    jensen = step * (p * np.log(2 * p / (p + q)) + q * np.log(2 * q / (p + q))).sum() / 2
    kl = step * (p * np.log(p / q)).sum()
    accuracy = step * np.maximum(p, q).sum() / 2
    assert jensen * 0.7 < found.jensen_shannon.value < jensen + 3 * found.jensen_shannon.error
    assert found.accuracy.value == pytest.approx(accuracy, abs=3 * found.accuracy.error + 0.01)
    for estimate in (found.first_to_second, found.second_to_first):
        assert estimate.value == pytest.approx(kl, rel=0.25)
        assert estimate.low < estimate.value < estimate.high


def test_data_far_apart_and_few_rows() -> None:
    rng = np.random.default_rng(1)
    far = od.compare_samples(
        {"a": rng.vonmises(0, 50, (60, 2)), "b": rng.vonmises(3, 50, (60, 2))},
        settings=od.DataComparisonSettings(bootstrap=100, divergence=True),
    )
    assert far.differ
    assert far.divergence is not None
    assert far.divergence.jensen_shannon.value == pytest.approx(math.log(2), abs=0.05)
    assert far.divergence.accuracy.value > 0.98
    few = od.compare_samples(
        {"a": rng.vonmises(0, 1, (8, 2)), "b": rng.vonmises(0, 1, (9, 2))},
        settings=od.DataComparisonSettings(divergence=True),
    )
    assert few.divergence is None
    assert any("not estimated" in note for note in few.notes)
    assert json.loads(json.dumps(to_json(few), allow_nan=False))["divergence"] is None
    same = rng.vonmises(0, 1, (30, 2))
    alike = od.compare_samples(
        {"a": same, "b": same}, settings=od.DataComparisonSettings(permutations=99)
    )
    assert (alike.differ, alike.divergence, alike.notes) == (False, None, ())  # nobody asked


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: od.compare_samples({"a": a}), "data sets"),
        (lambda a: od.compare_samples({"a": a, "b": a[:, :1]}), "columns 2 1"),
        (lambda a: od.compare_samples({"a": a, "b": a[:2]}), "their"),
        (lambda a: od.compare_samples({"a": a, "b": a}, "cube"), "unknown space"),
        (lambda a: od.compare_samples({"a": a, "b": a}, groups={"a": [1], "b": [2]}), "rows 20"),
        (
            lambda a: od.compare_samples(
                {"a": a, "b": a}, settings=od.DataComparisonSettings(permutations=3)
            ),
            "permutations",
        ),
        (
            lambda a: od.compare_samples({"a": a, "b": a}, groups={"a": [1] * 20, "b": [2] * 20}),
            "2 groups",
        ),
    ],
)
def test_mistakes(call: Any, message: str) -> None:
    with refused(*message.split()):
        call(np.random.default_rng(0).vonmises(0, 1, (20, 2)))


@pytest.mark.parametrize("test", [od.compare_samples, od.named_tests])
def test_what_columns_declare_of_rows_counts(test: Any) -> None:
    rng, nests = np.random.default_rng(0), np.repeat(np.arange(8), 5)
    rows = {
        name: np.column_stack([rng.vonmises(0, 1, 40), nests + k])
        for k, name in ((0, "a"), (8, "b"))
    }
    angles = {name: own[:, :1] for name, own in rows.items()}
    labels = {name: own[:, 1] for name, own in rows.items()}
    kind = od.DataComparisonSettings if test is od.compare_samples else od.NamedTestSettings
    how = {"settings": kind(permutations=99)}
    declared = test(rows, columns="phi=angle,nest=group", **how)
    assert declared == test(angles, columns="phi=angle", groups=labels, **how)
    with refused("group", "groups"):
        test(rows, columns="phi=angle,nest=group", groups=labels)
    with refused("weight", "ignore"):
        test(rows, columns="phi=angle,nest=weight")


@pytest.mark.parametrize("test", [od.compare_samples, od.named_tests])
def test_columns_of_data_sets_are_found_by_name(test: Any) -> None:
    pandas = pytest.importorskip("pandas")
    rng = np.random.default_rng(0)
    first, second = (
        pandas.DataFrame(rng.vonmises([0, 2], 4, (30, 2)), columns=["phi_rad", "psi_rad"])
        for _ in "ab"
    )
    mixed = second[["psi_rad", "phi_rad"]]
    assert test({"a": first, "b": second}) == test({"a": first, "b": mixed})
    with refused("a{}", "b", "psi_rad", "chi_rad", "columns"):
        test({"a{}": first, "b": second.rename(columns={"psi_rad": "chi_rad"})})


@pytest.mark.parametrize("name", ["klein-bottle", "projective-plane"])
def test_rows_are_known_again_however_they_are_written(name: str) -> None:
    rng = np.random.default_rng(0)
    space, data = od.make_space(name), rng.uniform(-1, 1, (5000, 2)).round(4)
    sketch = from_json(RowSketch, json.loads(json.dumps(to_json(RowSketch.of(space, data)))))
    new = rng.uniform(-1, 1, (3000, 2))
    known, looked_up = sketch.known(space, np.concatenate([data[:1000], new]))
    assert 0.3 * 4000 < looked_up < 0.5 * 4000
    assert known == sketch.known(space, data[:1000])[1]
    assert sketch.known(space, new)[0] == 0
    if not space.is_round:
        turned = data + 2 * np.pi * np.array([1, -2])
        assert sketch.known(space, turned)[0] >= 0.99 * sketch.known(space, data)[0]


def test_directions_are_known_in_another_form_and_frame() -> None:
    rng = np.random.default_rng(0)
    data = np.degrees(rng.uniform(-1, 1, (500, 2)))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    sketch = RowSketch.of(od.Sphere(), data)
    other = od.Sphere(form="vector", rotation=turn)
    vectors = od.Sphere(form="vector").from_chart(od.Sphere().to_chart(data))
    assert sketch.known(other, vectors)[0] >= 0.99 * 500
    for hashes in ([3, 2], [], [-1], [2**53], [0.5]):
        with refused("hashes"):
            from_json(RowSketch, {"rows": 3, "whole": True, "hashes": hashes})
