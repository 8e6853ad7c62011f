"""Tilings by several prototiles and by tiles with a symmetry: certified; edges and skeleton."""

import re

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import (
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    identity,
    symmetry_elements,
    wallpaper_group,
)
from orbiflow.tiles import (
    IsohedralClass,
    Placed,
    Prototile,
    Tile,
    Tiling,
    aspects,
    certify,
    colouring,
    copies_inside,
    copies_meeting,
    dirichlet_tile,
    dirichlet_tiling,
    edge_classes,
    edge_to_edge,
    edges,
    neighbours,
    patch,
    skeleton,
)
from orbiflow.tiles.page import outline
from refusals import refused
from some_tilings import (
    NAMED,
    SQUARE,
    dirichlet_tilings,
    fixing,
    mirror_tiles,
    shared_lengths,
    sites,
    tilings,
)
from strategies import seeds, wallpaper_groups


def window_of(tiling: Tiling, half: float = 2.5) -> tuple[float, float, float, float]:
    low, high = tiling.box
    reach = half * np.sqrt(tiling.tile_area)
    return (*(low - reach).tolist(), *(high + reach).tolist())


@pytest.mark.parametrize("name", NAMED)
def test_named_tilings_and_their_stabilisers(name: str) -> None:
    tiling, orders = NAMED[name]
    certificate = certify(tiling)
    assert certificate.valid, certificate
    assert certificate.edge_matching == "segments"
    assert tuple(own.order for own in tiling.stabilisers) == orders


@settings(max_examples=15, deadline=None)
@given(tilings)
def test_certified(tiling: Tiling) -> None:
    certificate = certify(tiling)
    assert certificate.valid, certificate
    assert certificate.edge_matching == "segments"
    assert certificate.area_error < 1e-12
    assert certificate.total_overlap < 1e-11
    assert certificate.uncovered < 1e-11


@settings(max_examples=15, deadline=None)
@given(tilings, seeds)
def test_a_vertex_moved_by_a_millionth_is_refused(tiling: Tiling, seed: int) -> None:
    rng = np.random.default_rng(seed)
    k = int(rng.integers(len(tiling.prototiles)))
    ring = tiling.prototiles[k].polygon.copy()
    vertex, angle = int(rng.integers(len(ring))), rng.uniform(0, 2 * np.pi)
    step = 1e-6 * np.sqrt(tiling.tile_area) * np.array([np.cos(angle), np.sin(angle)])
    before, after = ring[vertex - 1], ring[(vertex + 1) % len(ring)]
    # along a straight boundary it would move nothing
    for other in (before, after):
        along = (other - ring[vertex]) / np.linalg.norm(other - ring[vertex])
        assume(abs(along[0] * step[1] - along[1] * step[0]) > 0.1 * np.linalg.norm(step))
    ring[vertex] += step
    own = [ring if n == k else p for n, p in enumerate(tiling.prototiles)]
    certificate = certify(Tiling(tiling.group, own))
    assert not certificate.valid
    found = certificate
    assert max(found.area_error, found.edge_mismatch, found.total_overlap, found.uncovered) > 2e-8


@settings(max_examples=8, deadline=None)
@given(tilings, st.sampled_from([0.97, 1.02]))
def test_a_prototile_of_another_size_is_refused(tiling: Tiling, scale: float) -> None:
    first, *others = tiling.prototiles
    scaled = (first.polygon - first.center) * scale + first.center
    certificate = certify(Tiling(tiling.group, [scaled, *others]))
    assert not certificate.valid
    assert any("area" in reason for reason in certificate.reasons)
    gap, overlap = certificate.uncovered > 1e-4, certificate.total_overlap > 1e-4
    assert gap if scale < 1 else overlap


@settings(max_examples=8, deadline=None)
@given(tilings)
def test_a_patch_covers_its_window_once(tiling: Tiling) -> None:
    """By shapely alone: areas of the pieces in a window add up to its own, as that of their union."""
    window = window_of(tiling)
    box = shapely.box(*window)
    elements = patch(tiling, window)
    shapes = [shapely.Polygon(g(tiling.prototiles[g.prototile].polygon)) for g in elements]
    pieces = shapely.intersection(shapes, box)
    assert np.isclose(shapely.area(pieces).sum(), box.area, rtol=1e-9)
    assert np.isclose(
        shapely.union_all(pieces, grid_size=1e-9 * box.length).area, box.area, rtol=1e-6
    )
    # the same tiles as integers, each once
    copies = copies_meeting(tiling, window)
    keys = set(zip(copies.aspects.tolist(), map(tuple, copies.cells.tolist()), strict=True))
    assert len(keys) == len(copies) == len(elements)
    assert sorted(aspects(tiling, elements)) == sorted(copies.aspects.tolist())
    for index, ring in enumerate(copies.rings()):
        found = copies.isometry(index)
        own = tiling.prototiles[found.prototile].polygon
        np.testing.assert_allclose(ring, found(own), atol=1e-9 * tiling.radius)
    inside = copies_inside(tiling, window)
    assert len(inside) == sum(bool(box.contains(shape)) for shape in shapes)


@settings(max_examples=8, deadline=None)
@given(tilings)
def test_neighbours_and_colours_are_those_that_shapely_measures(tiling: Tiling) -> None:
    size = np.sqrt(tiling.tile_area)
    chosen = colouring(tiling)
    elements = patch(tiling, window_of(tiling, 1.0))
    shapes = [shapely.Polygon(g(tiling.prototiles[g.prototile].polygon)) for g in elements]
    colours = [chosen.colour(g) for g in elements]
    shared = shared_lengths(tiling, elements)
    assert all(colours[i] != colours[j] for i, j in shared)
    assert colouring(tiling).colours(copies_meeting(tiling, window_of(tiling))).max() < chosen.count
    for k in range(len(tiling.prototiles)):
        itself = next(i for i, g in enumerate(elements) if _is(g, k))
        near = neighbours(tiling, k)
        assert len(near.edge) == sum(i == itself for i, _ in shared)
        touching = sum(shape.distance(shapes[itself]) < 1e-7 * size for shape in shapes) - 1
        assert len(near.edge) + len(near.point) == touching


def _is(element: Placed, prototile: int) -> bool:
    return element.prototile == prototile and element.is_close(identity(2), 1e-6)


@settings(max_examples=12, deadline=None)
@given(st.data())
def test_dirichlet_cells_have_the_stabiliser_of_their_point(data: st.DataObject) -> None:
    group = data.draw(wallpaper_groups())
    point = data.draw(sites(group))
    near = group.elements_near(point, 0.02 * np.sqrt(group.cell_volume), source=point)
    assume(len(near) == len(fixing(group, point)))
    tile = dirichlet_tile(group, point)
    certificate = certify(tile)
    assert certificate.valid, certificate
    assert tile.tiling.stabilisers[0].order == len(near)
    assert np.isclose(tile.signed_area * group.order, len(near) * group.cell_volume)


@settings(max_examples=12, deadline=None)
@given(wallpaper_groups(), seeds, st.floats(-12.0, -7.0))
def test_a_site_beside_a_centre_or_mirror_counts_as_on_it(
    group: CrystallographicGroup, seed: int, power: float
) -> None:
    """Of all 17 groups: neither the cell nor its stabiliser depends on rounding."""
    rng = np.random.default_rng(seed)
    elements, size = symmetry_elements(group), np.sqrt(group.cell_volume)
    lines = [line.line for line in elements.lines if line.is_mirror]
    special = [center.point for center in elements.centers]
    special += [line.point + rng.uniform() * size * line.direction for line in lines]
    assume(special)
    point = special[rng.integers(len(special))]
    near = group.elements_near(point, 0.02 * size, source=point)
    assume(len(near) == len(fixing(group, point)))
    angle = rng.uniform(0, 2 * np.pi)
    beside = point + 10.0**power * size * np.array([np.cos(angle), np.sin(angle)])
    tile = dirichlet_tile(group, beside)
    certificate = certify(tile)
    assert certificate.valid, certificate
    assert tile.tiling.stabilisers[0].order == len(near)


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
@settings(max_examples=1, deadline=None)
@given(data=st.data())
def test_every_group_has_several_prototiles(name: str, data: st.DataObject) -> None:
    tiling = data.draw(dirichlet_tilings(names=(name,)))
    assert certify(tiling).valid
    shares = [own.order for own in tiling.stabilisers]
    areas = [abs(prototile.signed_area) for prototile in tiling.prototiles]
    total = sum(a * tiling.group.order / s for a, s in zip(areas, shares, strict=True))
    assert np.isclose(total, tiling.group.cell_volume, rtol=1e-12)


def test_a_symmetry_of_the_curve_but_not_of_the_vertices() -> None:
    """The square cell under p4m with a vertex too many: as good a tile, matched as curves."""
    ring = np.insert(SQUARE, 1, (0.13, -0.5), axis=0)
    tiling = Tiling(wallpaper_group("p4m"), [ring])
    certificate = certify(tiling)
    assert certificate.valid, certificate
    assert certificate.edge_matching == "curves"
    assert tiling.stabilisers[0].order == 8


def test_two_prototiles_that_are_one() -> None:
    kept = dirichlet_tile(wallpaper_group("p2"), (0.2, 0.3))
    twin = kept.group.cosets[1](kept.polygon)
    certificate = certify(Tiling(kept.group, [kept.polygon, twin]))
    assert not certificate.valid
    assert any("overlaps" in reason for reason in certificate.reasons)
    with refused("0 and 1"):
        dirichlet_tiling(kept.group, [(0.2, 0.3), kept.group.cosets[1](np.array([0.2, 0.3]))])


UNIT_SQUARE = SQUARE + 0.5


@pytest.mark.parametrize("height", [1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("lift", [0.0, 0.5])
def test_a_sliver_inside_another_prototile_is_refused(height: float, lift: float) -> None:
    sliver = UNIT_SQUARE * (1.0, height) - (0.0, lift * height)
    certificate = certify(Tiling(wallpaper_group("p1", np.eye(2)), [UNIT_SQUARE, sliver]))
    assert not certificate.valid
    assert re.search(r"prototile 1 is only .* wide: .* leave it out", certificate.reasons[0])


@pytest.mark.parametrize("side", [1e-5, 1e-6])
def test_small_prototiles_overlap_by_a_share_of_their_own(side: float) -> None:
    """Two equal ones inside another: edges match, and little area is covered twice."""
    group, small = wallpaper_group("p1", np.eye(2)), 0.3 + side * UNIT_SQUARE
    certificate = certify(Tiling(group, [UNIT_SQUARE, small, small]))
    assert certificate.edge_mismatch < 1e-9
    assert certificate.total_overlap < 1e-9
    assert any("prototile 1 overlaps" in reason for reason in certificate.reasons)


@pytest.mark.parametrize("side", [1e-2, 1e-4, 1e-6])
def test_a_small_prototile_in_its_place_is_certified(side: float) -> None:
    corner = [[0.0, 0.0], [side, 0.0], [0.0, side]]
    rest = [[side, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, side]]
    certificate = certify(Tiling(wallpaper_group("p1", np.eye(2)), [rest, corner]))
    assert certificate.valid, certificate


def test_half_of_a_pair_is_refused_and_says_which() -> None:
    tiling = NAMED["hexagons and triangles"][0]
    certificate = certify(Tiling(tiling.group, tiling.prototiles[:1]))
    assert any("uncovered" in reason for reason in certificate.reasons)
    larger = Tiling(tiling.group, [tiling.prototiles[0], 1.1 * tiling.prototiles[1].polygon])
    assert any("prototile" in reason for reason in certify(larger).reasons)


@pytest.mark.parametrize(
    ("prototiles", "message"),
    [
        ([], "at least one prototile"),
        (3, "at least one prototile"),
        (SQUARE, r"Tiling\(group, \[polygon\]\)"),
        ([SQUARE, SQUARE[::-1]], "prototile 1 .* opposite orientations"),
        ([SQUARE[:2]], "at least 3 vertices"),
        ([Prototile(SQUARE), "x"], "real numbers"),
    ],
)
def test_what_is_no_tiling(prototiles: list, message: str) -> None:
    with pytest.raises(OrbiflowError, match=message):
        Tiling(wallpaper_group("p4m"), prototiles)


def test_a_tile_is_the_tiling_by_it_alone() -> None:
    tile = Tile(SQUARE, wallpaper_group("p4m"))
    assert certify(tile) == certify(tile.tiling)
    assert colouring(tile).count == colouring(tile.tiling).count == 2
    with refused("p4m", "Tile"):
        certify("p4m")  # pyright: ignore[reportArgumentType]
    with refused("prototile", 1):
        neighbours(tile, 1)


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
