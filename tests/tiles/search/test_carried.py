"""The map from the silhouette to its tile."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.tiles import Bending, EscherTile, Frame, TileMap, signed_area
from orbiflow.tiles.search import carried_anew
from orbiflow.tiles.search.bent_map import map_of_bent, onto_polygon
from orbiflow.tiles.silhouette import triangulate, unfolded
from orbiflow.tiles.silhouette.bending import MAX_POINTS
from outlines import BentTile, animal, bent_squirrel, disc
from refusals import refused
from strategies import seeds

CASES = [("IH4", False), ("IH5", False), ("IH21", False), ("IH4", True), ("IH21", True)]


@cache
def bending(name: str, mirrored: bool = False) -> tuple[BentTile, Bending]:
    case = bent_squirrel(name, mirrored)
    return case, map_of_bent(case.bent, case.factor, case.shift, case.tile)


def outline(case: BentTile) -> Array:
    side = case.bent.orientation
    return side.outline * (1.0, -1.0) if side.mirrored else side.outline


def points_in(ring: Array, count: int, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    points = rng.uniform(ring.min(axis=0), ring.max(axis=0), (4 * count, 2))
    return points[shapely.contains_xy(shapely.Polygon(ring), *points.T)][:count]


@pytest.mark.parametrize(("name", "mirrored"), CASES)
def test_the_outline_lands_on_the_certified_polygon(name: str, mirrored: bool) -> None:
    case, carried = bending(name, mirrored)
    tile = shapely.Polygon(case.tile.polygon)
    ring = outline(case)
    dense = np.concatenate([ring + t * (np.roll(ring, -1, axis=0) - ring) for t in (0, 0.3, 0.8)])
    images = carried.forward(dense)
    assert shapely.distance(shapely.points(images), tile.exterior).max() < 1e-12
    # and covers it: every vertex of the polygon comes from the outline
    back = carried.inverse(case.tile.polygon)
    assert shapely.distance(shapely.points(back), shapely.LinearRing(ring)).max() < 1e-9
    pieces = np.asarray(shapely.polygons(carried.images[carried.triangles]))
    assert abs(shapely.area(pieces).sum() - tile.area) < 1e-12
    assert abs(shapely.union_all(pieces).symmetric_difference(tile).area) < 1e-9
    # there and back
    points = points_in(outline(case), 2000)
    assert abs(carried.inverse(carried.forward(points)) - points).max() < 1e-9
    images = points_in(case.tile.polygon, 2000)
    assert abs(carried.forward(carried.inverse(images)) - images).max() < 1e-9


def test_tensors_lists_and_shapes() -> None:
    case, carried = bending("IH4")
    points = points_in(outline(case), 12).reshape(3, 4, 2)
    there = carried.forward(points)
    assert there.shape == points.shape
    assert isinstance(there, np.ndarray)
    tensor = carried.forward(torch.tensor(points, dtype=torch.float32))
    assert tensor.dtype == torch.float32
    assert abs(tensor.numpy() - there).max() < 1e-5
    assert carried.forward(torch.zeros(2, dtype=torch.int64)).dtype == torch.float64
    assert np.array_equal(carried.forward(points.tolist()), there)
    assert carried.forward(np.zeros((0, 2))).shape == (0, 2)
    assert np.isnan(carried.inverse([[np.nan, 0.0], [np.inf, 0.0], [0.0, 0.0]])).any(
        axis=1
    ).tolist() == [True, True, False]
    with refused("points"):
        carried.forward(np.zeros(3))


def test_in_the_input_s_coordinates() -> None:
    case, own = bending("IH4")
    frame = animal("squirrel.dat").frame
    placed = case.tile.transformed(frame.linear, frame.offset)
    carried = EscherTile(placed, map_source=TileMap(frame=frame, bending=own))
    assert carried.map is not None
    assert carried.map.ends_on(placed)
    ring = animal("squirrel.dat").outline
    dense = np.concatenate([ring + t * (np.roll(ring, -1, axis=0) - ring) for t in (0, 0.3, 0.8)])
    size = np.sqrt(abs(placed.signed_area))
    for way, start, end in (
        (carried.forward, dense, placed.polygon),
        (carried.inverse, placed.polygon, ring),
    ):
        there = shapely.points(way(start))
        assert shapely.distance(there, shapely.LinearRing(end)).max() < 1e-6 * size
    points = frame.to_input(points_in(outline(case), 100))
    images = carried.forward(points)
    assert shapely.contains_xy(shapely.Polygon(carried.tile.polygon), *images.T).all()
    extent = np.ptp(carried.tile.polygon)
    assert abs(carried.inverse(images) - points).max() < 1e-9 * extent
    assert torch.is_tensor(carried.forward(torch.tensor(points)))


def test_no_map_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbiflow.tiles.silhouette.bending.MAX_SHARPENINGS", 2)
    case = bent_squirrel("IH4")
    crossed = case.tile.polygon[::-1]  # against the outline's sense: nothing can follow
    tile = type(case.tile)(crossed, case.tile.group, case.tile.isohedral_class, case.tile.corners)
    with refused("silhouette"):
        map_of_bent(case.bent, case.factor, case.shift, tile)
    bare = EscherTile(tile, map_source=TileMap(frame=Frame(np.eye(2), np.zeros(2))))
    with refused("IH4", "map"):
        bare.forward([0.0, 0.0])


@given(seeds, st.integers(3, 40))
def test_a_polygon_with_vertices_of_its_own(seed: int, count: int) -> None:
    """Where the polygon bends between points of the outline, the outline gets points there."""
    rng = np.random.default_rng(seed)
    ring = disc(24)
    mesh = triangulate(ring)
    turns = np.sort(rng.uniform(0, 2 * np.pi, count))
    turns[0] = 0
    radii = rng.uniform(0.5, 0.6, count)
    polygon = radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    if not shapely.Polygon(polygon).contains(shapely.Point(0, 0)):
        return
    fitted, images = onto_polygon(mesh, mesh.points, polygon, np.array([0]), np.array([0]))
    assert (signed_area(fitted.points[fitted.triangles]) > 0).all()
    assert abs(signed_area(fitted.points[fitted.triangles]).sum() - 1) < 1e-12
    boundary = fitted.size + len(fitted.sides)
    tile = shapely.Polygon(polygon)
    assert shapely.distance(shapely.points(images[:boundary]), tile.exterior).max() < 1e-12
    there = images[:boundary]
    for vertex in polygon:
        assert np.linalg.norm(there - vertex, axis=1).min() < 1e-12
    rest = shapely.LinearRing(ring)
    assert shapely.distance(shapely.points(fitted.points[:boundary]), rest).max() < 1e-12
    signed = signed_area(unfolded(fitted, images)[fitted.triangles])
    assert (signed > 0).all()
    assert abs(signed.sum() - tile.area) < 1e-12


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])
BAD: dict[str, tuple[Any, Any, Any]] = {
    **{"shape": (SQUARE[:, :1], SQUARE, TWO), "count": (SQUARE, SQUARE[:3], TWO)},
    **{"not finite": (SQUARE, SQUARE * np.nan, TWO), "fractions": (SQUARE, SQUARE, TWO + 0.5)},
    **{"pairs": (SQUARE, SQUARE, TWO[:, :2]), "none": (SQUARE, SQUARE, TWO[:0])},
    **{"range": (SQUARE, SQUARE, TWO + 1), "negative": (SQUARE, SQUARE, TWO - 1)},
    "many": (np.zeros((MAX_POINTS + 1, 2)), np.zeros((MAX_POINTS + 1, 2)), TWO),
    "turned over": (SQUARE, SQUARE, TWO[:, ::-1]),
    **{"mirrored": (SQUARE, SQUARE * (-1, 1), TWO), "flat": (SQUARE, SQUARE * (1, 0), TWO)},
    "huge": (SQUARE, SQUARE * 1e300, TWO),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_map_is_refused(case: str) -> None:
    with refused():
        Bending(*BAD[case])


@pytest.mark.parametrize(("name", "mirrored"), CASES)
def test_with_triangles_of_its_own_a_map_is_carried_to_where_the_outline_goes(
    name: str, mirrored: bool
) -> None:
    case, known = bending(name, mirrored)
    ring = case.tile.polygon
    size = np.ptp(ring, axis=0).max()
    shear = np.array([[1.0, 0.4], [0.0, 1.2]])
    found = carried_anew(known, ring, ring @ shear.T, 10)
    points = points_in(outline(case), 800)
    # what is affine is followed, but for where chords cut the silhouette's outline off
    apart = np.hypot(*(found.forward(points) - known.forward(points) @ shear.T).T)
    assert np.median(apart) < 0.02 * size
    pieces = shapely.polygons(found.images[found.triangles])
    tile = shapely.Polygon(ring @ shear.T)
    assert abs(shapely.union_all(np.asarray(pieces)).symmetric_difference(tile).area) < 1e-9
