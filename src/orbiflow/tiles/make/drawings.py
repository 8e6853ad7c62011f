"""What lies on the tiles of an export: to engrave and to score, or in colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from orbiflow.drawing import lightness, palette
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.make.layout import BLACK, BLUE, Layout, line_style
from orbiflow.tiles.motifs import Over, motifs_on
from orbiflow.tiles.page import (
    INK,
    USUAL_WIDTH,
    Layer,
    Motif,
    PathPart,
    PlacedTile,
    Scene,
    Style,
    Uses,
    boundary,
    cut_off,
    lines_of,
    polylines,
    region_of,
    symbol_of,
)
from orbiflow.tiles.write import INCH

EDGE = 0.6  # least distance in mm from the tile's edge of lines, which a drawing has there, too
MOST_PIXELS = 1e8  # the largest number of pixels of pictures on a page


def drawn_on(layout: Layout, overs: Sequence[Over]) -> tuple[tuple[Motif, ...], tuple[str, ...]]:
    """Return what lies on each of the tile's figures, in its place on the page in mm, and notes.

    Raises `OrbiflowError` for a picture of pixels that a pen is to draw.
    """
    settings, page, tile = layout.settings, layout.page, layout.tile
    if settings.purpose == "plotter" and any(over.picture for over in overs):
        raise OrbiflowError(
            "a pen draws lines, and the picture is made of pixels; give an SVG drawing of fills "
            "and strokes alone"
        )
    density = min(settings.dpi / INCH, float(np.sqrt(MOST_PIXELS / np.prod(settings.page))))
    chosen = palette(settings.palette if settings.coloured else "ink")
    how = {"density": density * page.place.scale, "hairlines": not settings.coloured}
    on = motifs_on(tile, settings, chosen, overs, tint=settings.tint, **how)
    both = zip(on.motifs, tile.figures, strict=True)
    return tuple(motif.moved(*page.place.after(part.place)) for motif, part in both), on.notes


def with_drawing(scene: Scene, layout: Layout) -> Scene:
    """Lay the layout's motifs on the tiles of a scene, in layers under the lines to cut."""
    settings = layout.settings
    if not layout.motifs or scene.motifs or not scene.tiles:
        return scene
    if settings.coloured:
        styles = {"drawing": Style()}
    else:
        line = line_style(layout)
        styles = {"engrave": Style(BLACK), "score": line._replace(stroke=BLUE)}
        if settings.purpose in ("plotter", "template", "colouring"):
            width = min(line.width, USUAL_WIDTH)  # finer than what is thick for small hands
            pen = line if settings.purpose == "plotter" else line._replace(width=width)
            styles = dict.fromkeys(styles, pen)
    motifs: dict[str, Motif] = {}
    items: dict[str, list[Uses]] = {name: [] for name in styles}
    for kind, (drawn, curve) in enumerate(zip(layout.motifs, layout.outline.closed, strict=True)):
        area = shapely.Polygon(curve.flattened(0.01))
        if settings.coloured:
            parts = {"drawing": cut_off(drawn, area, whole_strokes=False)}
        else:
            edge = max(EDGE, settings.tile_size / 60) + styles["score"].width / 2
            parts = burnt(drawn, area, styles, edge)
        tiles = [tile for tile in scene.tiles if tile.prototile == kind]
        for name, motif in parts.items():
            if tiles and (motif.parts or motif.rasters):
                motifs[symbol_of(kind, name)] = motif
                items[name].append(_uses(symbol_of(kind, name), tiles))
    ink = palette(settings.palette).outline if settings.coloured else None
    clip = settings.clip or settings.cut == "jigsaw"
    power = "" if settings.power is None else f" {settings.power:g} %"
    layers = [
        Layer(name + power, "drawing", styles[name], tuple(uses), clip, ink)
        for name, uses in items.items()
        if uses
    ]
    below = tuple(layer for layer in scene.layers if layer.role == "tiles")
    above = tuple(layer for layer in scene.layers if layer.role != "tiles")
    return replace(scene, layers=(*below, *layers, *above), motifs=motifs)


def _uses(name: str, tiles: Sequence[PlacedTile]) -> Uses:
    linear = np.array([tile.linear for tile in tiles])
    return Uses(name, linear, np.arange(len(tiles)), np.array([tile.offset for tile in tiles]))


def dark_parts(
    motif: Motif, nozzle: float | None = None
) -> tuple[BaseGeometry, list[BaseGeometry]]:
    """Return the dark region of a motif, and its dark lines; they are of the region with a nozzle.

    What is lighter than middle grey erases what lies under it, as on white; faint colours do nothing.
    Lines are no thinner than the nozzle's, in mm.
    """
    dark: BaseGeometry = shapely.Polygon()
    lines: list[BaseGeometry] = []
    for part in (part for part in motif.parts if part.opacity >= 0.5):
        fill, stroke, width = part.style
        pen = max(width, nozzle or 0.0)
        for colour, is_line in ((fill, False), (stroke, True)):
            if colour is None:
                continue
            is_dark = colour == INK or lightness(colour) < 0.5
            if is_line and is_dark and nozzle is None:
                lines.append(lines_of(part))
                continue
            region = lines_of(part).buffer(pen / 2) if is_line else region_of(part)
            dark = dark | region if is_dark else dark - region
            lines = [line - region for line in lines]
    return dark, lines


def burnt(
    motif: Motif, tile: shapely.Polygon, styles: dict[str, Style], edge: float = 0.0
) -> dict[str, Motif]:
    """Return the regions and pictures to engrave, and the lines to score.

    Lines keep a distance in mm from the tile's `edge`, so that none is drawn twice; what that leaves
    of a line, no longer than the distance, goes.
    """
    dark, lines = dark_parts(motif)
    inner = tile.buffer(-edge)
    if styles["engrave"].fill:
        regions = [boundary(region) for region in polygons_in(dark & tile)]
    else:
        regions = [polylines((dark & tile).boundary & inner)]
    kept = (curve for line in lines for curve in polylines(line & inner))
    scored = tuple(c for c in kept if c.closed or np.ptp(c.bounds(), axis=0).max() > edge)
    pictures = cut_off(Motif(rasters=motif.rasters), tile).rasters
    engraved = tuple(PathPart(region, styles["engrave"]) for region in regions if region)
    return {
        "engrave": Motif(engraved, pictures),
        "score": Motif((PathPart(scored, styles["score"]),) if scored else ()),
    }
