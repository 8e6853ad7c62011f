"""Separate pieces to cut, nested on sheets."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.exporting.curves import Curve
from orbiflow.tiles.exporting.layouts import Layout, rectangle_sides
from orbiflow.tiles.exporting.nesting import (
    Placed,
    dense_arrangements,
    on_sheet,
)
from orbiflow.tiles.exporting.outlines import fitted, turning
from orbiflow.tiles.exporting.scene import (
    Box,
    Layer,
    PlacedTile,
    Scene,
)
from orbiflow.tiles.exporting.tiling_scenes import line_style
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.likeness import (
    Thinnest,
    narrowest_neck,
    narrowest_slit,
)

MITRE = 4.0
"""How far a sharp corner of a cut reaches at most, in offsets."""


def cut_ring(ring: Array, kerf: float, clearance: float) -> Array:
    """(M, 2) the line that the middle of the beam follows, for pieces that are to have this outline.

    The piece that is left is `ring`, less half the clearance all around.

    Args:
        ring: (N, 2) simple, in mm.
        kerf: width of what is burned away, in mm.
        clearance: gap between two pieces put together, in mm.

    Raises:
        OrbiflowError: where a neck is no wider than kerf or clearance, or a slit so narrow that the
            beam closes it; the message says where on the piece.

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
    return _moved(ring, (kerf - clearance) / 2)


def _moved(ring: Array, distance: float) -> Array:
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
    """Where on a piece that is, in words.

    >>> ring = np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 14.0], [10.0, 14.0]])
    >>> place_on(ring, narrowest_neck(ring)).split(" from ")[1]
    'its left and 2.0 mm'
    """
    x, y = found.place - ring.min(axis=0)
    return f"{x:.1f} mm from its left and {y:.1f} mm from its top"


LEAST_GAP = 0.01
"""Between cuts, in mm: pieces never touch."""

LEAST_EDGE = 0.1
"""Twice the distance of cuts from the sheet's edge at least, in mm."""


def pieces_scenes(layout: Layout, *, fine: bool = True) -> list[Scene]:
    """One scene a sheet; a single sheet unless there is a bed and it does not hold all copies.

    Args:
        fine: smooth curves, or polygons.

    Raises:
        OrbiflowError: for a kerf or clearance that the piece is too thin for, a sheet smaller than a
            piece, and more copies than the page holds where there is no bed.
    """
    settings, box = layout.settings, layout.box
    flat = settings.deviation / 4
    # flattening and fitting anew share what the outline's fit left of the tolerance
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
    """Smooth pieces along a closed polygon; the polygon itself where they would cross."""
    closed = np.concatenate([ring[-1:], ring, ring[:1]])
    first = int(np.argmax(np.abs(turning(closed))))  # a corner, where there is one
    turned = np.roll(ring, -first, axis=0)
    curve = fitted(np.concatenate([turned, turned[:1]]), tolerance)
    curve = Curve(curve.pieces, curve.straight, closed=True)
    if shapely.Polygon(curve.flattened(tolerance / 4)).is_valid:
        return curve
    return Curve.polyline(ring, closed=True)


def _require_clear(rings: Array, box: Box, gap: float) -> None:
    """Nothing, for pieces that keep their distance and lie on the sheet: the arrangement's promise."""
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
