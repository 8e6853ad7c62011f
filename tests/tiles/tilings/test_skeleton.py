"""The skeleton has every edge once, whatever copies it is of."""

from __future__ import annotations

from collections import Counter

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from exported import tiles
from orbiflow.tiles import copies_meeting, edges, skeleton


@settings(max_examples=15, deadline=None)
@given(tiles, st.integers(0, 2**32 - 1))
def test_every_edge_once(tile, seed: int) -> None:
    half = 4 * tile.radius
    copies = copies_meeting(tile, (*(tile.center - half), *(tile.center + half)))
    rng = np.random.default_rng(seed)
    copies = copies.select(rng.random(len(copies)) < rng.uniform(0.1, 1))  # with holes
    own = edges(tile)
    found = skeleton(own, copies)
    sides = len(own.starts) * len(copies)
    shared = int((found.other >= 0).sum())
    assert len(found) + shared == sides
    # measured: together they are the copies' boundaries, and none lies on another
    size = tile.radius
    lines = [
        shapely.LineString(copies.isometry(copy)(own.points(edge)) / size)
        for copy, edge in zip(found.copy, found.edge, strict=True)
    ]
    middles = shapely.line_interpolate_point(lines, 0.4371, normalized=True)
    if len(lines):
        pairs = shapely.STRtree(lines).query(middles, predicate="dwithin", distance=1e-7)
        assert (pairs[0] == pairs[1]).all()
    rings = shapely.linearrings(copies.images(tile.polygon) / size)
    total = shapely.length(lines).sum()
    on_others = sum(shapely.length(lines[k]) for k in np.flatnonzero(found.other >= 0))
    assert np.isclose(total + on_others, shapely.length(rings).sum())


@settings(max_examples=10, deadline=None)
@given(tiles)
def test_ends_with_one_number_are_one_point(tile) -> None:
    half = 3 * tile.radius
    copies = copies_meeting(tile, (*(tile.center - half), *(tile.center + half)))
    own = edges(tile)
    found = skeleton(own, copies)
    places: dict[int, list] = {}
    for copy, edge, ends in zip(found.copy, found.edge, found.ends.tolist(), strict=True):
        points = copies.isometry(copy)(own.points(edge))
        for end, point in zip(ends, (points[0], points[-1]), strict=True):
            places.setdefault(end, []).append(point)
    for points in places.values():
        assert np.ptp(np.array(points), axis=0).max() < 1e-8 * tile.radius
    # three edges meet in most vertices
    degrees = Counter(len(points) for points in places.values())
    assert degrees.most_common(1)[0][0] == 3
