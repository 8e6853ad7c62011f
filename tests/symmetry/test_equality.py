"""Groups are equal, and hashed, by the isometries that they consist of."""

import copy

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import make_space
from orbiflow.fields import FourierField
from orbiflow.symmetry import (
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    rotation,
    translation,
    wallpaper_group,
)
from strategies import (
    equivariance_error,
    groups,
    random_field,
    random_orthogonal,
    random_tensor,
    seeds,
    wallpaper_groups,
)


def unimodular(rng: np.random.Generator, dim: int) -> np.ndarray:
    """An integer matrix of determinant +-1: another basis of the same lattice."""
    change = np.eye(dim)
    for _ in range(3 * (dim > 1)):
        i, j = rng.choice(dim, 2, replace=False)
        change[:, i] += rng.integers(-2, 3) * change[:, j]
    return change[:, rng.permutation(dim)] * rng.choice([-1, 1], dim)


def rewritten(group: CrystallographicGroup, rng: np.random.Generator) -> CrystallographicGroup:
    """The same group from another basis, other coset representatives, in another order."""
    shifts = rng.integers(-3, 4, (group.order, group.dim)) @ group.lattice.T
    moved = [translation(s) @ g for s, g in zip(shifts, group.cosets, strict=True)]
    chosen = [moved[i] for i in rng.permutation(group.order)]
    return CrystallographicGroup.generate(group.lattice @ unimodular(rng, group.dim), chosen)


@given(groups, seeds)
def test_the_way_a_group_is_written_does_not_matter(group, seed):
    other = rewritten(group, np.random.default_rng(seed))
    assert other == group
    assert hash(other) == hash(group)
    assert len({group, other}) == 1


@given(wallpaper_groups(), seeds)
def test_a_larger_cell_with_centring_translations_is_the_same_group(group, seed):
    rng = np.random.default_rng(seed)
    # twice each vector: normalised by every point group that the lattice has
    centring = [translation(v) for v in group.lattice.T]
    other = CrystallographicGroup.generate(2 * group.lattice, [*group.cosets, *centring])
    assert other.order == 4 * group.order
    assert rewritten(other, rng) == group
    assert hash(other) == hash(group)


@given(groups, seeds)
def test_rounding_does_not_matter(group, seed):
    rng = np.random.default_rng(seed)
    turn, shift = random_orthogonal(rng, group.dim), rng.uniform(-2, 2, group.dim)
    there = group.conjugate(turn, shift)
    back = there.conjugate(turn.T, -turn.T @ shift)
    assert back == group
    assert hash(back) == hash(group)
    assert hash(there) == hash(group)


@given(wallpaper_groups([n for n in WALLPAPER_GROUPS if n != "p1"]), seeds, st.floats(1e-6, 0.1))
def test_a_group_moved_a_little_is_another(group, seed, amount):
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    # along an axis a mirror does not move: two directions, of which one must matter
    moved = [
        group.conjugate(
            np.eye(2), amount * np.sqrt(group.cell_volume) * np.array([np.cos(t), np.sin(t)])
        )
        for t in (angle, angle + np.pi / 2)
    ]
    assert any(other != group for other in moved)


@given(groups, st.floats(1e-4, 0.5))
def test_a_group_of_another_size_is_another(group, amount):
    assert group.conjugate((1 + amount) * np.eye(group.dim)) != group


@pytest.mark.parametrize("factor", [1e-11, 0.5, 2.0, 1e11])
def test_lattices_within_each_other_are_not_equal(factor):
    plain = CrystallographicGroup.generate(np.eye(2))
    assert CrystallographicGroup.generate(factor * np.eye(2)) != plain


def test_the_catalogue_has_no_two_equal_groups():
    made = {name: wallpaper_group(name) for name in WALLPAPER_GROUPS}
    assert len(set(made.values())) == len(made)
    assert all(wallpaper_group(name) == group for name, group in made.items())


def test_groups_of_other_dimensions_and_other_things_are_not_equal():
    assert wallpaper_group("p1") != CrystallographicGroup.generate(np.eye(3))
    assert wallpaper_group("p1") != "p1"
    assert copy.deepcopy(wallpaper_group("p6m")) == wallpaper_group("p6m")


@settings(max_examples=10)
@given(wallpaper_groups(), seeds)
def test_fields_of_equal_groups_keep_to_their_own_basis(group, seed):
    random_field(group, 2, seed)  # what it works out is kept
    other = rewritten(group, np.random.default_rng(seed))
    field = random_field(other, 2, seed)
    assert field.group is other
    assert field.basis.frequencies.shape[1] == 2
    assert torch.equal(field.frame, torch.tensor(other.inverse_lattice))
    points = random_tensor(seed, 10, 2)
    assert equivariance_error(field, group, points) < 1e-9
    # the same frequencies in the plane, whatever numbers they have
    waves = field.basis.frequencies @ other.inverse_lattice
    lengths = np.linalg.norm(waves, axis=1)
    assert np.isclose(lengths[:, None], field.basis.magnitude[None]).any(axis=0).all()


def test_groups_written_alike_share_a_basis():
    first, second = (FourierField(wallpaper_group("p4"), 3) for _ in range(2))
    assert first.group is not second.group
    assert first.basis is second.basis


def test_spaces_are_equal_by_their_settings():
    assert make_space("torus") == make_space("torus")
    assert hash(make_space("torus")) == hash(make_space("torus"))
    assert make_space("torus") != make_space("torus", axes=3)
    assert make_space("torus") != make_space("torus", unit="degrees")
    assert make_space("sphere") != make_space("projective-plane")
    turn = np.eye(3)
    turn[:2, :2] = rotation((0.0, 0.0), 4).linear
    assert make_space("sphere", rotation=turn) != make_space("sphere")
    assert make_space("sphere", rotation=turn) == make_space("sphere", rotation=turn)
