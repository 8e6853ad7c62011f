"""Templates: one tile to draw on, with its silhouette faint inside and numbers at its edges."""

from __future__ import annotations

from collections.abc import Iterator
from operator import itemgetter

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from orbiflow.arrays import Array
from orbiflow.tiles.make.layout import Layout, line_style
from orbiflow.tiles.page import Curve, Layer, PlacedTile, Scene, Style

FAINT = "#e4e4e4"
DIGIT = 4.5  # height of a digit in mm
AWAY = 5.5  # distance in mm of a number's middle from its edge
INSIDE = 2.0  # how much less free, in mm, a place inside the tile counts: it is to be drawn on
TICK = np.array([[0.0, -1.5], [0.0, 1.5]])  # in mm, across the outline
BARB = np.array([[-2.6, 1.3], [0.0, 0.0], [-2.6, -1.3]])  # an arrow's head in mm, to the right

# The corners of each digit's stroke, across (0 to 4) and down (0 to 6)
DIGITS = (
    "10 30 41 45 36 16 05 01 10",
    "11 20 26",
    "01 10 30 41 42 06 46",
    "00 40 22 32 43 45 36 16 05",
    "36 30 04 44",
    "40 00 02 32 43 45 36 16 05",
    "30 10 01 05 16 36 45 43 32 12 03",
    "00 40 16",
    "12 01 10 30 41 32 12 03 05 16 36 45 43 32",
    "43 34 14 03 01 10 30 41 45 36 16",
)


def template_scene(layout: Layout) -> Scene:
    """Return a scene with one tile; edges that fit together have a number, and arrows that agree."""
    style, tile = line_style(layout), layout.tile
    layers = [Layer("outline", "cut", style, layout.outline.closed)]
    mapped = [part for part in tile.figures if part.figure.bending is not None]
    if mapped:
        faint = tuple(
            Curve.polyline(figure.silhouette_outline, closed=True).moved(
                *layout.page.place.after(place)
            )
            for figure, place in mapped
        )
        layers.insert(0, Layer("silhouette", "tiles", Style(FAINT), faint))
    marks = tuple(_marks(layout))
    layers.append(Layer("numbers", "mark", style._replace(width=style.width / 2), marks))
    notes = () if mapped else ("the template has no silhouette: no map of it is known",)
    tiles = (
        PlacedTile(0, np.eye(2), np.zeros(2), prototile=k) for k in range(len(layout.prototiles))
    )
    return layout.scene(layers, tuple(tiles), remarks=notes)


def numbered_edges(layout: Layout) -> Iterator[tuple[int, Array]]:
    """Yield the number and points of each edge, and of the one that it fits, with its start first.

    An edge that is turned onto itself is two halves, which fit each other.
    """
    edges = layout.outline.edges
    lines = [curve.flattened(layout.fine) for curve in layout.outline.curves]
    for number, pair in enumerate(edges.identifications if edges else (), 1):
        first, second = lines[pair.first], lines[pair.second]
        if pair.folded and pair.reversed:
            whole = shapely.LineString(first)
            halves = (substring(whole, end, 0.5, normalized=True) for end in (0, 1))
            first, second = map(shapely.get_coordinates, halves)
        elif pair.reversed:
            second = second[::-1]
        yield number, first
        if not pair.folded or pair.reversed:
            yield number, second


def _marks(layout: Layout) -> Iterator[Curve]:
    """Yield a tick where each edge begins, and an arrow and a number for each."""
    tiles = [shapely.Polygon(curve.flattened(layout.fine)) for curve in layout.outline.closed]
    tile = shapely.union_all(tiles)
    for curve in layout.outline.curves:
        yield _turned(TICK, curve.start, curve.flattened(layout.fine)[1] - curve.start)
    taken: list[Array] = []
    for number, points in numbered_edges(layout):
        at, along, middle = _place(shapely.LineString(points), tile, taken)
        taken.append(middle)
        yield _turned(BARB, at, along)
        yield from _digits(str(number), middle)


def _place(
    line: shapely.LineString, tile: BaseGeometry, taken: list[Array]
) -> tuple[Array, Array, Array]:
    """Return a point on a line, the way along it, and a free place beside it, outside if possible."""
    places: list[tuple[float, Array, Array, Array]] = []
    for share in (0.5, 0.4, 0.6, 0.3, 0.7):
        steps = (share * line.length + step for step in (-1.0, 0.0, 1.0))
        before, at, after = shapely.get_coordinates([line.interpolate(step) for step in steps])
        along = after - before
        across = AWAY * np.array([-along[1], along[0]]) / np.linalg.norm(along)
        for middle in (at + across, at - across):
            point = shapely.Point(middle)
            near = [float(np.linalg.norm(middle - other)) for other in taken]
            free = min([tile.boundary.distance(point), *near]) - INSIDE * tile.contains(point)
            places.append((round(free, 1), at, along, middle))
    return max(places, key=itemgetter(0))[1:]


def _turned(points: Array, at: Array, along: Array) -> Curve:
    """Return a line with its origin at a point and its x in a direction."""
    x, y = along / np.linalg.norm(along)
    return Curve.polyline(at + points @ np.array([[x, y], [-y, x]]))


def _digits(number: str, middle: Array) -> Iterator[Curve]:
    size = DIGIT / 6
    left = middle - size * np.array([2.5 * len(number) - 0.5, 3.0])
    for k, digit in enumerate(number):
        corners = [[int(across) + 5 * k, int(down)] for across, down in DIGITS[int(digit)].split()]
        yield Curve.polyline(left + size * np.array(corners))
