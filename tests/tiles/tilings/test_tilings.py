"""Tilings by several prototiles and by tiles with a symmetry: certified, or refused."""

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
    neighbours,
    patch,
)
from refusals import refused
from some_tilings import NAMED, SQUARE, dirichlet_tilings, fixing, shared_lengths, sites, tilings
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
