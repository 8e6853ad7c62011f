"""Motifs as plain curves and pictures, cut off at their edges, for programs without copies or clips."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import shapely
from PIL import Image, ImageDraw
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.tiles.geometry import orient, polygons_in
from orbiflow.tiles.page.fills import fill
from orbiflow.tiles.page.scene import (
    INK,
    Curve,
    Item,
    Layer,
    Motif,
    PathPart,
    Raster,
    Scene,
    Style,
    Uses,
    Warped,
)


def flattened(scene: Scene, tolerance: float) -> Scene:
    """Return a scene in which each copy of a motif has parts and pictures of its own.

    Where the symbol or the page cuts a motif off, curves become polygons within `tolerance`.
    """
    flat = {name: _within(motif, scene, tolerance) for name, motif in scene.motifs.items()}
    layers = tuple(
        replace(layer, items=tuple(_items(layer, flat, shapely.box(*scene.clip))))
        for layer in scene.layers
    )
    return replace(scene, layers=layers, motifs={}) if flat else scene


def expanded(scene: Scene) -> Scene:
    """Return a scene of plain curves, for programs that drop symbols and their copies."""

    def plain(layer: Layer) -> Iterator[Item]:
        for item in layer.items:
            if isinstance(item, Uses):
                yield from item.curves(scene.symbols[item.symbol])
            else:
                yield item

    layers = tuple(replace(layer, items=tuple(plain(layer))) for layer in scene.layers)
    return replace(scene, layers=layers, symbols={})


def _within(motif: Motif, scene: Scene, tolerance: float) -> Motif:
    if motif.within is None:
        return motif
    ring = scene.symbols[motif.within].flattened(tolerance)
    return cut_off(motif, shapely.Polygon(ring), whole_strokes=False)


def _items(layer: Layer, motifs: dict[str, Motif], window: shapely.Polygon) -> Iterator[Item]:
    for item in layer.items:
        if not isinstance(item, Uses) or item.symbol not in motifs:
            yield item
            continue
        for which, offset in zip(item.which, item.offsets, strict=True):
            placed = motifs[item.symbol].moved(item.linear[which], offset)
            if layer.clipped:
                placed = cut_off(placed, window)
            yield from placed.rasters
            for part in placed.parts:
                fill, stroke = (layer.ink if c == INK else c for c in part.style[:2])
                yield part._replace(style=part.style._replace(fill=fill, stroke=stroke))


def cut_off(motif: Motif, area: shapely.Polygon, *, whole_strokes: bool = True) -> Motif:
    """Return what of a motif lies in an area; strokes stay lines of their width, or are cut, too."""
    parts = [
        kept for part in motif.parts for kept in _cut_off(part, area, whole_strokes) if kept.curves
    ]
    return Motif(tuple(parts), tuple(_masked(raster, area) for raster in motif.rasters))


def _cut_off(part: PathPart, area: shapely.Polygon, whole_strokes: bool) -> Iterator[PathPart]:
    lines, style = lines_of(part), part.style
    if area.covers(lines) and (whole_strokes or not style.stroke):
        yield part
        return
    if style.fill:
        curves = boundary(region_of(part) & area)
        yield part._replace(curves=curves, style=Style(style.fill))
    if style.stroke and whole_strokes:
        yield part._replace(curves=polylines(lines & area), style=style._replace(fill=None))
    elif style.stroke:
        curves = boundary(lines.buffer(style.width / 2) & area)
        yield part._replace(curves=curves, style=Style(style.stroke))


FINE = 1e-3  # distance in mm of points on a motif's curves from these, which are mostly polylines


def lines_of(part: PathPart) -> BaseGeometry:
    """Return the curves of a part as lines."""
    rings = [curve.flattened(FINE) for curve in part.curves]
    return shapely.MultiLineString(
        [
            np.concatenate([ring, ring[:1]]) if curve.closed else ring
            for ring, curve in zip(rings, part.curves, strict=True)
        ]
    )


def region_of(part: PathPart) -> BaseGeometry:
    """Return the region that a part fills."""
    return fill([curve.flattened(FINE) for curve in part.curves if curve.closed])


SEAM_OVERLAP, GROUND_INSET = 0.01, 0.05  # distances in mm


def ground_of(rings: Iterable[Array]) -> BaseGeometry:
    """Return what lies under tiles (N, 2), so that no paper shows in the seams between neighbours.

    Viewers smooth the edge of each tile by itself, and two half covered pixels are no whole one.
    """
    tiles = np.array([shapely.Polygon(ring) for ring in rings], dtype=object)
    grown = shapely.buffer(tiles, SEAM_OVERLAP, quad_segs=1, join_style="mitre")
    whole = shapely.union_all(grown).buffer(-SEAM_OVERLAP - GROUND_INSET)
    return whole.simplify(GROUND_INSET)


def boundary(region: BaseGeometry) -> tuple[Curve, ...]:
    """Return the rings around a region; holes run the other way."""
    return tuple(
        Curve.polyline(
            orient(shapely.get_coordinates(ring)[:-1], counter_clockwise=k == 0), closed=True
        )
        for polygon in polygons_in(region)
        for k, ring in enumerate([polygon.exterior, *polygon.interiors])
    )


def polylines(lines: BaseGeometry) -> tuple[Curve, ...]:
    """Return lines as curves, joined where they continue each other."""
    merged = shapely.get_parts(shapely.line_merge(lines))
    return tuple(
        Curve.polyline(points[:-1] if line.is_closed else points, closed=line.is_closed)
        for line in merged
        if len(points := shapely.get_coordinates(line)) > 1
    )


def _masked(picture: Raster | Warped, area: shapely.Polygon) -> Raster:
    """Return a picture that is transparent outside an area."""
    raster = picture.raster() if isinstance(picture, Warped) else picture
    if area.covers(shapely.Polygon(raster.corners)):
        return raster
    ring, mask = shapely.get_coordinates(area.exterior) - raster.offset, Image.new("L", raster.size)
    places = ring @ np.linalg.inv(raster.linear).T - 0.5
    ImageDraw.Draw(mask).polygon([(x, y) for x, y in places.tolist()], fill=255)
    pixels = raster.pixels.copy()
    pixels[..., 3] = np.minimum(pixels[..., 3], np.asarray(mask))
    return raster._replace(pixels=pixels)
