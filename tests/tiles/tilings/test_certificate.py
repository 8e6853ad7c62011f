"""What is a tile is certified, what is not is refused and says why."""

import cProfile
import itertools
import json
import tracemalloc
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.errors import CertificationError
from orbiflow.symmetry import CrystallographicGroup, rotation, rotation_matrix
from orbiflow.tiles import IsohedralClass, Tile, certify, isohedral_class
from refusals import refused


def square(side: float = 1.0) -> Tile:
    group = CrystallographicGroup.generate(np.eye(2))
    return Tile(side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), group)


@pytest.mark.parametrize("seed", range(3))
def test_stretched_templates_of_any_shape(kind: IsohedralClass, make_tile: Any, seed: int) -> None:
    tile = make_tile(kind, seed, bend=0.0, stretch=0.8, shape=0.25)
    certificate = certify(tile)
    assert certificate.valid, certificate
    assert certificate.edge_matching == "segments"
    assert certificate.edge_mismatch < 1e-13
    assert certificate.total_overlap < 1e-13
    assert certificate.uncovered < 1e-13


@pytest.mark.parametrize("seed", range(3))
def test_equivariant_perturbation_tiles(kind: IsohedralClass, make_tile: Any, seed: int) -> None:
    tile = make_tile(kind, seed, stretch=0.3, shape=0.1)
    certificate = certify(tile)
    assert certificate.valid, certificate
    assert certificate.neighbours == len(kind.template())


def test_other_perturbations_do_not(kind: IsohedralClass, make_tile: Any) -> None:
    tile = make_tile(kind, 1)
    for vertex in (7, 55):
        polygon = tile.polygon.copy()
        polygon[vertex] += (1e-5, 2e-5)
        certificate = certify(Tile(polygon, tile.group))
        assert not certificate.valid
        assert certificate.edge_mismatch > 1e-6
        assert any("edges miss" in reason for reason in certificate.reasons)


def test_clockwise_and_y_down(kind: IsohedralClass, make_tile: Any) -> None:
    tile = make_tile(kind, 2, stretch=0.3)
    backwards = certify(Tile(tile.polygon[::-1], tile.group))
    assert backwards.valid
    assert backwards.signed_area < 0
    flip = np.diag([1.0, -1.0])
    assert certify(tile.transformed(flip, np.array([3.0, 40.0]))).valid


@settings(max_examples=12, deadline=None)
@given(
    exponent=st.floats(-3, 5),
    angle=st.floats(-3.2, 3.2),
    offset=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
    name=st.sampled_from(["IH2", "IH5", "IH21"]),
)
def test_any_scale_turn_and_position(
    exponent: float, angle: float, offset: tuple[float, float], name: str
) -> None:
    kind = isohedral_class(name)
    tile = Tile(kind.template(), kind.group())
    scale = 10.0**exponent
    moved = tile.transformed(scale * rotation_matrix(angle), scale * np.array(offset))
    certificate = certify(moved)
    assert certificate.valid, certificate
    assert certificate.expected_area == pytest.approx(scale**2 * 1.5 * np.sqrt(3.0))


def test_crossing_polygons_are_refused_with_the_place(make_tile: Any) -> None:
    tile = make_tile(isohedral_class("IH5"))
    polygon = tile.polygon + np.array([500.0, 0.0])
    polygon[[10, 60]] = polygon[[60, 10]]
    group = tile.group.conjugate(np.eye(2), np.array([500.0, 0.0]))
    certificate = certify(Tile(polygon, group))
    assert not certificate.valid
    assert not certificate.simple
    assert "self-intersection near (500." in certificate.reasons[0]
    assert json.loads(json.dumps(certificate.as_dict()))["overlap"] is None


@pytest.mark.parametrize(
    "polygon",
    [
        *([[0, 0], [1, 1], [2, 2]], [[0, 0], [0, 0], [0, 0]], [[0, 0], [1, 0], [1, 0], [0, 0]]),
        *([[0, 0], [1, 1], [1, 0], [0, 1]], [[0, 0], [1, 0], [1, 1], [0.5, 0.0], [0, 1]]),
        *([[0, 0], [1e6, 0], [1e6, 1e6]], [[0, 0], [1e-9, 0], [0, 1e-9]]),
        [[0, 0], [5, 0], [5, 5], [0, 5]],
    ],
)
def test_awkward_polygons_never_crash(polygon: list[list[float]]) -> None:
    for order in (2, 4):
        group = CrystallographicGroup.generate(np.eye(2), [rotation((0.5, 0.5), order)])
        certificate = certify(Tile(np.array(polygon, dtype=float), group))
        assert not certificate.valid
        assert certificate.reasons
        json.dumps(certificate.as_dict(), allow_nan=False)


def test_repeated_vertices_do_no_harm() -> None:
    tile = square()
    assert certify(Tile(np.repeat(tile.polygon, 2, axis=0), tile.group)).valid


def test_doubly_covering_tile_is_refused() -> None:
    """Every edge of the square finds a partner under p2, but the plane is covered twice."""
    group = CrystallographicGroup.generate(np.eye(2), [rotation((0.5, 0.2), 2)])
    certificate = certify(Tile(square().polygon, group))
    assert certificate.edge_mismatch < 1e-12
    assert certificate.total_overlap == pytest.approx(2.0)  # of the expected area, one half
    assert not certificate.valid


def test_bricks_match_as_curves() -> None:
    group = CrystallographicGroup.generate(np.array([[1.0, 0.3], [0.0, 1.0]]))
    certificate = certify(Tile(square().polygon, group))
    assert certificate.valid, certificate
    assert certificate.edge_matching == "curves"
    assert certificate.neighbours == 6


def test_tolerance_is_the_callers() -> None:
    tile = isohedral_class("IH4")
    rounded = Tile(tile.template().round(6), tile.group())
    assert not certify(rounded).valid
    assert certify(rounded, tolerance=1e-5).valid


def test_require() -> None:
    certify(square()).require()
    with refused("1.44", kind=CertificationError):
        certify(square(1.2)).require()


def test_work_does_not_grow_with_the_square_of_the_vertices(make_tile: Any) -> None:
    """Calls and memory, not seconds: those depend on who else is at work."""
    calls, memory = zip(*(cost(make_tile, per_edge) for per_edge in (33, 330)), strict=True)
    assert calls[1] < 1.5 * calls[0]
    assert memory[1] < 20 * memory[0]


def cost(make_tile: Any, per_edge: int) -> tuple[int, int]:
    """Calls of functions, and bytes at most, of a certificate."""
    tile = make_tile(isohedral_class("IH6"), per_edge=per_edge)
    certify(tile)  # caches are full now
    profile = cProfile.Profile()
    assert profile.runcall(certify, tile).valid
    tracemalloc.start()
    certify(tile)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return sum(entry.callcount for entry in profile.getstats()), peak


@pytest.mark.parametrize("angle", np.linspace(-3.0, 3.0, 13))
def test_edges_that_agree_but_for_rounding_do_not_fool_the_overlay(angle: float) -> None:
    kind = isohedral_class("IH2")
    tile = Tile(kind.template(), kind.group()).transformed(rotation_matrix(angle), np.zeros(2))
    assert certify(tile).valid


def test_needles_finer_than_rounding_are_refused_in_words() -> None:
    found: list[str] = []
    some = [(2.7, 0.28, 0.83, -0.1), (5.5, 0.15, 0.73, 0.8), (0.4, 0.28, 0.8, 0.1)]
    for width, (turn, a, b, c) in itertools.product([-2e-16, -6e-17, -4e-17], some):
        side = np.array([[0, 0], [a, 0], [b, c], [0, c * 0.3], [0, c * 0.7], [b, 0]])
        side[3:5] += [[a + 0.3 * (b - a), width], [a + 0.7 * (b - a), 2 * width]]
        ring = np.concatenate([side, [[1, 0], [1, 1]], (side[1:] + np.eye(2)[1])[::-1], [[0, 1]]])
        basis = rotation_matrix(turn)
        certificate = certify(Tile(ring @ basis.T, CrystallographicGroup.generate(basis)))
        assert certificate.valid == (not certificate.reasons)
        found.extend(certificate.reasons)
    assert any("thinner than 1e-12" in reason for reason in found)


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 2])
@pytest.mark.parametrize(
    ("lattice", "turns"),
    [
        ([[100.0, 0.0], [0.0, 0.01]], False),
        ([[100.0, 0.0], [0.0, 0.02]], True),  # half turns make the other row
        ([[100.0, 50.0], [0.0, 0.01]], False),  # bricks
        ([[100.0, 100.0], [0.01, 0.0]], False),
    ],
)
def test_thin_rectangles_tile(turn: float, lattice: Any, turns: bool) -> None:
    rectangle = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 0.01], [0.0, 0.01]])
    elements = [rotation((50.0, 0.01), 2)] * turns
    group = CrystallographicGroup.generate(np.array(lattice), elements)
    turned = group.conjugate(rotation_matrix(turn), np.zeros(2))
    assert certify(Tile(rectangle @ rotation_matrix(turn).T, turned)).valid
    for wrong in ((1.001, 1.0), (1.0, 1.1), (1.0, 0.5)):
        assert not certify(Tile((rectangle * wrong) @ rotation_matrix(turn).T, turned)).valid


def test_a_tile_in_other_units_than_its_group_is_refused_at_once() -> None:
    certificate = certify(square(1000.0))
    assert "have the same units" in certificate.reasons[0]
