"""The lines that tiles share, each cut or drawn once, joined into few long ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make.layout import Layout, layout, line_style
from orbiflow.tiles.make.sheets import counts_by_sheet
from orbiflow.tiles.make.tabs import edges_with_tabs
from orbiflow.tiles.page import Curve, Layer, Scene, clipped, rectangle
from orbiflow.tiles.tilings import skeleton


def shared_edges(layout: Layout) -> Iterator[tuple[Curve, tuple[int, int], list[Curve]]]:
    """Yield each edge on the page once: its curve, the numbers of its ends, and what of it is cut."""
    edges, copies, settings = layout.outline.edges, layout.page.copies, layout.settings
    if edges is None:
        raise OrbiflowError(
            "this tile's edges do not match its neighbours', so there are no shared edges to cut "
            "once; choose cut none or cut pieces"
        )
    cut = [(curve,) for curve in layout.outline.curves]
    if settings.tabs is not None:
        cut = edges_with_tabs(layout.outline, settings.tabs, settings.tab_width)
    lines = skeleton(edges, copies)
    linear, translations = copies.group.linear_parts, copies.translations
    for copy, edge, (start, end) in zip(
        lines.copy.tolist(), lines.edge.tolist(), lines.ends.tolist(), strict=True
    ):
        place = linear[copies.cosets[copy]], translations[copy]
        parts = [part.moved(*place) for part in cut[edge]]
        yield layout.outline.curves[edge].moved(*place), (start, end), parts


def skeleton_scenes(placed: Layout) -> list[Scene]:
    """Return a scene; of whole tiles one for each bed that all tiles of the page need."""
    settings, page = placed.settings, placed.page
    if settings.bed is None or not settings.whole_sheets:
        return [_skeleton_scene(placed)]
    wanted = len(layout(placed.tile, settings.replace(bed=None)).page.copies)
    counts = counts_by_sheet(wanted, len(page.copies))
    return [_skeleton_scene(replace(placed, page=replace(page, most=n))) for n in counts]


def _skeleton_scene(placed: Layout) -> Scene:
    """Return a scene with each edge that tiles share once, in few long lines."""
    settings, box = placed.settings, placed.page.box
    arcs: list[Curve] = []
    ends: list[tuple[int, int]] = []
    free = -1
    for curve, vertices, parts in shared_edges(placed):
        if settings.clip:
            parts = [bit for part in parts for bit in clipped(part, box, placed.fine, filled=False)]
        for part in parts:
            # a cut end is a vertex of its own
            start, end = vertices
            if not np.allclose(part.start, curve.start, 0, 1e-9):
                start = free = free - 1
            if not np.allclose(part.end, curve.end, 0, 1e-9):
                end = free = free - 1
            arcs.append(part)
            ends.append((start, end))
    style = line_style(placed)
    layers = [Layer("cut", "cut", style, tuple(joined(arcs, ends)))]
    if settings.border:
        layers.append(Layer("border", "cut", style, (rectangle(box),)))
    return placed.scene(layers, placed.placed_tiles)


def joined(arcs: list[Curve], ends: list[tuple[int, int]]) -> list[Curve]:
    """Join arcs that lead from vertex to vertex into few long curves."""
    long = []
    for trail in trails(np.array(ends)) if arcs else ():
        parts = [arcs[number] if forward else arcs[number].reversed() for number, forward in trail]
        (first, along), (last, forward) = trail[0], trail[-1]
        start, end = ends[first][0 if along else 1], ends[last][1 if forward else 0]
        long.append(Curve.joined(parts, closed=start == end))
    return long


Trail = list[tuple[int, bool]]
"""Arcs end to end: the number of each, and whether it runs from its start to its end."""


def trails(ends: NDArray[np.int64]) -> list[Trail]:
    """Return the fewest trails that run every arc, with the ends (S, 2), once, by Hierholzer's method.

    A connected part with 2k odd vertices, where an odd number of arcs meet, falls into k trails;
    one without odd vertices is a single closed trail (Euler).

    >>> trails(np.array([[0, 1], [1, 2], [2, 0]]))
    [[(0, True), (1, True), (2, True)]]
    """
    # joining the odd vertices in pairs makes all even; the joints are taken out at the end
    joints = _joints(ends)
    both = np.concatenate([ends, joints]) if len(joints) else ends
    arcs: dict[int, list[tuple[int, int, bool]]] = defaultdict(list)
    for number, (start, end) in reversed(list(enumerate(both.tolist()))):
        arcs[start].append((number, end, True))
        arcs[end].append((number, start, False))
    used = np.zeros(len(both), dtype=bool)
    paths: list[Trail] = []
    for start in both[:, 0].tolist():
        circuit = _circuit(start, arcs, used)
        if circuit:
            paths += _without_joints(circuit, len(ends))
    return paths


def _joints(ends: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return pairs (J, 2) of the odd vertices of each connected part."""
    vertices, index, counts = np.unique(ends, return_inverse=True, return_counts=True)
    arcs = (np.ones(len(ends)), tuple(index.reshape(-1, 2).T))
    _, part_of = connected_components(coo_array(arcs, shape=(len(vertices), len(vertices))), False)
    odd: dict[int, list[int]] = defaultdict(list)
    for k in np.flatnonzero(counts % 2):
        odd[int(part_of[k])].append(int(vertices[k]))
    pairs = [part[k : k + 2] for part in odd.values() for k in range(0, len(part), 2)]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _circuit(
    start: int, arcs: dict[int, list[tuple[int, int, bool]]], used: NDArray[np.bool_]
) -> Trail:
    """Return a closed trail through all unused arcs that are connected with `start`."""
    path: list[tuple[int, int, bool]] = [(start, -1, True)]
    circuit: Trail = []
    while path:
        vertex, arc, forward = path[-1]
        near = arcs[vertex]
        while near and used[near[-1][0]]:
            near.pop()
        if near:
            number, other, along = near.pop()
            used[number] = True
            path.append((other, number, along))
        else:
            path.pop()
            if arc >= 0:
                circuit.append((arc, forward))
    return circuit[::-1]


def _without_joints(circuit: Trail, count: int) -> list[Trail]:
    """Return the parts of a circuit between the joints, which are numbered from `count` on."""
    breaks = [k for k, (arc, _) in enumerate(circuit) if arc >= count]
    if not breaks:
        return [circuit]
    turned = circuit[breaks[0] + 1 :] + circuit[: breaks[0] + 1]
    parts: list[Trail] = [[]]
    for arc, forward in turned:
        if arc >= count:
            parts.append([])
        else:
            parts[-1].append((arc, forward))
    return [part for part in parts if part]
