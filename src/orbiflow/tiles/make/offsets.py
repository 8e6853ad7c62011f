"""Lines beside a piece's outline: where a tool runs, with its kerf, clearance and offset."""

from __future__ import annotations

import math
from operator import itemgetter

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.likeness import narrowest_neck, narrowest_slit
from orbiflow.tiles.page import Curve, fitted, turning

LEAST_GAP = 0.01  # the least distance in mm between cuts: pieces never touch
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
    distance = (kerf - clearance) / 2
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


def closed_fit(ring: Array, tolerance: float) -> Curve:
    """Fit a smooth curve to a closed polygon; take the polygon where the curve would cross itself."""
    closed = np.concatenate([ring[-1:], ring, ring[:1]])
    first = int(np.argmax(np.abs(turning(closed))))  # a corner, where there is one
    turned = np.roll(ring, -first, axis=0)
    curve = fitted(np.concatenate([turned, turned[:1]]), tolerance)
    curve = Curve(curve.pieces, curve.straight, closed=True)
    if shapely.Polygon(curve.flattened(tolerance / 4)).is_valid:
        return curve
    return Curve.polyline(ring, closed=True)


def place_on(ring: Array, place: Array) -> str:
    """Return in words where on a piece a point (2,) is.

    >>> ring = np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 14.0], [10.0, 14.0]])
    >>> place_on(ring, narrowest_neck(ring).place).split(" from ")[1]
    'its left and 2.0 mm'
    """
    x, y = place - ring.min(axis=0)
    return f"{x:.1f} mm from its left and {y:.1f} mm from its top"
