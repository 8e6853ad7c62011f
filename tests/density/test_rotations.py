"""Rotations and orientations: forms against SciPy, symmetries, means and their cones."""

import math
from typing import Any

import numpy as np
import pandas
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orbiflow.density import (
    AdaptiveKernels,
    DensityEstimator,
    RotationSpace,
    summarize_orientations,
)
from orbiflow.density.data import rotation_form
from orbiflow.density.spaces import rotation_group_name, rotations_of
from orbiflow.density.spaces.point_groups import NAMES
from orbiflow.errors import SettingError
from refusals import refused
from strategies import seeds

ORDERS = {"C1": 1, "C2": 2, "C2x": 2, "C2y": 2, "C3": 3, "C4": 4, "C6": 6, "D2": 4, "D3": 6}
ORDERS |= {"D3y": 6, "D4": 8, "D6": 12, "T": 12, "O": 24, "I": 60}
symmetries = st.sampled_from(sorted(NAMES))
small = st.sampled_from(["C1", "C2", "C2y", "C3", "C4", "D2", "D3", "D3y", "D4", "D6", "T", "O"])


def written(form: str, turns: Rotation) -> np.ndarray:
    """Return rotations as SciPy writes them in a form."""
    quaternions = turns.as_quat()
    if form == "scalar-first":
        return turns.as_quat(scalar_first=True)
    if form == "rodrigues":
        return quaternions[:, :3] / quaternions[:, 3:]
    if form in ("quaternion", "matrix", "vector"):
        every = {"quaternion": quaternions, "vector": turns.as_rotvec(degrees=True)}
        return every.get(form, turns.as_matrix().reshape(-1, 9))
    axes: Any = "ZXZ" if form == "bunge" else form
    return turns.as_euler(axes, degrees=True)


@settings(max_examples=40)
@given(
    seed=seeds,
    form=st.sampled_from(
        ["quaternion", "scalar-first", "vector", "rodrigues", "matrix", "bunge", "ZYZ", "xyz"]
    ),
    passive=st.booleans(),
)
def test_every_form_is_read_and_written_as_scipy_does(seed: int, form: str, passive: bool) -> None:
    turns = Rotation.random(12, random_state=seed)
    if passive and form == "bunge":
        with refused("passive", kind=SettingError):
            RotationSpace(form=form, passive=True)
        return
    space = RotationSpace(form=form, unit="degrees", passive=passive)
    data = written(form, turns)
    read = Rotation.from_quat(space.to_chart(data).numpy())
    wanted = turns.inv() if passive else turns
    assert (read * wanted.inv()).magnitude().max() < 1e-7
    again = space.from_chart(space.to_chart(data))
    assert again.shape == data.shape == (12, len(space.columns))
    same = Rotation.from_quat(space.to_chart(again).numpy())
    assert (same * wanted.inv()).magnitude().max() < 1e-7
    if form == "bunge":
        assert bool((again >= 0).all())


def test_bunges_angles_are_those_of_his_matrix() -> None:
    p, f, q = np.radians([30.0, 50.0, 70.0])
    c, s = np.cos([p, f, q]), np.sin([p, f, q])
    # Bunge, Texture Analysis in Materials Science (1982), equation 2.50: from specimen to crystal
    bunge = [
        [c[0] * c[2] - s[0] * s[2] * c[1], s[0] * c[2] + c[0] * s[2] * c[1], s[2] * s[1]],
        [-c[0] * s[2] - s[0] * c[2] * c[1], -s[0] * s[2] + c[0] * c[2] * c[1], c[2] * s[1]],
        [s[0] * s[1], -c[0] * s[1], c[1]],
    ]
    angles = RotationSpace(form="bunge", unit="degrees").to_chart([[30.0, 50.0, 70.0]])
    matrix = RotationSpace(form="matrix", passive=True).to_chart(np.reshape(bunge, (1, 9)))
    assert torch.allclose(angles, matrix, atol=1e-12)


def test_gradients_are_those_of_the_columns_that_came_in() -> None:
    quaternions = Rotation.random(6, random_state=0).as_quat()
    space = RotationSpace(form="scalar-first", passive=True)
    one = torch.ones(1, dtype=torch.float64)
    density = AdaptiveKernels(space, space.to_chart(quaternions[:1]), 5 * one[:, None], one)
    estimator, at = DensityEstimator.fitted(density), quaternions[1:]
    step = np.random.default_rng(0).normal(size=(5, 4))
    step -= (step * at).sum(axis=1, keepdims=True) * at
    ends = [at + sign * 1e-5 * step for sign in (1, -1)]
    up, down = (estimator.score_samples(e / np.linalg.norm(e, axis=1, keepdims=True)) for e in ends)
    slope = (estimator.score_gradient(at) * step).sum(axis=1)
    assert slope == pytest.approx((up - down) / 2e-5, abs=1e-6)


@given(name=symmetries)
@settings(max_examples=15)
def test_names_of_symmetries_stand_for_groups_of_rotations(name: str) -> None:
    for word in NAMES[name].split():
        assert rotation_group_name(word) == rotation_group_name(word.upper()) == name
    turns = rotations_of(name)
    assert len(turns) == ORDERS[name]
    assert turns[0].magnitude() < 1e-12
    products = Rotation.concatenate([one * turns for one in turns]).as_matrix()
    apart = abs(products[:, None] - turns.as_matrix()).max(axis=(2, 3))
    assert bool(((apart < 1e-9).sum(axis=1) == 1).all())


AXES_OF_ORDER_TWO = {
    "C2": "z", "C2x": "x", "C2y": "y", "D2": "xyz", "D3": "x", "D3y": "y", "D6": "xyz",
}  # fmt: skip


@pytest.mark.parametrize("name", AXES_OF_ORDER_TWO)
def test_axes_of_order_two_lie_as_the_names_say(name: str) -> None:
    matrices = rotations_of(name).as_matrix()
    found = ""
    for axis, unit in zip("xyz", np.eye(3), strict=True):
        half = 2 * np.outer(unit, unit) - np.eye(3)
        found += axis * bool((abs(matrices - half).max(axis=(1, 2)) < 1e-9).any())
    assert found == AXES_OF_ORDER_TWO[name]


def test_monoclinic_symmetries_must_say_their_axis() -> None:
    for name in ("2", "monoclinic"):
        with refused("112", kind=SettingError):
            RotationSpace(symmetry=name)
    with refused("specimen", "432", kind=SettingError):
        RotationSpace(specimen="cubes")


@settings(max_examples=6)
@given(crystal=small, specimen=small, seed=seeds)
def test_densities_are_invariant_under_both_symmetries(
    crystal: str, specimen: str, seed: int
) -> None:
    space = RotationSpace(symmetry=crystal, specimen=specimen)
    generator = torch.Generator().manual_seed(seed)
    kappa = torch.tensor([[2.0], [6.0]], dtype=torch.float64)
    weights = torch.tensor([0.3, 0.7], dtype=torch.float64)
    density = AdaptiveKernels(space, space.uniform(2, generator), kappa, weights)
    turns = Rotation.random(8, random_state=seed)
    values = density.log_prob(space.to_chart(turns.as_quat()), measure="natural")
    rng = np.random.default_rng(seed)
    left = space.specimen_rotations[rng.integers(len(space.specimen_rotations), size=8)]
    right = space.crystal_rotations[rng.integers(len(space.crystal_rotations), size=8)]
    moved = space.to_chart((left * turns * right).as_quat())
    assert torch.allclose(moved, space.to_chart(turns.as_quat()), atol=1e-9)
    # as they are, too: images of points and of kernels share the group
    raw = torch.tensor((left * turns * right).as_quat())
    assert torch.allclose(density.log_prob(raw, measure="natural"), values, atol=1e-9)
    # the sum over all images, by SciPy, of von Mises-Fisher kernels on the sphere of quaternions
    assert values.numpy() == pytest.approx(_plainly(density, turns), abs=1e-9)


def _plainly(density: AdaptiveKernels, turns: Rotation) -> np.ndarray:
    from scipy.special import iv

    space: Any = density.space
    total = np.zeros(len(turns))
    weighed = zip(density.concentrations[:, 0].tolist(), density.weights.tolist(), strict=True)
    for center, (kappa, weight) in zip(density.centers.numpy(), weighed, strict=True):
        constant = kappa / (4 * np.pi**2 * iv(1, kappa))
        for left in space.specimen_rotations:
            images = (left * Rotation.from_quat(center) * space.crystal_rotations).as_quat()
            cosines = turns.as_quat() @ images.T
            total += weight * constant * 2 * np.cosh(kappa * cosines).sum(axis=1)
    return np.log(total)


def test_kernels_of_samples_with_both_symmetries_are_found_again() -> None:
    space = RotationSpace(form="bunge", unit="degrees", symmetry="432", specimen="222")
    one = torch.ones(1, dtype=torch.float64)
    center = space.to_chart([[35.0, 45.0, 0.0]])
    truth = AdaptiveKernels(space, center, 200 * one[:, None], one)
    rows = space.from_chart(truth.sample(200, torch.Generator().manual_seed(0)))
    # images of any kind are the same orientation
    turns = Rotation.from_euler("ZXZ", rows, degrees=True)
    turns = space.specimen_rotations[np.arange(200) % 4] * turns * space.crystal_rotations[5]
    fit = DensityEstimator(space, components="mixture").fit(turns.as_euler("ZXZ", degrees=True))
    new = space.from_chart(truth.sample(300, torch.Generator().manual_seed(1)))
    known = DensityEstimator.fitted(truth)
    assert float((known.score_samples(new) - fit.score_samples(new)).mean()) < 0.05


NAMED = {
    "phi1_deg,PHI_deg,phi2_deg": "ZXZ", "euler angle 1,euler angle 2,euler angle 3": "ZXZ",
    "rx,ry,rz": "vector", "rodrigues_x,rodrigues_y,rodrigues_z": "rodrigues",
    "w,x,y,z": "quaternion", "q0,q1,q2,q3": "quaternion",
    "r11,r12,r13,r21,r22,r23,r31,r32,r33": "matrix",
}  # fmt: skip


@pytest.mark.parametrize("names", NAMED)
def test_names_say_the_form(names: str) -> None:
    columns = names.split(",")
    assert rotation_form("rotation-space", columns, len(columns)) == NAMED[names]


OPEN = {
    "q1,q2,q3,q4": "scalar form quaternion", "a,b,c,d": "scalar", "r1,r2,r3": "form bunge",
    "alpha,beta,gamma": "form bunge", "roll,pitch,yaw": "Euler form axes",
}  # fmt: skip


@pytest.mark.parametrize("names", OPEN)
def test_names_that_leave_it_open_are_refused(names: str) -> None:
    values = Rotation.random(30, random_state=0).as_quat()[:, : names.count(",") + 1]
    frame = pandas.DataFrame(values, columns=names.split(","))
    with refused(*OPEN[names].split(), kind=SettingError):
        DensityEstimator("rotation-space").fit(frame)


def test_a_space_of_another_form_than_the_names_is_refused() -> None:
    frame = pandas.DataFrame(
        np.random.default_rng(0).normal(0, 0.1, (40, 3)), columns=["rx", "ry", "rz"]
    )
    with refused("form", "ZXZ", kind=SettingError):
        DensityEstimator(RotationSpace(form="bunge")).fit(frame)
    turns = Rotation.random(40, random_state=0).as_quat()
    frame = pandas.DataFrame(turns, columns=["x", "y", "z", "w"])
    with refused("form", "scalar-first", kind=SettingError):
        DensityEstimator(RotationSpace(form="scalar-first")).fit(frame)


def test_weights_that_do_not_fit_and_families_without_the_symmetry_are_refused() -> None:
    with refused("weights", "4"):
        summarize_orientations(RotationSpace(), np.eye(4), weights=[1.0])
    from orbiflow.density.models import images_of

    assert images_of(RotationSpace()) == 2
    for own in (RotationSpace(symmetry="D2"), RotationSpace(specimen="D2")):
        with refused("RotationSpace"):
            images_of(own)


@settings(max_examples=12)
@given(crystal=small, specimen=small, seed=seeds)
def test_misorientations_are_the_smallest_angles_between_images(
    crystal: str, specimen: str, seed: int
) -> None:
    space = RotationSpace(symmetry=crystal, specimen=specimen)
    first, *others = Rotation.random(6, random_state=seed)
    points = torch.tensor(Rotation.concatenate(others).as_quat())
    found = space.misorientations(points, torch.tensor(first.as_quat()))
    least = [
        min(
            (left * first * space.crystal_rotations * other.inv()).magnitude().min()
            for left in space.specimen_rotations
        )
        for other in others
    ]
    assert found.numpy() == pytest.approx(np.array(least), abs=1e-7)


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
