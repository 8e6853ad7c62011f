"""Trails hold every arc once, hang together, and are as few as there can be."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.tiles.make.skeletons import trails

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
