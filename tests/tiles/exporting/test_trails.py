"""Trails hold every arc once, hang together, and are as few as there can be."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.tiles import Curve
from orbiflow.tiles.make.skeletons import in_short_order, trails

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


@settings(max_examples=30)
@given(st.lists(st.tuples(*[st.floats(0, 100)] * 4), min_size=1, max_size=60))
def test_the_order_keeps_all_and_goes_to_the_nearest(rows: list) -> None:
    curves = [Curve.polyline([[a, b], [c, d]]) for a, b, c, d in rows]
    ordered = in_short_order(curves)
    assert Counter(key(c) for c in ordered) == Counter(key(c) for c in curves)
    left = [np.array([c.start, c.end]) for c in ordered]
    place = np.zeros(2)
    for k, curve in enumerate(ordered):
        nearest = min(float(np.linalg.norm(ends - place, axis=1).min()) for ends in left[k:])
        assert np.isclose(np.linalg.norm(curve.start - place), nearest)
        place = curve.end


def key(curve: Curve) -> tuple:
    return tuple(sorted([tuple(curve.start), tuple(curve.end)]))
