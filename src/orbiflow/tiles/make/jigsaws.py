"""Jigsaws: a rectangle cut into tiles, with a straight border and no crumbs; and its tray."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.make.layout import Layout, line_style
from orbiflow.tiles.make.skeletons import joined, shared_edges
from orbiflow.tiles.page import Box, Curve, Layer, Scene, fitted, inset, rectangle
from orbiflow.tiles.silhouette import DISC_OVERREACH, opened

LEAST_SHARE = 1 / 3  # the least area of a piece at the border, in tiles
LEAST_WIDTH = 1 / 12  # the least width of a piece along the border, in tile sizes
LEAST_STRIP = (
    1.5  # the least length of a strip along the border, in widths: no tip of 37 degrees is one
)
ROUNDS = 3  # how often thin strips are looked for: a piece may get one when crumbs join it
GRID = 1e-4  # the grid in mm of the places where lines meet
TRAY_EDGE = 5.0  # width in mm of the empty edge around the parts of a tray


def jigsaw_scenes(layout: Layout) -> list[Scene]:
    """Return the scene of a jigsaw and, if there is to be a tray, those of its frame and its base.

    All that is cut is cut once. A part of a tile that is smaller than `LEAST_SHARE` joins the neighbour
    with which it has most of its outline in common, and so does what would be thinner along the
    border than `LEAST_WIDTH`.
    """
    area = shapely.box(*layout.page.box)
    flat = layout.fine / 2
    edges = {shapely.LineString(c.flattened(flat)): c for c, *_ in shared_edges(layout)}
    lines = [area.exterior, *edges]
    tiles = [shapely.Polygon(curve.flattened(flat)) for curve in layout.outline.closed]
    widest = min(shapely.maximum_inscribed_circle(tile).length for tile in tiles)
    width = min(LEAST_WIDTH * layout.settings.tile_size, widest)
    areas = [tile.area for tile in tiles]
    pieces, whole = _faces(lines, area), 0
    for _ in range(ROUNDS):
        lines += [line for piece in pieces for line in _chords(piece, area.exterior, width)]
        pieces, whole = _pieces(_faces(lines, area), areas, width)
    if len(pieces) < 2:
        raise OrbiflowError("the jigsaw has a single piece; choose a larger area or smaller tiles")
    style = line_style(layout)
    cuts = Layer("cut", "cut", style, tuple(_cuts(pieces, edges, layout)))
    border = Layer("border", "cut", style, (rectangle(layout.page.box),))
    facts = {
        "pieces": len(pieces),
        "whole_tiles": whole,
        "smallest": round(min(piece.area for piece in pieces) / min(areas), 3),
    }
    tray = list(_tray(layout))
    note = f"the jigsaw has {len(pieces)} pieces, {whole} whole tiles and "
    note += f"{len(pieces) - whole} at the border, the smallest {facts['smallest']:.2f} of a tile"
    if tray:
        note += f"; the tray's two sheets are {tray[0].width:g} x {tray[0].height:g} mm"
    layers = (cuts, border)
    return [layout.scene(layers, layout.placed_tiles, facts=facts, remarks=(note,)), *tray]


def _faces(lines: Sequence[BaseGeometry], area: shapely.Polygon) -> list[shapely.Polygon]:
    """Return the faces in an area between lines, whose vertices are exactly the same on both sides."""
    net = shapely.get_parts(shapely.union_all(lines, grid_size=GRID))
    faces = shapely.get_parts(shapely.polygonize(net))
    return list(faces[shapely.intersects(area, shapely.point_on_surface(faces))])


def _chords(
    face: shapely.Polygon, border: BaseGeometry, width: float
) -> Iterator[shapely.LineString]:
    """Yield the lines that divide a face where it is a thin strip along the border."""
    if not face.intersects(border.buffer(GRID)):
        return
    core = opened(face, width, DISC_OVERREACH)
    around, beside = face.exterior.buffer(10 * GRID), face.buffer(10 * GRID)
    for strip in polygons_in(face.difference(core)):
        if strip.exterior.intersection(border.buffer(GRID)).length < LEAST_STRIP * width:
            continue
        inner = shapely.line_merge(strip.exterior.difference(around))
        for seam in shapely.get_parts(inner):
            start, end = shapely.get_coordinates(seam)[[0, -1]]
            beyond = (end - start) * (0.1 * width / max(float(np.hypot(*(end - start))), GRID))
            chord = shapely.LineString([start - beyond, end + beyond]).intersection(beside)
            yield max(shapely.get_parts(chord), key=shapely.length)


def _pieces(
    faces: list[shapely.Polygon], tile_areas: Sequence[float], width: float
) -> tuple[list[shapely.Polygon], int]:
    """Join faces that are no pieces to a neighbour; return the pieces, and how many are whole tiles."""

    def poor(piece: shapely.Polygon) -> bool:
        small = piece.area < LEAST_SHARE * min(tile_areas)
        return small or piece.buffer(-width / 2).is_empty

    areas = np.array(tile_areas)
    pieces = [(face, bool((abs(face.area - areas) < 1e-3 * areas).any())) for face in faces]
    todo = [face for face, whole in pieces if not whole and poor(face)]
    while todo and len(pieces) > 1:
        crumb = min(todo, key=shapely.area)
        pieces = [entry for entry in pieces if entry[0] is not crumb]
        touching = np.flatnonzero(shapely.dwithin([piece for piece, _ in pieces], crumb, GRID))
        rings = shapely.boundary([pieces[k][0] for k in touching])
        common = shapely.length(shapely.intersection(rings, crumb.boundary))
        # whole tiles are better left whole
        common *= np.where([pieces[k][1] for k in touching], 0.5, 1.0)
        near = int(touching[common.argmax()])
        other = pieces[near][0]
        (both,) = polygons_in(shapely.union_all([other, crumb], grid_size=GRID))
        pieces[near] = both, False
        todo = [face for face in todo if face is not crumb and face is not other]
        todo += [both] if poor(both) else []
    return [piece for piece, _ in pieces], sum(whole for _, whole in pieces)


def _cuts(
    pieces: list[shapely.Polygon], edges: dict[shapely.LineString, Curve], layout: Layout
) -> list[Curve]:
    """Return the lines between pieces, each once, as few long curves."""
    border = shapely.box(*layout.page.box).exterior.buffer(2 * GRID)
    lines, tree = list(edges), shapely.STRtree(list(edges))

    def curve(line: shapely.LineString) -> Curve:
        # most are whole edges, whose curve is there already
        for k in tree.query(line.interpolate(0.5, normalized=True), "dwithin", 10 * GRID).tolist():
            if line.hausdorff_distance(lines[k]) < 10 * GRID:
                return _between(edges[lines[k]], *shapely.get_coordinates(line)[[0, -1]])
        return fitted(shapely.get_coordinates(line), layout.fine)

    net = shapely.line_merge(shapely.union_all(shapely.boundary(pieces), grid_size=GRID))
    curves = [curve(line) for line in shapely.get_parts(net) if not border.covers(line)]
    ends = np.array([[curve.start, curve.end] for curve in curves]).reshape(-1, 2)
    _, numbers = np.unique(ends, axis=0, return_inverse=True)
    return joined(curves, [(a, b) for a, b in numbers.reshape(-1, 2).tolist()])


def _between(curve: Curve, start: Array, end: Array) -> Curve:
    """Return a curve with its ends moved a little, so that they are exactly those of other curves."""
    if np.hypot(*(curve.start - start)) > np.hypot(*(curve.end - start)):
        curve = curve.reversed()
    pieces = curve.pieces.copy()
    pieces[0, 0], pieces[-1, 3] = start, end
    return Curve(pieces, curve.straight)


def _tray(layout: Layout) -> Iterator[Scene]:
    """Yield the frame of a tray, whose opening is the jigsaw with a gap all around, and its base."""
    rim, gap = layout.settings.tray, layout.settings.clearance
    if rim is None:
        return
    width, height = (
        side + 2 * (gap + rim + TRAY_EDGE)
        for side in (layout.page.box.width, layout.page.box.height)
    )
    page = Box(0.0, 0.0, width, height)
    outer = inset(page, TRAY_EDGE)
    for name, boxes in {"frame": (inset(outer, rim), outer), "base": (outer,)}.items():
        cuts = tuple(rectangle(box) for box in boxes)
        layer = Layer("cut", "cut", line_style(layout), cuts)
        yield Scene(width, height, (layer,), notes=(f"The tray's {name}.",))
