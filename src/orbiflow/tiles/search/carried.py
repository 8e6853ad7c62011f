"""From the silhouette to its tile, point by point: what artwork is carried by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, overload

import numpy as np
import shapely
import torch
from numpy.typing import ArrayLike, NDArray

from orbiflow.arguments import numbers
from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import (
    arc_lengths,
    best_similarity,
    complex_points,
)
from orbiflow.tiles.search.bending import Bent
from orbiflow.tiles.silhouette import (
    Frame,
    Locator,
    Mesh,
    unfolded,
)
from orbiflow.tiles.tilings import Tile
from orbiflow.typed_shapely import ufuncs

SAME = 1e-9
"""Distance along the outline, in outlines, below which points are one."""


def onto_polygon(
    mesh: Mesh, images: Array, polygon: Array, corners: Integers, vertices: Integers
) -> tuple[Mesh, Array]:
    """Move the outline's images so that together they are the polygon.

    Where a vertex of the polygon belongs to none of the outline's points, a point is put on the
    outline and its triangle divided; points between two vertices are laid onto the side between them,
    in proportion to where they were.

    Args:
        mesh: of the silhouette.
        images: (N, 2) of its points; the outline's lie near the polygon.
        polygon: (Q, 2), run through as the outline is.
        corners: (K,) of the outline's points, in order.
        vertices: (K,) of the polygon's vertices: where the corners go.

    Returns:
        The mesh, with more points where need be, and their images.

    Raises:
        OrbiflowError: if the corners do not run round the outline and the polygon once.
    """
    n, outline = mesh.size, mesh.size + len(mesh.sides)
    knots = arc_lengths(np.roll(images[:n], -corners[0], axis=0))
    polygon = np.roll(polygon, -vertices[0], axis=0)
    own, goal = (corners - corners[0]) % n, (vertices - vertices[0]) % len(polygon)
    if len(own) != len(goal) or (np.diff(own) < 1).any() or (np.diff(goal) < 1).any():
        raise OrbiflowError("the corners of the outline and the polygon do not correspond")
    places = _places(np.roll(images[:n], -corners[0], axis=0), polygon, knots, own, goal)

    share: Array = (np.concatenate([np.arange(n), mesh.sides + mesh.shares]) - corners[0]) % n
    known = np.interp(share, np.arange(n + 1), knots)
    order = np.argsort(known)
    places, fresh = _snapped(places, known[order], knots[-1])
    closed = np.append(places, knots[-1])
    along = np.concatenate([known, places[fresh]])
    laid = np.stack(
        [np.interp(along, closed, np.append(column, column[0])) for column in polygon.T], axis=-1
    )
    at = np.interp(places[fresh], knots, np.arange(n + 1)) + corners[0]
    divided = _with_points(mesh, at % n, order, np.searchsorted(known[order], places[fresh]))
    return divided, np.concatenate([laid, images[outline:]])


def _places(ring: Array, polygon: Array, knots: Array, own: Integers, goal: Integers) -> Array:
    """(Q,) where on the ring, in arc length, the polygon's vertices belong: increasing from 0."""
    lengths = arc_lengths(polygon)
    closed, loop = np.concatenate([ring, ring[:1]]), np.concatenate([polygon, polygon[:1]])
    found = np.empty(len(polygon))
    ends = zip(own, [*own[1:], len(ring)], goal, [*goal[1:], len(polygon)], strict=True)
    for a, b, p, q in ends:
        edge = shapely.LineString(closed[a : b + 1])
        at = knots[a] + ufuncs.line_locate_point(edge, ufuncs.points(loop[p : q + 1]))
        at[0], at[-1] = knots[a], knots[b]
        at = _on_vertices(at, loop[p : q + 1], closed[a : b + 1], knots[a : b + 1])
        if (np.diff(at) <= SAME * knots[-1]).any():
            # where the edge comes back to itself the nearest point may be out of order
            at = np.interp(lengths[p : q + 1], lengths[[p, q]], knots[[a, b]])
        found[p:q] = at[:-1]
    return found


def _on_vertices(at: Array, vertices: Array, points: Array, knots: Array) -> Array:
    """Put those vertices that are points of the edge exactly there."""
    apart = abs(vertices[:, None] - points[None]).max(axis=2)
    nearest = apart.argmin(axis=1)
    same = apart.min(axis=1) < SAME
    same[[0, -1]] = False
    return np.where(same, knots[nearest], at)


def _snapped(places: Array, known: Array, total: float) -> tuple[Array, NDArray[np.bool_]]:
    """Places moved to the known ones that they agree with, and which agree with none."""
    after = np.searchsorted(known, places).clip(1, len(known) - 1)
    near = np.where(
        places - known[after - 1] < known[after] - places, known[after - 1], known[after]
    )
    fresh = abs(near - places) > SAME * total
    return np.where(fresh, places, near), fresh


def _with_points(mesh: Mesh, at: Array, order: Integers, slots: Integers) -> Mesh:
    """The mesh with points on the outline at `at` (m,), in vertices from the first.

    Point j lies between the outline's points `order[slots[j] - 1]` and `order[slots[j]]`, and after
    those before it in the same gap.
    """
    if not len(at):
        return mesh
    n, outline = mesh.size, mesh.size + len(mesh.sides)
    side = np.minimum(np.floor(at).astype(np.int64), n - 1)
    start, end = mesh.points[side], mesh.points[(side + 1) % n]
    points = start + (at - side)[:, None] * (end - start)
    triangles = np.where(mesh.triangles >= outline, mesh.triangles + len(at), mesh.triangles)
    owner = {(t[k - 1], t[k]): (i, k) for i, t in enumerate(triangles.tolist()) for k in range(3)}
    rows = triangles.tolist()
    for slot in np.unique(slots):
        a, b = int(order[slot - 1]), int(order[slot % len(order)])
        i, k = owner[a, b]
        apex = rows[i][k - 2]
        chain = [a, *(outline + np.flatnonzero(slots == slot)).tolist(), b]
        pieces = [[u, v, apex] for u, v in pairwise(chain)]
        rows[i] = pieces[0]
        rows += pieces[1:]
    return Mesh(
        np.concatenate([mesh.points[:outline], points, mesh.points[outline:]]),
        np.array(rows, dtype=np.int64),
        np.concatenate([mesh.sides, side]),
        np.concatenate([mesh.shares, at - side]),
        n,
    )


MAX_POINTS, MAX_TRIANGLES = 100_000, 200_000
"""Beyond these a mesh is refused: real ones have some thousands."""

FLAT = 1e-18
"""Twice the area of a triangle, in squares of the whole's extent, that rounding can turn over."""

MIRROR = np.array([1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Bending:
    """A map of the plane that takes a triangulated silhouette to its tile, affine on each triangle.

    Both sides are in the target's normal form. The image's outline is the tile's polygon, vertex for
    vertex, and no triangle is turned over, so that inside the silhouette the map is a homeomorphism
    onto the tile. A point outside goes with the nearest point of the silhouette, and the rest of its
    way under the similarity nearest to the whole map: continuous across the outline, meant for what
    lies close to it.

    Args:
        rest: (N, 2) points of the silhouette.
        images: (N, 2) where they go.
        triangles: (M, 3) indices of the points, counter-clockwise in both.

    Raises:
        OrbiflowError: for arrays of other shapes, numbers that are not finite, indices out of range,
            too many points, and triangles that are flat or turned over.

    >>> corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    >>> bending = Bending(corners, [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]], [[0, 1, 2]])
    >>> bending.forward([0.25, 0.5]), bending.inverse([0.5, 0.5])
    (array([0.5, 0.5]), array([0.25, 0.5 ]))
    """

    rest: Array
    images: Array
    triangles: NDArray[np.int64]

    def __post_init__(self) -> None:
        rest = numbers(self.rest, "the bending's rest", ("N", 2))
        images = numbers(self.images, "the bending's images", (len(rest), 2))
        triangles = _indices(self.triangles, len(rest))
        for name, array in (("rest", rest), ("images", images)):
            with np.errstate(all="ignore"):  # an overflow counts as turned over
                sound = _determinants(array, triangles) > FLAT * np.ptp(array, axis=0).max() ** 2
            if not sound.all():
                raise OrbiflowError(
                    f"the bending's {name}: {int((~sound).sum())} triangles are flat or turned over"
                )
        for name, array in (("rest", rest), ("images", images), ("triangles", triangles)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @overload
    def forward(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def forward(self, points: ArrayLike) -> Array: ...
    def forward(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Where points (..., 2) of the silhouette go.

        Args:
            points: an array, lists or a tensor, in the target's normal form; those that are not
                finite give NaN.

        Returns:
            (..., 2): for a tensor, one of its dtype and device, without a gradient.
        """
        return _kind_of(points, self._forward(_checked(points)))

    @overload
    def inverse(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def inverse(self, points: ArrayLike) -> Array: ...
    def inverse(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Where points (..., 2) of the tile come from; as `forward`."""
        return _kind_of(points, self._backward(_checked(points)))

    @cached_property
    def _forward(self) -> _PiecewiseAffine:
        return _PiecewiseAffine(self.rest, self.images, self.triangles)

    @cached_property
    def _backward(self) -> _PiecewiseAffine:
        return _PiecewiseAffine(self.images, self.rest, self.triangles)

    def __getstate__(self) -> dict[str, Any]:
        # the trees are made anew where they are needed
        return {name: self.__dict__[name] for name in ("rest", "images", "triangles")}

    @classmethod
    def from_bent(cls, bent: Bent, factor: complex, shift: complex, tile: Tile) -> Bending:
        """The map that a bent silhouette and its similarity z -> factor z + shift make.

        Args:
            bent: a silhouette that is a tile.
            factor, shift: of the similarity, in the frame of the hand that was bent.
            tile: extracted from it, in the target's normal form: a mirrored hand's is reflected back.
                It may have fewer vertices than the bent outline: the outline is laid onto it.

        Raises:
            OrbiflowError: if the silhouette's inside cannot follow without folds.
        """
        hand = bent.hand
        flip = MIRROR if hand.mirrored else np.ones(2)
        z = factor * bent.points + shift
        placement, n = bent.placement, hand.fine.size
        first = np.cumsum(placement.lengths[0]) - placement.lengths[0]
        mesh, images = onto_polygon(
            hand.fine.mesh,
            np.stack([z.real, z.imag], axis=-1),
            tile.polygon * flip,
            (first + placement.starts[0]) % n,
            np.array(tile.corners),
        )
        images = unfolded(mesh, images)
        triangles = mesh.triangles[:, ::-1] if hand.mirrored else mesh.triangles
        return cls(mesh.points * flip, images * flip, triangles)


@dataclass(frozen=True, eq=False)
class CarriedTile:
    """A tile with what carries the input's picture onto it, all in the input's coordinates.

    - `tile`: certified.
    - `frame`: where the silhouette's normal form lies in the input.
    - `bending`: the map in normal form; None where there is none, and `notes` say why.
    """

    tile: Tile
    frame: Frame
    bending: Bending | None = None
    notes: tuple[str, ...] = ()

    @classmethod
    def from_bent(
        cls, bent: Bent, factor: complex, shift: complex, tile: Tile, frame: Frame
    ) -> CarriedTile:
        """As `Bending.from_bent`; where the silhouette cannot follow, a note says so."""
        placed = tile.transformed(frame.linear, frame.offset)
        try:
            return cls(placed, frame, Bending.from_bent(bent, factor, shift, tile))
        except OrbiflowError as error:
            return cls(placed, frame, None, (str(error),))

    @overload
    def forward(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def forward(self, points: ArrayLike) -> Array: ...
    def forward(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Where points (..., 2) of the silhouette go.

        Raises:
            OrbiflowError: if there is no map.
        """
        return self.frame.to_input(self._map().forward(self.frame.to_normal(points)))

    @overload
    def inverse(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def inverse(self, points: ArrayLike) -> Array: ...
    def inverse(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Where points (..., 2) of the tile come from; as `forward`."""
        return self.frame.to_input(self._map().inverse(self.frame.to_normal(points)))

    def _map(self) -> Bending:
        if self.bending is None:
            raise OrbiflowError("; ".join(self.notes) or "this tile has no map of its silhouette")
        return self.bending


class _PiecewiseAffine:
    """One direction of the map."""

    def __init__(self, start: Array, end: Array, triangles: NDArray[np.int64]) -> None:
        self.locator = Locator(start, triangles)
        before, after = start[triangles], end[triangles]
        sides, images = (
            np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]], axis=2) for c in (before, after)
        )
        self.origin, self.image = before[:, 0], after[:, 0]
        self.linear = images @ np.linalg.inv(sides)
        self.similarity = _similarity(start, end)

    def __call__(self, points: Array) -> Array:
        flat = points.reshape(-1, 2)
        result = np.full_like(flat, np.nan)
        finite = np.isfinite(flat).all(axis=1)
        own = flat[finite]
        triangle, nearest = self.locator.locate(own)
        inside = np.einsum("pij,pj->pi", self.linear[triangle], nearest - self.origin[triangle])
        result[finite] = self.image[triangle] + inside + (own - nearest) @ self.similarity.T
        return result.reshape(points.shape)


def _similarity(start: Array, end: Array) -> Array:
    """Linear part (2, 2) of the similarity that takes points nearest to their images."""
    factor = complex(best_similarity(complex_points(start), complex_points(end)))
    return np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])


def _determinants(points: Array, triangles: NDArray[np.int64]) -> Array:
    corners = points[triangles]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _indices(values: ArrayLike, count: int) -> NDArray[np.int64]:
    triangles = np.array(values)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise OrbiflowError(
            "the bending's triangles must be whole numbers of shape (M, 3), got "
            f"{triangles.dtype} of shape {triangles.shape}"
        )
    if not 3 <= count <= MAX_POINTS or not 1 <= len(triangles) <= MAX_TRIANGLES:
        raise OrbiflowError(
            f"a bending has 3 to {MAX_POINTS} points and 1 to {MAX_TRIANGLES} triangles, got "
            f"{count} and {len(triangles)}"
        )
    if triangles.min() < 0 or triangles.max() >= count:
        raise OrbiflowError(f"the bending's triangles must be indices of its {count} points")
    return triangles.astype(np.int64)


def _checked(points: Any) -> Array:
    return numbers(points, "points", (..., 2), finite=False)


def _kind_of(given: Any, result: Array) -> Any:
    if not isinstance(given, torch.Tensor):
        return result
    dtype = given.dtype if given.is_floating_point() else torch.float64
    return torch.as_tensor(result, dtype=dtype, device=given.device)
