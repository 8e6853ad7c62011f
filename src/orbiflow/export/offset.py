"""A piece's cut: its outline moved by half of what the tool burns away, and what forbids that."""

from __future__ import annotations

import numpy as np
import shapely

from orbiflow.errors import OrbiflowError
from orbiflow.geometry import polygons_in
from orbiflow.likeness.thinnest import Thinnest, narrowest_neck, narrowest_slit
from orbiflow.symmetry.isometry import Array

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
