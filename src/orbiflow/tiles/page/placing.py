"""Where a tile lies on a page: in the same place for what is cut, printed and painted."""

from __future__ import annotations

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.tiles.page.scene import Box
from orbiflow.tiles.page.settings import MARKS_EDGE, USUAL_WIDTH, usual_tolerance
from orbiflow.tiles.tilings import Tiling, copies_inside

# Places along each side of a lattice cell that are tried for a page with most whole tiles
SHIFTS = 10
# Number of tiles on a page beyond which a few more are not worth looking for
MOST_TILES_TO_SHIFT = 1000


def edge_margin(tile_size: float) -> float:
    """Return the distance in mm that whole tiles of a size keep from the page's edge."""
    return usual_tolerance(tile_size) + USUAL_WIDTH / 2


def inset(box: Box, margin: float) -> Box:
    """Return a box that is smaller by a margin on each side."""
    return Box(box.left + margin, box.top + margin, box.right - margin, box.bottom - margin)


MARK = 20.0  # length in mm of registration marks, around which nothing else may lie


def mark_corners(page: tuple[float, float]) -> list[Box]:
    """Return the boxes of registration marks: in the corners of a page but the lower right one."""
    left = top = MARKS_EDGE
    right, bottom = page[0] - MARKS_EDGE, page[1] - MARKS_EDGE
    return [
        Box(left, top, left + MARK, top + MARK),
        Box(right - MARK, top, right, top + MARK),
        Box(left, bottom - MARK, left + MARK, bottom),
    ]


def shift_to_most_whole(tiling: Tiling, box: Box) -> Array:
    """Return the shift after which most tiles are whole in a box; none if it is best."""
    if box.width * box.height > MOST_TILES_TO_SHIFT * tiling.tile_area:
        return np.zeros(2)
    best, shift = len(copies_inside(tiling, box)), np.zeros(2)
    shares = np.arange(SHIFTS) / SHIFTS
    grid = np.stack(np.meshgrid(shares, shares), axis=-1).reshape(-1, 2)
    for step in grid @ tiling.group.lattice.T:
        moved = (box.left - step[0], box.top - step[1], box.right - step[0], box.bottom - step[1])
        count = len(copies_inside(tiling, moved))
        if count > best:
            best, shift = count, step
    return shift


def longer_side(ring: Array) -> float:
    """Return the longer side of the smallest rectangle, however turned, around a ring."""
    return rectangle_sides(ring)[1]


def rectangle_sides(ring: Array) -> tuple[float, float]:
    """Return the sides of the smallest rectangle by area around a ring, the shorter first.

    Of the same area, as around a regular hexagon, the shortest: rounding does not choose.

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
