"""Separate pieces to cut, nested on sheets, with kerf and clearance allowed for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.exporting.layouts import Layout, line_style, rectangle_sides
from orbiflow.tiles.exporting.nesting import Placed, dense_arrangements, on_sheet
from orbiflow.tiles.exporting.outlines import fitted, turning
from orbiflow.tiles.exporting.scene import Box, Curve, Layer, PlacedTile, Scene
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.likeness import Thinnest, narrowest_neck, narrowest_slit

MITRE = 4.0
"""The greatest reach of a sharp corner of a cut, in offsets."""


def cut_ring(ring: Array, kerf: float, clearance: float) -> Array:
    """Return the line (M, 2) that the middle of the beam follows to cut a piece with this outline.

    The piece that is left is `ring`, less half the clearance all around.

    Args:
        ring: The outline (N, 2), a simple polygon in mm.
        kerf: The width in mm of what is burned away.
        clearance: The gap in mm between two pieces put together.

    Raises:
        OrbiflowError: If a neck is no wider than kerf or clearance, or the beam would close a slit; the
            message says where on the piece.

    >>> bar = np.array([[0.0, 0.0], [20, 0], [20, 4], [0, 4]])
    >>> shapely.Polygon(cut_ring(bar, 0.2, 0.0)).bounds
    (-0.1, -0.1, 20.1, 4.1)
    """
    neck = narrowest_neck(ring)
    if neck.width <= max(kerf, clearance):
        what = "kerf" if kerf >= clearance else "clearance"
        raise OrbiflowError(
            f"the {what} of {max(kerf, clearance):g} mm is wider than the piece's neck: it is "
            f"{neck.width:.2f} mm wide {place_on(ring, neck)}; choose a larger tile size"
        )
    slit = narrowest_slit(ring)
    if slit is not None and slit.width + clearance <= kerf:
        raise OrbiflowError(
            f"the kerf of {kerf:g} mm is wider than a slit of the piece: it is {slit.width:.2f} mm "
            f"wide {place_on(ring, slit)}, and would be burned away; choose a larger tile size"
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


def place_on(ring: Array, found: Thinnest) -> str:
    """Return in words where on a piece a neck or slit is.

    >>> ring = np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 14.0], [10.0, 14.0]])
    >>> place_on(ring, narrowest_neck(ring)).split(" from ")[1]
    'its left and 2.0 mm'
    """
    x, y = found.place - ring.min(axis=0)
    return f"{x:.1f} mm from its left and {y:.1f} mm from its top"


LEAST_GAP = 0.01
"""The least distance in mm between cuts: pieces never touch."""

LEAST_EDGE = 0.1
"""Twice the least distance in mm of cuts from the sheet's edge."""


def pieces_scenes(layout: Layout, *, fine: bool = True) -> list[Scene]:
    """Return a scene for each sheet; there is one unless a bed is given and does not hold all copies.

    Args:
        layout: The tile's place on the page.
        fine: Whether the cuts are smooth curves, or else polygons.

    Raises:
        OrbiflowError: If the piece is too thin for kerf or clearance, a sheet is smaller than a piece,
            or the page does not hold all copies and no bed is given.
    """
    settings, box = layout.settings, layout.box
    flat = settings.deviation / 4
    # flattening and fitting again share what the outline's fit left of the tolerance
    ring = cut_ring(layout.outline.closed.flattened(flat / 2), settings.kerf, settings.clearance)
    curve = _closed_fit(ring, flat) if fine else Curve.polyline(ring, closed=True)
    line = curve.flattened(flat / 4)
    gap = max(settings.spacing, LEAST_GAP)
    arrangements = dense_arrangements(layout.tile, line, gap)
    edge = max(gap, LEAST_EDGE) / 2
    placed = on_sheet(arrangements, line, box.width - 2 * edge, box.height - 2 * edge)
    placed = replace(placed, offsets=placed.offsets + edge)
    if not len(placed):
        _refuse_sheet(line, box)
    return [
        _scene(layout, part, curve, line, box, gap) for part in _shared_out(placed, layout, box)
    ]


def _shared_out(placed: Placed, layout: Layout, box: Box) -> list[Placed]:
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
    return [placed.first(min(fit, wanted - k * fit)) for k in range(sheets)]


def _scene(
    layout: Layout, placed: Placed, curve: Curve, line: Array, box: Box, gap: float
) -> Scene:
    _require_clear(placed.rings(line), box, gap)
    cuts = tuple(
        curve.moved(linear, offset)
        for linear, offset in zip(placed.linear, placed.offsets, strict=True)
    )
    return Scene(
        *layout.settings.page,
        (Layer("cut", "cut", line_style(layout), cuts),),
        window=box,
        prototile=layout.tile.polygon,
        tiles=tuple(
            PlacedTile(int(aspect), linear, offset)
            for aspect, linear, offset in zip(
                placed.aspects, placed.linear, placed.offsets, strict=True
            )
        ),
    )


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
    if (first != second).any() or (low < 0).any() or (high > (box.width, box.height)).any():
        raise RuntimeError("the nesting broke its promise: pieces too close or off the sheet")


def _refuse_sheet(line: Array, box: Box) -> None:
    short, long = rectangle_sides(line)
    raise OrbiflowError(
        f"the page of {box.width:g} x {box.height:g} mm does not hold a single piece, which takes "
        f"{long:.1f} x {short:.1f} mm; choose a larger area or bed, or a smaller tile size"
    )
