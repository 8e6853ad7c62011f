"""Skeletons measured in the files: no line twice, none missing, none beyond the page; and trails."""

from collections import Counter
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from exported import Line, dxf_lines, scenes, sheet_content, svg_lines, tile_of, tiles
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import ExportSettings, Scene, Tile, edges
from orbiflow.tiles.make.skeletons import trails
from refusals import refused

AREA = (150.0, 110.0)
# svgelements takes an inch for 25.39998 mm: 2e-4 in these tests


def lines_of(tile: Tile, **options) -> tuple[Scene, list[Line]]:
    chosen = ExportSettings(cut="skeleton", area=AREA, **options)
    (scene,), _ = scenes(tile, chosen)
    text = sheet_content(scene, chosen)
    return scene, dxf_lines(text)[1] if chosen.format == "dxf" else svg_lines(text, 8)


def sides_of(lines: list[Line]) -> np.ndarray:
    """(n, 2, 2) all straight bits."""
    found = []
    for line in lines:
        points = np.concatenate([line.points, line.points[:1]]) if line.closed else line.points
        found.append(np.stack([points[:-1], points[1:]], axis=1))
    sides = np.concatenate(found)
    return sides[np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) > 1e-9]


def drawn_twice(lines: list[Line]) -> int:
    """How many bits have their middle on another bit that runs the same way or back."""
    sides = sides_of(lines)
    # bits shorter than that begin within a hair of where lines meet
    sides = sides[np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) > 5e-3]
    bits: Any = shapely.linestrings(sides)
    way = sides[:, 1] - sides[:, 0]
    way /= np.linalg.norm(way, axis=1)[:, None]
    first, second = shapely.STRtree(bits).query(
        shapely.points(sides.mean(axis=1)), predicate="dwithin", distance=2e-4
    )
    other = first != second
    first, second = first[other], second[other]
    return int((np.abs((way[first] * way[second]).sum(axis=1)) > 0.999).sum())


@settings(max_examples=6, deadline=None)
@given(tiles, st.floats(15, 50), st.sampled_from(["svg", "dxf"]), st.booleans())
def test_no_line_twice_and_nothing_beyond_the_page(tile, size, form, clip) -> None:
    _, lines = lines_of(tile, tile_size=size, format=form, clip=clip)
    assert drawn_twice(lines) == 0
    points = np.concatenate([line.points for line in lines])
    assert (points >= -2e-4).all()
    assert (points <= np.array(AREA) + 2e-4).all()


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21", "IH28"])
def test_the_lines_bound_the_tiles(name: str) -> None:
    scene, lines = lines_of(tile_of(name), tile_size=30)
    # 1e-3: the places at which lines meet are rounded
    bits: Any = shapely.linestrings(sides_of(lines))
    noded = shapely.union_all(bits, grid_size=2e-3)
    areas = [face.area for face in shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))]
    assert scene.prototiles
    area = shapely.Polygon(scene.prototiles[0]).area
    tiles_found = sum(abs(found - area) < 0.002 * area for found in areas)
    assert tiles_found == len(scene.tiles)
    shared = sum(len(tile.neighbours) for tile in scene.tiles) / 2
    assert shared > len(scene.tiles)


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21"])
def test_lines_are_long(name: str) -> None:
    tile = tile_of(name)
    scene, lines = lines_of(tile, tile_size=12)
    count = len(edges(tile).starts) * len(scene.tiles) / 2
    assert len(lines) < 0.5 * count


def test_the_border_only_where_it_is_asked_for() -> None:
    tile = tile_of("IH6")
    _, bare = lines_of(tile, clip=True)
    _, framed = lines_of(tile, clip=True, border=True)
    (border,) = [line for line in framed if line.layer == "border"]
    assert len(framed) == len(bare) + 1
    assert border.closed
    assert shapely.Polygon(border.points).area == pytest.approx(AREA[0] * AREA[1], rel=1e-5)
    # with it, the lines part the page into pieces
    assert drawn_twice(framed) == 0
    bits: Any = shapely.linestrings(sides_of(framed))
    noded = shapely.union_all(bits, grid_size=2e-3)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    assert shapely.area(faces).sum() == pytest.approx(AREA[0] * AREA[1], rel=1e-3)


def test_edges_that_match_as_curves_alone_have_no_skeleton() -> None:
    brick = Tile(
        np.array([[0, 0], [2, 0], [2, 1], [0, 1]]), wallpaper_group("p1", [[2, 1], [0, 1]])
    )
    with refused("cut", "edges"):
        scenes(brick, ExportSettings(cut="skeleton"))
    (scene,), notes = scenes(brick, ExportSettings())
    assert len(scene.tiles) > 20
    assert "left as it is" in notes[0]


graphs = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=40)


@given(graphs)
def test_every_arc_once_in_the_fewest_trails(arcs: list[tuple[int, int]]) -> None:
    ends = np.array(arcs)
    found = trails(ends)
    assert sorted(arc for trail in found for arc, _ in trail) == list(range(len(arcs)))
    for trail in found:
        way = [ends[arc] if forward else ends[arc][::-1] for arc, forward in trail]
        assert all(before[1] == after[0] for before, after in pairwise(way))
    assert len(found) == fewest(arcs)


def fewest(arcs: list[tuple[int, int]]) -> int:
    parts: list[set[int]] = []
    for start, end in arcs:
        touching = [part for part in parts if start in part or end in part]
        parts = [part for part in parts if part not in touching]
        parts.append({start, end}.union(*touching))
    degree = Counter(vertex for arc in arcs for vertex in arc)
    return sum(max(1, sum(degree[v] % 2 for v in part) // 2) for part in parts)
