"""A lesson on one page: a shape with straight sides, what is cut off it and where that goes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import Place, polygons_in
from orbiflow.tiles.make.layout import BLACK, Layout
from orbiflow.tiles.page import Box, Curve, Layer, Scene, Style, Words, boundary, inset
from orbiflow.tiles.tilings import EdgeIdentification, Edges, colouring, copies_meeting

COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#b58900", "#56b4e9")
PALER = 0.62  # how much paler what is cut off is filled
SHADES = ("#ffffff", "#d9d9d9", "#b3b3b3", "#efefef")
STRAIGHT = 0.004  # of the tile's size: an edge that leaves its straight side by less stays as it is
TITLE, LETTERS, LINE = (
    6.0,
    3.6,
    6.2,
)  # heights in mm of the title's and other letters, and of a line
LARGE, SMALL = 0.37, 0.13  # heights of the large figure and of the steps, as shares of the page
AWAY = 4.5  # distance in mm of a number from its side
DOT = 1.1  # radius in mm of the dot about which a part turns
TURNS = {2: "half", 3: "a third of the", 4: "a quarter of the", 6: "a sixth of the"}
SIDES = {3: "three", 4: "four", 5: "five", 6: "six"}


@dataclass(frozen=True, eq=False)
class Lesson:
    """How a tile comes of the shape with straight sides between its corners, which tiles as it does."""

    edges: Edges
    lines: tuple[Array, ...]  # points (n, 2) of each edge, from end to end

    @cached_property
    def shape(self) -> shapely.Polygon:
        """The shape with straight sides."""
        return shapely.Polygon([line[0] for line in self.lines])

    @cached_property
    def moves(self) -> list[EdgeIdentification]:
        """The pairs of edges that are not straight, each of which is a move."""
        size = float(np.sqrt(self.shape.area))
        bent = [
            shapely.distance(shapely.points(line), shapely.LineString(line[[0, -1]])).max()
            for line in self.lines
        ]
        return [pair for pair in self.edges.identifications if bent[pair.first] > STRAIGHT * size]

    def ring(self, count: int) -> Array:
        """Return the outline (n, 2) after so many moves."""
        done = {edge for pair in self.moves[:count] for edge in (pair.first, pair.second)}
        return np.concatenate(
            [line[:-1] if k in done else line[:1] for k, line in enumerate(self.lines)]
        )

    def parts(self, pair: EdgeIdentification) -> tuple[BaseGeometry, BaseGeometry]:
        """Return what a move cuts off the shape, and where it lands."""
        between = shapely.union_all(
            [shapely.make_valid(shapely.Polygon(self.lines[k])) for k in {pair.first, pair.second}]
        )
        return between & self.shape, between - self.shape


def words_of(pair: EdgeIdentification) -> str:
    """Return what is to be done with what is cut off a side."""
    other = "the other side with this number"
    if pair.kind == "translation":
        return f"Slide it straight across to {other}."
    if pair.kind == "rotation":
        angle = np.arccos(np.clip(np.trace(pair.isometry.linear) / 2, -1, 1))
        turn = TURNS.get(round(2 * np.pi / angle), f"{np.degrees(angle):.0f} degrees of the")
        to = "along the same side" if pair.folded else f"to {other}"
        return f"Turn it {turn} way round the dot, {to}."
    return f"Flip it over, like a page of a book, and slide it to {other}."


def lesson_scene(layout: Layout) -> Scene:
    """Return a page that shows how to make the tile with scissors.

    Raises `OrbiflowError` for a tile of several figures, or one whose corners make no shape.
    """
    edges, box = layout.outline.edges, layout.page.box
    if edges is None or len(layout.prototiles) > 1:
        raise OrbiflowError(
            "a lesson is of a tile of one figure, whose edges fit; choose another tile"
        )
    lines = tuple(curve.flattened(layout.fine) for curve in layout.outline.curves)
    lesson = Lesson(edges, lines)
    if len(lines) < 3 or not lesson.shape.is_valid:
        raise OrbiflowError(
            "the straight lines between this tile's corners cross, so no lesson begins with them; "
            "choose a tile of another class"
        )
    top = box.top + TITLE
    sides = SIDES.get(len(lines), str(len(lines)))
    texts = [
        Words(f"A tile from a shape with {sides} sides", (box.left, top), TITLE),
        Words(
            "Copy the shape onto card. Cut off what is coloured, move it as the list says, and stick "
            "it on where it is dashed.",
            (box.left, top + TITLE + 1.0),
            LETTERS,
        ),
    ]
    top += TITLE + 2 * LINE
    large = Box(box.left, top, box.right, top + LARGE * box.height)
    layers = [*_large(lesson, large)]
    top = large.bottom + LINE
    for number, pair in enumerate(lesson.moves, 1):
        height = top + (number - 1) * LINE
        texts.append(Words(str(number), (box.left, height), LETTERS, colour=_colour(number)))
        texts.append(Words(words_of(pair), (box.left + LINE, height), LETTERS))
    top += len(lesson.moves) * LINE
    steps = Box(box.left, top, box.right, top + SMALL * box.height)
    layers += _steps(lesson, steps)
    top = steps.bottom + LINE
    last = "Trace round it again and again: its copies cover the page without a gap."
    texts.append(Words(last, (box.left, top), LETTERS))
    floor = Box(box.left, top + LINE, box.right, box.bottom)
    if floor.height > LARGE * box.height / 4:
        layers += _floor(layout, floor)
    layers.append(Layer("words", "mark", Style(BLACK), tuple(texts)))
    return layout.scene(layers, (), facts={"pieces": 1, "tile_size": None})


def _colour(number: int) -> str:
    return COLOURS[(number - 1) % len(COLOURS)]


def _paler(colour: str) -> str:
    channels = bytes.fromhex(colour[1:])
    return "#" + bytes(round(v + PALER * (255 - v)) for v in channels).hex()


def _fitted(shapes: Sequence[Array], box: Box) -> Place:
    """Return the map that lays points into the middle of a box, as large as it holds."""
    points = np.concatenate(shapes)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = min((box.width, box.height) / (high - low))
    middle = np.array([box.left + box.right, box.top + box.bottom]) / 2
    return Place(scale * np.eye(2), middle - scale * (low + high) / 2)


def _large(lesson: Lesson, box: Box) -> Iterator[Layer]:
    """Yield the shape with what is cut off it, where that lands, dots and numbers."""
    place = _fitted([lesson.ring(0), lesson.ring(len(lesson.moves))], inset(box, AWAY))
    numbers, dots = list[Words](), list[Curve]()
    for number, pair in enumerate(lesson.moves, 1):
        cut, landing = lesson.parts(pair)
        colour = _colour(number)
        for name, region, style in (
            ("cut", cut, Style(_paler(colour), colour, 0.5)),
            ("landing", landing, Style(None, colour, 0.25)),
        ):
            curves = [curve for part in polygons_in(region) for curve in boundary(part)]
            if name == "landing":
                curves = [dash for curve in curves for dash in _dashes(curve.moved(*place))]
            else:
                curves = [curve.moved(*place) for curve in curves]
            yield Layer(f"{name} {number}", "mark", style, tuple(curves))
        for edge in dict.fromkeys((pair.first, pair.second)):
            numbers.append(Words(str(number), _beside(lesson, edge, place), LETTERS, True, colour))
        if pair.kind == "rotation":
            linear = pair.isometry.linear
            centre = np.linalg.solve(np.eye(2) - linear, pair.isometry.translation)
            dots.append(_disc(place(centre[None])[0]))
    outline = Curve.polyline(place(np.asarray(lesson.shape.exterior.coords)[:-1]), closed=True)
    yield Layer("shape", "mark", Style(None, BLACK, 0.5), (outline,))
    yield Layer("dots", "mark", Style(BLACK), tuple(dots))
    yield Layer("numbers", "mark", Style(BLACK), tuple(numbers))


def _beside(lesson: Lesson, edge: int, place: Place) -> tuple[float, float]:
    """Return the place of a side's number: inside the shape, near the side's middle."""
    start, end = place(lesson.lines[edge][[0, -1]])
    across = np.array([start[1] - end[1], end[0] - start[0]]) / np.linalg.norm(end - start)
    shape = shapely.Polygon(place(np.asarray(lesson.shape.exterior.coords)))
    middles = [(start + end) / 2 + side * AWAY * across for side in (1, -1)]
    inner = max(middles, key=lambda point: shape.contains(shapely.Point(point)))
    return float(inner[0]), float(inner[1])


def _dashes(curve: Curve) -> list[Curve]:
    """Return a closed curve as short lines with gaps as long."""
    line = shapely.LineString([*curve.flattened(0.02), curve.start])
    count = max(2, round(line.length / 2.4))
    ends = np.linspace(0.0, 1.0, 2 * count + 1)
    parts = (
        substring(line, start, end, normalized=True)
        for start, end in zip(ends[:-1:2], ends[1::2], strict=True)
    )
    return [Curve.polyline(shapely.get_coordinates(part)) for part in parts]


def _disc(middle: Array) -> Curve:
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return Curve.polyline(
        middle + DOT * np.stack([np.cos(turns), np.sin(turns)], axis=1), closed=True
    )


def _steps(lesson: Lesson, box: Box) -> Iterator[Layer]:
    """Yield the outline after each move, side by side."""
    count = len(lesson.moves) + 1
    width = box.width / count
    every = [lesson.ring(k) for k in range(count)]
    curves = list[Curve]()
    for k, ring in enumerate(every):
        cell = Box(box.left + k * width, box.top, box.left + (k + 1) * width, box.bottom)
        place = _fitted(every, inset(cell, min(3.0, width / 10)))
        curves.append(Curve.polyline(place(ring), closed=True))
    yield Layer("steps", "mark", Style("#f2f2f2", BLACK, 0.35), tuple(curves))


def _floor(layout: Layout, box: Box) -> Iterator[Layer]:
    """Yield tiles in shades of grey that fill a box."""
    tiling = layout.page.tiling
    size = float(np.sqrt(tiling.tile_area))
    scale = box.height / (2.6 * size)
    linear = scale * np.eye(2)
    middle = np.array([box.left + box.right, box.top + box.bottom]) / 2
    moved = tiling.transformed(linear, middle - linear @ tiling.center)
    copies = copies_meeting(moved, tuple(box))
    numbers = colouring(moved).colours(copies)
    area = shapely.box(*box)
    for colour in sorted(set(numbers.tolist())):
        rings = [ring for ring, n in zip(copies.rings(), numbers, strict=True) if n == colour]
        regions = [shapely.Polygon(ring) & area for ring in rings]
        curves = [c for region in regions for part in polygons_in(region) for c in boundary(part)]
        style = Style(SHADES[colour % len(SHADES)], BLACK, 0.2)
        yield Layer(f"copies {colour + 1}", "mark", style, tuple(curves))
