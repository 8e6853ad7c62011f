"""A page in millimetres before it is a file of any format: curves, layers, copies of symbols.

Coordinates are in mm from the page's upper left corner, y down, as on a screen and in SVG.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import border, doubled_areas, polygons_in
from orbiflow.tiles.page.rastering import MARGIN, Grid, Pixels, bleed, carried, covered

if TYPE_CHECKING:
    from orbiflow.tiles.page.endless import Endless

Booleans = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of cubic Bézier pieces and straight ones, end to end.

    - `pieces`: The control points (n, 4, 2) of each piece: start, two handles, end.
    - `straight`: Which pieces (n,) are straight: their handles are on the line.
    - `closed`: Whether the last piece ends where the first starts.

    >>> square = Curve.polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True)
    >>> len(square.pieces)
    4
    """

    pieces: Array
    straight: Booleans
    closed: bool = False

    @classmethod
    def polyline(cls, points: ArrayLike, *, closed: bool = False) -> Curve:
        """Return straight pieces through points (n, 2); a closed curve does not repeat the first."""
        array = np.asarray(points, dtype=np.float64)
        ends = np.roll(array, -1, axis=0) if closed else array[1:]
        starts = array if closed else array[:-1]
        steps = (ends - starts) / 3
        pieces = np.stack([starts, starts + steps, ends - steps, ends], axis=1)
        return cls(pieces, np.ones(len(pieces), dtype=bool), closed)

    @classmethod
    def joined(cls, curves: Sequence[Curve], *, closed: bool = False) -> Curve:
        """Join curves that continue each other."""
        pieces = np.concatenate([curve.pieces for curve in curves])
        return cls(pieces, np.concatenate([curve.straight for curve in curves]), closed)

    @property
    def start(self) -> Array:
        """The first point (2,)."""
        return self.pieces[0, 0]

    @property
    def end(self) -> Array:
        """The last point (2,)."""
        return self.pieces[-1, 3]

    def moved(self, linear: Array, offset: ArrayLike) -> Curve:
        """Return the image under the affine map p -> linear p + offset."""
        return Curve(self.pieces @ linear.T + np.asarray(offset), self.straight, self.closed)

    def reversed(self) -> Curve:
        """Return the curve run the other way."""
        return Curve(self.pieces[::-1, ::-1], self.straight[::-1], self.closed)

    def flattened(self, tolerance: float) -> Array:
        """Return points (m, 2) on the curve whose polygon stays within `tolerance` of it.

        The ends of the pieces are among them; a closed curve's first point is not repeated.
        """
        if self.straight.all():
            return self.pieces[:, 0] if self.closed else np.vstack([self.pieces[:, 0], self.end])
        second = np.diff(self.pieces, n=2, axis=1)
        bend = 6 * np.linalg.norm(second, axis=2).max(axis=1)
        count = np.maximum(1, np.ceil(np.sqrt(bend / 8 / tolerance)).astype(int))
        count[self.straight] = 1
        piece = np.repeat(np.arange(len(count)), count)
        first = np.cumsum(count) - count
        share = (np.arange(count.sum()) - first[piece]) / count[piece]
        points = bezier(self.pieces[piece], share)
        return points if self.closed else np.concatenate([points, self.end[None]])

    def bounds(self) -> Array:
        """Return the corners (2, 2), lower and upper, of the box around all control points."""
        points = self.pieces.reshape(-1, 2)
        return np.stack([points.min(axis=0), points.max(axis=0)])


def bezier(pieces: Array, share: Array) -> Array:
    """Return the point of each piece (n, 4, 2) at its parameter `share` (n,)."""
    t = share[:, None]
    u = 1 - t
    weights = np.stack([u**3, 3 * u**2 * t, 3 * u * t**2, t**3], axis=1)
    return (weights * pieces).sum(axis=1)


Role = Literal["paper", "tiles", "drawing", "cut", "mark"]
"""What a layer is for: a background, tiles, what lies on them, lines to cut, marks to measure by."""

INK = "currentColor"
"""A colour in a motif's styles: the one that its layer gives, which shows on the copy's own colour."""


class Box(NamedTuple):
    """A rectangle in mm."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        return self.right - self.left

    @property
    def height(self) -> float:
        return self.bottom - self.top


class Style(NamedTuple):
    """Fill and stroke as #rrggbb or None, and the stroke's width in mm."""

    fill: str | None = None
    stroke: str | None = None
    width: float = 0.0


class PathPart(NamedTuple):
    """Curves drawn as one."""

    curves: tuple[Curve, ...]  # the curves; closed ones are filled, holes run the other way
    style: Style  # fill and stroke, which may be `INK`
    opacity: float = 1.0  # a number from 0 to 1

    def moved(self, linear: Array, offset: Array) -> PathPart:
        """Return the image under a map p -> linear p + offset."""
        scale = float(np.sqrt(abs(np.linalg.det(linear))))
        return PathPart(
            tuple(curve.moved(linear, offset) for curve in self.curves),
            self.style._replace(width=self.style.width * scale),
            self.opacity,
        )


class Raster(NamedTuple):
    """A picture of pixels (height, width, 4); what is (x, y) in it lies at linear (x, y) + offset."""

    pixels: Pixels
    linear: Array
    offset: Array

    @property
    def size(self) -> tuple[int, int]:
        """The width and height in pixels."""
        height, width = self.pixels.shape[:2]
        return width, height

    @property
    def corners(self) -> Array:
        """The corners (4, 2)."""
        width, height = self.size
        return [[0, 0], [width, 0], [width, height], [0, height]] @ self.linear.T + self.offset

    def moved(self, linear: Array, offset: Array) -> Raster:
        """Return the image under a map p -> linear p + offset."""
        return self._replace(linear=linear @ self.linear, offset=linear @ self.offset + offset)


class Warped(NamedTuple):
    """A picture of pixels (height, width, 4) on a mesh that bends it."""

    pixels: Pixels
    texels: Array  # where points (V, 2) of the mesh lie in it
    points: Array  # where they are seen (V, 2)
    triangles: Integers  # of the mesh (T, 3)
    opacity: float = 1.0

    @property
    def corners(self) -> Array:
        """Two corners (2, 2) of the box around it."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)])

    def moved(self, linear: Array, offset: Array) -> Warped:
        """Return the image under a map p -> linear p + offset."""
        return self._replace(points=self.points @ linear.T + offset)

    def raster(self) -> Raster:
        """Return it as it is seen, with as many pixels as it has, and a little beyond its edge."""
        areas = (
            np.abs(doubled_areas(at, self.triangles)).sum() for at in (self.texels, self.points)
        )
        grid = Grid.over(self.points, float(np.sqrt(next(areas) / next(areas))))
        size = grid.width, grid.height
        shown, inside = carried(
            self.pixels, self.texels, grid.texels(self.points), self.triangles, size
        )
        ring = grid.texels(self.points)[border(self.triangles)]
        bleed(shown, inside, covered(ring, size, MARGIN - 1))
        return Raster(shown, np.eye(2) / grid.density, grid.corner)


class Words(NamedTuple):
    """A line of text."""

    text: str
    place: tuple[float, float]  # its middle in height; in width its start, or its middle
    size: float  # the height of its letters in mm
    centred: bool = False
    colour: str = "#1a1a1a"


@dataclass(frozen=True, eq=False)
class Motif:
    """A drawing of many parts that every copy of a tile carries."""

    parts: tuple[PathPart, ...] = ()  # what is drawn, from the bottom up
    rasters: tuple[Raster | Warped, ...] = ()  # pictures of pixels under the parts
    within: str | None = None  # the name of the symbol that cuts the drawing off, if any

    def moved(self, linear: Array, offset: Array) -> Motif:
        """Return the image under a map p -> linear p + offset."""
        return Motif(
            tuple(part.moved(linear, offset) for part in self.parts),
            tuple(raster.moved(linear, offset) for raster in self.rasters),
            self.within,
        )


@dataclass(frozen=True, eq=False)
class Uses:
    """M copies of a symbol: a point p of it goes to linear[which[m]] p + offsets[m]."""

    symbol: str  # its name in the scene
    linear: Array  # the linear parts (A, 2, 2) of the aspects
    which: NDArray[np.int64]  # the aspect (M,) of each copy
    offsets: Array  # the offset (M, 2) of each copy in mm

    def __len__(self) -> int:
        return len(self.which)

    def images(self, points: Array) -> Array:
        """Return the images (M, ..., 2) of points (..., 2) of the symbol."""
        turned = np.einsum("aij,...j->a...i", self.linear, points)
        shape = (len(self), *[1] * (points.ndim - 1), 2)
        return turned[self.which] + self.offsets.reshape(shape)

    def near(self, points: Array, box: Box) -> Booleans:
        """Return which copies (M,) of points (N, 2) have a bounding box that meets a box."""
        images = self.images(points)
        low, high = images.min(axis=1), images.max(axis=1)
        return (high > box[:2]).all(axis=1) & (low < box[2:]).all(axis=1)

    def select(self, keep: Booleans | slice) -> Uses:
        """Return the copies where `keep` is true, or in a slice."""
        return replace(self, which=self.which[keep], offsets=self.offsets[keep])

    def curves(self, curve: Curve) -> Iterator[Curve]:
        """Yield the images of a curve of the symbol."""
        for pieces in self.images(curve.pieces):
            yield Curve(pieces, curve.straight, curve.closed)


Item = Curve | Uses | PathPart | Raster | Warped | Words


@dataclass(frozen=True, eq=False)
class Layer:
    """Things of one kind, drawn alike, that programs show under one name."""

    name: str  # a name for people, such as "colour 1" or "cut"
    role: Role
    style: Style  # fill and stroke of all items
    items: tuple[Item, ...]  # with copies of symbols and motifs
    clipped: bool = False  # whether it is shown within the scene's `window` alone
    ink: str | None = None  # the colour that `INK` means in the layer's motifs


@dataclass(frozen=True, eq=False)
class PlacedTile:
    """A tile on the page, for programs that read the JSON file."""

    aspect: int  # the index of its coset representative
    linear: Array  # with `offset`: the map from the prototile's place in the scene to this tile's
    offset: Array
    neighbours: tuple[int, ...] = ()  # the numbers of the scene's tiles that share an edge with it
    whole: bool = True  # whether all of it is on the page
    prototile: int = 0  # the number of the scene's prototile that it is a copy of


@dataclass(frozen=True, eq=False)
class Scene:
    """A page with everything on it."""

    width: float  # with `height`: the page's size in mm
    height: float
    layers: tuple[Layer, ...]  # from the bottom up
    symbols: dict[str, Curve] = field(default_factory=dict)  # closed curves by name, for `Uses`
    window: Box | None = None  # the box within which clipped layers show; by default the page
    title: str = ""  # with `notes`: words for the file's metadata
    notes: tuple[str, ...] = ()
    prototiles: tuple[Array, ...] = ()  # the polygons (N, 2) in mm of which `tiles` are copies
    tiles: tuple[PlacedTile, ...] = ()
    facts: dict[str, Any] = field(default_factory=dict)  # for the JSON file, such as the class
    remarks: tuple[str, ...] = ()  # what the user should know of how it was made
    motifs: dict[str, Motif] = field(default_factory=dict)  # drawings by name, for `Uses`
    endless: Endless | None = None  # the whole tiling, if it is shown in colours
    web_page: Callable[[], str] | None = None  # what makes the page to turn a curved world by hand

    @property
    def clip(self) -> Box:
        """The box within which clipped layers show."""
        return self.window or Box(0.0, 0.0, self.width, self.height)

    def with_layers(self, *above: Layer) -> Scene:
        """Return the scene with layers above the others."""
        return replace(self, layers=(*self.layers, *above))

    def points(self, name: str) -> Array:
        """Return points (n, 2) whose box holds a symbol or a motif."""
        motif = self.motifs.get(name)
        if motif is None or motif.within is not None:
            symbol = name if motif is None or motif.within is None else motif.within
            return self.symbols[symbol].pieces.reshape(-1, 2)
        curves = [curve.pieces.reshape(-1, 2) for part in motif.parts for curve in part.curves]
        return np.concatenate([*curves, *(raster.corners for raster in motif.rasters)])

    def curves(self, layer: Layer) -> Iterator[Curve]:
        """Yield every curve of a layer, including copies of symbols; refuse pictures of pixels."""
        for item in layer.items:
            if isinstance(item, Uses):
                yield from item.curves(self.symbols[item.symbol])
            elif isinstance(item, PathPart):
                yield from item.curves
            elif isinstance(item, Curve):
                yield item
            elif isinstance(item, Raster | Warped):
                raise OrbiflowError(
                    "DXF and JSON hold lines, and the picture is made of pixels; choose SVG or PDF, "
                    "or give an SVG drawing of fills and strokes alone as the picture"
                )


def rectangle(box: Box) -> Curve:
    """Return the border of a box, clockwise from the upper left corner."""
    left, top, right, bottom = box
    return Curve.polyline([[left, top], [right, top], [right, bottom], [left, bottom]], closed=True)


def clipped(curve: Curve, box: Box, tolerance: float, *, filled: bool) -> list[Curve]:
    """Return what a box leaves of a curve, or of its inside: the curve if it is all, else polylines."""
    (low, high), corners = curve.bounds(), np.array(box).reshape(2, 2)
    if (low >= corners[0] - 1e-9).all() and (high <= corners[1] + 1e-9).all():
        return [curve]
    points = curve.flattened(tolerance)
    if filled:
        polygon = shapely.Polygon(points)
        polygon = polygon if polygon.is_valid else shapely.make_valid(polygon)
        rings = [part.exterior for part in polygons_in(polygon & shapely.box(*box))]
        return [Curve.polyline(shapely.get_coordinates(r)[:-1], closed=True) for r in rings]
    line = shapely.LineString(np.concatenate([points, points[:1]]) if curve.closed else points)
    parts = shapely.get_parts(shapely.intersection(line, shapely.box(*box)))
    lines = [part for part in parts if part.geom_type == "LineString" and not part.is_empty]
    return [Curve.polyline(shapely.get_coordinates(part)) for part in lines]
