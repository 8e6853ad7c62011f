"""A tile laid another way: the nearest tile of another isohedral class, with what lies on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.studio.pulled_tiles import COMPARED_POINTS, moved_figure
from orbiflow.tiles import (
    ClassFailure,
    EscherTile,
    LikenessSearch,
    Target,
    arc_lengths,
    escherize_class,
    isohedral_class,
    points_along,
    signed_area,
)

LAID = "its copies were laid another way by hand"
SAME_POINT_SHARE = 1e-7  # of an outline's length: vertices of two outlines this near are one
SEARCHED = 0.8  # the share of the work that the search is


def in_class(tile: EscherTile, name: str, report: Callable[[float], None]) -> EscherTile:
    """Return the certified tile of another class whose outline is most like this one's.

    The outline is searched for as a silhouette is; then the maps are carried on to what was found.
    `report` hears the share of the work; it may raise to end it.

    Raises:
        OrbiflowError: For two figures in one tile, or an unknown class.
        CertificationError: If the class has no tile that is like this one, in plain words.
    """
    if len(tile.figures) > 1:
        raise OrbiflowError("two figures lie as they were found; search for other pairs")
    kind, ring = isohedral_class(name), tile.tile.polygon
    likest = escherize_class(
        Target.from_polygon(ring),
        kind,
        LikenessSearch.for_effort("fast"),
        progress=lambda share, _: report(SEARCHED * share),
    )
    if isinstance(likest, ClassFailure):
        raise CertificationError(f"no tile that lies so is like this one: {likest.reason}")
    bending, frame = likest.bending, likest.frame
    assert bending is not None  # a search for likeness bends
    assert frame is not None
    rest = frame.to_input(bending.inverse(frame.to_normal(likest.tile.polygon)))
    before, after = _side_by_side(ring, likest.tile.polygon, rest)
    return moved_figure(
        tile,
        likest.tile,
        lambda share: before + share * (after - before),
        COMPARED_POINTS,
        lambda share: report(SEARCHED + (1 - SEARCHED) * share),
        note=LAID,
    )


def _side_by_side(old: Array, new: Array, rest: Array) -> tuple[Array, Array]:
    """Return two outlines point by point, with all vertices of both.

    `rest` are the places of the new one's vertices near the old one.
    """
    if signed_area(old) * signed_area(new) < 0:
        old = old[::-1]
    lengths = arc_lengths(old)
    places = shapely.line_locate_point(shapely.LinearRing(old), shapely.points(rest))
    first = int(np.argmin(places))
    new, places = np.roll(new, -first, axis=0), np.maximum.accumulate(np.roll(places, -first))
    goals = arc_lengths(new)
    corners = np.append(places, places[0] + lengths[-1])
    apart = abs(lengths[:-1, None] - corners).min(axis=1) > SAME_POINT_SHARE * lengths[-1]
    both = np.unique(np.concatenate([places, lengths[:-1][apart]]))
    turns = np.where(both < places[0], lengths[-1], 0.0)
    return points_along(old, both), points_along(new, np.interp(both + turns, corners, goals))
