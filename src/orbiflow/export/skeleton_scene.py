"""The lines between tiles, each once, for a laser or a pen."""

from __future__ import annotations

import numpy as np

from orbiflow.export.clipping import clipped_line
from orbiflow.export.curves import Curve
from orbiflow.export.layout import Layout, placed_tiles
from orbiflow.export.scene import Layer, Scene, Style
from orbiflow.export.tiling_scene import chosen_copies, rectangle, require_edges
from orbiflow.export.trails import in_short_order, trails
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import skeleton

RED = "#ff0000"


def line_style(layout: Layout) -> Style:
    """Of lines to cut."""
    settings = layout.settings
    return Style(None, settings.stroke or RED, settings.stroke_width or 0.1)


def skeleton_scene(layout: Layout) -> Scene:
    """Each edge that tiles share once, in few long lines.

    Raises:
        OrbiflowError: for a page with too many tiles, and a tile whose edges do not match.
    """
    require_edges(layout)
    settings, box = layout.settings, layout.box
    copies = chosen_copies(layout)
    own = layout.outline.edges
    assert own is not None
    lines = skeleton(own, copies)
    linear, translations = copies.group.linear_parts, copies.translations
    arcs: list[Curve] = []
    ends: list[tuple[int, int]] = []
    free = -1
    for copy, edge, vertices in zip(
        lines.copy.tolist(), lines.edge.tolist(), lines.ends.tolist(), strict=True
    ):
        curve = layout.outline.curves[edge].moved(linear[copies.cosets[copy]], translations[copy])
        if not settings.clip:
            arcs.append(curve)
            ends.append((vertices[0], vertices[1]))
            continue
        for part in clipped_line(curve, box, settings.deviation / 4):
            # a cut end is a vertex of its own
            start = vertices[0] if _same(part.start, curve.start) else (free := free - 1)
            end = vertices[1] if _same(part.end, curve.end) else (free := free - 1)
            arcs.append(part)
            ends.append((start, end))
    style = line_style(layout)
    layers = [Layer("cut", "cut", style, tuple(joined(arcs, ends)))]
    if settings.border:
        layers.append(Layer("border", "cut", style, (rectangle(box),)))
    rings = copies.images(layout.tile.polygon)
    low, high = rings.min(axis=1), rings.max(axis=1)
    whole = ((low >= box[:2]) & (high <= box[2:])).all(axis=1)
    return Scene(
        *settings.page,
        tuple(layers),
        prototile=layout.tile.polygon,
        tiles=placed_tiles(copies, layout, whole),
    )


def joined(arcs: list[Curve], ends: list[tuple[int, int]]) -> list[Curve]:
    """Arcs that lead from vertex to vertex, as few long curves in a short order."""
    if not arcs:
        return []
    long = []
    for trail in trails(np.array(ends)):
        parts = [arcs[number] if forward else arcs[number].reversed() for number, forward in trail]
        (first, along), (last, forward) = trail[0], trail[-1]
        start, end = ends[first][0 if along else 1], ends[last][1 if forward else 0]
        long.append(Curve.joined(parts, closed=start == end))
    return in_short_order(long)


def _same(point: Array, other: Array) -> bool:
    return bool(np.abs(point - other).max() < 1e-9)
