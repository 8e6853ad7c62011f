"""Summaries of orientations: means modulo symmetry, and their cones."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orbiflow.density import RotationSpace, summarize_orientations
from refusals import refused
from strategies import seeds

GROUPS = st.sampled_from(["C1", "C2y", "D2", "D3", "D6", "O"])


def about(mean: Rotation, degrees: float, count: int, seed: int) -> Rotation:
    steps = np.random.default_rng(seed).normal(0, math.radians(degrees), (count, 3))
    return mean * Rotation.from_rotvec(steps)


@settings(max_examples=5)
@given(crystal=GROUPS, specimen=GROUPS, seed=seeds)
def test_the_mean_is_found_whatever_images_rows_are(crystal: str, specimen: str, seed: int) -> None:
    space = RotationSpace(symmetry=crystal, specimen=specimen)
    mean = Rotation.random(random_state=seed)
    turns = about(mean, 1.0, 60, seed)
    rng = np.random.default_rng(seed)
    lefts, rights = space.specimen_rotations, space.crystal_rotations
    moved = lefts[rng.integers(len(lefts), size=60)] * turns
    moved = moved * rights[rng.integers(len(rights), size=60)]
    found = summarize_orientations(space, moved.as_quat())
    # SciPy's mean of rows that were not moved, unless an axis of symmetry folds them
    plain = torch.tensor(turns.mean().as_quat())
    near = space.misorientations(torch.tensor(turns.as_quat()), plain).numpy()
    folded = not np.allclose(near, (turns * turns.mean().inv()).magnitude(), atol=1e-9)
    off = math.degrees(float(space.misorientations(torch.tensor([found.mean]), plain)[0]))
    assert off < (2 if folded else 1e-4)
    assert found.cone is not None
    assert 0 < found.cone < 1.5
    assert found.half == pytest.approx(1.6, abs=0.9)
    assert found.spread == pytest.approx(1.6, abs=0.9)


def test_the_cone_holds_the_true_mean_as_often_as_it_says() -> None:
    space = RotationSpace(symmetry="O")
    truth, held = Rotation.from_euler("ZXZ", [20, 35, 10], degrees=True), 0
    target = torch.tensor(truth.as_quat())
    for seed in range(60):
        found = summarize_orientations(space, about(truth, 4.0, 40, seed).as_quat(), level=0.9)
        assert found.cone is not None
        off = space.misorientations(torch.tensor([found.mean]), target)[0]
        held += math.degrees(float(off)) <= found.cone
    # 54 are expected, with a deviation of 2.3
    assert 47 <= held <= 59


def test_rows_of_a_group_count_once_and_weights_as_repeats() -> None:
    space, truth = (
        RotationSpace(symmetry="O"),
        Rotation.from_euler("ZXZ", [20, 35, 10], degrees=True),
    )
    rows = about(truth, 4.0, 30, 0).as_quat()
    single = summarize_orientations(space, rows)
    every = np.repeat(rows, 4, axis=0)
    grouped = summarize_orientations(space, every, groups=np.repeat(np.arange(30), 4))
    assert grouped.mean == pytest.approx(single.mean, abs=1e-9)
    assert single.cone is not None
    assert grouped.cone is not None
    assert single.cone < grouped.cone < 1.3 * single.cone
    weights = np.arange(30) % 3
    weighed = summarize_orientations(space, rows, weights=weights)
    repeated = summarize_orientations(space, np.repeat(rows, weights, axis=0))
    assert weighed.mean == pytest.approx(repeated.mean, abs=1e-9)
    assert weighed.spread == pytest.approx(repeated.spread)


def test_weights_that_do_not_fit_are_refused() -> None:
    with refused("weights", "4"):
        summarize_orientations(RotationSpace(), np.eye(4), weights=[1.0])
