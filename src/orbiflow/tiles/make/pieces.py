"""Pieces to cut, one beside the other, as dense as their shape allows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make.fit_tests import fit_test_scene
from orbiflow.tiles.make.layout import BLUE, Layout, line_style
from orbiflow.tiles.make.nesting import dense_arrangements, on_sheet
from orbiflow.tiles.make.offsets import LEAST_GAP, closed_fit, cut_ring
from orbiflow.tiles.make.sheets import counts_by_sheet
from orbiflow.tiles.make.tabs import with_tabs
from orbiflow.tiles.page import (
    USUAL_WIDTH,
    Box,
    Curve,
    Layer,
    PlacedTile,
    Scene,
    Style,
    Uses,
    mark_corners,
    rectangle_sides,
)

STICKER_COLOURS = 3
LEAST_EDGE = 0.1  # twice the least distance in mm of cuts from the sheet's edge


def pieces_scenes(layout: Layout) -> list[Scene]:
    """Return a scene for each sheet, several where a bed does not hold all, and for each figure."""
    if layout.settings.fit_test:
        return [fit_test_scene(layout)]
    kinds = range(len(layout.pieces))
    return [scene for kind in kinds for scene in _scenes_of(layout, kind)]


def _scenes_of(layout: Layout, kind: int) -> list[Scene]:
    """Return the sheets of one prototile's pieces."""
    settings, box, flat = layout.settings, layout.page.box, layout.fine
    ring = cut_ring(layout.pieces[kind][0], settings.kerf, settings.clearance)
    curve = closed_fit(ring, flat)
    line = curve.flattened(flat / 4)
    gap = max(settings.spacing, LEAST_GAP)
    if settings.coloured:  # colours that reach beyond the cut do not meet
        gap += 2 * max(0.0, -settings.offset)
    arrangements = dense_arrangements(layout.page.tiling, line, gap)
    edge = max(gap, LEAST_EDGE) / 2
    placed = on_sheet(arrangements, line, box.width - 2 * edge, box.height - 2 * edge)
    corner = np.array([box.left + edge, box.top + edge])
    placed = replace(placed, offsets=placed.offsets + corner)
    if settings.marks:
        hidden = [placed.near(line, corner) for corner in mark_corners(settings.page)]
        placed = placed.select(~np.any(hidden, axis=0))
    if not len(placed):
        short, long = rectangle_sides(line)
        raise OrbiflowError(
            f"the page of {box.width:g} x {box.height:g} mm does not hold a single piece, which takes "
            f"{long:.1f} x {short:.1f} mm; choose a larger area or bed, or a smaller tile size"
        )
    shared = _shared_out(placed, layout, box)
    return [_scene(layout, kind, part, curve) for part in shared]


def _shared_out(placed: Uses, layout: Layout, box: Box) -> list[Uses]:
    settings, fit = layout.settings, len(placed)
    wanted = settings.copies or fit
    counts = counts_by_sheet(wanted, fit)
    if len(counts) > 1 and settings.bed is None:
        plural = "s" if fit > 1 else ""
        raise OrbiflowError(
            f"{wanted} pieces do not fit on the page of {box.width:g} x {box.height:g} mm: it holds "
            f"{fit} piece{plural}, so that {len(counts)} sheets are needed; choose a larger area, or "
            f"give the bed to have {len(counts)} files"
        )
    return [placed.select(slice(n)) for n in counts]


def _scene(layout: Layout, kind: int, placed: Uses, curve: Curve) -> Scene:
    pieces = [
        PlacedTile(aspect, placed.linear[aspect], offset, prototile=kind)
        for aspect, offset in zip(placed.which.tolist(), placed.offsets, strict=True)
    ]
    settings, lines = layout.settings, (curve,)
    if settings.tabs is not None:  # the beam takes half of the kerf from both sides of each
        lines = with_tabs(curve, settings.tabs, settings.tab_width + settings.kerf)
    cuts = tuple(curve for line in lines for curve in _moved(line, pieces))
    layers = [Layer("cut", "cut", line_style(layout), cuts)]
    if layout.settings.purpose == "stickers":
        layers = [*_coloured(layout, pieces), *layers]
    elif layout.settings.offset > 0 and not layout.settings.coloured:
        seams = _moved(layout.outline.closed[kind], pieces)
        layers.insert(0, Layer("seam", "mark", Style(None, BLUE, 0.1), seams))
    return layout.scene(layers, tuple(pieces))


def _coloured(layout: Layout, pieces: list[PlacedTile]) -> Iterator[Layer]:
    """Yield a layer of tiles for each of a few colours, which pieces have in turn."""
    chosen, count = palette(layout.settings.palette), min(STICKER_COLOURS, len(pieces))
    for colour in range(count):
        kind = pieces[0].prototile
        tiles = _moved(layout.outline.closed[kind], pieces[colour::count])
        style = Style(chosen.fill(colour), chosen.outline, USUAL_WIDTH)
        yield Layer(f"colour {colour + 1}", "tiles", style, tiles)


def _moved(curve: Curve, pieces: list[PlacedTile]) -> tuple[Curve, ...]:
    return tuple(curve.moved(piece.linear, piece.offset) for piece in pieces)
