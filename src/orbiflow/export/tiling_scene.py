"""Every tile drawn, in the colours of a colouring."""

from __future__ import annotations

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.export.curves import Curve
from orbiflow.export.layout import Layout, inner_box, placed_tiles
from orbiflow.export.scene import Box, Layer, Scene, Style, Uses
from orbiflow.figures.palette import palette
from orbiflow.tilings import Copies, colouring, copies_inside, copies_meeting

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
