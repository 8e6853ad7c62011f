"""Crystallographic groups: closure, cells, images, conjugation, equality."""

import copy
import itertools

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.density import make_space
from orbiflow.errors import GroupError, LatticeMismatchError, NotAnIsometryError, NotDiscreteError
from orbiflow.fields import FourierField
from orbiflow.symmetry import (
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    Isometry,
    Line,
    identity,
    rotation,
    rotation_matrix,
    transflection,
    translation,
    wallpaper_group,
)
from refusals import refused
from strategies import (
    angles,
    elements,
    equivariance_error,
    groups,
    lattices,
    plane_groups,
    random_field,
    random_orthogonal,
    random_points,
    random_tensor,
    seeds,
    wallpaper_groups,
)


def fractional(group, vectors):
    return vectors @ np.linalg.inv(group.lattice).T


def is_lattice_vector(group, vectors, tolerance=1e-9):
    steps = fractional(group, vectors)
    return np.abs(steps - np.round(steps)).max(initial=0.0) <= tolerance


@given(groups)
def test_products_and_inverses_of_cosets_are_contained(group):
    for g, h in itertools.product(group.cosets, repeat=2):
        assert group.contains(g @ h)
        assert group.contains(g.inverse())


@given(groups)
def test_cosets_are_distinct_modulo_the_lattice(group):
    for g, h in itertools.combinations(group.cosets, 2):
        difference = g.inverse() @ h
        same = np.allclose(difference.linear, np.eye(group.dim), atol=1e-9)
        assert not (same and is_lattice_vector(group, difference.translation, 1e-6))


@given(groups)
def test_the_identity_comes_first_and_translations_lie_in_the_cell(group):
    assert group.cosets[0].is_close(identity(group.dim), 0.0)
    steps = fractional(group, group.translations)
    assert steps.min() >= -1e-12
    assert steps.max() < 1 - 1e-9


@given(st.data(), st.floats(1e-3, 0.05))
def test_elements_moved_off_the_lattice_are_not_contained(data, amount):
    group = data.draw(groups)
    g = data.draw(elements(group))
    off = translation(group.lattice @ np.full(group.dim, amount)) @ g
    assert not group.contains(off)


@given(groups, seeds)
def test_wrap_moves_into_the_cell_by_lattice_vectors(group, seed):
    p = random_points(seed, 3, 4, group.dim, size=20.0)
    steps = fractional(group, group.wrap(p))
    assert steps.min() >= -1e-12
    assert steps.max() < 1 + 1e-12
    assert is_lattice_vector(group, group.wrap(p) - p, 1e-12)


@given(groups, seeds, st.sampled_from([(torch.float64, 1e-12), (torch.float32, 1e-5)]))
def test_wrap_agrees_for_torch(group, seed, kind):
    dtype, tolerance = kind
    p = random_points(seed, 5, group.dim)
    difference = group.wrap(torch.tensor(p, dtype=dtype)).numpy() - group.wrap(p)
    assert is_lattice_vector(group, difference, tolerance)


def test_wrap_has_the_identity_as_derivative():
    p = torch.tensor([[3.3, -2.7]], dtype=torch.float64, requires_grad=True)
    wallpaper_group("p6").wrap(p).sum().backward()
    assert p.grad is not None
    assert p.grad.tolist() == [[1.0, 1.0]]


@given(groups, seeds)
def test_images_are_those_of_the_coset_representatives(group, seed):
    p = random_points(seed, 2, 3, group.dim)
    expected = np.stack([g(p) for g in group.cosets])
    np.testing.assert_allclose(group.images(p), expected, atol=1e-13)
    np.testing.assert_allclose(group.images(torch.tensor(p)).numpy(), expected, atol=1e-13)


@settings(max_examples=10)
@given(plane_groups, seeds, st.floats(0.0, 3.0))
def test_elements_near_are_those_of_a_brute_force_search(group, seed, radius):
    center, source = random_points(seed, 2, 2)
    found = group.elements_near(center, radius, source=source)
    expected = []
    for coset in group.cosets:
        # the window holds every translate within reach: the shortest height of the cell bounds it
        heights = 1 / np.linalg.norm(np.linalg.inv(group.lattice), axis=1)
        reach = int(np.ceil((radius + np.linalg.norm(coset(source) - center)) / heights.min()))
        axis = range(-reach, reach + 1)
        for step in itertools.product(axis, repeat=2):
            image = coset(source) + group.lattice @ np.array(step, dtype=float)
            if np.linalg.norm(image - center) <= radius:
                expected.append(translation(group.lattice @ np.array(step, dtype=float)) @ coset)
    key = [tuple(np.round([*g.linear.ravel(), *g.translation], 6) + 0.0) for g in found]
    assert len(set(key)) == len(found) == len(expected)
    assert all(any(g.is_close(h) for h in found) for g in expected)


@given(st.data(), seeds)
def test_elements_near_come_nearest_first(data, seed):
    group = data.draw(groups)
    center = random_points(seed, group.dim)
    size = group.cell_volume ** (1 / group.dim)
    found = group.elements_near(center, 1.5 * size)
    distances = [np.linalg.norm(g(center) - center) for g in found]
    assert found[0].is_close(identity(group.dim))
    assert distances == sorted(distances) or np.diff(distances).min() > -1e-12


@given(st.data(), angles, st.floats(0.3, 3), seeds)
def test_conjugating_by_a_similarity_carries_elements_along(data, angle, scale, seed):
    group = data.draw(plane_groups)
    m, v = scale * rotation_matrix(angle), random_points(seed, 2)
    moved = group.conjugate(m, v)
    g = data.draw(elements(group))
    carried = Isometry(m @ g.linear @ np.linalg.inv(m), m @ g.translation + v)
    carried = Isometry(carried.linear, carried.translation - carried.linear @ v)
    assert moved.contains(carried, 1e-8)
    assert moved.order == group.order
    assert moved.cell_volume == pytest.approx(scale**2 * group.cell_volume, rel=1e-12)


@given(lattices("oblique"), st.floats(0.2, 3), st.floats(-1, 1))
def test_any_linear_map_conjugates_p2_to_p2(lattice, stretch, shear):
    moved = wallpaper_group("p2", lattice).conjugate([[stretch, shear], [0.0, 1.0]])
    assert moved.order == 2
    np.testing.assert_allclose(moved.lattice, np.array([[stretch, shear], [0, 1.0]]) @ lattice)


@pytest.mark.parametrize("name", ["p3", "p4", "p6", "p4m", "pmm"])
def test_a_shear_does_not_normalise_a_group_with_more_than_half_turns(name):
    with refused("orthogonal", kind=NotAnIsometryError):
        wallpaper_group(name).conjugate([[1.0, 0.3], [0.0, 1.0]])


@pytest.mark.parametrize(
    ("linear", "offset", "about"),
    [
        (np.eye(3), None, (3, 3)),
        (np.eye(2), np.zeros(3), (2, 2)),
        (np.ones((2, 2)), None, "lattice"),
    ],
)
def test_a_singular_conjugation_or_one_of_another_dimension_is_refused(linear, offset, about):
    with refused(about, kind=GroupError):
        wallpaper_group("p1").conjugate(linear, offset)


def test_a_five_fold_rotation_is_refused_by_number():
    half_turn = rotation((0.0, 0.0), 2)
    with refused("generator 1", "lattice", kind=LatticeMismatchError):
        CrystallographicGroup.generate(np.eye(2), [half_turn, rotation((0.0, 0.0), 5)])


@given(lattices("square"), st.floats(0.05, 0.7))
def test_a_mirror_askew_to_the_lattice_is_refused(lattice, angle):
    direction = rotation_matrix(angle) @ lattice[:, 0]
    with refused("generator 0", kind=LatticeMismatchError):
        CrystallographicGroup.generate(lattice, [transflection(Line((0, 0), direction), 0.0)])


@pytest.mark.parametrize("number", [0, 1, 2])
def test_an_irrational_glide_is_refused_by_number(number):
    generators = [transflection(Line((0.0, 0.0), (0.0, 1.0)), 0.0), rotation((0.0, 0.0), 2)]
    generators.insert(number, transflection(Line((0.0, 0.0), (1.0, 0.0)), np.sqrt(2)))
    with refused(500, f"generator {number},", kind=NotDiscreteError):
        CrystallographicGroup.generate(np.eye(2), generators, max_order=500)


@given(st.integers(2, 12))
def test_a_glide_by_a_fraction_of_the_lattice_multiplies_the_order(parts):
    glide = transflection(Line((0.0, 0.3), (1.0, 0.0)), 1.0 / parts)
    order = CrystallographicGroup.generate(np.eye(2), [glide]).order
    assert order == (parts if parts % 2 == 0 else 2 * parts)


@pytest.mark.parametrize(
    "lattice",
    [
        *([[1.0, 2.0], [1.0, 2.0]], [[1.0, 1.0], [0.0, 1e-8]], [[1.0, 0.0], [0.0, 0.0]]),
        *([[1.0, np.nan], [0.0, 1.0]], [[1e308, 1e308], [0.0, 1e308]]),
        *([[1.0, 0.0]], [1.0, 1.0], np.zeros((0, 0))),
    ],
)
def test_degenerate_lattices_are_refused(lattice):
    with refused("lattice", kind=GroupError):
        CrystallographicGroup.generate(lattice)


def test_generators_of_another_dimension_are_refused():
    with refused("generator 0", "R^3", "R^2", kind=GroupError):
        CrystallographicGroup.generate(np.eye(2), [identity(3)])


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
