"""A tile in millimetres, in its place on the page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles.exporting.outlines import Outline, outline
from orbiflow.tiles.exporting.scene import Box, PlacedTile
from orbiflow.tiles.exporting.settings import ExportSettings
from orbiflow.tiles.tilings import (
    Copies,
    Tile,
    copies_inside,
)

STRIP = 8.0
"""Height in mm of the strip at the page's foot that the calibration mark has for itself."""


@dataclass(frozen=True, eq=False)
class Layout:
    """What every kind of export starts from.

    - `settings`: as they were given.
    - `tile`: in mm on the page, y down.
    - `outline`: its curves.
    - `box`: the part of the page that tiles may use.
    - `notes`: what the user should know.
    """

    settings: ExportSettings
    tile: Tile
    outline: Outline
    box: Box
    notes: tuple[str, ...]


STEPS = 10
"""Places along each side of a lattice cell that are tried for a page with most whole tiles."""

MANY = 1000
"""Tiles on a page beyond which a few more are not worth looking for."""


def layout(tile: Tile, settings: ExportSettings, *, y_down: bool) -> Layout:
    """Scale the tile and put it on the page, the way up it has, turned as the settings say.

    In the middle; where tiles are not cut at the page's edge, nearby, so that most are whole.

    Args:
        tile: in any units.
        y_down: whether its y axis points down.

    Raises:
        OrbiflowError: for a page that is smaller than the tile.
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
    """Longer side of a ring's smallest rectangle, turned as it may be."""
    return rectangle_sides(ring)[1]


def rectangle_sides(ring: Array) -> tuple[float, float]:
    """Sides of a ring's smallest rectangle by area, the shorter first.

    Of rectangles that are as small, as a regular hexagon has, the one with the shortest sides: which
    of them comes out must not depend on rounding.

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
    """How far in mm a line may reach beyond its tile's polygon."""
    return settings.deviation + (settings.stroke_width or 0.25) / 2


def inner_box(box: Box, settings: ExportSettings) -> Box:
    """Where polygons lie whose lines are all in the box."""
    margin = bleed(settings)
    return Box(box.left + margin, box.top + margin, box.right - margin, box.bottom - margin)


def _with_most_whole(tile: Tile, box: Box) -> Tile:
    """The tile moved so that most copies lie in the box whole; as it is where none is better."""
    if box.width * box.height > MANY * abs(tile.signed_area):
        return tile
    best, shift = len(copies_inside(tile, box)), np.zeros(2)
    shares = np.arange(STEPS) / STEPS
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


def placed_tiles(copies: Copies, layout: Layout, whole: Array) -> tuple[PlacedTile, ...]:
    """What the JSON file says of each copy."""
    own = layout.outline.edges
    beyond = np.zeros((len(copies), 0), int) if own is None else copies.neighbours(own.across)
    linear = copies.group.linear_parts
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
