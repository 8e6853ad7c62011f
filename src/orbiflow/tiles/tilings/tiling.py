"""Tilings: a crystallographic group, and prototiles whose images should cover the plane.

Dirichlet cells are tiles of every group.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array, as_instance, described, is_a
from orbiflow.symmetry import CrystallographicGroup, Isometry, reduced_basis
from orbiflow.tiles.tilings.prototile import Prototile, Stabiliser, stabiliser

# the coordinates of a lattice vector in the basis of the group's lattice
Cell: TypeAlias = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Aspects:
    """The A tiles of a tiling up to translations: pairs of a prototile and a coset of the lattice.

    Elements that differ by an element of a prototile's stabiliser make the same tile of it; the
    coset of an aspect is the first of them. With one prototile of no symmetry, aspects are cosets.
    Coset i is its aspect's representative, in that cell, after the element `turns` of the stabiliser.
    """

    prototiles: Integers  # with `cosets`: the pairs, (A,) each
    cosets: Integers
    table: Integers  # the aspect (K, |G|) of coset i's image of prototile k
    steps: Integers  # the lattice cell (K, |G|, 2) of that aspect
    turns: Integers  # the element (K, |G|) of the stabiliser

    def __len__(self) -> int:
        return len(self.cosets)

    @classmethod
    def of(cls, group: CrystallographicGroup, stabilisers: Sequence[Stabiliser]) -> Aspects:
        """Return the aspects of prototiles with these stabilisers."""
        count, order = len(stabilisers), group.order
        table = np.zeros((count, order), dtype=np.int64)
        steps = np.zeros((count, order, 2), dtype=np.int64)
        turns = np.zeros((count, order), dtype=np.int64)
        prototiles: list[int] = []
        cosets: list[int] = []
        for k, symmetry in enumerate(stabilisers):
            first = np.arange(order)
            if symmetry.order > 1:
                first, steps[k], turns[k] = _first_cosets(group, symmetry)
            kept, number = np.unique(first, return_inverse=True)
            table[k] = len(cosets) + number
            prototiles += [k] * len(kept)
            cosets += kept.tolist()
        return cls(np.array(prototiles), np.array(cosets), table, steps, turns)

    def find(
        self, group: CrystallographicGroup, element: Isometry, prototile: int
    ) -> tuple[int, Cell, int]:
        """Return (aspect, cell, turn) of the tile that `element` makes of a prototile."""
        coset, (first, second) = coset_and_cell(group, element)
        step = self.steps[prototile, coset]
        cell = first + int(step[0]), second + int(step[1])
        return int(self.table[prototile, coset]), cell, int(self.turns[prototile, coset])


def _first_cosets(
    group: CrystallographicGroup, symmetry: Stabiliser
) -> tuple[Integers, Integers, Integers]:
    """Return for each coset the first that makes the same tile, its cell, and the element before."""
    first = np.arange(group.order)
    steps = np.zeros((group.order, 2), dtype=np.int64)
    turns = np.zeros(group.order, dtype=np.int64)
    for i, g in enumerate(group.cosets):
        for s in symmetry.elements[1:]:
            coset, cell = coset_and_cell(group, g @ s)
            if coset < first[i]:  # g s = (translation) h, so g = (translation) h s^-1
                errors = [np.abs(s.linear @ t.linear - np.eye(2)).max() for t in symmetry.elements]
                first[i], steps[i], turns[i] = coset, cell, int(np.argmin(errors))
    return first, steps, turns


def coset_and_cell(group: CrystallographicGroup, element: Isometry) -> tuple[int, Cell]:
    """Return (i, n) with element = translation by B n after the i-th coset representative."""
    as_instance(element, Isometry, "an element of the group")
    steps = (element.translation - group.translations) @ group.inverse_lattice.T
    error = np.abs(steps - np.round(steps)).max(axis=1)
    error += np.abs(group.linear_parts - element.linear).max(axis=(1, 2))
    coset = int(error.argmin())
    if error[coset] > 1e-6:
        raise OrbiflowError(f"{element!r} is not an element of {group!r}")
    nearest: Array = steps[coset]
    first, second = np.round(nearest).astype(int)
    return coset, (int(first), int(second))


@dataclass(frozen=True, eq=False)
class Tiling:
    """Prototiles T_k and a group G in the same coordinates; the tiles are all g(T_k) (design point 16).

    The stabiliser S_k, the elements that take T_k onto itself, is found from the polygon. A
    `Tiling` need not tile the plane: `certify` checks that. Its tiles cover the plane once if sum_k
    area(T_k) |G| / |S_k| = |det B| and their boundaries pair off.

    Args:
        group: A group of the plane.
        prototiles: At least one `Prototile` or polygon (N, 2), none an image of another. All must
            have the same orientation.

    Raises `OrbiflowError` if the group is not planar, there is no prototile, a polygon is invalid,
    or orientations differ.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> eighth = Tiling(wallpaper_group("p4m"), [[[0, 0], [0.5, 0], [0.5, 0.5]]])
    >>> cell = Tiling(eighth.group, [[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]])
    >>> [tiling.stabilisers[0].order for tiling in (eighth, cell)]
    [1, 8]
    """

    group: CrystallographicGroup
    prototiles: tuple[Prototile, ...]

    def __init__(
        self, group: CrystallographicGroup, prototiles: Sequence[Prototile | ArrayLike]
    ) -> None:
        how = "isohedral_class(name).group() and wallpaper_group(name) make one"
        as_instance(group, CrystallographicGroup, "the tile's group", how)
        if group.dim != 2:
            raise OrbiflowError(f"a tile needs a group of the plane, got dimension {group.dim}")
        try:
            listed = list(prototiles)
        except TypeError:
            listed = []
        if listed and not isinstance(listed[0], Prototile | str) and np.ndim(listed[0]) == 1:
            listed = []  # a single polygon instead of a sequence
        tiles = tuple(p if isinstance(p, Prototile) else Prototile(np.asarray(p)) for p in listed)
        if not tiles:
            raise OrbiflowError(
                "a tiling needs a sequence of at least one prototile: Tiling(group, [polygon])"
            )
        for number, prototile in enumerate(tiles):
            if prototile.signed_area * tiles[0].signed_area < 0:
                raise OrbiflowError(
                    f"prototile {number} and prototile 0 have opposite orientations: reverse the "
                    "vertices of one"
                )
        object.__setattr__(self, "group", group)
        object.__setattr__(self, "prototiles", tiles)

    @cached_property
    def stabilisers(self) -> tuple[Stabiliser, ...]:
        """The stabiliser of each prototile."""
        return tuple(stabiliser(self.group, p.ring) for p in self.prototiles)

    @cached_property
    def aspects(self) -> Aspects:
        """The tiles of a lattice cell."""
        return Aspects.of(self.group, self.stabilisers)

    @cached_property
    def tile_area(self) -> float:
        """The mean area of a tile: |det B| over the number of tiles in a cell."""
        return self.group.cell_volume / len(self.aspects)

    @cached_property
    def box(self) -> Array:
        """The lower left and upper right corner (2, 2) of the prototiles' bounding box."""
        boxes = np.stack([p.box for p in self.prototiles])
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    @property
    def center(self) -> Array:
        """The centre (2,) of `box`."""
        return (self.box[0] + self.box[1]) / 2

    @property
    def radius(self) -> float:
        """The radius of the largest prototile."""
        return max(p.radius for p in self.prototiles)

    def transformed(self, linear: Array, offset: Array) -> Tiling:
        """Return the image under the affine map p -> linear p + offset, a similarity."""
        by, to = np.asarray(linear), np.asarray(offset)
        moved = [Prototile(p.polygon @ by.T + to, p.corners) for p in self.prototiles]
        return Tiling(self.group.conjugate(by, to), moved)

    def __repr__(self) -> str:
        orders = ", ".join(str(symmetry.order) for symmetry in self.stabilisers)
        name = self.group.name or f"order {self.group.order}"
        return f"Tiling({name}, prototiles with stabilisers of order {orders})"


@dataclass(frozen=True, eq=False)
class Tile:
    """A closed polygon with a crystallographic group acting in the same coordinates.

    This is a `Tiling` by one prototile, `tiling`, with its isohedral class. A `Tile` need not tile
    the plane: `certify` checks that.

    Args:
        polygon: The vertices (N, 2) in order, in either orientation, without repeating the first.
        group: The group whose images of the polygon are the tiles.
        isohedral_class: The class, such as "IH4", or "" if it is unknown.
        corners: The indices in `polygon` of the tiling vertices of the class, in order.

    Raises `OrbiflowError` if the polygon is not (N >= 3, 2) finite numbers or the group not planar.
    """

    polygon: Array
    group: CrystallographicGroup
    isohedral_class: str = ""
    corners: tuple[int, ...] = field(default=())
    tiling: Tiling = field(init=False)

    def __post_init__(self) -> None:
        prototile = Prototile(self.polygon, self.corners)
        object.__setattr__(self, "tiling", Tiling(self.group, (prototile,)))
        as_instance(self.isohedral_class, str, "the tile's isohedral class", 'give its name, "IH4"')
        object.__setattr__(self, "polygon", prototile.polygon)
        object.__setattr__(self, "corners", prototile.corners)

    @property
    def signed_area(self) -> float:
        """Area, positive for counter-clockwise order (with y up)."""
        return self.tiling.prototiles[0].signed_area

    @property
    def center(self) -> Array:
        """The centre (2,) of the bounding box."""
        return self.tiling.prototiles[0].center

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from `center`."""
        return self.tiling.prototiles[0].radius

    def transformed(self, linear: Array, offset: Array) -> Tile:
        """Return the image under the affine map p -> linear p + offset, a similarity."""
        moved = self.polygon @ np.asarray(linear).T + np.asarray(offset)
        group = self.group.conjugate(linear, offset)
        return Tile(moved, group, self.isohedral_class, self.corners)


Tiles: TypeAlias = Tile | Tiling
"""A tile or a tiling, which most functions of tilings take."""


def as_tiling(tiles: Tiles) -> Tiling:
    """Return a tile or a tiling as a tiling; raise `OrbiflowError` for anything else."""
    if isinstance(tiles, Tiling):
        return tiles
    if is_a(tiles, Tile):
        return tiles.tiling
    raise OrbiflowError(
        f"the tile must be a Tile or a Tiling, got {described(tiles)}; Tile(polygon, group) makes one"
    )


_SAME_DISTANCE = 1e-6  # the distance, in square roots of |det B|, below which points count as one


def dirichlet_tile(group: CrystallographicGroup, point: ArrayLike) -> Tile:
    """Return the points nearer to `point` than to any other of its images, as a tile.

    The tile is convex and tiles edge to edge. Its stabiliser is that of the point: about a rotation
    centre or on a mirror the cell has that symmetry. A point with an image nearer than a millionth of
    the square root of |det B| is moved onto that centre or mirror, as rounding decides its cell.

    Args:
        group: A group of the plane.
        point: A point (2,), in the group's units.

    Raises `OrbiflowError` if `point` is not a point, or the group is not of the plane.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> hexagon = dirichlet_tile(wallpaper_group("p6m"), (0.0, 0.0))
    >>> len(hexagon.polygon), hexagon.tiling.stabilisers[0].order
    (6, 12)
    """
    site = as_array(point, "the point of a Dirichlet cell", (2,))
    return Tile(dirichlet_tiling(group, [site]).prototiles[0].polygon, group)


def dirichlet_tiling(group: CrystallographicGroup, points: Sequence[ArrayLike]) -> Tiling:
    """Return the Dirichlet cells of several points among all their images: a prototile for each.

    Args:
        group: A group of the plane.
        points: Points (K, 2), none an image of another.

    Raises `OrbiflowError` if `points` are not points or are images of each other, or if the group
    is not of the plane.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> squares = dirichlet_tiling(wallpaper_group("p4m"), [(0, 0), (0.5, 0.5)])
    >>> [len(prototile.polygon) for prototile in squares.prototiles]
    [4, 4]
    """
    as_instance(group, CrystallographicGroup, "the group", "wallpaper_group(name) makes one")
    if group.dim != 2:
        raise OrbiflowError(f"a tile needs a group of the plane, got dimension {group.dim}")
    sites = as_array(points, "the points of Dirichlet cells", ("K", 2))
    if not len(sites):
        raise OrbiflowError("a Dirichlet tiling needs at least one point")
    same = _SAME_DISTANCE * float(np.sqrt(group.cell_volume))
    sites = np.array([_settled(group, point, same) for point in sites])
    return Tiling(group, [_cell(group, sites, k, same) for k in range(len(sites))])


def _settled(group: CrystallographicGroup, point: Array, same: float) -> Array:
    """Return a point (2,), moved onto the centre or mirror that it is within rounding of."""
    for _ in range(16):  # each step is nearer, where more elements join in
        images = np.array([g(point) for g in group.elements_near(point, same)])
        if np.ptp(images, axis=0).max() <= 1e-6 * same:
            break
        point = images.mean(axis=0)
    return point


def _cell(group: CrystallographicGroup, points: Array, k: int, same: float) -> Array:
    """Return (N, 2) the cell of point k, counter-clockwise."""
    from scipy.spatial import KDTree

    site = points[k]
    # no point of the cell is further from the site than half the two shortest lattice vectors
    # together, and what bounds the cell no further than twice that
    reach = 1.01 * float(np.linalg.norm(reduced_basis(group.lattice), axis=0).sum())
    images: list[Array] = []
    for number, point in enumerate(points):
        offsets = [g(point) - site for g in group.elements_near(site, reach, source=point)]
        if number != k and offsets and float(np.linalg.norm(offsets[0])) < same:
            raise OrbiflowError(
                f"points {k} and {number} of a Dirichlet tiling have the same images"
            )
        images += offsets
    others = np.array(images)
    others = others[np.linalg.norm(others, axis=1) > same]
    pairs = KDTree(others).query_pairs(same, output_type="ndarray")
    corners = _nearest_to_origin(np.delete(others, pairs[:, 1], axis=0), reach)
    corners = corners[np.argsort(np.arctan2(corners[:, 1], corners[:, 0]))]
    # rounding divides a vertex of four and more cells into several
    steps = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    return corners[steps > same / 1e4] + site


def _nearest_to_origin(others: Array, reach: float) -> Array:
    """Return the polygon (N, 2) of the points nearer to the origin than to `others` (M, 2).

    It is a square of half side `reach`, cut along one bisector after the other, which keeps digits
    that Qhull merges away where a point is close.
    """
    cell = reach * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for other in others[np.argsort(np.linalg.norm(others, axis=1))]:
        over = cell @ other - other @ other / 2
        ahead, beyond = np.roll(cell, -1, axis=0), np.roll(over, -1)
        cut = (over > 0) != (beyond > 0)
        share = np.divide(over, over - beyond, out=np.zeros(len(over)), where=cut)
        both = np.stack([cell, cell + share[:, None] * (ahead - cell)], axis=1)
        cell = both[np.stack([over <= 0, cut], axis=1)]
    return cell
