"""A tile's outline in smooth curves: one fit an edge class, its partner's the exact image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from orbiflow.errors import OrbiflowError
from orbiflow.export.curve_fit import fitted
from orbiflow.export.curves import Curve
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import EdgeImage, Edges, Tile, edge_classes, edges

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

    One of each class of identified edges is fitted and the others are its images; an edge that is its
    own image, by a half-turn or a mirror across it, is fitted up to the middle. Where curves would
    touch each other within the tolerance they are fitted more closely, at worst along the polygon
    itself.

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
    for kind in edge_classes(own):
        points = own.points(kind.edge)
        if kind.straight:
            curve = Curve.polyline(points)
        elif kind.folds:
            curve = _folded(points, kind.folds[0], tolerance)
        else:
            curve = fitted(points, tolerance)
        found[kind.edge] = curve
        for image in kind.images:
            moved = curve.moved(image.isometry.linear, image.isometry.translation)
            found[image.edge] = moved.reversed() if image.reversed else moved
    return tuple(found[k] for k in range(len(own)))


def _folded(points: Array, fold: EdgeImage, tolerance: float) -> Curve:
    """An edge that is its own image, turned or mirrored: half of it, and the half's image."""
    middle, odd = divmod(len(points) - 1, 2)
    half = points[: middle + 1]
    if odd:  # the centre lies on a side
        half = np.concatenate([half, points[middle : middle + 2].mean(axis=0)[None]])
    curve = fitted(half, tolerance)
    image = curve.moved(fold.isometry.linear, fold.isometry.translation).reversed()
    return Curve.joined([curve, image])
