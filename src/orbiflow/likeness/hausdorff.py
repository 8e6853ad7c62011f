"""Hausdorff distance between two sets of segments, by branch and bound.

The distance to a curve is not convex along a segment, so its maximum may lie inside one. A segment
is bounded from above in two ways: the distance is 1-Lipschitz, and the distance to any one edge of
the other curve is convex. Halving the segments whose bound is still above the best value found
closes the gap.
"""

import numpy as np
import shapely
from numpy.typing import NDArray

# Of the diagonal of the box around both curves.
TOLERANCE = 1e-6


def hausdorff_distance(
    a: NDArray[np.float64], b: NDArray[np.float64], *, tolerance: float
) -> float:
    """Hausdorff distance between the unions of the segments `a` and `b`, each (M, 2, 2).

    Too small by at most `tolerance` (in the unit of the coordinates), never too large.
    """
    forth = _directed(a, b, tolerance)
    return max(forth, _directed(b, a, tolerance, at_least=forth))


def _directed(
    a: NDArray[np.float64], b: NDArray[np.float64], tolerance: float, at_least: float = 0.0
) -> float:
    """Greatest distance from a point of `a` to the nearest point of `b`."""
    tree = shapely.STRtree(list(np.asarray(shapely.linestrings(b), dtype=object)))
    start, end = a[:, 0], a[:, 1]
    best = at_least
    (d0, e0), (d1, e1) = _nearest(tree, start), _nearest(tree, end)
    while len(start):
        best = max(best, float(d0.max()), float(d1.max()))
        length = np.hypot(*(end - start).T)
        via0 = np.maximum(d0, _distance(end, b[e0]))
        via1 = np.maximum(d1, _distance(start, b[e1]))
        bound = np.minimum(np.minimum(via0, via1), (d0 + d1 + length) / 2)
        go = bound > best + tolerance
        start, end, d0, d1, e0, e1 = (item[go] for item in (start, end, d0, d1, e0, e1))
        middle = (start + end) / 2
        dm, em = _nearest(tree, middle)
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
        d0, d1 = np.concatenate([d0, dm]), np.concatenate([dm, d1])
        e0, e1 = np.concatenate([e0, em]), np.concatenate([em, e1])
    return best


def _nearest(
    tree: shapely.STRtree, points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distance to, and index of, the edge of `tree` nearest to each of `points` (P, 2)."""
    pairs, distance = tree.query_nearest(
        shapely.points(points), return_distance=True, all_matches=False
    )
    return distance, pairs[1]


def _distance(points: NDArray[np.float64], edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of each of `points` (P, 2) to the edge (P, 2, 2) of the same index."""
    origin, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    length2 = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    t = np.clip(((points - origin) * along).sum(axis=1) / length2, 0.0, 1.0)
    return np.hypot(*(points - origin - t[:, None] * along).T)
