"""Partitions of space into cells that a group maps to one another."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.errors import GroupError
from orbiflow.solids.cell_shapes import cubes, tetrahedra, triangular_prisms
from orbiflow.solids.complexes import cell_complex, conventional_group
from orbiflow.symmetry import CrystallographicGroup, space_group, wallpaper_group
from refusals import refused
from solids.known_solids import CELLS, group_named, names, seeds

SHAPES = {"P 21 3": "tetrahedra", "R 3": "triangular prisms", "P 3": "triangular prisms"}


@pytest.mark.parametrize("name", sorted(CELLS))
def test_the_conventional_group_is_the_same_group(name):
    group = group_named(name)
    own = conventional_group(group)
    assert own == group
    assert np.linalg.det(own.lattice) > 0
    assert own.name == group.name


@pytest.mark.parametrize("name", sorted(CELLS))
def test_orbits_have_as_many_cells_as_the_group_has_cosets(name):
    grid = cell_complex(group_named(name), 400)
    counts = np.bincount(grid.orbits.ravel())
    assert len(counts) == grid.cells_per_tile
    assert (counts == grid.group.order).all()
    assert grid.shape.name == SHAPES.get(name, grid.shape.name)
    volume = np.linalg.det(grid.group.lattice) / grid.group.order
    assert grid.spacing**3 * grid.cells_per_tile == pytest.approx(volume)


@given(names, seeds)
def test_elements_take_cells_to_cells_of_their_orbit_and_their_corners_along(name, seed):
    grid = cell_complex(group_named(name), 300)
    rng = np.random.default_rng(seed)
    cells = np.column_stack(
        [rng.integers(-40, 40, (30, 3)), rng.integers(grid.shape.kinds, size=30)]
    )
    where = np.argwhere(np.isin(grid.orbits, grid.orbit_of(cells)))
    table = dict(zip(grid.orbit_of(where).tolist(), where, strict=True))
    sources = np.array([table[k] for k in grid.orbit_of(cells).tolist()])
    cosets, shifts = grid.elements_between(sources, cells)
    moves = grid.group.translations[cosets] + shifts @ grid.group.lattice.T
    images = np.einsum("nij,nj->ni", grid.group.linear_parts[cosets], grid.centers(sources)) + moves
    np.testing.assert_allclose(images, grid.centers(cells), atol=1e-9)
    corners = grid.shape.denominator * sources[:, :3] + grid.shape.corners[sources[:, 3], 0]
    there = grid.images(corners, cosets, shifts)
    own = grid.shape.denominator * cells[:, None, :3] + grid.shape.corners[cells[:, 3]]
    assert (own == there[:, None]).all(axis=2).any(axis=1).all()
    np.testing.assert_array_equal(grid.preimages(there, cosets, shifts), corners)


def test_cells_of_unlike_orbits_have_no_element_between_them():
    grid = cell_complex(group_named("P 21 21 21"), 300)
    cells = np.argwhere(grid.orbits != grid.orbits[0, 0, 0, 0])[:1]
    with refused("orbit", kind=GroupError):
        grid.elements_between(np.zeros((1, 4), int), cells)


@pytest.mark.parametrize(
    "shape", [cubes(), triangular_prisms(), tetrahedra()], ids=lambda s: s.name
)
def test_cells_fill_a_block_and_neighbours_share_faces(shape):
    total = 0.0
    for kind, faces in enumerate(shape.faces):
        center = shape.corners[kind].mean(axis=0)
        np.testing.assert_array_equal(shape.centers[kind], center)
        for side, (face, neighbor) in enumerate(zip(faces, shape.neighbors[kind], strict=True)):
            corners = shape.corners[kind][list(face)] - center
            fans = itertools.pairwise(corners[1:])
            parts = [np.dot(corners[0], np.cross(b, c)) / 6 for b, c in fans]
            assert min(parts) > 0  # counter-clockwise from outside
            total += sum(parts)
            there = shape.corners[neighbor.kind] + shape.denominator * np.array(neighbor.offset)
            own = set(map(tuple, shape.face_corners[kind, side].tolist()))
            assert own <= set(map(tuple, there.tolist()))
    assert total == pytest.approx(shape.denominator**3)


def test_discs_on_a_cube_are_one_connected_part_with_a_connected_rest():
    discs = cubes().attachable_faces(0)
    assert not discs[0]
    assert not discs[63]
    # of 62 proper sets, 3 are of two opposite faces and 3 of the ring between them
    assert sum(discs) == 56


@given(st.sampled_from(["P 1 m 1", "P n m a", "P 4/m m m", "F d -3 m:1"]))
@settings(max_examples=4)
def test_groups_with_mirrors_are_refused(name):
    with refused(name, "mirrors", kind=GroupError):
        cell_complex(space_group(name), 500)


def test_groups_of_the_plane_are_refused():
    with refused("dimension", 2, kind=GroupError):
        cell_complex(wallpaper_group("p1"), 500)


def test_a_group_whose_origin_is_off_its_centres_is_refused_with_advice():
    group = group_named("P -1").conjugate(np.eye(3), [0.123, 0.0456, 0.0789])
    with refused("P -1", "origin", kind=GroupError):
        cell_complex(group, 500)


def test_a_lattice_that_is_not_along_the_axes_is_replaced():
    group = group_named("P 1 21 1")
    skew = group.lattice @ np.array([[1, 1, 0], [0, 1, 0], [0, 1, 1]])
    other = CrystallographicGroup(skew, group.cosets)
    assert other == group
    assert cell_complex(other, 500).cells_per_tile == cell_complex(group, 500).cells_per_tile
