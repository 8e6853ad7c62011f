"""Triangulations of silhouettes."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from awkward import NOT_SIMPLE, STRANGE
from orbiflow.arrays import Array
from orbiflow.settings import as_array
from orbiflow.tiles import orient, resampled, signed_area
from orbiflow.tiles.silhouette import Mesh, triangulate
from outlines import ANIMALS, SHAPES, animal, comb, disc, dumbbell, slit_square, star, unit
from refusals import refused
from strategies import dyadic_rings

HARD: dict[str, Array] = {
    **SHAPES,
    **{name: np.asarray(animal(name).normal) for name in ANIMALS},
    "hair": unit(dumbbell(1e-3, 2.0)),
    "hair slit": slit_square(1e-3, 0.9),
    "fine comb": resampled(unit(comb(12, 0.03, 0.02, 1.0)), 480),
    "needle star": star(12, 0.1),
    "circle of 20,000, resampled": resampled(disc(20_000), 480),
    "twenty in line": np.concatenate([np.linspace([0, 0], [1, 0], 20), [[0.5, 1.5]]]),
}


def assert_fills(mesh: Mesh, ring: Array) -> None:
    """All that a mesh promises."""
    n, outline = len(ring), mesh.size + len(mesh.sides)
    area = signed_area(ring)
    assert mesh.size == n
    assert np.array_equal(mesh.points[:n], ring)
    assert np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.points)))
    corners = mesh.points[mesh.triangles]
    assert (signed_area(corners) > 0).all()
    assert abs(signed_area(corners).sum() - area) < 1e-12 * max(1, area)
    # points on sides lie there
    start, end = ring[mesh.sides], ring[(mesh.sides + 1) % n]
    assert ((mesh.shares > 0) & (mesh.shares < 1)).all()
    on_side = start + mesh.shares[:, None] * (end - start)
    assert np.abs(mesh.points[n:outline] - on_side).max(initial=0) < 1e-12 * max(1, area)
    # each directed side is one triangle's; those without a partner run round the outline
    t = mesh.triangles
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    codes = directed[:, 0] * len(mesh.points) + directed[:, 1]
    assert len(np.unique(codes)) == len(codes)
    partners = directed[:, 1] * len(mesh.points) + directed[:, 0]
    free = directed[~np.isin(partners, codes)]
    place = np.concatenate([np.arange(n), mesh.sides + mesh.shares])
    order = np.argsort(place)
    expected = np.stack([order, np.roll(order, -1)], axis=1)
    assert set(map(tuple, free.tolist())) == set(map(tuple, expected.tolist()))
    # every triangle can follow the outline: no chords
    inner = directed[np.isin(partners, codes)]
    assert not (inner < outline).all(axis=1).any()
    assert not (t < outline).all(axis=1).any()


@pytest.mark.parametrize("name", HARD)
def test_triangles_fill_the_polygon(name: str) -> None:
    ring = HARD[name]
    mesh = triangulate(ring)
    assert_fills(mesh, ring)
    pieces = np.asarray(shapely.polygons(mesh.points[mesh.triangles]))
    assert shapely.covers(shapely.Polygon(ring).buffer(1e-9), pieces).all()


@settings(max_examples=30)
@given(dyadic_rings())
def test_any_star_shaped_polygon(ring: Array) -> None:
    ring = unit(orient(ring))
    assert_fills(triangulate(ring), ring)


@given(dyadic_rings())
def test_finer_inside_where_asked(ring: Array) -> None:
    ring = unit(orient(ring))
    coarse, fine = triangulate(ring, 0.4), triangulate(ring, 0.08)
    assert_fills(coarse, ring)
    assert_fills(fine, ring)
    assert len(fine.points) > len(coarse.points)


@pytest.mark.parametrize("name", sorted(STRANGE))
def test_strange_polygons(name: str) -> None:
    ring = unit(orient(as_array(STRANGE[name], "the ring", ("N", 2))))
    assert_fills(triangulate(ring), ring)


@pytest.mark.parametrize("name", sorted(NOT_SIMPLE))
def test_what_crosses_itself_is_refused(name: str) -> None:
    with refused("polygon"):
        triangulate(np.array(NOT_SIMPLE[name], dtype=np.float64))


@given(dyadic_rings(), st.data())
def test_a_point_twice_is_refused(ring: Array, data: st.DataObject) -> None:
    place = data.draw(st.integers(0, len(ring) - 1))
    with refused("twice"):
        triangulate(np.insert(unit(orient(ring)), place, unit(orient(ring))[place], axis=0))
