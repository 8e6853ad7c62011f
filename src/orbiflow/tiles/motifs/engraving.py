"""Lines inside a tile, as engraved: hatching, echoes of the outline, feathers; and eyes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
import shapely

from orbiflow.arrays import Array
from orbiflow.drawing import Palette
from orbiflow.tiles.geometry import (
    arc_lengths,
    best_similarity,
    complex_points,
    resampled,
    signed_area,
)
from orbiflow.tiles.motifs.settings import Strokes
from orbiflow.tiles.page import INK, Curve, Grid, PathPart, Style
from orbiflow.tiles.silhouette import outside
from orbiflow.tiles.tile import EscherTile

GRID_DENSITY = 420.0  # cells of the raster along the square root of the area
# The direction from which light comes, with y down: from above, on the left
LIGHT = np.array([-0.6, -0.8])


@dataclass(frozen=True, eq=False)
class TileDepths:
    """A tile at area 1 with y down, and how deep places in it lie."""

    ring: Array  # the outline (N, 2)

    @cached_property
    def _grid(self) -> Grid:
        return Grid.over(self.ring, GRID_DENSITY)

    @cached_property
    def _depth(self) -> Array:
        grid = self._grid
        return (
            np.asarray(scipy.ndimage.distance_transform_edt(grid.inside(self.ring))) / grid.density
        )

    @cached_property
    def _slope(self) -> tuple[Array, Array]:
        # along x, along y
        smooth = scipy.ndimage.gaussian_filter(self._depth, 6.0)
        return np.gradient(smooth, axis=1), np.gradient(smooth, axis=0)

    def depth(self, points: Array) -> Array:
        """Return how far inside the outline points (..., 2) lie; 0 outside."""
        return self._at(self._depth, points)

    def inward(self, points: Array) -> Array:
        """Return unit vectors (..., 2) away from the nearest part of the outline."""
        vector = np.stack([self._at(part, points) for part in self._slope], axis=-1)
        return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12)

    def half_thickness(self, points: Array, normals: Array) -> Array:
        """Return how far (n,) inwards the outline stays the nearest part of the outline."""
        steps = np.linspace(0, float(self._depth.max()) * 1.05, 90)
        depth = self.depth(points[:, None] + steps[None, :, None] * normals[:, None])
        ahead = depth >= 0.85 * steps[None] - 0.004
        return steps[np.argmin(np.column_stack([ahead, np.zeros(len(points), bool)]), axis=1) - 1]

    @cached_property
    def axis(self) -> Array:
        """The longest direction (2,), to the right or down."""
        points = resampled(self.ring, 400)
        _, _, ways = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        way = ways[0]
        return way * np.sign(way @ (1.0, 0.5))

    @cached_property
    def thickest(self) -> float:
        """The greatest depth."""
        return float(self._depth.max())

    def _at(self, values: Array, points: Array) -> Array:
        place = self._grid.texels(points) - 0.5
        flat = place.reshape(-1, 2)
        sampled = scipy.ndimage.map_coordinates(
            values, [flat[:, 1], flat[:, 0]], order=1, mode="nearest"
        )
        return sampled.reshape(points.shape[:-1])


def shade(normals: Array) -> Array:
    """Return how dark (n,) it is at these inward normals: 0 in the light, 1 in the shade."""
    toward = normals @ (LIGHT / np.linalg.norm(LIGHT))
    return np.clip(0.5 + 0.5 * toward, 0, 1)


def stroke(points: Array, widths: Array) -> Array:
    """Return the outline (2 n, 2) of a line through points (n, 2) with a width (n,) at each."""
    step = np.gradient(points, axis=0)
    across = np.stack([-step[:, 1], step[:, 0]], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]
    side = across * widths[:, None] / 2
    return np.concatenate([points + side, (points - side)[::-1]])


USUAL_EYE = 0.032  # radius of an eye in square roots of the tile's area
EYE_CLEARANCE = 1.7  # distance, in radii of an eye, that lines keep from its middle
# Step of an echo in square roots of the tile's area, and the least number of steps of a piece
ECHO_STEP, ECHO_LEAST_STEPS = 0.008, 12
SMOOTHING = np.hanning(13)  # weights of the widths along an echo


class Eye(NamedTuple):
    """An eye on the tile: its middle, its radius and its parts, in the tile's units."""

    middle: Array
    radius: float
    parts: tuple[PathPart, ...]


def eye(tile: EscherTile, place: tuple[float, ...], palette: Palette) -> Eye:
    """Carry an eye (x, y) or (x, y, radius) from the silhouette onto the tile; it stays round."""
    x, y = place[:2]
    outline = shapely.Polygon(tile.silhouette_outline)
    if not outline.contains(shapely.Point(x, y)):
        raise outside("the eye", x, y, outline)
    polygon = shapely.Polygon(tile.tile.polygon)
    size = float(np.sqrt(polygon.area))
    here = np.array([x, y])
    middle = tile.forward(here)
    room = 0.75 * float(polygon.exterior.distance(shapely.Point(middle)))
    reach = 0.5 * USUAL_EYE * size
    around = reach * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    moved = tile.forward(here + around) - middle
    # how the map turns and scales the eye's surroundings
    factor = complex(best_similarity(complex_points(around), complex_points(moved)))
    radius = USUAL_EYE * size if len(place) < 3 else place[2] * abs(factor)
    radius = min(radius, room)
    up = -1.0 if tile.y_down else 1.0
    spot = complex(-0.3, 0.35 * up) * (factor / abs(factor))
    light = middle + radius * np.array([spot.real, spot.imag]) * 0.9
    edge = Style(palette.paper, palette.outline, 0.2 * radius)
    parts = (
        PathPart((_circle(middle, radius),), edge),
        PathPart((_circle(middle, 0.58 * radius),), Style(palette.outline)),
        PathPart((_circle(light, 0.2 * radius),), Style(palette.paper)),
    )
    return Eye(middle, radius, parts)


def _circle(middle: Array, radius: float) -> Curve:
    turns = 2 * np.pi * np.arange(48) / 48
    ring = middle + radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return Curve.polyline(ring, closed=True)


def engraved(
    tile: EscherTile, strokes: Strokes, around: Sequence[Eye] = (), *, hairlines: bool = False
) -> tuple[PathPart, ...]:
    """Return lines of one kind, clear of eyes, thin in the light and deep inside, or without width."""
    polygon = tile.tile.polygon
    size = float(np.sqrt(abs(tile.tile.signed_area)))
    flip = np.array([1.0, 1.0 if tile.y_down else -1.0])
    body = TileDepths(polygon * flip / size)
    rings = {"hatch": _hatch, "echoes": _echoes, "feathers": _feathers}[strokes](body)
    rings = [ring * flip * size for ring in rings]
    for eye in around:
        far = EYE_CLEARANCE * eye.radius
        rings = [ring for ring in rings if np.hypot(*(ring - eye.middle).T).min() > far]
    if hairlines:  # a ring runs along one side of its line and back along the other
        middles = [(ring + ring[::-1])[: len(ring) // 2] / 2 for ring in rings]
        return (PathPart(tuple(map(Curve.polyline, middles)), Style(None, INK)),)
    return (PathPart(tuple(Curve.polyline(ring, closed=True) for ring in rings), Style(INK)),)


def _hatch(body: TileDepths, reach: float = 0.32, spacing: float = 0.017) -> list[Array]:
    """Return ticks inwards from the outline as on a woodcut: long in the shade, up to `reach`."""
    count = int(arc_lengths(body.ring)[-1] / spacing)
    points = resampled(body.ring, count)
    step = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    inward = np.stack([-step[:, 1], step[:, 0]], axis=1) * np.sign(signed_area(body.ring))
    inward = scipy.ndimage.gaussian_filter(inward, (2, 0), mode="wrap")
    n = inward / np.maximum(np.linalg.norm(inward, axis=1), 1e-12)[:, None]
    thickness = body.half_thickness(points, n)
    dark = shade(n)
    half = scipy.ndimage.median_filter(thickness, 9, mode="wrap")  # no single spikes out of notches
    length = np.minimum(half, 1.15 * thickness) * (0.22 + 0.62 * dark)
    # around a point of a neighbour they fan out: short, or they make a star
    bend = np.roll(n, -1, axis=0) - np.roll(n, 1, axis=0)
    length /= 1 + 0.05 * np.hypot(*bend.T) / (2 * spacing)
    length = np.minimum(length, reach) * (0.82 + 0.18 * _wobble(count, 1))
    lean = np.deg2rad(24 + 6 * _wobble(count, 2))
    cos, sin = np.cos(lean), np.sin(lean)
    way = np.stack([cos * n[:, 0] - sin * n[:, 1], sin * n[:, 0] + cos * n[:, 1]], axis=1)
    share = np.linspace(0, 1, 9)
    ticks = []
    for k in range(count):
        if length[k] < 0.016:
            continue
        # bends towards the normal on its way in
        path = points[k] + length[k] * (
            share[:, None] * way[k] + 0.35 * (share**2)[:, None] * (n[k] - way[k])
        )
        if body.depth(path[2:]).min() <= 0.002:
            continue
        width = (0.0045 + 0.0065 * dark[k]) * (1 - share) ** 0.8 + 0.0006
        ticks.append(stroke(path, width))
    return ticks


def _echoes(body: TileDepths) -> list[Array]:
    """Return the outline repeated inwards, thick in the shade and fading in the light."""
    lines: list[Array] = []
    shape = shapely.Polygon(body.ring)
    depth, gap = 0.018, 0.017
    while depth < 0.92 * body.thickest:
        inner = shape.buffer(-depth, join_style="round", quad_segs=6)
        for part in shapely.get_parts(inner):
            lines += _echo(body, part, depth)
        depth, gap = depth + gap, gap * 1.13
    return lines


def _echo(body: TileDepths, part: shapely.Polygon, depth: float) -> list[Array]:
    ring = shapely.get_coordinates(part.exterior)[:-1]
    total = arc_lengths(ring)[-1] if len(ring) > 2 else 0.0
    if total < 0.12:
        return []
    count = max(24, int(total / ECHO_STEP))
    points = resampled(ring, count)
    fade = 1 - depth / body.thickest
    dark = shade(body.inward(points))
    # in the light only the first lines run on
    width = 0.0085 * fade**0.7 * np.clip(1.25 * dark + 1.1 * fade - 0.85, 0, 1)
    width = scipy.ndimage.convolve1d(width, SMOOTHING / SMOOTHING.sum(), mode="wrap")
    # shorter ones look like strays
    arcs = [arc for arc in _arcs(width > 0.0012) if len(arc) >= min(ECHO_LEAST_STEPS, count)]
    return [stroke(points[arc], width[arc]) for arc in arcs]


def _feathers(body: TileDepths) -> list[Array]:
    """Return rows of scallops that follow the body from one end to the other."""
    scallops = []
    axis = body.axis
    across = np.array([-axis[1], axis[0]])
    place = body.ring @ np.stack([axis, across], axis=1)
    low, high = place.min(axis=0), place.max(axis=0)
    row, column = 0.062, 0.072
    for i, u in enumerate(np.arange(low[0], high[0], row)):
        for v in np.arange(low[1] + (i % 2) * column / 2, high[1], column):
            point = u * axis + v * across
            scallops += _scallop(body, point, column)
    return scallops + _hatch(body, reach=0.035, spacing=0.022)


def _scallop(body: TileDepths, point: Array, size: float) -> list[Array]:
    depth = float(body.depth(point))
    if depth < 0.02:
        return []
    # along the outline near it, along the body deep inside
    normal = body.inward(point)
    tangent = np.array([-normal[1], normal[0]])
    tangent *= np.sign(tangent @ body.axis) or 1.0
    deep = min(depth / body.thickest, 1.0)
    way = tangent * (1 - deep) + body.axis * (0.35 + deep)
    way /= np.linalg.norm(way)
    side = np.array([-way[1], way[0]])
    radius = min(0.52 * size, 1.1 * depth)
    turns = np.deg2rad(np.linspace(-82, 82, 15))
    path = point + radius * (0.9 * np.cos(turns)[:, None] * way + np.sin(turns)[:, None] * side)
    dark = float(shade(normal[None])[0]) * (1 - deep) + 0.5 * deep
    width = (0.0035 + 0.0065 * dark) * np.cos(turns * 0.98) ** 0.7 + 0.0008
    if body.depth(path).min() < 0.006:
        return []
    quill = point + np.linspace(-0.25, 0.55, 5)[:, None] * radius * way
    thin = (0.002 + 0.003 * dark) * np.linspace(1, 0.2, 5)
    return [stroke(path, width), stroke(quill, thin)]


def _wobble(count: int, seed: int) -> Array:
    """Return numbers (count,) from -1 to 1, irregular as by hand but always the same."""
    k = np.arange(count) + 1000.0 * seed
    return 2 * np.modf(np.abs(np.sin(12.9898 * k) * 43758.5453))[0] - 1


def _arcs(kept: np.ndarray) -> list[np.ndarray]:
    """Return the indices of each run of true entries around a ring; a whole ring is closed."""
    count = len(kept)
    if kept.all():
        return [np.append(np.arange(count), 0)]
    start = int(np.argmin(kept))
    order = (np.arange(count) + start) % count
    change = np.flatnonzero(np.diff(kept[order].astype(int), prepend=0, append=0))
    return [order[a:b] for a, b in zip(change[::2], change[1::2], strict=True) if b - a >= 4]
