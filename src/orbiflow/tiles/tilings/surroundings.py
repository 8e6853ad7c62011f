"""The tiles around a prototile: how they match its boundary, which touch it, how they lie in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_whole
from orbiflow.symmetry import Isometry, symmetry_elements
from orbiflow.tiles.geometry import checked_window
from orbiflow.tiles.tilings.tile_copies import (
    Copies,
    Placed,
    copies_meeting,
    copies_near,
    expected_near,
    prototile_of,
)
from orbiflow.tiles.tilings.tiling import Tiles, Tiling, as_tiling

MAX_AROUND = 40_000  # the most tiles whose boxes meet that of a tile, for these to be listed


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A prototile and the tiles nearby, moved and scaled so that the expected area is one."""

    ring: Array  # the prototile (N, 2) without repeated vertices, centred at zero
    copies: Copies  # the M other tiles nearby, in the tiling's own coordinates
    points: Array  # their vertices (P, 2), tile by tile, in the order of their prototile
    counts: Integers  # the number of vertices of each tile, (M,)
    mirrored: NDArray[np.bool_]  # whether each tile's element reverses orientation, (M,)

    def __len__(self) -> int:
        return len(self.copies)

    @cached_property
    def owner(self) -> Integers:
        """The tile (P,) that each point is a vertex of."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def place(self) -> Integers:
        """The vertex (P,) of its prototile that each point is."""
        first = np.cumsum(self.counts) - self.counts
        return np.arange(len(self.points)) - np.repeat(first, self.counts)

    @cached_property
    def ahead(self) -> Array:
        """The next vertex (P, 2) of the same tile."""
        following = np.arange(1, len(self.points) + 1)
        last = np.cumsum(self.counts) - 1
        following[last] = last + 1 - self.counts
        return self.points[following]

    @cached_property
    def rings(self) -> Any:
        """The tiles' boundaries (M,) as shapely rings."""
        return np.asarray(shapely.linearrings(self.points, indices=self.owner))

    def select(self, keep: NDArray[np.bool_]) -> Surroundings:
        """Return the tiles where `keep`, (M,), is true."""
        return replace(
            self,
            copies=self.copies.select(keep),
            points=self.points[keep[self.owner]],
            counts=self.counts[keep],
            mirrored=self.mirrored[keep],
        )


def surroundings(tiling: Tiling, prototile: int, margin: float) -> Surroundings:
    """Return the tiles whose box is within `margin`, in tile sizes, of a prototile's, nearest first."""
    scale = math.sqrt(tiling.tile_area)
    tile = tiling.prototiles[prototile]
    count = expected_near(tiling, *(tile.box[1] - tile.box[0] + 2 * margin * scale))
    if count > MAX_AROUND:
        raise OrbiflowError(
            f"the tile's radius is {tile.radius / scale:.0f} times the size that its group allows for, "
            f"and about {count:.0f} tiles would lie around it: check that polygon and group belong "
            "together and have the same units"
        )
    if any(len(p.ring) < 3 for p in tiling.prototiles):
        raise OrbiflowError("the tile's polygon has fewer than three distinct vertices")
    (left, bottom), (right, top) = tile.box + margin * scale * np.array([[-1.0], [1.0]])
    near = copies_near(tiling, (left, bottom, right, top), whole=False)
    itself = (near.aspects == tiling.aspects.table[prototile, 0]) & ~near.cells.any(axis=1)
    away = np.linalg.norm(near.centers() - tile.center, axis=1)
    away[itself] = np.inf
    order = np.argsort(away, kind="stable")[: len(near) - int(itself.sum())]
    near = near.select(order)
    rings = near.rings([p.ring for p in tiling.prototiles])
    counts = np.array([len(ring) for ring in rings], dtype=np.int64)
    points = np.concatenate([*rings, np.empty((0, 2))])
    local = ((part - tile.center) / scale for part in (tile.ring, points))
    # squares of coordinates such as 1e-200 underflow in GEOS and give areas that are plainly wrong
    ring, points = (np.where(np.abs(part) < 1e-15, 0.0, part) for part in local)
    mirrored = (np.linalg.det(tiling.group.linear_parts) < 0)[near.cosets]
    return Surroundings(ring, near, points, counts, mirrored)


class SegmentMatch(NamedTuple):
    """The nearest reversed segment, in the tiles around, of each segment of a prototile."""

    distance: Array  # the distance (N,) in R^4 of (a, b) to the nearest (b', a')
    tile: Integers  # the index (N,) of its tile in the surroundings, -1 where there is none
    partner: Integers  # the index (N,) of the segment in that tile's prototile


def match_segments(around: Surroundings, tolerance: float) -> SegmentMatch:
    """Return, for each segment (a, b) of a prototile, the nearest segment from b to a.

    All prototiles run the same way around, and so do their images: those of elements that reverse
    orientation are read backwards.
    """
    ring = around.ring
    count = len(ring)
    plain = ~around.mirrored[around.owner, None]
    starts, ends = around.points, around.ahead
    reverse = np.concatenate([np.where(plain, ends, starts), np.where(plain, starts, ends)], axis=1)
    low, high = np.tile([ring.min(axis=0) - tolerance, ring.max(axis=0) + tolerance], 2)
    inside = np.flatnonzero(((reverse >= low) & (reverse <= high)).all(axis=1))
    if not len(inside):
        nowhere = np.full(count, -1)
        return SegmentMatch(np.full(count, np.inf), nowhere, nowhere)
    segments = np.concatenate([ring, np.roll(ring, -1, axis=0)], axis=1)
    distance, index = KDTree(reverse[inside]).query(segments)
    nearest = inside[index]
    return SegmentMatch(np.asarray(distance), around.owner[nearest], around.place[nearest])


def boundaries_cancel(
    tiling: Tiling, around: Sequence[Surroundings], matches: Sequence[SegmentMatch]
) -> bool:
    """Return whether the matched segments of all prototiles, with their signs, add up to zero.

    The boundary of all tiles together is, per orbit of the group, the sum of [e] / |S_k| over the
    segments e of each T_k. If e is the reverse of an image of its partner, it is also minus the sum
    of [partner of e] / |S_k|. The two agree if every segment, modulo the stabiliser of its
    prototile, is a partner as often as it occurs, counted so; then the sum is its own negative.
    With one prototile and no stabiliser: if the partners are a permutation.
    """
    sizes = np.array([len(a.ring) for a in around])
    first: Integers = np.cumsum(sizes) - sizes
    weights = np.repeat([1.0 / stabiliser.order for stabiliser in tiling.stabilisers], sizes)
    pairs = zip(around, matches, strict=True)
    partners = np.concatenate([first[a.copies.prototiles[m.tile]] + m.partner for a, m in pairs])
    labels = _orbits(tiling, first)
    if labels is None:
        return False
    totals = np.bincount(labels, weights, minlength=len(labels))
    named = np.bincount(labels[partners], weights, minlength=len(labels))
    return bool(np.abs(totals - named).max() < 1e-9)


def _orbits(tiling: Tiling, first: Integers) -> Integers | None:
    """Return the first segment that has each as an image in its tile; None if vertices have none."""
    labels: list[Integers] = []
    for start, stabiliser in zip(first, tiling.stabilisers, strict=True):
        images: list[Integers] = []
        for element, order in zip(stabiliser.elements, stabiliser.orders, strict=True):
            if order is None:
                return None
            # segment i from vertex i on; read backwards its image begins where its end is taken
            images.append(order if element.determinant > 0 else np.roll(order, -1))
        labels.append(start + np.min(images, axis=0))
    return np.concatenate(labels)


def curve_distance(around: Surroundings) -> float:
    """Return the largest distance of a prototile's vertex to the boundaries of the tiles around.

    With the tiles' vertices seen from the prototile being its vertices seen from them, over all
    prototiles this is the Hausdorff distance between a boundary and the union of the others near
    it.
    """
    if not len(around):
        return float("inf")
    points = shapely.points(around.ring)
    _, distance = segment_tree(around).query_nearest(
        points, all_matches=False, return_distance=True
    )
    return float(distance.max())


def segment_tree(around: Surroundings) -> shapely.STRtree:
    """Return a tree of the segments of all tiles around; segment p begins at their p-th point."""
    ends = np.stack([around.points, around.ahead], axis=1)
    return shapely.STRtree(np.asarray(shapely.linestrings(ends)))


_TOUCHING = 1e-7
"""The distance that counts as touching, and the length above which boundary is shared.

In square roots of the tile's area: a hundred times what a certificate allows edges to be apart.
"""


class Neighbours(NamedTuple):
    """The other tiles that touch a prototile, as group elements, nearest first.

    Args:
        edge: The tiles that share boundary, longer than 1e-7 of the side of a square of a tile's area.
        point: The other tiles that touch.
    """

    edge: tuple[Placed, ...]
    point: tuple[Placed, ...]


def neighbours(tile: Tiles, prototile: int = 0) -> Neighbours:
    """Return the tiles that touch a prototile.

    Args:
        tile: A tile or a tiling, which need not be certified.
        prototile: The number of the prototile; each neighbour names the prototile that it is a copy of.

    Raises `OrbiflowError` if polygon and group are of very different size.

    >>> from orbiflow.tiles import Tile, isohedral_class
    >>> floret = isohedral_class("IH21")
    >>> found = neighbours(Tile(floret.template(), floret.group()))
    >>> len(found.edge), len(found.point)
    (5, 3)
    """
    tiling = as_tiling(tile)
    prototile = as_whole(prototile, "the prototile", 0, len(tiling.prototiles) - 1)
    around = surroundings(tiling, prototile, _TOUCHING)
    near, shares = touching(around, _TOUCHING)
    return Neighbours(*(near.copies.select(kind).elements() for kind in (shares, ~shares)))


def touching(around: Surroundings, tolerance: float) -> tuple[Surroundings, NDArray[np.bool_]]:
    """Return the tiles that touch the prototile, and which of them share boundary with it."""
    if not len(around):
        return around, np.zeros(0, dtype=bool)
    outline = shapely.linearrings(around.ring)
    shapely.prepare(outline)
    near = around.select(np.asarray(shapely.dwithin(outline, around.rings, tolerance)))
    return near, _shared_lengths(near, tolerance) > tolerance


def _shared_lengths(around: Surroundings, tolerance: float) -> Array:
    """Return the length (M,) of boundary that each tile shares with the prototile.

    Two sides share where each lies beside the other, if they are within `tolerance` of each other
    along all of that: sides that only meet at an angle share nothing.
    """
    if not len(around):
        return np.zeros(0)
    ring, ahead = around.ring, np.roll(around.ring, -1, axis=0)
    low, high = np.minimum(ring, ahead) - tolerance, np.maximum(ring, ahead) + tolerance
    boxes = cast(NDArray[np.object_], shapely.box(*low.T, *high.T))
    side, other = segment_tree(around).query(boxes)
    lengths = np.linalg.norm(ahead - ring, axis=1)
    along = ((ahead - ring) / lengths[:, None])[side]
    ends = np.stack([around.points[other], around.ahead[other]], axis=1) - ring[side, None]
    place = np.einsum("pei,pi->pe", ends, along)
    height = ends[..., 1] * along[:, None, 0] - ends[..., 0] * along[:, None, 1]
    # from where to where along the prototile's side the other lies, and how far it is there
    part = np.sort(np.clip(place, 0.0, lengths[side, None]), axis=1)
    run = place[:, 1] - place[:, 0]
    slope = np.divide(height[:, 1] - height[:, 0], run, out=np.zeros(len(run)), where=run != 0)
    apart = np.abs(height[:, :1] + slope[:, None] * (part - place[:, :1])).max(axis=1)
    shared = np.where(apart <= tolerance, part[:, 1] - part[:, 0], 0.0)
    return np.bincount(around.owner[other], shared, minlength=len(around))


def patch(tile: Tiles, window: Sequence[float]) -> list[Placed]:
    """Return `copies_meeting` as elements of the group, nearest the window's middle first.

    >>> from orbiflow.tiles import Tile, isohedral_class
    >>> ih1 = isohedral_class("IH1")
    >>> len(patch(Tile(ih1.template(), ih1.group()), (-0.1, -0.1, 0.1, 0.1)))
    1
    """
    copies = copies_meeting(tile, window)
    xmin, ymin, xmax, ymax = checked_window(window)
    middle = np.array([xmin + xmax, ymin + ymax]) / 2
    away = np.linalg.norm(copies.centers() - middle, axis=1)
    return list(copies.select(np.argsort(away, kind="stable")).elements())


def aspects(tile: Tiles, elements: Sequence[Isometry]) -> list[int]:
    """Return the aspect of each element's tile: tiles of one aspect are translates.

    A plain isometry moves prototile 0. Raises `OrbiflowError` for one that is not in the tile's group.
    """
    tiling = as_tiling(tile)
    find, group = tiling.aspects.find, tiling.group
    return [find(group, element, prototile_of(element))[0] for element in elements]


_NUMBERS = {3: "three", 4: "four", 6: "six", 8: "eight", 12: "twelve"}
_ROUNDING = 1e-6


def arrangement(tile: Tiles) -> str:
    """Return how the tiles of a tiling lie, in plain words, from its group and from who meets whom.

    The words are about copies of the first prototile.

    >>> from orbiflow.tiles import CLASSES, Tile
    >>> arrangement(Tile(CLASSES["IH21"].template(), CLASSES["IH21"].group()))
    'six around a point'
    """
    tiling = as_tiling(tile)
    shapes = len(tiling.prototiles)
    return (f"{shapes} shapes, " if shapes > 1 else "") + _words(tiling)


def _words(tiling: Tiling) -> str:
    symmetries, cosets = tiling.stabilisers[0].elements, tiling.group.cosets
    flips = any(g.determinant < 0 for g in cosets) and all(s.determinant > 0 for s in symmetries)
    turns = sum(g.determinant > 0 for g in cosets) // sum(s.determinant > 0 for s in symmetries)
    if turns > 2:
        return _around(tiling) + (", with their mirror images" if flips else "")
    half = ", half of them mirrored" if flips else ""
    if turns == 2 and any(np.allclose(s.linear, -np.eye(2)) for s in symmetries):
        return f"every other one turned a quarter{half}"
    near = [g for g in neighbours(tiling).edge if g.prototile == 0]
    rows = [g.translation for g in near if np.allclose(g.linear, np.eye(2))]
    if turns == 2 and not rows:
        return f"every other one upside down{half}"
    if turns == 2:
        return "rows, " + (
            "by turns upside down and mirrored" if flips else "every other row upside down"
        )
    if not flips:
        return "rows, all alike"
    return _flipped_rows(near, rows[0]) if rows else "every other one mirrored"


def _around(tiling: Tiling) -> str:
    """Return how many tiles meet at the centre of a rotation, where these are most."""
    centers = [c.point for c in symmetry_elements(tiling.group).centers if c.order > 2]
    size = _ROUNDING * float(np.sqrt(tiling.tile_area))
    met = [copies_meeting(tiling, (*(p - size), *(p + size))).prototiles for p in centers]
    count = max(int((prototiles == 0).sum()) for prototiles in met)
    return f"{_NUMBERS.get(count, count)} around a point"


def _flipped_rows(near: Sequence[Placed], row: Array) -> str:
    """Return the words for rows along a vector, with every other row mirrored."""
    flipped = [g for g in near if g.determinant < 0]
    image = flipped[0].linear @ row
    size = _ROUNDING * float(np.linalg.norm(row))
    if np.linalg.norm(image + row) < size:
        return "rows, every other row facing the other way"
    mirrored = any(np.linalg.norm((g @ g).translation) < size for g in flipped)
    bricks = np.linalg.norm(image - row) < size and not mirrored
    return f"{'brick ' if bricks else ''}rows, every other row mirrored"
