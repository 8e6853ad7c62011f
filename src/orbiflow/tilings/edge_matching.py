"""How the boundary of a prototile meets the boundaries of the tiles around it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import KDTree

from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.aspects import Integers
from orbiflow.tilings.images import Surroundings
from orbiflow.tilings.tiling import Tiling


class SegmentMatch(NamedTuple):
    """Nearest reversed segment, of the tiles around, of each segment of a prototile.

    - `distance`: (N,) distance in R^4 of (a, b) to the nearest (b', a').
    - `tile`: (N,) whose segment that is, as an index of the surroundings; -1 where there is none.
    - `partner`: (N,) which segment of that tile's prototile it is.
    """

    distance: Array
    tile: Integers
    partner: Integers


def match_segments(around: Surroundings, tolerance: float) -> SegmentMatch:
    """For each segment (a, b) of a prototile the nearest segment that runs from b to a.

    All prototiles run the same way around, and so do their images: those of elements that reverse
    orientation are read backwards.
    """
    ring = around.ring
    count = len(ring)
    plain = ~around.mirrored[around.owner, None]
    starts, ends = around.points, around.ahead
    reverse = np.concatenate([np.where(plain, ends, starts), np.where(plain, starts, ends)], axis=1)
    low, high = ring.min(axis=0) - tolerance, ring.max(axis=0) + tolerance
    inside = np.flatnonzero(
        ((reverse >= np.tile(low, 2)) & (reverse <= np.tile(high, 2))).all(axis=1)
    )
    if not len(inside):
        nowhere = np.full(count, -1)
        return SegmentMatch(np.full(count, np.inf), nowhere, nowhere)
    segments = np.concatenate([ring, np.roll(ring, -1, axis=0)], axis=1)
    distance, index = KDTree(reverse[inside]).query(segments)
    found = inside[index]
    return SegmentMatch(np.asarray(distance), around.owner[found], around.place[found])


def boundaries_cancel(
    tiling: Tiling, around: Sequence[Surroundings], matches: Sequence[SegmentMatch]
) -> bool:
    """Whether the matched segments of all prototiles, with their signs, add up to nothing.

    Args:
        around, matches: of each prototile.

    The boundary of all tiles together is, per orbit of the group, the sum of [e] / |S_k| over the
    segments e of each T_k. If e is the reverse of an image of its partner, it is also minus the sum
    of [partner of e] / |S_k|. The two agree if every segment, modulo the stabiliser of its prototile,
    is a partner as often as it occurs, counted so; then the sum is its own negative. With one
    prototile and no stabiliser: if the partners are a permutation.
    """
    sizes = np.array([len(a.ring) for a in around])
    first: Integers = np.cumsum(sizes) - sizes
    weights = np.repeat([1.0 / own.order for own in tiling.stabilisers], sizes)
    partners = np.concatenate(
        [
            first[a.copies.prototiles[match.tile]] + match.partner
            for a, match in zip(around, matches, strict=True)
        ]
    )
    labels = _orbits(tiling, first)
    if labels is None:
        return False
    own = np.bincount(labels, weights, minlength=len(labels))
    named = np.bincount(labels[partners], weights, minlength=len(labels))
    return bool(np.abs(own - named).max() < 1e-9)


def _orbits(tiling: Tiling, first: Integers) -> Integers | None:
    """The first segment that each is an image of under its prototile's stabiliser.

    None where vertices are not taken to vertices.
    """
    labels: list[Integers] = []
    for start, own in zip(first, tiling.stabilisers, strict=True):
        images: list[Integers] = []
        for element, order in zip(own.elements, own.orders, strict=True):
            if order is None:
                return None
            # segment i from vertex i on; read backwards its image begins where its end is taken
            images.append(order if element.determinant > 0 else np.roll(order, -1))
        labels.append(start + np.min(images, axis=0))
    return np.concatenate(labels)


def curve_distance(around: Surroundings) -> float:
    """Largest distance of a vertex of the prototile to the boundaries of the tiles around it.

    With the tiles' vertices seen from the prototile being its vertices seen from them, over all
    prototiles this is the Hausdorff distance between a boundary and the union of the others near it.
    """
    if not len(around):
        return float("inf")
    tree = segment_tree(around)
    _, distance = tree.query_nearest(
        shapely.points(around.ring), all_matches=False, return_distance=True
    )
    return float(distance.max())


def segment_tree(around: Surroundings) -> shapely.STRtree:
    """Tree of the segments of all tiles around; segment p begins at the p-th of their points."""
    ends = np.stack([around.points, around.ahead], axis=1)
    return shapely.STRtree(np.asarray(shapely.linestrings(ends)))
