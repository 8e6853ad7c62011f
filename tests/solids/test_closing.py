"""Partitions of space into cells, and balls of cells where a function is almost largest."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings

from orbiflow.errors import GroupError
from orbiflow.solids.cell_shapes import cubes, tetrahedra, triangular_prisms
from orbiflow.solids.closing import close_tile
from orbiflow.solids.complexes import cell_complex, conventional_group
from orbiflow.solids.growth import BallOfCells, CellBox
from orbiflow.symmetry import CrystallographicGroup, space_group, wallpaper_group
from refusals import refused
from solids.known_solids import CELLS, group_named, names, random_function, random_tile, seeds


@given(names, seeds)
def test_a_tile_has_one_cell_of_each_orbit_at_little_loss(name, seed):
    tile, _ = random_tile(name, seed)
    orbits = tile.complex.orbit_of(tile.cells)
    np.testing.assert_array_equal(orbits, np.arange(tile.complex.cells_per_tile))
    assert tile.is_ball
    assert tile.loss < 0.1
    assert tile.moved < 0.2 * len(tile.cells)


@given(names, seeds)
@settings(max_examples=6)
def test_cells_are_a_ball_by_counting_their_parts(name, seed):
    tile, _ = random_tile(name, seed, cubes=200)
    shape = tile.complex.shape
    d = shape.denominator
    cells = tile.cells
    # the closed cells' union: corners, edges, faces and cells, each counted once
    points, edges, faces = set(), set(), set()
    for *block, kind in cells.tolist():
        corners = [tuple(c) for c in (d * np.array(block) + shape.corners[kind]).tolist()]
        for face in shape.faces[kind]:
            ring = [corners[k] for k in face]
            points.update(ring)
            faces.add(frozenset(ring))
            edges.update(frozenset(e) for e in zip(ring, ring[1:] + ring[:1], strict=True))
    assert len(points) - len(edges) + len(faces) - len(cells) == 1


def test_a_body_in_two_parts_becomes_one_piece_that_has_both():
    group = group_named("P 1")
    _, middle = random_function(group, 0)
    ends = middle + np.array([[-0.42, 0, 0], [0.42, 0, 0.0]])

    def function(points):
        return -np.linalg.norm(points[:, None] - ends, axis=2).min(axis=1)

    tile = close_tile(function, middle - 1, middle + 1, cell_complex(group, 1000))
    assert tile.is_ball
    centers = tile.complex.centers(tile.cells)
    for end in ends:
        assert np.linalg.norm(centers - end, axis=1).min() < 2 * tile.complex.spacing


def test_a_ring_is_cut_so_that_no_handle_is_left():
    group = group_named("P 1")
    _, middle = random_function(group, 0)

    def function(points):
        x, y, z = (points - middle).T
        return -np.hypot(np.hypot(x, y) - 0.33, z)

    tile = close_tile(function, middle - 1, middle + 1, cell_complex(group, 3000))
    assert tile.is_ball
    assert tile.raw_pieces >= 1


def test_a_small_box_is_widened_until_all_orbits_are_in_it():
    group = group_named("P 21 21 21")
    function, middle = random_function(group, 1)
    assert close_tile(function, middle - 0.1, middle + 0.1, cell_complex(group, 300)).is_ball


def test_what_is_far_from_a_body_is_not_asked():
    group = group_named("P 1")
    _, middle = random_function(group, 0)
    asked = list[int]()

    def function(points):
        asked.append(len(points))
        return -np.linalg.norm((points - middle) * (1, 1, 0.3), axis=1)

    complex = cell_complex(group, 6000)
    tile = close_tile(function, middle - 2, middle + 2, complex)
    assert tile.is_ball
    assert sum(asked) < 0.25 * 4**3 / complex.spacing**3
    close = close_tile(function, middle - 0.8, middle + 0.8, complex)
    assert tile.loss == pytest.approx(close.loss, abs=0.02)


def test_a_function_that_is_not_a_number_is_refused():
    group = group_named("P 1")
    nowhere = lambda x: np.full(len(x), np.nan)  # noqa: E731
    with refused("function"):
        close_tile(nowhere, -np.ones(3), np.ones(3), cell_complex(group, 200))


def cube_ball(number: int = 6) -> BallOfCells:
    grid = cell_complex(group_named("P 1"), 8000)
    box = CellBox(grid, np.zeros(3, int), np.full(3, number))
    orbits = np.where(box.is_inner(), np.arange(box.number_of_cells), -1)
    return BallOfCells(box, orbits, box.number_of_cells)


def number_of(ball: BallOfCells, *block: int) -> int:
    return int(ball.box.numbers(np.array([[*block, 0]]))[0])


def test_cells_touch_in_faces_and_never_close_a_ring():
    ball = cube_ball()
    ball.attach(number_of(ball, 2, 2, 2))
    reach = [ball.can_attach(number_of(ball, *at)) for at in ((3, 3, 2), (3, 3, 3), (4, 2, 2))]
    assert reach == [False] * 3
    assert ball.can_attach(number_of(ball, 3, 2, 2))
    ball = cube_ball()
    ring = [(1, 1), (1, 2), (1, 3), (2, 3), (3, 3), (3, 2), (3, 1)]
    for x, y in ring:
        ball.attach(number_of(ball, x, y, 2))
    assert not ball.can_attach(number_of(ball, 2, 1, 2))


def test_a_cell_is_not_detached_or_moved_where_the_hole_would_touch_the_outside():
    ball = cube_ball()
    for cell in itertools.product((1, 2, 3), (1, 2, 3), (1, 2)):
        ball.attach(number_of(ball, *cell))
    middle = number_of(ball, 2, 2, 2)
    assert ball.detach(middle)  # a dent
    ball.attach(middle)
    assert ball.detach(number_of(ball, 1, 1, 2))
    # its corner is on the boundary since its neighbour has gone: the dent would meet it there
    assert not ball.detach(middle)
    # a move that is not possible changes nothing
    ball = cube_ball()
    for x in (1, 2, 3):
        ball.attach(number_of(ball, x, 2, 2))
    before = ball.members().tolist()
    assert not ball.move(number_of(ball, 2, 2, 2), number_of(ball, 2, 3, 2))
    assert ball.members().tolist() == before


SHAPES = {"P 21 3": "tetrahedra", "R 3": "triangular prisms", "P 3": "triangular prisms"}


@pytest.mark.parametrize("name", sorted(CELLS))
def test_orbits_have_as_many_cells_as_the_group_has_cosets(name):
    group = group_named(name)
    own = conventional_group(group)
    assert own == group
    assert np.linalg.det(own.lattice) > 0
    assert own.name == group.name
    grid = cell_complex(group, 400)
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


def test_groups_that_have_no_cells_are_refused():
    off_its_centres = group_named("P -1").conjugate(np.eye(3), [0.123, 0.0456, 0.0789])
    cases = [
        ((name, "mirrors"), space_group(name)) for name in ("P 1 m 1", "P n m a", "F d -3 m:1")
    ]
    cases += [(("dimension", 2), wallpaper_group("p1")), (("P -1", "origin"), off_its_centres)]
    for about, group in cases:
        with refused(*about, kind=GroupError):
            cell_complex(group, 500)


def test_a_lattice_that_is_not_along_the_axes_is_replaced():
    group = group_named("P 1 21 1")
    skew = group.lattice @ np.array([[1, 1, 0], [0, 1, 0], [0, 1, 1]])
    other = CrystallographicGroup(skew, group.cosets)
    assert other == group
    assert cell_complex(other, 500).cells_per_tile == cell_complex(group, 500).cells_per_tile
