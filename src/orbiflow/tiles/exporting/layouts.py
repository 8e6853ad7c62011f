"""A tile in millimetres in its place on the page, and the copies of it, each in its colour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles.exporting.outlines import Outline, outline
from orbiflow.tiles.exporting.scene import Box, Layer, PlacedTile, Scene, Style, Uses, rectangle
from orbiflow.tiles.exporting.settings import ExportSettings
from orbiflow.tiles.tilings import Copies, Tile, colouring, copies_inside, copies_meeting

STRIP = 8.0
"""Height in mm of the strip at the page's foot that the calibration mark has for itself."""


@dataclass(frozen=True, eq=False)
class Layout:
    """A tile's place on the page, from which every kind of export starts.

    - `settings`: The settings as they were given.
    - `tile`: The tile in mm on the page, y down.
    - `outline`: The tile's curves.
    - `box`: The part of the page that tiles may use.
    - `notes`: What the user should know.
    """

    settings: ExportSettings
    tile: Tile
    outline: Outline
    box: Box
    notes: tuple[str, ...]


SHIFTS = 10
"""Places along each side of a lattice cell that are tried for a page with most whole tiles."""

MOST_TILES_TO_SHIFT = 1000
"""Number of tiles on a page beyond which a few more are not worth looking for."""


def layout(tile: Tile, settings: ExportSettings, *, y_down: bool) -> Layout:
    """Scale the tile and put it on the page, the way up it has, turned as the settings say.

    It lies in the middle; where tiles are not cut at the page's edge, it lies nearby, so that as many
    as possible are whole.

    Args:
        tile: The tile, in any units.
        settings: How it is exported.
        y_down: Whether its y axis points down.

    Raises:
        OrbiflowError: If the page is smaller than the tile.
    """
    width, height = settings.page
    box = Box(0.0, 0.0, width, height - (STRIP if settings.calibrate else 0.0))
    scale = settings.tile_size / longer_side(tile.polygon)
    turn = rotation_matrix(-np.radians(settings.rotate))  # y points down on the page
    linear = scale * turn @ np.diag([1.0, 1.0 if y_down else -1.0])
    middle = np.array([(box.left + box.right) / 2, (box.top + box.bottom) / 2])
    placed = tile.transformed(linear, middle - linear @ tile.center)
    if settings.cut != "pieces":
        _check_room(placed, settings, box)
        if not settings.clip:
            placed = _with_most_whole(placed, inner_box(box, settings))
    curves = outline(placed, settings.deviation)
    return Layout(settings, placed, curves, box, (curves.note,) if curves.note else ())


def longer_side(ring: Array) -> float:
    """Return the longer side of the smallest rectangle, however turned, around a ring."""
    return rectangle_sides(ring)[1]


def rectangle_sides(ring: Array) -> tuple[float, float]:
    """Return the sides of the smallest rectangle by area around a ring, the shorter first.

    Among rectangles of the same area, as around a regular hexagon, it is the one with the shortest
    sides, so that the choice does not depend on rounding.

    >>> square = np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 2.0], [-1.0, 1.0]])
    >>> [round(side, 6) for side in rectangle_sides(square)]
    [1.414214, 1.414214]
    """
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(ring)))
    steps = np.diff(hull, axis=0)  # a smallest rectangle lies along one of the hull's sides
    along = steps / np.linalg.norm(steps, axis=1)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    sides = np.sort(np.stack([np.ptp(hull @ way.T, axis=0) for way in (along, across)]), axis=0)
    areas = sides.prod(axis=0)
    smallest = np.flatnonzero(areas <= (1 + 1e-6) * areas.min())
    best = smallest[sides[1, smallest].argmin()]
    return float(sides[0, best]), float(sides[1, best])


def bleed(settings: ExportSettings) -> float:
    """Return how far in mm a line may reach beyond its tile's polygon."""
    return settings.deviation + (settings.stroke_width or 0.25) / 2


def inner_box(box: Box, settings: ExportSettings) -> Box:
    """Return the box for polygons whose lines are to lie in `box`."""
    margin = bleed(settings)
    return Box(box.left + margin, box.top + margin, box.right - margin, box.bottom - margin)


def _with_most_whole(tile: Tile, box: Box) -> Tile:
    """Return the tile moved so that as many copies as possible are whole, or as it is."""
    if box.width * box.height > MOST_TILES_TO_SHIFT * abs(tile.signed_area):
        return tile
    best, shift = len(copies_inside(tile, box)), np.zeros(2)
    shares = np.arange(SHIFTS) / SHIFTS
    grid = np.stack(np.meshgrid(shares, shares), axis=-1).reshape(-1, 2)
    for step in grid @ tile.group.lattice.T:
        moved = (box.left - step[0], box.top - step[1], box.right - step[0], box.bottom - step[1])
        count = len(copies_inside(tile, moved))
        if count > best:
            best, shift = count, step
    return tile.transformed(np.eye(2), shift)


def _check_room(tile: Tile, settings: ExportSettings, box: Box) -> None:
    need = np.ptp(tile.polygon, axis=0) + 2 * bleed(settings)
    if need[0] <= box.width and need[1] <= box.height:
        return
    extra = settings.page[1] - box.height
    strip = f", {extra:g} mm of it for the calibration mark" if extra else ""
    raise OrbiflowError(
        f"a tile of {settings.tile_size:g} mm does not fit on the page of {settings.page[0]:g} x "
        f"{settings.page[1]:g} mm: it needs {need[0]:.1f} x {need[1] + extra:.1f} mm{strip}; choose "
        "a larger area or a smaller tile size"
    )


def placed_tiles(copies: Copies, layout: Layout) -> tuple[PlacedTile, ...]:
    """Return what the JSON file says about each copy."""
    own = layout.outline.edges
    beyond = np.zeros((len(copies), 0), int) if own is None else copies.neighbours(own.across)
    linear = copies.group.linear_parts
    rings = copies.images(layout.tile.polygon)
    low, high = rings.min(axis=1), rings.max(axis=1)
    whole = ((low >= layout.box[:2]) & (high <= layout.box[2:])).all(axis=1)
    return tuple(
        PlacedTile(
            int(coset),
            linear[coset],
            offset,
            tuple(dict.fromkeys(k for k in near if k >= 0)),
            bool(kept),
        )
        for coset, offset, near, kept in zip(
            copies.cosets, copies.translations, beyond.tolist(), whole, strict=True
        )
    )


SYMBOL = "tile"


def chosen_copies(layout: Layout) -> Copies:
    """Return the copies on the page: those that meet it if it clips, else the whole ones."""
    settings, box = layout.settings, layout.box
    if settings.clip:
        return copies_meeting(layout.tile, box)
    return copies_inside(layout.tile, inner_box(box, settings))


def tiling_scene(layout: Layout) -> Scene:
    """Return a scene with the tile as a symbol, a use of it for each copy, a layer for each colour.

    Raises:
        OrbiflowError: If the page holds too many tiles.
    """
    settings = layout.settings
    copies = chosen_copies(layout)
    # relative to the symbol's own middle, so that rounding a transform moves no point by much
    middle = layout.tile.center
    symbol = layout.outline.closed.moved(np.eye(2), -middle)
    turned = np.einsum("aij,j->ai", copies.group.linear_parts, middle)
    offsets = copies.translations + turned[copies.cosets]
    chosen = palette(settings.palette)
    if settings.filled:
        colours = colouring(layout.tile).colours(copies)
    else:
        colours = np.zeros(len(copies), dtype=np.int64)
    layers = []
    for colour in range(int(colours.max(initial=0)) + 1):
        own = colours == colour
        uses = Uses(SYMBOL, copies.group.linear_parts, copies.cosets[own], offsets[own])
        name = f"colour {colour + 1}" if settings.filled else "tiles"
        style = Style(
            chosen.fill(colour) if settings.filled else None,
            settings.stroke or (chosen.outline if settings.filled else "#000000"),
            settings.stroke_width or 0.25,
        )
        layers.append(Layer(name, "tiles", style, (uses,), clipped=settings.clip))
    box = layout.box
    if settings.filled:
        layers.insert(0, Layer("paper", "paper", Style(fill=chosen.paper), (rectangle(box),)))
    return Scene(
        *settings.page,
        tuple(layers),
        {SYMBOL: symbol},
        window=box,
        prototile=layout.tile.polygon,
        tiles=placed_tiles(copies, layout),
    )


RED = "#ff0000"


def line_style(layout: Layout) -> Style:
    """Return the style of lines to cut."""
    settings = layout.settings
    return Style(None, settings.stroke or RED, settings.stroke_width or 0.1)
