"""A scene: what is on a page, in millimetres, before it is a file of any format.

Coordinates are mm from the page's upper left corner, y down, as on a screen and in SVG.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.exporting.curves import Curve
from orbiflow.tiles.geometry import polygons_in

Role = Literal["paper", "tiles", "cut", "mark"]
"""What a layer is for: a background, filled tiles, lines to cut or draw, marks to measure by."""


INK = "currentColor"
"""A colour in a motif's styles: the one that shows on the copy's own, which its layer says."""


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


class Part(NamedTuple):
    """Curves drawn as one.

    - `curves`: closed ones are filled; holes run the other way.
    - `style`: fill and stroke; `INK` is a colour that shows on the copy's own.
    - `opacity`: 0 to 1.
    """

    curves: tuple[Curve, ...]
    style: Style
    opacity: float = 1.0

    @property
    def inked(self) -> bool:
        """Whether it is drawn in ink."""
        return INK in (self.style.fill, self.style.stroke)

    def moved(self, linear: Array, offset: Array) -> Part:
        """Under a map p -> linear p + offset."""
        scale = float(np.sqrt(abs(np.linalg.det(linear))))
        return Part(
            tuple(curve.moved(linear, offset) for curve in self.curves),
            self.style._replace(width=self.style.width * scale),
            self.opacity,
        )


class Raster(NamedTuple):
    """A picture of pixels: `png` is the file, its pixel (x, y) lies at linear (x, y) + offset."""

    png: bytes
    size: tuple[int, int]
    linear: Array
    offset: Array

    def moved(self, linear: Array, offset: Array) -> Raster:
        """Under a map p -> linear p + offset."""
        return self._replace(linear=linear @ self.linear, offset=linear @ self.offset + offset)


@dataclass(frozen=True, eq=False)
class Motif:
    """What is drawn on every copy of a tile: a symbol of many parts.

    - `parts`: from the bottom up.
    - `rasters`: under them.
    - `within`: the symbol that cuts it off, if any.
    """

    parts: tuple[Part, ...] = ()
    rasters: tuple[Raster, ...] = ()
    within: str | None = None

    def moved(self, linear: Array, offset: Array) -> Motif:
        """Under a map p -> linear p + offset."""
        return Motif(
            tuple(part.moved(linear, offset) for part in self.parts),
            tuple(raster.moved(linear, offset) for raster in self.rasters),
            self.within,
        )


@dataclass(frozen=True, eq=False)
class Uses:
    """M copies of a symbol: a point p of it goes to linear[which[m]] p + offsets[m].

    - `symbol`: its name in the scene.
    - `linear`: (A, 2, 2) the aspects' linear parts.
    - `which`: (M,) aspect of each copy.
    - `offsets`: (M, 2) in mm.
    """

    symbol: str
    linear: Array
    which: NDArray[np.int64]
    offsets: Array

    def __len__(self) -> int:
        return len(self.which)

    def images(self, points: Array) -> Array:
        """(M, ..., 2) images of points (..., 2) of the symbol."""
        turned = np.einsum("aij,...j->a...i", self.linear, points)
        shape = (len(self), *[1] * (points.ndim - 1), 2)
        return turned[self.which] + self.offsets.reshape(shape)

    def curves(self, curve: Curve) -> Iterator[Curve]:
        """The images of a curve of the symbol."""
        for pieces in self.images(curve.pieces):
            yield Curve(pieces, curve.straight, curve.closed)


@dataclass(frozen=True, eq=False)
class Layer:
    """Things of one kind, drawn alike, that programs show under one name.

    - `name`: as people read it, such as "colour 1" or "cut".
    - `items`: curves, and copies of symbols.
    - `clipped`: whether to show it within the scene's `window` alone.
    - `ink`: the colour of `INK` in motifs, where it holds copies of them.
    """

    name: str
    role: Role
    style: Style
    items: tuple[Curve | Uses, ...]
    clipped: bool = False
    ink: str | None = None


@dataclass(frozen=True, eq=False)
class PlacedTile:
    """What is known of a tile on the page, for programs that read it.

    - `aspect`: index of its coset representative.
    - `linear`, `offset`: from the prototile's own place in the scene to this tile's.
    - `neighbours`: numbers of the tiles in the scene that it shares an edge with.
    - `whole`: whether all of it is on the page.
    """

    aspect: int
    linear: Array
    offset: Array
    neighbours: tuple[int, ...] = ()
    whole: bool = True


@dataclass(frozen=True, eq=False)
class Scene:
    """A page.

    - `width`, `height`: in mm.
    - `layers`: from the bottom up.
    - `symbols`: closed curves by name, for `Uses`.
    - `motifs`: drawings by name, for `Uses`; SVG alone has them.
    - `window`: where clipped layers show, default all of the page.
    - `title`, `notes`: in words, for the file's metadata.
    - `prototile`: (N, 2) polygon of the tile that `tiles` are copies of, in mm.
    - `facts`: plain data for the JSON file, such as the class.
    """

    width: float
    height: float
    layers: tuple[Layer, ...]
    symbols: dict[str, Curve] = field(default_factory=dict)
    window: Box | None = None
    title: str = ""
    notes: tuple[str, ...] = ()
    prototile: Array | None = None
    tiles: tuple[PlacedTile, ...] = ()
    facts: dict[str, Any] = field(default_factory=dict)
    motifs: dict[str, Motif] = field(default_factory=dict)

    @property
    def clip(self) -> Box:
        """The window."""
        return self.window or Box(0.0, 0.0, self.width, self.height)

    def require_plain(self) -> None:
        """Nothing, if symbols are single curves.

        Raises:
            OrbiflowError: if there are motifs, which SVG alone can hold.
        """
        if self.motifs:
            raise OrbiflowError("artwork is written as SVG, or rendered as PNG")

    def curves(self, layer: Layer) -> Iterator[Curve]:
        """Every curve of a layer, copies of symbols among them.

        Raises:
            OrbiflowError: for artwork, as `require_plain`.
        """
        self.require_plain()
        for item in layer.items:
            if isinstance(item, Uses):
                yield from item.curves(self.symbols[item.symbol])
            else:
                yield item


def inside(curve: Curve, box: Box, *, slack: float = 1e-9) -> bool:
    """Whether the box surely holds the curve: its control points are in it."""
    (left, top), (right, bottom) = curve.bounds()
    return bool(
        left >= box.left - slack
        and top >= box.top - slack
        and right <= box.right + slack
        and bottom <= box.bottom + slack
    )


def clipped_region(curve: Curve, box: Box, tolerance: float) -> list[Curve]:
    """What of the region inside a closed curve is in the box, as closed curves.

    The curve itself if all of it is; else polygons within `tolerance` of it.
    """
    if inside(curve, box):
        return [curve]
    polygon = shapely.Polygon(curve.flattened(tolerance))
    if not polygon.is_valid:
        polygon = shapely.make_valid(polygon)
    common = shapely.intersection(polygon, shapely.box(*box))
    return [
        Curve.polyline(np.asarray(part.exterior.coords)[:-1], closed=True)
        for part in polygons_in(common)
    ]


def clipped_line(curve: Curve, box: Box, tolerance: float) -> list[Curve]:
    """What of an open curve is in the box."""
    if inside(curve, box):
        return [curve]
    points = curve.flattened(tolerance)
    line = shapely.LineString(np.concatenate([points, points[:1]]) if curve.closed else points)
    common = shapely.intersection(line, shapely.box(*box))
    return [Curve.polyline(part) for part in _lines(common)]


def _lines(geometry: BaseGeometry) -> list[np.ndarray]:
    if geometry.geom_type == "LineString":
        return [] if geometry.is_empty else [shapely.get_coordinates(geometry)]
    return [line for part in getattr(geometry, "geoms", ()) for line in _lines(part)]
