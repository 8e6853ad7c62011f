"""Every tile drawn, in the colours of a colouring."""

from __future__ import annotations

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.exporting.curves import Curve
from orbiflow.tiles.exporting.layouts import (
    Layout,
    inner_box,
    placed_tiles,
)
from orbiflow.tiles.exporting.scene import (
    Box,
    Layer,
    Scene,
    Style,
    Uses,
    clipped_line,
)
from orbiflow.tiles.exporting.trails import in_short_order, trails
from orbiflow.tiles.tilings import (
    Copies,
    colouring,
    copies_inside,
    copies_meeting,
    skeleton,
)

SYMBOL = "tile"


def chosen_copies(layout: Layout) -> Copies:
    """The copies on the page: those that meet it if it clips, else the whole ones."""
    settings, box = layout.settings, layout.box
    if settings.clip:
        return copies_meeting(layout.tile, box)
    return copies_inside(layout.tile, inner_box(box, settings))


def tiling_scene(layout: Layout) -> Scene:
    """One symbol, and a use of it for each copy; a layer a colour.

    Raises:
        OrbiflowError: for a page with too many tiles.
    """
    settings = layout.settings
    copies = chosen_copies(layout)
    # about the symbol's own middle: a transform's rounding then moves no point by much
    middle = layout.tile.center
    symbol = layout.outline.closed.moved(np.eye(2), -middle)
    turned = np.einsum("aij,j->ai", copies.group.linear_parts, middle)
    offsets = copies.translations + turned[copies.cosets]
    chosen = palette(settings.palette)
    if settings.filled:
        colours = colouring(layout.tile).colours(copies)
    else:
        colours = np.zeros(len(copies), dtype=np.int64)
    layers = []
    for colour in range(int(colours.max(initial=0)) + 1):
        own = colours == colour
        uses = Uses(SYMBOL, copies.group.linear_parts, copies.cosets[own], offsets[own])
        name = f"colour {colour + 1}" if settings.filled else "tiles"
        style = Style(
            chosen.fill(colour) if settings.filled else None,
            settings.stroke or (chosen.outline if settings.filled else "#000000"),
            settings.stroke_width or 0.25,
        )
        layers.append(Layer(name, "tiles", style, (uses,), clipped=settings.clip))
    box = layout.box
    rings = copies.images(layout.tile.polygon)
    low, high = rings.min(axis=1), rings.max(axis=1)
    whole = ((low >= box[:2]) & (high <= box[2:])).all(axis=1)
    if settings.filled:
        layers.insert(0, _paper(box, chosen.paper))
    return Scene(
        *settings.page,
        tuple(layers),
        {SYMBOL: symbol},
        window=box,
        prototile=layout.tile.polygon,
        tiles=placed_tiles(copies, layout, whole),
    )


def _paper(box: Box, colour: str) -> Layer:
    return Layer("paper", "paper", Style(fill=colour), (rectangle(box),))


def rectangle(box: Box) -> Curve:
    """The box's border."""
    left, top, right, bottom = box
    return Curve.polyline([[left, top], [right, top], [right, bottom], [left, bottom]], closed=True)


def require_edges(layout: Layout) -> None:
    """Nothing, if the tile's edges are known.

    Raises:
        OrbiflowError: if they are not: then none is shared.
    """
    if layout.outline.edges is None:
        raise OrbiflowError(
            "this tile's edges do not match its neighbours', so there are no shared edges to cut "
            "once; choose cut none or cut pieces"
        )


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
