"""Warnings about a silhouette before a search: parts left out, holes, threads."""

from __future__ import annotations

import numpy as np
from shapely import Polygon

from orbiflow.errors import Advice
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import (
    MAX_THREAD_WIDTH,
    MIN_PART_SHARE,
    filled,
    is_thread,
    opened,
    percent,
)
from orbiflow.tiles.silhouette.target import Target

MAX_LEFT_OUT_SHARE = 0.02  # of what was seen
# Shares of the silhouette: smaller holes are eyes; larger ones are what the line of a drawing encloses.
MIN_HOLE_SHARE, MAX_HOLE_SHARE = 0.02, 0.3
MIN_CONVEX_SHARE = 0.95  # of its convex hull: what a frame fills
MAX_CUT_OUT_SHARE = 0.7  # of a card: what the line of a drawing encloses is larger
MIN_CARD_COVERAGE = 0.94  # of its box: what a card fills, round corners apart
MIN_CARD_SHARE = 0.85  # of the page's sides: a card's
MAX_INSIDE_SHARE = 0.1  # of the silhouette: more that lies in a hole is a shape of its own
MIN_LENGTH_PIXELS = 40
THIN_PIXELS = 3.0  # pixels
MAX_THIN_SHARE = 0.5  # of the outline's length
LEG_WIDTH_SHARE = 0.035  # of the silhouette's length: what is thinner is easily lost
MAX_LEG_SHARE = 0.45  # of the outline's length: on thinner parts than this the likeness hangs


def parts_left_out(target: Target) -> list[Polygon]:
    """Return the parts of what was seen that are not in the silhouette, but for specks."""
    outline = Polygon(target.outline)
    parts = [] if target.seen is None else polygons_in(target.seen)
    least = MIN_PART_SHARE * target.area
    return [
        part
        for part in parts
        if part.area >= least and not outline.intersects(part.representative_point())
    ]


def left_out_share(target: Target) -> float:
    """Return the share of what was seen that is in parts left out of the silhouette."""
    seen = 0.0 if target.seen is None else float(target.seen.area)
    return sum(part.area for part in parts_left_out(target)) / seen if seen else 0.0


def holes_filled(target: Target) -> list[Polygon]:
    """Return the holes in what was seen that the silhouette fills."""
    outline = Polygon(target.outline)
    parts = [] if target.seen is None else polygons_in(target.seen)
    holes = [Polygon(ring) for part in parts for ring in part.interiors]
    return [hole for hole in holes if outline.intersects(hole.representative_point())]


def doubts(target: Target) -> list[Advice]:
    """Return what may be wrong with a silhouette, each with what to do about it."""
    return [*map(Advice, _lost_parts(target)), *map(Advice, _thin_parts(target))]


def _lost_parts(target: Target) -> list[str]:
    warnings: list[str] = []
    lost, holes, is_image = parts_left_out(target), holes_filled(target), target.kind == "image"
    share = left_out_share(target)
    level = ", or try another {threshold}, or a plain ground of another colour for a photograph"
    if share > MAX_LEFT_OUT_SHARE:
        parts = "a part" if len(lost) == 1 else f"{len(lost)} parts"
        warnings.append(
            f"{percent(share)} of what was seen is left out, in {parts} apart from the rest: join "
            f"them to it in the drawing, or by a larger {{smooth}}{level * is_image}"
        )
    share = sum(hole.area for hole in holes) / target.area
    is_cut_out = _is_card(target, holes)
    if is_cut_out:
        warnings.append(
            f"the silhouette is a card, of whose area a hole takes {percent(share)}: if the hole is "
            "the shape, change {invert}"
        )
    elif MIN_HOLE_SHARE < share < MAX_HOLE_SHARE:
        level = " or try another {threshold} or another {invert}" if is_image else ""
        warnings.append(
            "large holes were filled, because a tile has none: if one is background, open it to the "
            f"outside in the drawing{level}"
        )
    share = _share_inside(target, holes)
    if share > MAX_INSIDE_SHARE:
        warnings.append(
            f"another shape, of {percent(share)} of the silhouette, lies inside the hole that was "
            "filled: if it is the one meant, remove the frame or lines around it"
        )
    elif not is_cut_out and _fills_page(target):
        warnings.append(
            "the silhouette is a rectangle almost as large as the page: if it is the card that the "
            "shape lies on, remove it from the picture"
        )
    return warnings


def _share_inside(target: Target, holes: list[Polygon]) -> float:
    """Return the share of the silhouette, if it may be a frame, of the largest shape in its holes."""
    if target.seen is None or not holes or not _is_convex(Polygon(target.outline)):
        return 0.0
    parts = [filled(part) for part in polygons_in(target.seen)]
    inside = [part for part in parts if any(hole.contains(part) for hole in holes)]
    return max((part.area for part in inside), default=0.0) / target.area


def _is_card(target: Target, holes: list[Polygon]) -> bool:
    """Return whether a silhouette is a plain shape, of which another shape has been cut out."""
    hole = max(holes, key=lambda part: part.area, default=Polygon())
    share = hole.area / target.area
    is_cut_out = MIN_HOLE_SHARE < share < MAX_CUT_OUT_SHARE and not _is_convex(hole)
    return is_cut_out and _is_convex(Polygon(target.outline))


def _fills_page(target: Target) -> bool:
    """Return whether a silhouette is a rectangle that all but fills the picture or the page."""
    sides = np.ptp(target.outline, axis=0)
    if target.size is None or target.kind not in ("image", "svg"):
        return False
    is_large = (sides >= MIN_CARD_SHARE * np.array(target.size)).all()
    return bool(is_large and target.area >= MIN_CARD_COVERAGE * sides.prod())


def _is_convex(shape: Polygon) -> bool:
    """Return whether a shape is all but convex, as cards and frames are."""
    return shape.area >= MIN_CONVEX_SHARE * shape.convex_hull.area


def is_mere_line(target: Target) -> bool:
    """Return whether a silhouette is a mere line, which no tile will look like."""
    return is_thread(Polygon(target.outline), float(np.ptp(target.outline, axis=0).max()))


def _thin_parts(target: Target) -> list[str]:
    """Return why no tile will look like a silhouette."""
    shape, warnings = Polygon(target.outline), list[str]()
    length = float(np.ptp(target.outline, axis=0).max())
    if is_mere_line(target):
        warnings.append(
            f"the silhouette is a line or thread, nowhere wider than {MAX_THREAD_WIDTH:.0%} of its "
            "length: no tile will look like it; let it grow ({thicken}) by 0.1, draw it wider, or "
            "close its outline"
        )
    elif (share := _thin_share(shape, LEG_WIDTH_SHARE * length)) > MAX_LEG_SHARE:
        warnings.append(
            f"legs or other parts thinner than {LEG_WIDTH_SHARE:.1%} of the silhouette's length have "
            f"{share:.0%} of its outline, and tiles may lose them: let them grow ({{thicken}}) by "
            "0.04, or draw them wider"
        )
    if target.kind != "image":
        return warnings
    if length < MIN_LENGTH_PIXELS:
        warnings.append(
            f"the silhouette is only {length:.0f} pixels long, so its outline is of stairs: give a "
            f"larger picture, at least {MIN_LENGTH_PIXELS} pixels and better 400"
        )
    if _thin_share(shape, THIN_PIXELS) > MAX_THIN_SHARE:
        warnings.append(
            f"most of the silhouette is less than {THIN_PIXELS:.0f} pixels wide, which is too thin to "
            "be followed: give a larger picture, or draw it wider"
        )
    return warnings


def _thin_share(shape: Polygon, width: float) -> float:
    """Return about which share of the outline is of parts thinner than a width."""
    return 1 - opened(shape, width).length / shape.length
