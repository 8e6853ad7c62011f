"""The linear space of a class's tiles."""

import itertools
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array, Complex
from orbiflow.tiles import (
    CLASSES,
    ISOHEDRAL_TYPES,
    Tile,
    certify,
    complex_points,
    plane_points,
    resampled,
    signed_area,
)
from orbiflow.tiles.search import Placements, TileSpace, best_placements
from orbiflow.tiles.search.tile_space import _compositions, _count, edge_lengths
from outlines import animal
from strategies import angles, seeds

COUNT = 48
OUTLINE = complex_points(resampled(animal("squirrel.dat").normal, COUNT))
GLIDES = [n for n, k in CLASSES.items() if any(not p.reversed for p in k.identified_edges)]
TURNING = [n for n in GLIDES if CLASSES[n].stretch_dim == 1]


@cache
def placements(name: str, count: int = 12) -> Placements:
    return best_placements(ISOHEDRAL_TYPES[name], OUTLINE, count)


def space(name: str, count: int = 12) -> TileSpace:
    return TileSpace(ISOHEDRAL_TYPES[name], placements(name, count))


def outlines(of: TileSpace, seed: int) -> Complex:
    """(C, n) the squirrel, a little different for each placement."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(2, of.count, of.size)) * 0.02
    return OUTLINE + noise[0] + 1j * noise[1]


def tile_of(of: TileSpace, index: int, ring: Complex, linear: Array, offset: Array) -> Tile:
    """A polygon of the space (n,), in the outline's order, with its group."""
    vertices = plane_points(ring[of.order[index]])
    group = of.kind.group().conjugate(linear, offset)
    return Tile(vertices, group, of.kind.name, tuple(of.corners[index].tolist()))


def edge_error(of: TileSpace, index: int, ring: Complex, linear: Array, offset: Array) -> float:
    """Largest distance of an edge's vertices from the images of its partner's."""
    vertices = plane_points(ring[of.order[index]])
    own = (vertices - offset) @ np.linalg.inv(linear).T
    closed = np.concatenate([own, own[:1]])
    ends = [*of.corners[index].tolist(), of.size]
    worst = 0.0
    for pair in of.kind.identified_edges:
        first, second = (closed[ends[k] : ends[k + 1] + 1] for k in (pair.first, pair.second))
        image = pair.isometry(first)
        image = image[::-1] if pair.reversed or pair.folded else image
        worst = max(worst, np.abs((image - second) @ linear.T).max())
    return worst


SYMMETRIC = [name for name, kind in ISOHEDRAL_TYPES.items() if len(kind.stabiliser) > 1]


@pytest.mark.parametrize("name", [*CLASSES, *SYMMETRIC])
@settings(max_examples=2)
@given(seed=seeds, turn=angles)
def test_nearest_is_the_projection_by_the_matrices(name: str, seed: int, turn: float) -> None:
    own = space(name, 12 if name in CLASSES else 4)
    own.turn(own.turns + turn)
    goals = outlines(own, seed)
    found = own.nearest(goals)
    ordered = own.in_order(found.vertices)
    for k in range(own.count):
        real, imaginary = own.matrices(k)
        stacked = np.concatenate([real, imaginary])
        goal = np.concatenate([goals[k].real, goals[k].imag])
        parameters = np.linalg.lstsq(stacked, goal, rcond=None)[0]
        nearest = real @ parameters + 1j * (imaginary @ parameters)
        assert abs(nearest - ordered[k]).max() < 1e-7
        assert found.distance[k] == pytest.approx((abs(nearest - goals[k]) ** 2).sum(), rel=1e-7)
        if name in SYMMETRIC:
            continue
        linear, offset = own.group(k, parameters)
        assert linear == pytest.approx(found.linear[k], abs=1e-6)
        if name != "IH1":  # which does not care where its group's origin is
            assert offset == pytest.approx(found.offset[k], abs=1e-6)


@pytest.mark.parametrize("name", CLASSES)
@settings(max_examples=4)
@given(seed=seeds, turn=angles)
def test_every_point_of_the_space_is_a_tile(name: str, seed: int, turn: float) -> None:
    own = space(name, 4)
    own.turn(own.turns + turn)
    rng = np.random.default_rng(seed)
    for k in range(own.count):
        real, imaginary = own.matrices(k)
        parameters = rng.normal(size=real.shape[1])
        ring = real @ parameters + 1j * (imaginary @ parameters)
        linear, offset = own.group(k, parameters)
        if np.linalg.cond(linear) < 1e3:
            assert edge_error(own, k, ring, linear, offset) < 1e-10 * (1 + abs(ring).max())


@pytest.mark.parametrize("name", CLASSES)
def test_the_nearest_tiles_match_and_certify(name: str) -> None:
    own = space(name, 200)
    own.turn(own.best_turns(np.tile(OUTLINE, (own.count, 1))))
    found = own.nearest(np.tile(OUTLINE, (own.count, 1)))
    rings = own.in_order(found.vertices)
    order = np.argsort(found.distance)
    certified = 0
    for k in order:
        if np.linalg.det(found.linear[k]) < 1e-3:
            continue
        assert edge_error(own, k, rings[k], found.linear[k], found.offset[k]) < 1e-12
        tile = tile_of(own, k, rings[k], found.linear[k], found.offset[k])
        if shapely.Polygon(tile.polygon).is_valid and signed_area(tile.polygon) > 0:
            assert certify(tile).valid
            certified += 1
        if certified == 3:
            break
    assert certified == 3


@pytest.mark.parametrize("name", TURNING)
@given(seed=seeds, error=st.floats(0.2, 1.4))
def test_best_turns_suit_a_tile_turned_away(name: str, seed: int, error: float) -> None:
    """The glides' directions of a tile are found from its edges alone."""
    own = space(name)
    own.turn(own.best_turns(outlines(own, seed)))
    tiles = own.in_order(own.nearest(outlines(own, seed)).vertices)
    right = own.turns.copy()
    own.turn(right + error)
    own.turn(own.best_turns(tiles))
    assert own.nearest(tiles).distance.max() < 1e-9
    assert abs(np.exp(2j * (own.turns - right)) - 1).max() < 1e-6


def test_classes_without_glides_keep_their_turns() -> None:
    for name in CLASSES:
        if name not in GLIDES:
            own = space(name)
            own.turn(np.full(own.count, 0.3))
            assert (own.best_turns(outlines(own, 0)) == 0.3).all()


@pytest.mark.parametrize("multiplicities", [(2, 2, 2), (1, 2, 1, 1, 1), (2, 2, 1, 1), (2, 1)])
def test_compositions_are_all_there(multiplicities: tuple[int, ...]) -> None:
    for total in (4, 9, 12):
        brute = {
            row
            for row in itertools.product(range(1, total), repeat=len(multiplicities))
            if np.dot(row, multiplicities) == total
        }
        found = _compositions(multiplicities, total)
        assert {tuple(row) for row in found.tolist()} == brute
        assert len(found) == len(brute) == _count(multiplicities, total)


@pytest.mark.parametrize("name", CLASSES)
def test_lengths_fit_the_class(name: str) -> None:
    lengths = edge_lengths(CLASSES[name], 24)
    assert (lengths.sum(axis=1) == 24).all()
    for pair in CLASSES[name].identified_edges:
        assert (lengths[:, pair.first] == lengths[:, pair.second]).all()
