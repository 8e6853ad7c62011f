"""The scorer of deformation energies, and the arithmetic of blind comparisons."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from orbiflow.tiles import resampled

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
NAMES = ("common", "likeness_methods", "likeness_energy", "likeness_blind")


@pytest.fixture(name="load")
def load_fixture(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Benchmarks by name, imported anew."""
    monkeypatch.setenv("ORBIFLOW_DATA", str(tmp_path))
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for name in NAMES:
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield importlib.import_module
    for name in NAMES:
        monkeypatch.delitem(sys.modules, name, raising=False)


def similar(ring: np.ndarray, mirrored: bool) -> np.ndarray:
    turned = 3 * ring @ np.array([[0.6, -0.8], [0.8, 0.6]]) + (5, 7)
    return turned[::-1] * (1, -1) if mirrored else turned


@pytest.mark.parametrize("name", ["bat_60", "spider_120"])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_similar_copy_costs_nothing(load, name: str, mirrored: bool) -> None:
    outline = np.asarray(load("common").goal(name).normal)
    scorer = load("likeness_energy").Scorer(outline)
    copy = similar(np.roll(outline, 17, axis=0), mirrored)
    assert scorer.of_vertices(copy) == pytest.approx(0, abs=1e-12)
    # points miss the vertices: the energy is small, not nothing
    points = similar(np.roll(resampled(outline, 240), 31, axis=0), mirrored)
    assert scorer.of_points(points) < 0.02
    fine = resampled(outline, 600, 0.3)
    own = similar(fine, mirrored=False)
    assert scorer.of_images(np.roll(own, 9, 0), np.roll(fine, 9, 0)) < 0.004


def test_energy_is_that_of_the_strain(load) -> None:
    """Stretched by (1 + e) along x and 1 / (1 + e) along y: 2 e^2 times the area, no rotation.

    Cotangent weights integrate the Dirichlet energy of linear maps, here e^2 + e^2, whatever the
    mesh; clipping changes a little.
    """
    outline = np.asarray(load("common").goal("penguin_60").normal)
    scorer = load("likeness_energy").Scorer(outline)
    stretched = outline * (1.02, 1 / 1.02)
    assert scorer.of_vertices(stretched) == pytest.approx(2 * 0.02**2, rel=0.15)


def test_answers_become_ranks(load) -> None:
    ranks = load("likeness_blind").ranks
    assert ranks([3, 1, 2], "ranking", 3) == [2, 3, 1]
    assert ranks([5, 8, 5], "scores", 3) == [2.5, 1, 2.5]
    for answer, kind in (([1, 1, 2], "ranking"), ([1, 2], "scores"), ([1, 2, 11], "scores")):
        with pytest.raises(ValueError, match=r"needed|needs"):
            ranks(answer, kind, 3)
    with pytest.raises(ValueError, match="kind"):
        ranks([1, 2, 3], "marks", 3)


def test_the_key_says_whose_the_numbers_are(load) -> None:
    blind = load("likeness_blind")
    key = {"rounds": {"2": {"bat": ["arap", "likeness"], "elk": ["likeness", "arap"]}}}
    answers = {"round": 2, "kind": "ranking", "answers": {"bat": [2, 1], "elk": [1, 2]}}
    rows = blind.judged(key, answers)
    both = {"likeness": 1, "arap": 2}
    assert rows == [("bat", both), ("elk", both)]
    assert blind.preferred([row for _, row in rows], "likeness", "arap") == (2, 2)
    assert blind.preferred([{"likeness": 1.5, "est": 1.5}, both], "likeness", "est") == (0.5, 1)
    with pytest.raises(ValueError, match="elk"):
        blind.judged(key, {**answers, "answers": {"bat": [1, 2]}})


def test_orders_are_repeatable_and_differ_from_sheet_to_sheet(load) -> None:
    shuffled = load("likeness_blind").shuffled
    methods = list("abcde")
    orders = [shuffled(methods, 3, turn, index) for turn in (1, 2) for index in range(9)]
    assert orders[0] == shuffled(methods, 3, 1, 0)
    assert all(sorted(order) == methods for order in orders)
    assert len({tuple(order) for order in orders}) > 12
