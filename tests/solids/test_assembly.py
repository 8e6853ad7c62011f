"""What comes apart, and what is interlocked: found from contacts, checked by moving bodies."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orbiflow.arrays import Array
from orbiflow.errors import GroupError, SettingError
from orbiflow.solids import FillSettings, Mesh, certify_solid, fill, separable
from orbiflow.solids.assembly import Assembly, Pieces, greatest_overlap, sphere
from orbiflow.solids.bodies import as_body, common_volume, moved_body, united
from orbiflow.solids.contacts import contacts, free_cone
from orbiflow.solids.distance import SignedDistance
from orbiflow.solids.separable import (
    check_separable,
    pieces_with_gap,
    separable_tile,
    sorted_labels,
)
from orbiflow.solids.stacks import stack_of
from orbiflow.symmetry import space_group
from refusals import refused
from solids.known_solids import ball, creature, dirichlet_solid, group_named, hooked_tile
from solids.mesh_files import box, bumpy_cell, cubic_group

AXES = np.concatenate([np.eye(3), -np.eye(3)])


def checked(tile: Mesh, count: int) -> Assembly:
    """The assembly of a cluster, of which each step is tried by moving the piece."""
    copies = stack_of(cubic_group(), tile, count)
    found = Pieces(cubic_group(), tile).assembly(copies)
    body = as_body(tile)
    placed = [moved_body(body, own.linear, own.shift) for own in copies]
    there = list(found.stuck)
    for step in found.steps:
        if there:
            fixed = united([placed[k] for k in there])
            way = greatest_overlap(placed[step.piece], fixed, -step.direction, distance=3.0)
            assert way < 1e-6
        there.append(step.piece)
    assert sorted(there) == list(range(count))
    return found


def test_cubes_come_apart() -> None:
    pieces = Pieces(cubic_group(), box())
    assert len(pieces.contacts) == 6
    assert [own.area for own in pieces.contacts] == pytest.approx([1.0] * 6)
    assert [cone.dimension for cone in pieces.cones] == [3] * 6
    for k, own in enumerate(pieces.contacts):
        leaving = pieces.leaving_neighbour(k)
        assert leaving is not None
        assert leaving.is_free
        assert leaving.direction @ own.element.translation < 0
    assert pieces.leaving_stack().is_free
    found = checked(box(), 7)
    assert not found.is_interlocked
    assert found.words == "7 copies can be put together one by one, each by a straight move."
    # a tile of displaced faces leaves along each axis
    tile = bumpy_cell(steps=8)
    pieces = Pieces(cubic_group(), tile)
    assert len(pieces.contacts) == 6
    assert sum(own.area for own in pieces.contacts) == pytest.approx(tile.area)
    assert not checked(tile, 4).is_interlocked


def test_a_tab_in_a_slot_slides_along_one_axis() -> None:
    tile = hooked_tile(0)
    assert tile.volume == pytest.approx(1)
    pieces = Pieces(cubic_group(), tile)
    hooked = [k for k, own in enumerate(pieces.contacts) if abs(own.element.translation[0]) > 0.5]
    assert len(hooked) == 2
    for k in hooked:
        cone = pieces.cones[k]
        assert cone.dimension == 1
        assert {tuple(ray) for ray in cone.rays.round(6) + 0.0} == {(0, 0, 1), (0, 0, -1)}
        leaving = pieces.leaving_neighbour(k)
        assert leaving is not None
        assert leaving.is_free
        fixed = moved_body(as_body(tile), np.eye(3), pieces.contacts[k].element.translation)
        ways = [greatest_overlap(as_body(tile), fixed, d, distance=3.0) for d in AXES]
        assert [way < 1e-6 for way in ways] == [abs(d[2]) == 1 for d in AXES]
    found = checked(tile, 7)
    assert not found.is_interlocked
    stack = pieces.leaving_stack()
    assert stack.is_free
    assert abs(stack.direction[2]) > 0.9


def test_hooks_on_all_axes_interlock() -> None:
    tile = hooked_tile(0, 1, 2)
    assert tile.volume == pytest.approx(1)
    pieces = Pieces(cubic_group(), tile)
    assert sum(own.area for own in pieces.contacts) == pytest.approx(tile.area)
    assert [cone.dimension for cone in pieces.cones] == [1] * 6
    copies = stack_of(cubic_group(), tile, 8)
    found = checked(tile, 8)
    assert found.is_interlocked
    assert "interlocked" in found.words
    # pairs still slide: what is left has no piece with a single neighbour
    assert len(found.stuck) >= 4
    body = as_body(tile)
    placed = [moved_body(body, own.linear, own.shift) for own in copies]
    for piece in found.stuck:
        rest = united([placed[k] for k in found.stuck if k != piece])
        for direction in np.concatenate([AXES, sphere(3)]):
            assert greatest_overlap(placed[piece], rest, direction, distance=1.5, steps=3) > 1e-4
    assert not pieces.leaving_stack().is_free


def test_contacts_of_unlike_triangles() -> None:
    """The same cubes, with other triangles on one of two opposite faces."""
    whole = box()
    top = np.flatnonzero(whole.face_vectors[:, 2] > 0.5)
    quad = whole.faces[top]
    ring = [*quad[0], *(set(quad[1]) - set(quad[0]))]
    middle = len(whole.points)
    around = sorted(ring, key=lambda k: np.arctan2(*(whole.points[k, 1::-1] - 0.5)))
    fan = [[around[k], around[(k + 1) % 4], middle] for k in range(4)]
    faces = np.concatenate([np.delete(whole.faces, top, axis=0), fan])
    tile = Mesh(np.concatenate([whole.points, [[0.5, 0.4, 1.0]]]), faces)
    assert tile.is_closed
    found = contacts(cubic_group(), tile)
    assert [own.area for own in found] == pytest.approx([1.0] * 6)
    assert sorted(len(own.faces) for own in found) == [2, 2, 2, 2, 2, 4]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_free_directions_against_many_that_are_tried(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(rng.integers(1, 12), 3)) + rng.normal(size=3)
    cone = free_cone(normals)
    tried = sphere(2000)
    free = tried[(tried @ normals.T <= 0).all(axis=1)]
    assert (cone.rays @ normals.T <= 1e-4 * np.linalg.norm(normals, axis=1)).all()
    if len(free):
        assert cone.dimension == 3
        assert cone.middle is not None
        assert (normals @ cone.middle < 0).all()
        # each is a sum of the rays with positive shares
        for direction in free[::40]:
            assert _in_hull(cone.rays, direction)
    elif cone.dimension == 3:
        assert np.linalg.norm(cone.rays - cone.rays.mean(axis=0), axis=1).max() < 1.5


def _in_hull(rays: Array, direction: Array) -> bool:
    from scipy.optimize import nnls

    return bool(nnls(rays.T, direction)[1] < 1e-6)


@pytest.mark.parametrize(
    ("normals", "dimension", "rays"),
    [
        ([[1, 0, 0], [-1, 0, 0]], 2, 3),
        ([[1, 0, 0], [-1, 0, 0], [0, 1, 0]], 2, 2),
        ([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], 1, 2),
        ([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], 1, 1),
        (AXES.tolist(), 0, 0),
        ([[1, 1, 1], [-1, 1, 1], [1, -1, 1], [-1, -1, -3]], 0, 0),
    ],
)
def test_thin_cones(normals: list[list[float]], dimension: int, rays: int) -> None:
    turn = Rotation.random(random_state=4).as_matrix()
    cone = free_cone(np.array(normals) @ turn.T)
    assert cone.dimension == dimension
    assert len(cone.rays) == rays if dimension < 2 else len(cone.rays) >= rays
    assert (cone.rays @ turn @ np.transpose(normals) < 1e-5).all()


def test_cells_of_screw_axes_come_apart() -> None:
    group = space_group("P 21 21 21", cell=(1.5, 1.6, 1.7))
    tile = dirichlet_solid(group)
    assert tile.volume == pytest.approx(group.cell_volume / 4)
    pieces = Pieces(group, tile)
    assert sum(own.area for own in pieces.contacts) == pytest.approx(tile.area)
    copies = stack_of(group, tile, 8)
    found = pieces.assembly(copies)
    assert not found.is_interlocked
    bodies = [moved_body(as_body(tile), own.linear, own.shift) for own in copies]
    for k, step in enumerate(found.steps[1:], 1):
        fixed = united([bodies[own.piece] for own in found.steps[:k]])
        way = greatest_overlap(bodies[step.piece], fixed, -step.direction, distance=4.0)
        assert way < 1e-6
    assert pieces.leaving_stack().is_free


def test_a_gap_lets_out_what_would_be_held() -> None:
    def height(places: Array) -> Array:
        u, v = np.pi * places.T
        return 0.42 * np.sin(u) ** 2 * np.sin(v) ** 2 * np.sin(2 * u)

    tile = bumpy_cell(height, steps=12)
    shifted = moved_body(as_body(tile), np.eye(3), (0, 1, 1))
    assert common_volume(as_body(tile), shifted) < 1e-9
    held, loose = (Pieces(cubic_group(), tile, gap).leaving_stack() for gap in (0.0, 0.06))
    assert not held.is_free
    assert held.blocked < 0.05
    assert loose.is_free
    body = as_body(Pieces(cubic_group(), tile, 0.06).piece)
    others = [g for g in stack_of(cubic_group(), tile, 27) if g.shift @ loose.direction < -1e-6]
    fixed = united([moved_body(body, own.linear, own.shift) for own in others])
    assert greatest_overlap(body, fixed, loose.direction, distance=3.0) < 1e-5
    copies = stack_of(cubic_group(), tile, 4)
    assert Pieces(cubic_group(), tile).assembly(copies).is_interlocked
    assert not Pieces(cubic_group(), tile, 0.06).assembly(copies).is_interlocked


@given(st.integers(1, 4), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_labels_are_sorted_as_well_as_can_be(count: int, length: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=(count, 1, 2, length))
    labels = sorted_labels(values)
    assert (np.diff(labels, axis=-1) >= 0).all()
    for line, own in zip(np.moveaxis(values[:, 0], 1, 0), labels[0], strict=True):
        best = max(
            sum(line[k, place] for place, k in enumerate(tried))
            for tried in combinations_with_replacement(range(count), length)
        )
        assert line[own, range(length)].sum() == pytest.approx(best)


def test_a_tile_with_a_head_over_its_legs_comes_apart_once_it_is_sorted(monkeypatch) -> None:
    monkeypatch.setattr(separable, "FINE", 0.1)
    monkeypatch.setattr(separable, "DIRECTIONS", 12)
    group, body = group_named("P -1"), creature()
    distance = SignedDistance.of_mesh(body, 0.1)
    tile = separable_tile(700, lambda points: -distance(points), body, group)
    assert tile is not None
    assert certify_solid(group, tile).valid
    size = float(np.ptp(tile.points, axis=0).max())
    pieces = pieces_with_gap(group, tile)
    leaving = pieces.leaving_stack(group.linear_parts)
    assert leaving.is_free
    # what lines say is checked by moving the body out of copies that are lower
    center = tile.centroid
    # the second direction is that of inverted copies
    for direction in leaving.direction @ group.linear_parts:
        lower = [
            as_body(pieces.piece.moved(g.linear, g.translation))
            for g in group.elements_near(center, 2.5, source=center)[1:]
            if (g.linear @ center + g.translation - center) @ direction < 1e-9
        ]
        way = greatest_overlap(
            as_body(pieces.piece), united(lower), direction, distance=3 * size, steps=12
        )
        assert way < 1e-4
    assert not pieces.assembly(stack_of(group, tile, 8)).is_interlocked


def test_other_groups_and_what_does_not_go_together_are_refused() -> None:
    for name in ("P 21", "P 21 21 21", "P c", "P 41"):
        with refused("P -1", kind=GroupError):
            check_separable(space_group(name))
    with refused("separable", "bending", kind=SettingError):
        FillSettings(separable=True, method="flow").check()
    with refused("P 1 21 1", kind=GroupError):
        fill(ball(), FillSettings(separable=True, groups=("P21",)))
