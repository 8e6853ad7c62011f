"""Edges, their classes and the skeleton, of tilings with symmetric tiles and several prototiles."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import (
    IsohedralClass,
    Tile,
    Tiling,
    certify,
    copies_meeting,
    edge_classes,
    edge_to_edge,
    edges,
    skeleton,
)
from orbiflow.tiles.page import outline
from refusals import refused
from some_tilings import SQUARE, dirichlet_tilings, mirror_tiles, tilings


@settings(max_examples=12, deadline=None)
@given(tilings)
def test_an_edge_is_its_partners_image(tiling: Tiling) -> None:
    own = edges(tiling)
    size = tiling.radius
    assert sum(len(own.points(e)) - 1 for e in range(len(own))) == sum(
        len(p.polygon) for p in tiling.prototiles
    )
    for edge, (partner, element) in enumerate(zip(own.partners, own.across, strict=True)):
        assert element.prototile == own.owners[partner]
        image = element(own.points(partner))
        image = image[::-1] if element.determinant > 0 else image
        np.testing.assert_allclose(image, own.points(edge), atol=1e-9 * size)
        # and its tile lies on the other side
        there = shapely.Polygon(element(tiling.prototiles[element.prototile].polygon))
        here = shapely.Polygon(tiling.prototiles[own.owners[edge]].polygon)
        assert shapely.intersection(here, there, grid_size=1e-9 * size).area < 1e-7 * size**2
    for pair in own.identifications:
        assert pair.isometry is own.across[pair.second]
        if pair.kind == "mirror" and pair.folded:
            points = own.points(pair.second)
            np.testing.assert_allclose(pair.isometry(points), points, atol=1e-9 * size)


@settings(max_examples=12, deadline=None)
@given(tilings)
def test_one_edge_of_each_class_says_them_all(tiling: Tiling) -> None:
    own = edges(tiling)
    classes = edge_classes(own)
    said = [e for kind in classes for e in (kind.edge, *(image.edge for image in kind.images))]
    assert sorted(said) == list(range(len(own)))
    for kind in classes:
        points = own.points(kind.edge)
        for image in (*kind.images, *kind.folds):
            moved = image.isometry(points)
            moved = moved[::-1] if image.reversed else moved
            np.testing.assert_allclose(moved, own.points(image.edge), atol=1e-9 * tiling.radius)
        if kind.straight:
            line = shapely.LineString(points[[0, -1]])
            assert all(line.distance(shapely.Point(p)) < 1e-9 * tiling.radius for p in points)
        assert len(kind.folds) in (0, 1, 3)


@settings(max_examples=8, deadline=None)
@given(tilings, st.integers(0, 2**32 - 1))
def test_the_skeleton_has_every_edge_once(tiling: Tiling, seed: int) -> None:
    half = 3 * tiling.radius
    copies = copies_meeting(tiling, (*(tiling.center - half), *(tiling.center + half)))
    rng = np.random.default_rng(seed)
    if rng.random() < 0.5:  # with holes
        copies = copies.select(rng.random(len(copies)) < rng.uniform(0.1, 1))
    own = edges(tiling)
    found = skeleton(own, copies)
    sides = np.bincount(own.owners, minlength=len(tiling.prototiles))[copies.prototiles].sum()
    shared = int((found.other >= 0).sum())
    assert len(found) + shared == sides
    size = tiling.radius
    lines = [
        shapely.LineString(copies.isometry(copy)(own.points(edge)) / size)
        for copy, edge in zip(found.copy.tolist(), found.edge.tolist(), strict=True)
    ]
    if not lines:
        return
    middles = shapely.line_interpolate_point(lines, 0.4371, normalized=True)
    pairs = shapely.STRtree(lines).query(middles, predicate="dwithin", distance=1e-7)
    assert (pairs[0] == pairs[1]).all()
    # and together they are the copies' boundaries, by shapely
    rings = shapely.linearrings
    boundaries = sum(shapely.length(rings(ring / size)) for ring in copies.rings())
    twice = sum(shapely.length(lines[k]) for k in np.flatnonzero(found.other >= 0))
    assert np.isclose(shapely.length(lines).sum() + twice, boundaries)
    # ends with one number are one point, and edges that end together within the set have it
    places: dict[int, list] = {}
    for copy, edge, ends in zip(found.copy, found.edge, found.ends.tolist(), strict=True):
        points = copies.isometry(copy)(own.points(edge))
        for end, point in zip(ends, (points[0], points[-1]), strict=True):
            places.setdefault(end, []).append(point)
    for points in places.values():
        assert np.ptp(np.array(points), axis=0).max() < 1e-8 * size
    for copy, other in zip(found.copy, found.other, strict=True):
        assert other != copy


@settings(max_examples=12, deadline=None)
@given(st.one_of(mirror_tiles(), dirichlet_tilings(most=1)))
def test_outlines_of_symmetric_tiles_tile(tiling: Tiling) -> None:
    """Curves for cutters, made of one fit an edge class, flattened: certified as polygons are."""
    tile = Tile(tiling.prototiles[0].polygon, tiling.group)
    size = float(np.sqrt(tiling.tile_area))
    smooth = outline(tile, 0.01 * size)
    assert smooth.note == ""
    ring = smooth.closed[0].flattened(1e-3 * size)
    found = certify(Tile(ring, tiling.group), tolerance=5e-3)
    assert found.total_overlap < 5e-3
    assert found.uncovered < 5e-3
    own = edges(tile)
    for kind in edge_classes(own):
        first = smooth.curves[kind.edge]
        for image in kind.images:
            moved = first.moved(image.isometry.linear, image.isometry.translation)
            moved = moved.reversed() if image.reversed else moved
            there = smooth.curves[image.edge].flattened(1e-3 * size)
            np.testing.assert_allclose(moved.flattened(1e-3 * size), there, atol=1e-9 * size)


BRICKS = Tiling(wallpaper_group("p1", [[2, 1], [0, 1]]), [[[0, 0], [2, 0], [2, 1], [0, 1]]])


def test_bricks_become_edge_to_edge() -> None:
    assert certify(BRICKS).edge_matching == "curves"
    with refused("edge_to_edge"):
        edges(BRICKS)
    whole = edge_to_edge(BRICKS)
    assert certify(whole).edge_matching == "segments"
    assert [pair.kind for pair in edges(whole).identifications] == ["translation"] * 3
    assert whole.prototiles[0].polygon.tolist() == [[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1]]


def test_vertices_that_break_the_symmetry_are_given_to_all() -> None:
    ring = np.insert(SQUARE, 1, (0.13, -0.5), axis=0)
    tiling = Tiling(wallpaper_group("p4m"), [ring])
    with refused("edge_to_edge"):
        edges(tiling)
    whole = edge_to_edge(tiling)
    assert len(whole.prototiles[0].polygon) == 12
    assert certify(whole).edge_matching == "segments"
    assert len(edges(whole)) == 4


@settings(max_examples=6, deadline=None)
@given(tilings)
def test_what_is_edge_to_edge_stays_so(tiling: Tiling) -> None:
    for before, after in zip(tiling.prototiles, edge_to_edge(tiling).prototiles, strict=True):
        np.testing.assert_array_equal(before.polygon, after.polygon)


def test_corners_stay_where_they_were() -> None:
    from orbiflow.tiles import Prototile

    brick = Prototile(BRICKS.prototiles[0].polygon, (1, 2))
    (after,) = edge_to_edge(Tiling(BRICKS.group, [brick])).prototiles
    assert after.polygon[list(after.corners)].tolist() == [[2, 0], [2, 1]]


def test_the_templates(kind: IsohedralClass) -> None:
    found = edges(Tile(kind.template(), kind.group())).identifications
    expected = {(pair.first, pair.second, pair.reversed) for pair in kind.identified_edges}
    assert {(pair.first, pair.second, pair.reversed) for pair in found} == expected


@pytest.mark.parametrize("turned", [False, True])
def test_bent_tiles(kind: IsohedralClass, make_tile, turned: bool) -> None:
    tile = make_tile(kind, seed=3, stretch=0.1, per_edge=15)
    if turned:  # the other sense, and begun within an edge
        count = len(tile.polygon)
        tile = Tile(np.roll(tile.polygon[::-1], -4, axis=0), tile.group)
        corners = sorted((count - 1 - k * 15 - 4) % count for k in range(count // 15))
        assert list(edges(tile).starts) == corners
    else:
        assert edges(tile).starts == tile.corners
    own = edges(tile)
    assert sum(len(own.points(k)) - 1 for k in range(len(own.starts))) == len(tile.polygon)
    for pair in own.identifications:
        image = pair.isometry(own.points(pair.first))
        image = image[::-1] if pair.reversed else image
        np.testing.assert_allclose(image, own.points(pair.second), atol=1e-9)
        assert own.across[pair.second].is_close(pair.isometry)
