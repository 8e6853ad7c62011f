"""A tile in its place on the page, and the scenes of whole tilings and of pieces to cut."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter
from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import Palette, palette
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles.exporting.nesting import dense_arrangements, on_sheet
from orbiflow.tiles.exporting.outlines import Outline, fitted, outline, turning
from orbiflow.tiles.exporting.placing import (
    edge_margin,
    inset,
    longer_side,
    mark_corners,
    place_on_page,
    rectangle_sides,
)
from orbiflow.tiles.exporting.settings import USUAL_WIDTH, ExportSettings
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.likeness import narrowest_neck, narrowest_slit
from orbiflow.tiles.scene import Box, Curve, Layer, Motif, PlacedTile, Scene, Style, Uses, rectangle
from orbiflow.tiles.tilings import Copies, Tile, colouring, copies_inside, copies_meeting

STRIP = 8.0  # height in mm of the strip at the page's foot that the calibration mark has for itself


@dataclass(frozen=True, eq=False)
class Layout:
    """A tile's place on the page, from which every kind of export starts."""

    settings: ExportSettings
    tile: Tile  # the tile in mm on the page, y down
    outline: Outline  # the tile's curves
    box: Box  # the part of the page that tiles may use
    place: tuple[Array, Array]  # the map, linear part and offset, from the tile's own units
    motif: Motif | None = None  # what lies on the tile, in mm on the page

    @property
    def fine(self) -> float:
        """The tolerance in mm of what is flattened or fitted again, a part of the whole."""
        return self.settings.deviation / 4

    def scene(self, layers: Iterable[Layer], tiles: tuple[PlacedTile, ...], **more: Any) -> Scene:
        """Return a scene of the page with these layers and tiles."""
        own = {"window": self.box, "prototile": self.tile.polygon, "tiles": tiles}
        return Scene(*self.settings.page, tuple(layers), **own, **more)

    @cached_property
    def piece(self) -> tuple[Array, str]:
        """The outline (M, 2) of a piece with its offset, and what the user should know of it."""
        # flattening and fitting again share what the outline's fit left of the tolerance
        ring = self.outline.closed.flattened(self.fine / 2)
        return offset_ring(ring, self.settings.offset, self.fine / 2)


def layout(tile: Tile, settings: ExportSettings, *, y_down: bool) -> Layout:
    """Scale and turn the tile and put it on the page."""
    width, height = settings.page
    strip = STRIP if settings.calibrate else 0.0
    box = inset(Box(0.0, 0.0, width, height - strip), settings.margin)
    if settings.cut == "template" and "tile_size" not in settings.fields_given:
        settings = settings.replace(tile_size=_largest(tile, settings.rotate, box))
    scale = settings.tile_size / longer_side(tile.polygon)
    centred = settings.clip or settings.cut in ("pieces", "template")
    margin = None if centred else edge_margin(settings.tile_size)
    place = place_on_page(tile, scale, box, y_down, rotate=settings.rotate, margin=margin)
    placed = tile.transformed(*place)
    if settings.cut != "pieces":
        need = np.ptp(placed.polygon, axis=0) + 2 * bleed(settings)
        if need[0] > box.width or need[1] > box.height:
            extra = f", {strip:g} mm of it for the calibration mark" if strip else ""
            edge = f" with a margin of {settings.margin:g} mm" if settings.margin else ""
            raise OrbiflowError(
                f"a tile of {settings.tile_size:g} mm does not fit on the page of {width:g} x "
                f"{height:g} mm{edge}: it needs {need[0]:.1f} x {need[1] + strip:.1f} mm{extra}; "
                "choose a larger area or a smaller tile size"
            )
    return Layout(settings, placed, outline(placed, settings.deviation), box, place)


LABELS = 9.0  # width in mm of the edge around a template that numbers have for themselves


def _largest(tile: Tile, rotate: float, box: Box) -> float:
    """Return the size of the largest tile, turned by an angle in degrees, with its numbers in a box."""
    width, height = np.ptp(tile.polygon @ rotation_matrix(-np.radians(rotate)).T, axis=0)
    room = inset(box, LABELS)
    return max(0.0, min(room.width / width, room.height / height)) * longer_side(tile.polygon)


def bleed(settings: ExportSettings) -> float:
    """Return the room in mm for lines that reach beyond their tile's polygon."""
    own = settings.deviation + (settings.stroke_width or USUAL_WIDTH) / 2
    return max(own, edge_margin(settings.tile_size))


def placed_tiles(copies: Copies, layout: Layout) -> tuple[PlacedTile, ...]:
    """Return what the JSON file says about each copy."""
    own, linear = layout.outline.edges, copies.group.linear_parts
    beyond = [[]] * len(copies) if own is None else copies.neighbours(own.across).copy.tolist()
    rings = copies.images(layout.tile.polygon)
    low, high = rings.min(axis=1), rings.max(axis=1)
    whole = ((low >= layout.box[:2]) & (high <= layout.box[2:])).all(axis=1).tolist()
    near = [tuple(dict.fromkeys(k for k in row if k >= 0)) for row in beyond]
    placed = zip(copies.cosets.tolist(), copies.translations, near, whole, strict=True)
    return tuple(PlacedTile(k, linear[k], at, ks, kept) for k, at, ks, kept in placed)


def chosen_copies(layout: Layout) -> Copies:
    """Return the copies on the page: those that meet it if it clips, else the whole ones."""
    settings, box = layout.settings, layout.box
    if settings.clip:
        return copies_meeting(layout.tile, box)
    return copies_inside(layout.tile, inset(box, bleed(settings)))


SYMBOL, MOTIF = "tile", "motif"


def tile_layers(
    copies: Uses,
    colours: Integers,
    chosen: Palette | None,
    line: Style,
    *,
    clipped: bool,
    seam: float | None = None,
    drawn: bool = False,
) -> list[Layer]:
    """Return a layer of tiles for each of their colours; with a motif on them, if `drawn`.

    Lines are drawn around each tile; or above all, if hairlines `seam` mm wide close the seams that
    viewers leave between neighbours.
    """
    layers = list[Layer]()
    for colour in sorted(set(colours.tolist())):
        own = colours == colour
        uses = copies.select(own)
        if chosen is None:
            return [Layer("tiles", "tiles", line, (uses,), clipped)]
        fill, name, ink = chosen.fill(colour), f"colour {colour + 1}", chosen.ink(colour)
        style = line._replace(fill=fill) if seam is None else Style(fill, fill, seam)
        layers.append(Layer(name, "tiles", style, (uses,), clipped))
        if drawn:
            motifs = (replace(uses, symbol=MOTIF),)
            layers.append(Layer(f"drawing on {name}", "drawing", Style(), motifs, clipped, ink))
    if seam is not None and line.width > 0:
        layers.append(Layer("outlines", "tiles", line, (copies,), clipped))
    return layers


SEAM = 0.025  # width in mm of hairlines between filled tiles


def tiling_scene(layout: Layout) -> Scene:
    """Return a scene with the tile as a symbol, a use of it for each copy, a layer for each colour."""
    settings, box = layout.settings, layout.box
    copies = chosen_copies(layout)
    # relative to the symbol's own middle, so that rounding a transform moves no point by much
    middle = layout.tile.center
    symbol = layout.outline.closed.moved(np.eye(2), -middle)
    turned = np.einsum("aij,j->ai", copies.group.linear_parts, middle)
    offsets = copies.translations + turned[copies.cosets]
    uses = Uses(SYMBOL, copies.group.linear_parts, copies.cosets, offsets)
    motifs, layers, chosen = dict[str, Motif](), list[Layer](), None
    colours, line = np.zeros(len(copies), dtype=np.int64), settings.stroke or "#000000"
    if settings.filled:
        chosen = palette(settings.palette)
        line = settings.stroke or chosen.outline
        colours = colouring(layout.tile).colours(copies)
        layers.append(Layer("paper", "paper", Style(fill=chosen.paper), (rectangle(box),)))
        if layout.motif is not None:
            motifs[MOTIF] = replace(layout.motif.moved(np.eye(2), -middle), within=SYMBOL)
    style = Style(None, line, settings.stroke_width or USUAL_WIDTH)
    seam, clip = SEAM if motifs else None, settings.clip
    layers += tile_layers(uses, colours, chosen, style, clipped=clip, seam=seam, drawn=bool(motifs))
    symbols = {SYMBOL: symbol}
    return layout.scene(layers, placed_tiles(copies, layout), symbols=symbols, motifs=motifs)


RED, BLACK, BLUE = "#ff0000", "#000000", "#0000ff"


def line_style(layout: Layout) -> Style:
    """Return the style of lines to cut."""
    settings = layout.settings
    return Style(None, settings.stroke or RED, settings.stroke_width or 0.1)


MITRE = 4.0  # the greatest reach of a sharp corner of a cut, in offsets


def cut_ring(ring: Array, kerf: float, clearance: float) -> Array:
    """Return the line (M, 2) of the beam's middle that leaves `ring` (N, 2), less half the clearance.

    A neck no wider than kerf or clearance is an error, and so is a slit that the beam would close.

    >>> bar = np.array([[0.0, 0.0], [20, 0], [20, 4], [0, 4]])
    >>> shapely.Polygon(cut_ring(bar, 0.2, 0.0)).bounds
    (-0.1, -0.1, 20.1, 4.1)
    """
    neck = narrowest_neck(ring)
    if neck.width <= max(kerf, clearance):
        what = "kerf" if kerf >= clearance else "clearance"
        raise OrbiflowError(
            f"the {what} of {max(kerf, clearance):g} mm is wider than the piece's neck: it is "
            f"{neck.width:.2f} mm wide {place_on(ring, neck.place)}; choose a larger tile size"
        )
    slit = narrowest_slit(ring)
    if slit is not None and slit.width + clearance <= kerf:
        raise OrbiflowError(
            f"the kerf of {kerf:g} mm is wider than a slit of the piece: it is {slit.width:.2f} mm "
            f"wide {place_on(ring, slit.place)}, and would be burned away; choose a larger tile size"
        )
    return _offset_ring(ring, (kerf - clearance) / 2)


def _offset_ring(ring: Array, distance: float) -> Array:
    if abs(distance) < 1e-9:
        return ring
    moved = shapely.Polygon(ring).buffer(distance, join_style="mitre", mitre_limit=MITRE)
    parts = polygons_in(moved)
    if len(parts) != 1 or parts[0].interiors:
        raise OrbiflowError(
            "kerf and clearance are wider than a part of the piece: its cut would fall into "
            f"{len(parts) + sum(len(part.interiors) for part in parts)} lines; choose a larger "
            "tile size"
        )
    points = np.asarray(parts[0].exterior.coords)[:-1]
    steps = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
    return points[steps > 1e-9]


def offset_ring(ring: Array, distance: float, tolerance: float) -> tuple[Array, str]:
    """Return the line (M, 2) at a distance outside a ring (N, 2), inside if negative, and a note.

    Every point of it is at that distance, within the tolerance, from the ring: corners are rounded on
    the side to which the line moves. The note says where gaps close or limbs vanish.

    >>> bar = np.array([[0.0, 0.0], [20, 0], [20, 4], [0, 4]])
    >>> shapely.Polygon(offset_ring(bar, 1.0, 1e-3)[0]).bounds
    (-1.0, -1.0, 21.0, 5.0)
    """
    if not distance:
        return ring, ""
    piece, reach = shapely.Polygon(ring), abs(distance)
    sides = max(8, math.ceil(np.pi / 4 / math.acos(max(0.0, 1 - tolerance / reach))))
    parts = polygons_in(piece.buffer(distance, quad_segs=sides))
    if len(parts) != 1:
        neck = narrowest_neck(ring)
        what = f"would fall into {len(parts)} parts" if parts else "vanishes"
        raise OrbiflowError(
            f"with an offset of {distance:g} mm the piece {what}: it is {neck.width:.2f} mm wide "
            f"{place_on(ring, neck.place)}; choose a smaller offset or a larger tile size"
        )
    moved = shapely.Polygon(parts[0].exterior)
    back = moved.buffer(-distance, quad_segs=sides)
    # what does not come back, but for corners, is a gap that closes or a limb that vanishes
    lost = polygons_in(piece.difference(back) if distance < 0 else back.difference(piece))
    ends = [_farthest(part, back) for part in lost]
    least = min(reach, np.ptp(ring, axis=0).max() / 10)  # no gap is as deep as a very wide offset
    deep = sorted((end for end in ends if end[0] > least), key=itemgetter(0))
    note = ""
    if deep:
        what = ("limb vanishes", "limbs vanish") if distance < 0 else ("gap closes", "gaps close")
        note = (
            f"with an offset of {distance:g} mm, {len(deep)} {what[len(deep) > 1]} where the outline "
            f"is less than {2 * reach:g} mm across, the largest {place_on(ring, deep[-1][1])}"
        )
    return shapely.get_coordinates(moved.exterior)[:-1], note


def _farthest(part: shapely.Polygon, other: shapely.Polygon) -> tuple[float, Array]:
    """Return how far a part reaches from the boundary of another polygon, and where."""
    points = shapely.get_coordinates(part)
    distance = np.asarray(shapely.distance(shapely.points(points), other.boundary))
    return float(distance.max()), points[distance.argmax()]


def place_on(ring: Array, place: Array) -> str:
    """Return in words where on a piece a point (2,) is.

    >>> ring = np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 14.0], [10.0, 14.0]])
    >>> place_on(ring, narrowest_neck(ring).place).split(" from ")[1]
    'its left and 2.0 mm'
    """
    x, y = place - ring.min(axis=0)
    return f"{x:.1f} mm from its left and {y:.1f} mm from its top"


STICKER_COLOURS = 3
LEAST_GAP = 0.01  # the least distance in mm between cuts: pieces never touch
LEAST_EDGE = 0.1  # twice the least distance in mm of cuts from the sheet's edge


def pieces_scenes(layout: Layout, *, fine: bool = True) -> list[Scene]:
    """Return a scene for each sheet, several where a bed does not hold all; smooth cuts if `fine`."""
    settings, box, flat = layout.settings, layout.box, layout.fine
    ring = cut_ring(layout.piece[0], settings.kerf, settings.clearance)
    curve = _closed_fit(ring, flat) if fine else Curve.polyline(ring, closed=True)
    line = curve.flattened(flat / 4)
    gap = max(settings.spacing, LEAST_GAP)
    if settings.coloured:  # colours that reach beyond the cut do not meet
        gap += 2 * max(0.0, -settings.offset)
    arrangements = dense_arrangements(layout.tile, line, gap)
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
    return [
        _scene(layout, part, curve, line, box, gap) for part in _shared_out(placed, layout, box)
    ]


def _shared_out(placed: Uses, layout: Layout, box: Box) -> list[Uses]:
    settings, fit = layout.settings, len(placed)
    wanted = settings.copies or fit
    sheets = math.ceil(wanted / fit)
    if sheets > 1 and settings.bed is None:
        plural = "s" if fit > 1 else ""
        raise OrbiflowError(
            f"{wanted} pieces do not fit on the page of {box.width:g} x {box.height:g} mm: it holds "
            f"{fit} piece{plural}, so that {sheets} sheets are needed; choose a larger area, or give "
            f"the bed to have {sheets} files"
        )
    counts = [min(fit, wanted - k * fit) for k in range(sheets)]
    return [placed.select(slice(n)) for n in counts]


def _scene(layout: Layout, placed: Uses, curve: Curve, line: Array, box: Box, gap: float) -> Scene:
    _require_clear(placed.images(line), box, gap)
    pieces = [
        PlacedTile(aspect, placed.linear[aspect], offset)
        for aspect, offset in zip(placed.which.tolist(), placed.offsets, strict=True)
    ]
    layers = [Layer("cut", "cut", line_style(layout), _moved(curve, pieces))]
    if layout.settings.purpose == "stickers":
        layers = [*_coloured(layout, pieces), *layers]
    elif layout.settings.offset > 0 and not layout.settings.coloured:
        seams = _moved(layout.outline.closed, pieces)
        layers.insert(0, Layer("seam", "mark", Style(None, BLUE, 0.1), seams))
    return layout.scene(layers, tuple(pieces))


def _coloured(layout: Layout, pieces: list[PlacedTile]) -> Iterator[Layer]:
    """Yield a layer of tiles for each of a few colours, which pieces have in turn."""
    chosen, count = palette(layout.settings.palette), min(STICKER_COLOURS, len(pieces))
    for colour in range(count):
        tiles = _moved(layout.outline.closed, pieces[colour::count])
        style = Style(chosen.fill(colour), chosen.outline, USUAL_WIDTH)
        yield Layer(f"colour {colour + 1}", "tiles", style, tiles)


def _moved(curve: Curve, pieces: list[PlacedTile]) -> tuple[Curve, ...]:
    return tuple(curve.moved(piece.linear, piece.offset) for piece in pieces)


def _closed_fit(ring: Array, tolerance: float) -> Curve:
    """Fit a smooth curve to a closed polygon; take the polygon where the curve would cross itself."""
    closed = np.concatenate([ring[-1:], ring, ring[:1]])
    first = int(np.argmax(np.abs(turning(closed))))  # a corner, where there is one
    turned = np.roll(ring, -first, axis=0)
    curve = fitted(np.concatenate([turned, turned[:1]]), tolerance)
    curve = Curve(curve.pieces, curve.straight, closed=True)
    if shapely.Polygon(curve.flattened(tolerance / 4)).is_valid:
        return curve
    return Curve.polyline(ring, closed=True)


def _require_clear(rings: Array, box: Box, gap: float) -> None:
    """Check that pieces keep their distance and lie on the sheet, as the arrangement promises."""
    polygons = np.asarray(shapely.polygons(rings))
    tree = shapely.STRtree(polygons)
    first, second = tree.query(polygons, predicate="dwithin", distance=0.999 * gap)
    low, high = rings.min(axis=(0, 1)), rings.max(axis=(0, 1))
    if (first != second).any() or (low < box[:2]).any() or (high > box[2:]).any():
        raise RuntimeError("the nesting broke its promise: pieces too close or off the sheet")
