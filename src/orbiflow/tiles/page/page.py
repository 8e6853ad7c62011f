"""A page of copies: tiles in their place in millimetres, which of them it shows, and their colours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array, Integers, Window
from orbiflow.drawing import Palette
from orbiflow.symmetry import Isometry, rotation_matrix
from orbiflow.tiles.geometry import Place, checked_window, polygons_in
from orbiflow.tiles.page.flattening import GROUND_INSET, boundary, ground_of
from orbiflow.tiles.page.scene import (
    Box,
    Curve,
    Layer,
    Motif,
    PlacedTile,
    Scene,
    Style,
    Uses,
    rectangle,
)
from orbiflow.tiles.page.settings import (
    MARKS_EDGE,
    USUAL_WIDTH,
    ColourRule,
    PageSettings,
    usual_tolerance,
)
from orbiflow.tiles.page.tinting import glass, tinted
from orbiflow.tiles.tilings import (
    Colouring,
    Copies,
    Edges,
    Tiles,
    Tiling,
    as_tiling,
    colouring,
    copies_inside,
    copies_meeting,
)

MOTIF = "motif"
"""The name of what lies on every tile, among a scene's motifs."""

MARK = 20.0  # length in mm of registration marks, around which nothing else may lie
MIN_COVERING_WIDTH = 0.1  # width in mm of lines that cover the seams between tiles
# Places along each side of a lattice cell that are tried for a page with most whole tiles
SHIFTS = 10
# Number of tiles on a page beyond which a few more are not worth looking for
MOST_TILES_TO_SHIFT = 1000


@dataclass(frozen=True, eq=False)
class Page:
    """A page of copies in mm, y down: what every cut, picture and motion is made from.

    - `size`: Its width and height.
    - `box`: The part of it that tiles may use.
    - `tiling`: The tiles, in their place on the page.
    - `place`: The map to the page, whose y points down, from the tile's own units.
    - `whole`: The distance that whole tiles keep from the box's edge. None shows all that meet the box.
    - `colour`: Which tiles have the same colour.
    - `colouring`: A colouring of the tiling in its own units. Default: the one with fewest colours.
    - `stretch`: A linear map of all copies, near the identity, for cells that repeat.
    - `most`: The largest number of whole tiles. Default: all that the box holds.
    """

    size: tuple[float, float]
    box: Box
    tiling: Tiling
    place: Place
    whole: float | None = None
    colour: ColourRule = "neighbour"
    colouring: Colouring | None = None
    stretch: Array = field(default_factory=lambda: np.eye(2))
    most: int | None = None

    @classmethod
    def placed(
        cls,
        tile: Tiles,
        settings: PageSettings,
        scale: float,
        *,
        y_down: bool,
        box: Box | None = None,
        whole: float | None = None,
        centred: bool = True,
    ) -> Page:
        """Return the page that settings describe, at so many mm per unit, with the tile in its middle.

        Unless it is to be `centred`, the tile is moved nearby to where most are whole.
        """
        size = settings.page
        box = box or Box(0.0, 0.0, *size)
        tiling = as_tiling(tile)
        turn = rotation_matrix(-np.radians(settings.rotate))  # y points down on the page
        linear = scale * turn @ np.diag([1.0, 1.0 if y_down else -1.0])
        middle = np.array([(box.left + box.right) / 2, (box.top + box.bottom) / 2])
        place = Place(linear, middle - linear @ tiling.center)
        if not centred:
            within = inset(box, edge_margin(scale * tiling_size(tiling)))
            shift = _shift_to_most_whole(tiling.transformed(*place), within)
            place = place._replace(offset=place.offset + shift)
        return cls(size, box, tiling.transformed(*place), place, whole, settings.colour)

    @classmethod
    def of_window(
        cls,
        tile: Tiles,
        window: Window,
        width: float,
        *,
        y_down: bool = False,
        colouring: Colouring | None = None,
    ) -> Page:
        """Return a page of this width with a window (xmin, ymin, xmax, ymax) of the tile's units."""
        tiling, (xmin, ymin, xmax, ymax) = as_tiling(tile), checked_window(window)
        scale = width / (xmax - xmin)
        linear = scale * np.diag([1.0, 1.0 if y_down else -1.0])
        place = Place(linear, -linear @ (xmin, ymin if y_down else ymax))
        size = width, scale * (ymax - ymin)
        moved = tiling.transformed(*place)
        return cls(size, Box(0.0, 0.0, *size), moved, place, colouring=colouring)

    @property
    def ring(self) -> Array:
        """The polygon (N, 2) of the first prototile, in its place."""
        return self.tiling.prototiles[0].polygon

    @property
    def polygons(self) -> list[Curve]:
        """The polygon of each prototile, in its place, as a curve."""
        return [Curve.polyline(p.polygon, closed=True) for p in self.tiling.prototiles]

    @property
    def tile_size(self) -> float:
        """The longer side in mm of the smallest rectangle around the largest prototile."""
        return tiling_size(self.tiling)

    @cached_property
    def copies(self) -> Copies:
        """The copies that the page shows."""
        if self.whole is not None:
            inside = copies_inside(self.tiling, inset(self.box, self.whole))
            return inside.select(np.arange(len(inside))[: self.most])
        left, top, right, bottom = self.box
        corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        mapped = corners @ np.linalg.inv(self.stretch).T
        return copies_meeting(self.tiling, (*mapped.min(axis=0), *mapped.max(axis=0)))

    @cached_property
    def _colouring(self) -> Colouring:
        return self.colouring or colouring(self.tiling)

    @property
    def count(self) -> int:
        """The number of colours."""
        if self.colour == "aspect":
            return self.tiling.group.order
        return self._colouring.count if self.colour == "neighbour" else 1

    def palette(self, chosen: Palette) -> Palette:
        """Return a palette in which each of several figures has a colour of its own, and its shades.

        One that a user wrote out is taken as it is.
        """
        return shades(chosen, self._colouring) if self.colour == "neighbour" else chosen

    @cached_property
    def colours(self) -> Integers:
        """The number (M,) of each copy's colour."""
        return self.colours_of(self.copies, self.tiling)

    def colours_of(self, copies: Copies, tiling: Tiling) -> Integers:
        """Return the number (M,) of each copy's colour, for copies of this or a like tiling."""
        if self.colour == "aspect":
            return copies.cosets
        if self.colour == "one":
            return np.zeros(len(copies), dtype=np.int64)
        if tiling is not self.tiling:
            return colouring(tiling).colours(copies)
        return self._colouring.colours(copies if self.colouring is None else self._own(copies))

    def _own(self, copies: Copies) -> Copies:
        """Return the same copies of the colouring's tiling, which is not on the page.

        On the page the representative of a coset may lie in another cell.
        """
        tiling, (linear, offset) = self._colouring.tiling, self.place
        table, back = tiling.aspects, np.linalg.inv(linear)
        places = []
        for coset, prototile in zip(
            self.tiling.aspects.cosets, self.tiling.aspects.prototiles, strict=True
        ):
            element = self.tiling.group.cosets[int(coset)]
            shift = element.linear @ offset + element.translation - offset
            moved = Isometry(back @ element.linear @ linear, back @ shift)
            places.append(table.find(tiling.group, moved, int(prototile))[:2])
        aspects, cells = (np.array(part) for part in zip(*places, strict=True))
        return Copies(tiling, aspects[copies.aspects], copies.cells + cells[copies.aspects])

    def rings(self) -> list[Array]:
        """Return the polygon (N, 2) of each copy."""
        return [ring @ self.stretch.T for ring in self.copies.rings()]

    def uses(self, prototile: int = 0) -> Uses:
        """Return the copies of what lies about the middle of a prototile, which is its symbol's origin.

        Relative to its own middle, the rounding of a transform moves no point by much.
        """
        copies, middle = self.copies, self.tiling.prototiles[prototile].center
        if len(self.tiling.prototiles) > 1:
            copies = copies.select(copies.prototiles == prototile)
        parts = self.stretch @ copies.group.linear_parts @ np.linalg.inv(self.stretch)
        turned = np.einsum("aij,j->ai", copies.group.linear_parts, middle)
        offsets = (copies.translations + turned[copies.cosets]) @ self.stretch.T
        return Uses(symbol_of(prototile), parts, copies.cosets, offsets)

    def about_middle(self, prototile: int = 0) -> tuple[Array, Array]:
        """Return the map, linear part and offset, from the page to a prototile's symbol."""
        return self.stretch, -self.stretch @ self.tiling.prototiles[prototile].center

    def scene(
        self,
        chosen: Palette | None,
        line: Style,
        *,
        outlines: Sequence[Curve] | None = None,
        clipped: bool,
        seam: float | None = None,
        motifs: Sequence[Motif] = (),
        tint: float = 0.0,
        **more: Any,
    ) -> Scene:
        """Return the copies as a scene: symbols, a use of them for each copy, a layer for each colour.

        Args:
            chosen: The colours; None for lines alone.
            line: The lines around tiles, drawn around each; or above all, if hairlines `seam` mm wide
                close the seams that viewers leave between neighbours.
            outlines: The outline of each prototile, on the page. Default: its polygon.
            clipped: Whether tiles are cut off at the box.
            motifs: What lies on each prototile, on the page; nothing lies on those beyond.
            tint: How much a copy's colour tints what lies on it, from 0 to 1.
            more: Further fields of the scene.
        """
        numbered = enumerate(self.polygons if outlines is None else outlines)
        symbols = {symbol_of(k): curve.moved(*self.about_middle(k)) for k, curve in numbered}
        drawn = {
            k: replace(motif.moved(*self.about_middle(k)), within=symbol_of(k))
            for k, motif in enumerate(motifs)
            if motif.parts or motif.rasters
        }
        layers = []
        if chosen is not None:
            chosen = self.palette(chosen)
            layers = [Layer("paper", "paper", Style(fill=chosen.paper), (rectangle(self.box),))]
            if line.width < MIN_COVERING_WIDTH:
                ground = Style(fill=chosen.mean({*self.colours.tolist()}))
                under = self._ground([*symbols.values()], clipped)
                layers.append(Layer("ground", "paper", ground, under))
        layers += self._tile_layers(chosen, line, clipped, seam, drawn, tint)
        named = {symbol_of(k, MOTIF): motif for k, motif in drawn.items()}
        if chosen is not None and tint:
            named = {
                symbol_of(k, tinted_name(colour)): tinted(motif, glass(chosen.fill(colour), tint))
                for colour in sorted(set(self.colours.tolist()))
                for k, motif in drawn.items()
            }
        return Scene(*self.size, tuple(layers), symbols, self.box, motifs=named, **more)

    def _ground(self, outlines: Sequence[Curve], clipped: bool) -> tuple[Curve, ...]:
        """Return what lies under copies of outlines about the middle of each prototile."""
        if clipped and self.whole is None:
            return (rectangle(self.box),)
        rings = [curve.flattened(GROUND_INSET / 2) for curve in outlines]
        copies = (copy for kind, ring in enumerate(rings) for copy in self.uses(kind).images(ring))
        parts = polygons_in(ground_of(copies))
        return tuple(curve for part in parts for curve in boundary(shapely.Polygon(part.exterior)))

    def empty(self, layers: Iterable[Layer], **more: Any) -> Scene:
        """Return the page as a scene of other layers."""
        return Scene(*self.size, tuple(layers), window=self.box, **more)

    def _tile_layers(
        self,
        chosen: Palette | None,
        line: Style,
        clipped: bool,
        seam: float | None,
        drawn: Iterable[int],
        tint: float,
    ) -> list[Layer]:
        kinds = range(len(self.tiling.prototiles))
        every, numbers = [self.uses(k) for k in kinds], [self.copies.prototiles == k for k in kinds]
        line = line if line.width > 0 else Style()
        if chosen is None:
            return [Layer("tiles", "tiles", line, tuple(every), clipped)]
        layers = list[Layer]()
        for colour in sorted(set(self.colours.tolist())):
            uses = [
                uses.select(self.colours[mine] == colour)
                for uses, mine in zip(every, numbers, strict=True)
            ]
            fill, name = chosen.fill(colour), f"colour {colour + 1}"
            style = line._replace(fill=fill) if seam is None else Style(fill, fill, seam)
            layers.append(Layer(name, "tiles", style, tuple(filter(len, uses)), clipped))
            what = tinted_name(colour) if tint else MOTIF
            on = tuple(replace(uses[k], symbol=symbol_of(k, what)) for k in drawn if len(uses[k]))
            if on:
                ink = chosen.ink(colour)
                layers.append(Layer(f"drawing on {name}", "drawing", Style(), on, clipped, ink))
        if seam is not None and line.width > 0:
            layers.append(Layer("outlines", "tiles", line, tuple(every), clipped))
        return layers

    def listed(self, edges: Edges | None) -> tuple[PlacedTile, ...]:
        """Return what a JSON file says of each copy, with its neighbours."""
        copies, linear = self.copies, self.copies.group.linear_parts
        beyond: Any = [[]] * len(copies)
        if edges is not None:
            beyond = copies.neighbours(edges.across, edges.owners).copy
        low, high = copies.boxes()
        whole = np.all((low >= self.box[:2]) & (high <= self.box[2:]), axis=1).tolist()
        near = [
            tuple(dict.fromkeys(k for k in row if k >= 0)) for row in np.asarray(beyond).tolist()
        ]
        numbers = copies.prototiles.tolist()
        placed = zip(copies.cosets.tolist(), copies.translations, near, whole, numbers, strict=True)
        return tuple(
            PlacedTile(k, linear[k], at, ks, kept, number) for k, at, ks, kept, number in placed
        )


def shades(chosen: Palette, coloured: Colouring) -> Palette:
    """Return a palette in which each of several prototiles has a colour of its own, and its shades."""
    return chosen if len(coloured.shares) == 1 else chosen.shaded(coloured.shares)


def symbol_of(prototile: int, what: str = "tile") -> str:
    """Return the name of a prototile's outline among a scene's symbols, or of its motif."""
    return what if prototile == 0 else f"{what}-{prototile + 1}"


def tinted_name(colour: int) -> str:
    """Return the name of what lies on tiles of a colour, which tints it."""
    return f"{MOTIF}-colour-{colour + 1}"


def edge_margin(tile_size: float) -> float:
    """Return the distance in mm that whole tiles of a size keep from the page's edge."""
    return usual_tolerance(tile_size) + USUAL_WIDTH / 2


def inset(box: Box, margin: float) -> Box:
    """Return a box that is smaller by a margin on each side."""
    return Box(box.left + margin, box.top + margin, box.right - margin, box.bottom - margin)


def mark_corners(page: tuple[float, float]) -> list[Box]:
    """Return the boxes of registration marks: in the corners of a page but the lower right one."""
    left = top = MARKS_EDGE
    right, bottom = page[0] - MARKS_EDGE, page[1] - MARKS_EDGE
    return [
        Box(left, top, left + MARK, top + MARK),
        Box(right - MARK, top, right, top + MARK),
        Box(left, bottom - MARK, left + MARK, bottom),
    ]


def _shift_to_most_whole(tiling: Tiling, box: Box) -> Array:
    """Return the shift after which most tiles are whole in a box; none if it is best."""
    if box.width * box.height > MOST_TILES_TO_SHIFT * tiling.tile_area:
        return np.zeros(2)
    best, shift = len(copies_inside(tiling, box)), np.zeros(2)
    shares = np.arange(SHIFTS) / SHIFTS
    grid = np.stack(np.meshgrid(shares, shares), axis=-1).reshape(-1, 2)
    for step in grid @ tiling.group.lattice.T:
        moved = (box.left - step[0], box.top - step[1], box.right - step[0], box.bottom - step[1])
        count = len(copies_inside(tiling, moved))
        if count > best:
            best, shift = count, step
    return shift


def tiling_size(tiling: Tiling) -> float:
    """Return the longer side of the smallest rectangle around the largest prototile."""
    return max(longer_side(prototile.polygon) for prototile in tiling.prototiles)


def longer_side(ring: Array) -> float:
    """Return the longer side of the smallest rectangle, however turned, around a ring."""
    return rectangle_sides(ring)[1]


def rectangle_sides(ring: Array) -> tuple[float, float]:
    """Return the sides of the smallest rectangle around a ring, the shorter first.

    >>> square = np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 2.0], [-1.0, 1.0]])
    >>> [round(side, 6) for side in rectangle_sides(square)]
    [1.414214, 1.414214]
    """
    first, second, third, _ = smallest_rectangle(ring)
    short, long = sorted(float(np.linalg.norm(side)) for side in (second - first, third - second))
    return short, long


def smallest_rectangle(ring: Array) -> Array:
    """Return the corners (4, 2) of the smallest rectangle by area around a ring.

    Of the same area, as around a regular hexagon, the shortest: rounding does not choose.
    """
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(ring)))
    steps = np.diff(hull, axis=0)  # a smallest rectangle lies along one of the hull's sides
    along = steps / np.linalg.norm(steps, axis=1)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    places = np.stack([hull @ way.T for way in (along, across)])  # of each point in each direction
    low, high = places.min(axis=1), places.max(axis=1)
    areas, longer = (high - low).prod(axis=0), (high - low).max(axis=0)
    smallest = np.flatnonzero(areas <= (1 + 1e-6) * areas.min())
    best = smallest[longer[smallest].argmin()]
    (left, bottom), (right, top) = low[:, best], high[:, best]
    corners = np.array([[left, bottom], [right, bottom], [right, top], [left, top]])
    return corners @ np.stack([along[best], across[best]])
