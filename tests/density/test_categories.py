"""Densities where a category is known: what rare ones borrow, exact mass, files, and scores of rows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import optimize, special

from orbiflow.density import DensityEstimator
from orbiflow.density.categories import CategoryDensity, fit_categories, shared_weight
from orbiflow.density.run_folder import category_files
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Outcome, Table, find

MEANS = {"ALA": 0.0, "P/O": 2.0, "rare": -2.0}


def drawn(counts: tuple[int, ...] = (150, 100, 6)) -> tuple[NDArray[Any], NDArray[Any]]:
    """Angles (N, 1) about the means of words (N,)."""
    words = np.repeat(list(MEANS), counts)
    rng = np.random.default_rng(0)
    angles = rng.vonmises([MEANS[word] for word in words], 6.0)
    return angles[:, None], words


@pytest.fixture(scope="module")
def found() -> tuple[DensityEstimator, dict[str, CategoryDensity]]:
    angles, words = drawn()
    pooled = DensityEstimator("torus", unit="radians", components="mixture").fit(angles)
    return pooled, fit_categories(pooled, angles, words)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=30),
    st.floats(0.1, 3.0),
)
def test_the_weight_is_the_likeliest(rows: list[tuple[float, float]], scale: float) -> None:
    table = torch.tensor(rows, dtype=torch.float64).T
    own, rest = table.numpy()

    def loss(weight: float) -> float:
        logs = np.logaddexp(np.log(weight) + own, np.log1p(-weight) + rest)
        return -float(logs.sum() + special.xlogy(1, weight) + special.xlog1py(1, -weight))

    best = optimize.minimize_scalar(loss, bounds=(1e-9, 1 - 1e-9), method="bounded")
    weight = shared_weight(table)
    assert loss(weight) <= best.fun + 2e-4 * (len(rows) + 2)
    counted = shared_weight(table, torch.full((len(rows),), scale, dtype=torch.float64))
    assert counted == pytest.approx(weight, abs=1e-6)  # only ratios count


def test_each_is_exactly_normalised_and_between_its_own_and_all(found: Any) -> None:
    pooled, parts = found
    line = np.linspace(-np.pi, np.pi, 4001)[:-1, None]
    of_all = np.exp(pooled.score_samples(line))
    for own in parts.values():
        density = np.exp(own.estimator.score_samples(line))
        assert density.mean() * 2 * np.pi == pytest.approx(1, abs=1e-9)
        assert (density >= (1 - own.weight) * of_all * (1 - 1e-9)).all()


def test_frequent_categories_are_known_and_rare_ones_borrow(found: Any) -> None:
    pooled, parts = found
    assert list(parts) == ["ALA", "P/O", "rare"]
    assert [own.rows for own in parts.values()] == [150, 100, 6]
    new, words = drawn((400, 400, 400))
    for word in ("ALA", "P/O"):
        own = parts[word]
        assert own.weight > 0.9
        assert own.gain > 3 * own.gain_error > 0
        some = new[words == word]
        assert own.estimator.score(some) > pooled.score(some) + 0.2
        assert own.estimator.mean()[0] == pytest.approx(MEANS[word], abs=0.15)
    rare = parts["rare"]
    assert rare.weight == 0
    assert "at least 10 different points" in rare.note
    assert np.allclose(rare.estimator.score_samples(new), pooled.score_samples(new))


def test_categories_that_do_not_matter_cost_little() -> None:
    angles = np.random.default_rng(1).vonmises(0, 2, (240, 1))
    words = np.tile(["a", "b"], 120)
    pooled = DensityEstimator("torus", unit="radians", components="mixture").fit(angles)
    new = np.random.default_rng(2).vonmises(0, 2, (2000, 1))
    for own in fit_categories(pooled, angles, words).values():
        assert own.estimator.score(new) > pooled.score(new) - 0.03


def test_bad_categories_are_refused(found: Any) -> None:
    pooled, _ = found
    angles, words = drawn()
    for wrong, message in (
        (words[:5], "expected one for each of 256 rows"),
        (["a"] * 256, "expected 2 to 1000 different ones, got 1"),
    ):
        with pytest.raises(OrbiflowError, match=message):
            fit_categories(pooled, angles, wrong)
    with pytest.raises(OrbiflowError, match="not fitted yet"):
        fit_categories(DensityEstimator(), angles, words)


def test_groups_are_held_out_whole() -> None:
    angles, words = drawn((60, 60, 0))
    groups = np.arange(120) // 5
    pooled = DensityEstimator("torus", unit="radians", components="mixture").fit(angles)
    parts = fit_categories(pooled, angles, words, groups=groups, sample_weight=np.full(120, 2.0))
    assert all(own.weight > 0.5 for own in parts.values())


def test_commands_fit_and_score_where_a_word_is_known(tmp_path: Path) -> None:
    angles, words = drawn((60, 60, 0))
    table, model, scores = (tmp_path / name for name in ("rows.csv", "fit", "scores.csv"))
    lines = [f"{angle:.6f},{word}" for angle, word in zip(angles[:, 0], words, strict=True)]
    table.write_text("\n".join(["phi,residue", *lines]))
    told: list[Any] = []
    options = {"space": "torus", "unit": "radians", "components": ["mixture"], "given": "residue"}
    find("density fit").call({"data": table, "out": model, **options}).run(told.append)
    shown = next(one for one in told if isinstance(one, Table))
    assert shown.columns == ("residue", "rows", "own", "nats", "error", "mean phi")
    said = json.loads((model / "report.json").read_text())["categories"]
    for word in ("ALA", "P/O"):
        assert said[word]["mean"] == [pytest.approx(MEANS[word], abs=0.2)]
    files = category_files(model)
    assert files == {"ALA": "category-ALA.safetensors", "P/O": "category-P_O.safetensors"}
    asked = {"data": table, "out": scores, "model": model, "given": ["residue"]}
    result: Outcome = find("density score").call(asked).run()
    assert result.summary["rows"] == 120
    rows = scores.read_text().splitlines()
    assert rows[0] == "phi,residue,log_prob_given"
    one = {**asked, "model": model / files["ALA"], "given": [], "out": tmp_path / "one.csv"}
    find("density score").call(one).run()
    alone = (tmp_path / "one.csv").read_text().splitlines()
    assert [row for row in rows if "ALA" in row] == [row for row in alone if "ALA" in row]
    table.write_text("phi,residue\n1.0,ALA\n2.0,TRP\n")
    with pytest.raises(OrbiflowError, match="column 'residue' has TRP, and the model knows ALA"):
        find("density score").call(asked).run()


def test_files_of_others_name_no_other_folder(tmp_path: Path) -> None:
    document = {"given": "residue", "categories": {"a": {"file": "../category-a.safetensors"}}}
    (tmp_path / "report.json").write_text(json.dumps(document))
    assert category_files(tmp_path) == {}
