"""A tile's outline in smooth curves: one fit an edge class, its partner's the exact image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from orbiflow.errors import OrbiflowError
from orbiflow.export.curve_fit import fitted
from orbiflow.export.curves import Curve
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import EdgeIdentification, Edges, Tile, edges

_SHARES = (0.6, 0.15, 0.04)  # of the tolerance; the finer ones where a curve would cross another


@dataclass(frozen=True, eq=False)
class Outline:
    """The curves of a tile.

    - `tile`: whose they are.
    - `edges`: how it falls into edges; None where that is not known (`note` says why).
    - `curves`: one an edge, end to end; or a single closed one.
    - `note`: what is to be said about it, or "".
    """

    tile: Tile
    edges: Edges | None
    curves: tuple[Curve, ...]
    note: str = ""

    @property
    def closed(self) -> Curve:
        """All of it."""
        return Curve.joined(self.curves, closed=True)


def outline(tile: Tile, tolerance: float) -> Outline:
    """Smooth curves along the tile's polygon that tile the plane as exactly as it does.

    Each pair of identified edges is fitted once and the partner is its image; an edge with a 2-fold
    centre is fitted up to the centre. Where curves would touch each other within the tolerance they
    are fitted more closely, at worst along the polygon itself.

    Args:
        tolerance: from the polygon, in the tile's units.
    """
    try:
        own = edges(tile)
    except OrbiflowError as error:
        plain = Curve.polyline(tile.polygon, closed=True)
        return Outline(tile, None, (plain,), f"the outline is left as it is: {error}")
    for share in _SHARES:
        curves = _curves(own, share * tolerance)
        ring = Curve.joined(curves, closed=True).flattened(tolerance / 20)
        if shapely.Polygon(ring).is_valid:
            return Outline(tile, own, curves)
    plain_edges = [Curve.polyline(own.points(k)) for k in range(len(own.starts))]
    return Outline(tile, own, tuple(plain_edges))


def _curves(own: Edges, tolerance: float) -> tuple[Curve, ...]:
    found: dict[int, Curve] = {}
    for pair in own.identifications:
        points = own.points(pair.first)
        if pair.folded:
            found[pair.first] = _folded(points, pair, tolerance)
            continue
        curve = fitted(points, tolerance)
        found[pair.first] = curve
        image = curve.moved(pair.isometry.linear, pair.isometry.translation)
        found[pair.second] = image.reversed() if pair.reversed else image
    return tuple(found[k] for k in range(len(own.starts)))


def _folded(points: Array, pair: EdgeIdentification, tolerance: float) -> Curve:
    if not pair.reversed:  # on a mirror: straight
        return Curve.polyline(points)
    middle, odd = divmod(len(points) - 1, 2)
    half = points[: middle + 1]
    if odd:  # the centre lies on a side
        half = np.concatenate([half, points[middle : middle + 2].mean(axis=0)[None]])
    curve = fitted(half, tolerance)
    image = curve.moved(pair.isometry.linear, pair.isometry.translation).reversed()
    return Curve.joined([curve, image])
