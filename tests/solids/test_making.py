"""Things to hold in the hand: closed, with gaps, flat below, and pieces that sit in their box."""

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from orbiflow.solids import Mesh
from orbiflow.solids.bodies import as_body, as_mesh, common_volume
from orbiflow.solids.making import PrintedParts, make_block, make_puzzle, make_stack, make_tile
from orbiflow.solids.offsets import offset_body
from orbiflow.solids.print_advice import lying, overhang_share, print_advice
from orbiflow.solids.sweeping import lifted
from orbiflow.symmetry import CrystallographicGroup, Isometry
from refusals import refused
from solids.known_solids import hooked_tile
from solids.mesh_files import ball, box, bumpy_cell, space_tile
from solids_read import read_3mf, read_stl

BUMPY = space_tile(bumpy_cell(steps=5))
HOOKED = space_tile(hooked_tile(0))


def mesh_of(body: Manifold) -> Mesh:
    mesh = as_mesh(body)
    assert mesh.is_closed
    assert len(mesh.pieces()) == 1
    return mesh


def test_an_offset_of_a_box_is_exact() -> None:
    for offset in (-0.5, 0.5):
        sides = np.ptp(mesh_of(offset_body(box(10, 20, 30), offset)).points, axis=0)
        assert sides == pytest.approx(np.array([10, 20, 30]) + 2 * offset, abs=0.01)
    assert offset_body(box(10, 20, 30), 0).volume() == pytest.approx(6000)
    with refused("9 mm"):
        offset_body(box(10, 20, 30), -9)
    # of a plate as thin as paper beside a cube little is left
    both = as_mesh(Manifold.cube((5, 5, 5)) + Manifold.cube((5, 5, 0.1)).translate((5, 0, 0)))
    inner = offset_body(both, -0.2)
    assert 0 < inner.volume() < 5.0**3
    assert (inner - as_body(both)).volume() == pytest.approx(0, abs=1e-9)
    assert as_mesh(inner).is_closed


@pytest.mark.parametrize("own", [BUMPY, HOOKED])
def test_a_smaller_tile_is_within_the_tile_all_around(own: Any) -> None:
    mesh = Mesh(30 * own.tile.points, own.tile.faces)
    inner, outer = (offset_body(mesh, d) for d in (-0.1, 0.1))
    whole = as_body(mesh)
    assert (inner - whole).volume() == pytest.approx(0, abs=1e-6)
    assert (whole - outer).volume() == pytest.approx(0, abs=1e-6)
    assert whole.volume() - inner.volume() == pytest.approx(0.1 * mesh.area, rel=0.03)
    assert mesh_of(inner).euler_number == 2
    neighbour = inner.translate((30, 0, 0))
    assert 0.17 < inner.min_gap(neighbour, 1.0) < 0.21


def test_the_tile_to_print() -> None:
    made = make_tile(BUMPY, clearance=0.3)
    (body,) = made.parts.values()
    assert 27_000 - body.volume() == pytest.approx(0.15 * 900 * BUMPY.tile.area, rel=0.03)
    assert body.bounding_box()[:3] == pytest.approx((0, 0, 0))
    assert made.notes[0].startswith("The tile is 4")
    assert read_stl(made.file("stl")).volume == pytest.approx(body.volume(), rel=1e-4)


def test_a_stack_is_one_object_of_copies() -> None:
    mirror = Isometry(np.diag([-1.0, 1.0, 1.0]), np.zeros(3))
    group = CrystallographicGroup.generate(np.diag([2.0, 1.0, 1.0]), [mirror], name="Pm")
    for own in (BUMPY, space_tile(box(), group)):
        made = make_stack(own, copies=8, clearance=0.3)
        bodies = list(made.parts.values())
        assert len(bodies) == 8
        assert made.parts.keys() == made.colours.keys()
        sizes = [body.volume() for body in bodies]
        assert sizes == pytest.approx([sizes[0]] * 8)
        for k, body in enumerate(bodies):
            for other in bodies[:k]:
                assert common_volume(body, other) == pytest.approx(0, abs=1e-9)
        touching = [b for b in bodies[1:] if bodies[0].min_gap(b, 1.0) < 0.32]
        assert len(touching) >= 3
        assert np.min([b.bounding_box()[:3] for b in bodies], axis=0) == pytest.approx([0, 0, 0])
        (whole,) = read_3mf(made.file("3mf", "a stack"))
        assert whole.mesh.volume == pytest.approx(sum(sizes), rel=1e-4)
    assert any("mirrored" in name for name in made.parts)


@pytest.mark.parametrize("own", [BUMPY, HOOKED, space_tile(hooked_tile(0, 1, 2))])
def test_a_copy_fits_into_the_starting_block(own: Any) -> None:
    made = make_block(own, clearance=0.3)
    block, tile = made.parts["starting block"], made.parts["tile"]
    mesh_of(block)
    assert block.bounding_box()[2] == pytest.approx(0)
    bottom = block.slice(0.05).area()
    low, high = np.reshape(block.bounding_box(), (2, 3))
    assert bottom == pytest.approx(np.prod((high - low)[:2]), rel=0.01)
    assert block.min_gap(tile, 1.0) > 0.1
    for height in (0.3, 1, 4, 12, 30):
        assert common_volume(block, tile.translate((0, 0, height))) < 1e-6
    if own is HOOKED:  # below it is flat
        return
    # the block holds the tile from the sides
    for x, y in ((2, 0), (-2, 0), (0, 2), (0, -2)):
        assert common_volume(block, tile.translate((x, y, 0))) > 1


def box_and_pieces(made: PrintedParts) -> tuple[Manifold, list[Manifold]]:
    return made.parts["box"], [made.parts[f"piece {k}"] for k in range(1, len(made.parts))]


def test_eight_pieces_sit_in_their_box() -> None:
    tray, pieces = box_and_pieces(make_puzzle(BUMPY, assembled=True))
    assert len(pieces) == 8
    mesh_of(tray)
    for k, piece in enumerate(pieces):
        assert common_volume(tray, piece) < 1e-6
        assert all(common_volume(piece, other) < 1e-6 for other in pieces[:k])
    whole = sum(pieces[1:], pieces[0])
    assert common_volume(tray, whole.translate((0, 0, 25))) < 1e-6
    assert common_volume(tray, whole.translate((0, 0, -1))) > 10
    assert tray.min_gap(whole, 2.0) < 0.3
    assert tray.bounding_box()[2] == 0


def test_pieces_lie_beside_their_box() -> None:
    made = make_puzzle(BUMPY)
    tray, pieces = box_and_pieces(made)
    assert made.notes[0] == "8 copies can be put together one by one, each by a straight move."
    assert made.notes[1] == "In the box they are put in one by one, straight from above."
    for k, piece in enumerate(pieces):
        assert piece.bounding_box()[2] == pytest.approx(0)
        assert all(piece.min_gap(other, 5.0) > 3 for other in (tray, *pieces[:k]))
    assert "interlocked" in make_puzzle(space_tile(hooked_tile(0, 1, 2))).notes[0]


def test_what_a_lifted_body_passes() -> None:
    body = Manifold.sphere(5, 48) + Manifold.cube((4, 4, 2)).translate((2, -2, 5))
    way = lifted(body, 12.0)
    for height in (0, 0.5, 3, 5):
        moved = body.translate((0, 0, height)).trim_by_plane((0, 0, -1), -12.0)
        assert (moved - way).volume() < 2e-3 * body.volume()
    # a cylinder on half a ball, and beside it what is below the cube's outline
    plain = np.pi * 25 * 12 + 2 / 3 * np.pi * 125
    assert plain < way.volume() < 1.06 * plain


def test_advice() -> None:
    plate = print_advice(Manifold.cube((40, 30, 0.6)), name="The plate")
    assert plate.thinnest == pytest.approx(0.6, abs=1e-3)
    assert plate.sentences[0] == "The plate is 40 x 30 x 1 mm on the bed and has 0.7 cm³."
    assert "less than two lines of a 0.4 mm nozzle" in plate.sentences[1]
    assert plate.sentences[2] == "It needs no supports."
    globe = ball(20, segments=80)
    advice = print_advice(as_body(globe))
    assert advice.thinnest == pytest.approx(40, rel=0.02)
    # what is below 45 degrees of southern latitude, but for what touches the bed
    assert advice.overhang == pytest.approx((1 - np.sqrt(0.5)) / 2 - 0.3 / 40, abs=0.02)
    assert "print it with supports" in advice.sentences[2]


def test_a_table_is_laid_upside_down() -> None:
    table = Manifold.cube((40, 40, 4)).translate((0, 0, 20))
    for x in (0, 35):
        for y in (0, 35):
            table += Manifold.cube((5, 5, 20)).translate((x, y, 0))
    mesh = as_mesh(table)
    turn = lying(mesh)
    assert np.linalg.det(turn) == pytest.approx(1)
    assert turn @ [0, 0, 1] == pytest.approx([0, 0, -1])
    assert overhang_share(mesh, (0, 0, 1)) > 0.1
    assert overhang_share(mesh.moved(turn), (0, 0, 1)) == 0
