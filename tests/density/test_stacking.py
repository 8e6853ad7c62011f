"""Weights by held-out rows, folds, repeats, mixtures by EM: what a fit by evidence is made of."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import DensitySettings, fit_automatic, make_space
from orbiflow.density.data import group_numbers
from orbiflow.density.fitting import Rows, folds_of, sparse_weights, stacked, stacking_weights
from orbiflow.density.fitting.held_out import FOLDS, TOLERANCE_NATS, supported_weights
from orbiflow.density.fitting.kernels import fit_mixture, kernel_estimates
from refusals import refused

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")
seeds = st.integers(0, 2**31)


def clustered(name: str, count: int, seed: int) -> torch.Tensor:
    """Canonical points about three places."""
    rng = np.random.default_rng(seed)
    centers = np.array([[0.3, 0.6], [0.8, 0.2], [0.5, 0.45]])[rng.integers(3, size=count)]
    return make_space(name).project(torch.tensor(centers + 0.04 * rng.normal(size=(count, 2))))


@given(seeds, st.integers(2, 8), st.integers(1, 100))
@settings(deadline=None)
def test_no_other_weights_are_better(seed: int, parts: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    table = torch.tensor(3 * rng.normal(size=(parts, rows)))
    weights = stacking_weights(table)
    assert float(weights.sum()) == pytest.approx(1)
    best = float(stacked(table, weights).mean())
    for other in torch.tensor(rng.dirichlet(np.ones(parts), 20)):
        assert float(stacked(table, other).mean()) <= best + 2 * TOLERANCE_NATS


@given(seeds)
@settings(deadline=None)
def test_what_must_be_there_is_and_what_is_negligible_is_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = torch.tensor(rng.normal(size=(6, 50)))
    table[-1] -= 50.0
    always = torch.arange(6) == 5
    weights = sparse_weights(table, always)
    assert float(weights[-1]) >= 0.4 / 51
    assert float(weights.sum()) == pytest.approx(1)
    assert not bool(((weights > 0) & (weights < 2e-3)).any())


@given(seeds, st.integers(1, 40))
@settings(deadline=None)
def test_spikes_need_more_rows_than_a_close_pair(seed: int, pairs: int) -> None:
    rng, rows = np.random.default_rng(seed), 600
    smooth, spikes = 1 + 0.3 * rng.normal(size=rows), np.full(rows, -400.0)
    spikes[: 2 * pairs] = 6.0 + rng.normal(size=2 * pairs)  # each of a pair is held out in its turn
    table = torch.tensor(np.stack([smooth, spikes, np.zeros(rows)]))
    always = torch.arange(3) == 2
    weights = supported_weights(table, always)
    assert float(weights.sum()) == pytest.approx(1)
    if pairs <= 1:
        assert float(weights[1]) == 0
    if pairs >= 10:
        assert torch.equal(weights, sparse_weights(table, always))
        assert float(weights[1]) > 0.01


@pytest.mark.parametrize("name", SPACES)
def test_a_mixture_finds_clusters(name: str) -> None:
    space, points = make_space(name), clustered(name, 300, 1)
    generator = torch.Generator().manual_seed(0)
    one, three = (fit_mixture(space, Rows(points), k, generator=generator) for k in (1, 3))
    test = clustered(name, 300, 2)
    assert float(three.log_prob(test).mean()) > float(one.log_prob(test).mean()) + 0.3
    again = fit_mixture(space, Rows(points), 1, generator=torch.Generator().manual_seed(0))
    assert torch.equal(again.concentrations, one.concentrations)


@pytest.mark.parametrize("name", ["torus", "sphere"])
def test_kernel_estimates_know_repeats(name: str) -> None:
    space = make_space(name)
    points = clustered(name, 60, 0)
    found = kernel_estimates(space, Rows(torch.cat([points, points[:5]])), narrowest=100.0)
    assert {"repeated", "near 2, 0.4, 1" if space.is_round else "near 2, 0.4, 0.3"} <= set(found)
    alone = kernel_estimates(space, Rows(torch.cat([points, points[:5]])), repeats=False)
    assert "repeated" not in alone


@pytest.mark.parametrize(("name", "images"), [("sphere", 1), ("projective-plane", 2)])
def test_as_many_rows_have_kernels_as_images_allow(name: str, images: int, monkeypatch) -> None:
    monkeypatch.setattr("orbiflow.density.fitting.kernels.MOST_IMAGES", 40)
    found = kernel_estimates(make_space(name), Rows(clustered(name, 60, 0)))
    assert {len(part.weights) for part in found.values()} == {40 // images}


@given(seeds, st.integers(30, 300), st.booleans())
@settings(max_examples=15, deadline=None)
def test_folds_part_the_rows(seed: int, count: int, together: bool) -> None:
    generator = torch.Generator().manual_seed(seed)
    points = torch.rand(20, 2, dtype=torch.float64, generator=generator)
    points = points[torch.randint(20, (count,), generator=generator)]
    folds = folds_of(Rows(points), together=together, generator=generator)
    assert torch.equal(folds.rows.points.sort(dim=0).values, points.sort(dim=0).values)
    assert sum(len(folds.held(k)) for k in range(FOLDS)) == count
    for number in range(folds.used):
        train, held = folds.train(number), folds.held(number)
        assert len(train) + len(held) == count
        if together:
            apart = (train.points[:, None] != held.points).any(dim=-1)
            assert bool(apart.all())


@given(seeds, st.integers(2, 40), st.integers(60, 300))
@settings(deadline=None)
def test_groups_are_held_out_whole(seed: int, count: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    labels = np.concatenate([np.arange(count), rng.integers(count, size=rows - count)])
    points = torch.tensor(rng.uniform(size=(rows, 2)))
    own = Rows(points, None, torch.as_tensor(group_numbers([f"g{k}" for k in labels], rows)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("orbiflow.density.fitting.held_out.USED", ((600, 10),))
        folds = folds_of(own, together=False, generator=torch.Generator().manual_seed(seed))
    assert folds.used == min(10, count)
    of = {int(g): set() for g in folds.rows.groups}  # type: ignore[union-attr]
    for group, fold in zip(folds.rows.groups.tolist(), folds.fold.tolist(), strict=True):  # type: ignore[union-attr]
        of[group].add(fold)
    assert all(len(found) == 1 for found in of.values())
    assert set(folds.fold.tolist()) == set(range(min(10, count)))
    held = torch.cat([folds.held(k).points for k in range(folds.used)])
    assert torch.equal(held.sort(dim=0).values, points.sort(dim=0).values)


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        ([0] * 40, "different 0"), ([0] * 37 + [1, 2, 3], "different 3"), ([0] * 20, "label 40"),
        ([None] * 40, "without 40"),
    ],
)  # fmt: skip
def test_groups_that_cannot_be_held_out(labels: list[object], said: str) -> None:
    space, points = make_space("torus"), torch.rand(40, 2, dtype=torch.float64)
    chosen = DensitySettings(components=("kernels", "mixture", "chains"))
    with refused(*said.split()):
        fit_automatic(space, points, chosen, groups=labels)  # type: ignore[arg-type]
    weights = torch.arange(40) < 20
    with refused("different", "0"):
        fit_automatic(space, points, chosen, weights=weights, groups=weights)  # type: ignore[arg-type]
