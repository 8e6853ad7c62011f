"""The smooth surface of a tile of cells, whose faces match under the group."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orbiflow.arrays import Array, Integers
from orbiflow.solids.closing import CellTile, Function
from orbiflow.solids.crossings import crossing_pairs
from orbiflow.solids.growth import CellBox
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.smoothing import PointOrbits, place_between_copies, relax

SMALLEST_SINE = 0.01
"""Of a triangle's area over half the square of its longest edge: thinner ones are taken back."""

REPAIRS, SMOOTHINGS, LAST_STEP = 48, 16, 32
"""Rounds in which crossings are looked for; those that smooth; the first that takes all back."""

SHARE_STEP, ATTEMPTS = 0.34, 4


@dataclass(frozen=True, eq=False)
class TileSurface:
    """The surface of a tile, and which copy is behind each of its faces.

    - `mesh`: The surface.
    - `cosets`, `shifts`: The element of the complex's group whose copy is behind each face: the number
      (M,) of its coset, and its shift (M, 3) along the group's lattice.
    - `partners`: The face (M,) that this element takes to the face, turned over.
    - `taken_back`: The share of the points that could not stay where they were moved, because triangles
      would have crossed.
    """

    mesh: Mesh
    cosets: Integers
    shifts: Integers
    partners: Integers
    taken_back: float


@dataclass(frozen=True, eq=False)
class Patches:
    """The faces of cells that bound a tile, before they are cut into triangles.

    - `points`: Their corners (N, 3) on the finer grid.
    - `corners`: The points (F, 4) of each face, counter-clockwise from outside; the last of a triangle
      is repeated.
    - `cosets`, `shifts`: The element (F,), (F, 3) whose copy is behind each face.
    - `partners`: The face (F,) that this element takes to it.
    - `partner_corners`: The points (F, 4) of the partner that go to `corners`.
    """

    points: Integers
    corners: Integers
    cosets: Integers
    shifts: Integers
    partners: Integers
    partner_corners: Integers


Move = Callable[[PointOrbits, Array, Patches], Array]
"""Takes the orbits' places (n, 3) to other places, given the tile's patches."""


def tile_surface(
    tile: CellTile, function: Function | None = None, *, move: Move | None = None
) -> TileSurface:
    """Return the surface of a tile of cells, smooth, with faces in pairs under the group.

    Points move by orbits of the group, and those that an element fixes stay fixed: so faces match
    wherever points go. Curves where three tiles meet are smoothed along themselves. Then points move
    to where the function is the same on both sides, f(x) = f(g^-1 x) with the copy g behind. Where
    triangles would cross or become too thin, the moves are taken back as far as is needed.

    Args:
        tile: A tile that is a ball.
        function: The function of `close_tile`. Default: the surface is only smoothed.
        move: Moves the places once more.
    """
    patches = boundary_patches(tile)
    orbits = PointOrbits(tile.complex, patches.points, patches.corners)
    moved = relax(orbits, orbits.start)
    if function is not None:
        moved = place_between_copies(orbits, moved, function, patches)
    if move is not None:
        moved = move(orbits, moved, patches)
    cells, kept_apart = patches, np.zeros(len(patches.points), bool)
    for attempt in range(ATTEMPTS):
        patches = _with_quads_at_seams(cells, orbits.seams, kept_apart)
        faces, owners, middles = _triangles(orbits.places(moved), patches)
        places, share, bad = _without_crossings(orbits, moved, faces, middles)
        if not bad.any():
            break
        # joined triangles are not those of the ball of cells: there, they are kept apart
        kept_apart = kept_apart | bad | (attempt == ATTEMPTS - 2)
    moved = places
    points = _with_middles(orbits.places(moved), middles)
    partners = _partner_triangles(points, faces, owners, patches, tile)
    return TileSurface(
        Mesh(points, faces), patches.cosets[owners], patches.shifts[owners], partners, share
    )


def boundary_patches(tile: CellTile) -> Patches:
    """Return the faces between a tile's cells and its copies'."""
    complex, shape = tile.complex, tile.complex.shape
    lower = tile.cells[:, :3].min(axis=0) - 2
    box = CellBox(complex, lower, tile.cells[:, :3].max(axis=0) + 3 - lower)
    numbers = box.numbers(tile.cells)
    inside = np.zeros(box.number_of_cells, bool)
    inside[numbers] = True
    behind = box.neighbors(numbers)
    rows, sides = np.nonzero((behind >= 0) & ~inside[behind])
    inner, other = tile.cells[rows], box.cells(behind[rows, sides])
    source = tile.cells[complex.orbit_of(other)]
    cosets, shifts = complex.elements_between(source, other)
    corners = shape.denominator * inner[:, None, :3] + shape.face_corners[inner[:, 3], sides]
    points, flat = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = flat.reshape(-1, 4)
    repeated = np.repeat(np.stack([cosets, *shifts.T], axis=1), 4, axis=0)
    back = complex.preimages(corners.reshape(-1, 3), repeated[:, 0], repeated[:, 1:])
    partner_corners = _rows_in(points, back).reshape(-1, 4)
    place = {frozenset(row): k for k, row in enumerate(faces.tolist())}
    partners = np.array([place[frozenset(row)] for row in partner_corners.tolist()])
    return Patches(points, faces, cosets, shifts, partners, partner_corners)


def _rows_in(table: Integers, rows: Integers) -> Integers:
    """Return the numbers of rows (n, 3) in a table of sorted, unlike rows."""
    low = np.minimum(table.min(axis=0), rows.min(axis=0))
    size = np.maximum(table.max(axis=0), rows.max(axis=0)) - low + 1
    keys, wanted = (
        np.ravel_multi_index(tuple((entries - low).T), tuple(size)) for entries in (table, rows)
    )
    return np.asarray(np.searchsorted(keys, wanted), np.int64)


def _with_quads_at_seams(patches: Patches, seams: Integers, kept_apart: Array) -> Patches:
    """Return patches where triangles with two edges on seams are joined to the next, partners alike.

    Once a seam is smooth such a triangle's corners are on one line. Of four corners the other diagonal
    can be taken. Triangles are left as they are at points (N,) that are kept apart.
    """
    partners = patches.partners
    apart: Array = np.any(kept_apart[patches.corners], axis=1)
    on_seam = set(map(tuple, seams.tolist()))
    three = np.flatnonzero(patches.corners[:, 2] == patches.corners[:, 3])
    rows: dict[int, list[int]] = dict(
        zip(three.tolist(), patches.corners[three, :3].tolist(), strict=True)
    )
    owner = {(row[k - 1], row[k]): t for t, row in rows.items() for k in range(3)}
    joined: dict[int, int] = {}
    used: set[int] = set()
    for first, row in rows.items():
        inner = [k for k in range(3) if (row[k - 1], row[k]) not in on_seam]
        second = owner.get((row[inner[0]], row[inner[0] - 1]), -1) if len(inner) == 1 else -1
        four = {first, second, int(partners[first]), int(partners[second])}
        if second >= 0 and len(four) == 4 and not four & used and not apart[[*four]].any():
            joined |= {first: second, int(partners[first]): int(partners[second])}
            used |= four
    corners, partner_corners = patches.corners.copy(), patches.partner_corners.copy()
    for first, second in joined.items():
        a, b = rows[first], rows[second]
        start = next(k for k in range(3) if a[k] in b and a[k - 1] in b)
        far = next(k for k in range(3) if b[k] not in a)
        for table in (corners, partner_corners):
            table[first] = [*np.roll(table[first, :3], -start), table[second, far]]
    kept = np.setdiff1d(np.arange(len(corners)), np.array([*joined.values()], np.int64))
    return Patches(
        patches.points,
        corners[kept],
        patches.cosets[kept],
        patches.shifts[kept],
        np.searchsorted(kept, partners[kept]).astype(np.int64),
        partner_corners[kept],
    )


def _triangles(places: Array, patches: Patches) -> tuple[Integers, Integers, Integers]:
    """Cut the patches into triangles, partners alike.

    Returns the triangles' points (M, 3), their patches (M,), and the patches (m,) that have a point of
    their own in their middle, after all others: an element turns these patches onto themselves so that
    no diagonal stays.
    """
    corners, partners = patches.corners, patches.partners
    number = np.arange(len(corners))
    three = corners[:, 2] == corners[:, 3]
    p = places[corners]
    normals = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    areas = [
        np.einsum("ni,ni->n", normals, np.cross(p[:, k] - p[:, k - 1], p[:, (k + 1) % 4] - p[:, k]))
        for k in range(4)  # of the triangle that a diagonal cuts off at corner k
    ]
    even_area, odd_area = np.minimum(areas[1], areas[3]), np.minimum(areas[0], areas[2])
    # the shorter diagonal, unless three corners are nearly on one line, as on a smooth seam
    diagonals = np.linalg.norm(p[:, [0, 1]] - p[:, [2, 3]], axis=2)
    odd = np.where(diagonals[:, 1] < diagonals[:, 0], odd_area > 0.4 * even_area, False)
    odd |= even_area < 0.4 * odd_area
    later = partners < number
    # the partner's diagonal, which goes to one of this patch's
    from_partner = _sees_diagonal(patches, odd)
    odd = np.where(later, from_partner, odd)
    itself = (partners == number) & ~three
    fixed = itself & (from_partner == odd)
    middle = itself & ~fixed
    cuts = {
        (0, 1, 2): three | ~middle & ~odd, (0, 2, 3): ~three & ~middle & ~odd,
        (1, 2, 3): ~three & ~middle & odd, (1, 3, 0): ~three & ~middle & odd,
    }  # fmt: skip
    faces = [corners[mask][:, list(cut)] for cut, mask in cuts.items()]
    owners = [number[mask] for mask in cuts.values()]
    middles = number[middle]
    own_point = len(places) + np.arange(len(middles))
    for k in range(4):
        faces.append(
            np.stack([corners[middle, k], corners[middle, (k + 1) % 4], own_point], axis=1)
        )
        owners.append(middles)
    return np.concatenate(faces), np.concatenate(owners), corners[middles]


def _sees_diagonal(patches: Patches, odd: Array) -> Array:
    """Return for each patch whether its partner's diagonal goes to that of its corners 1 and 3."""
    theirs = patches.corners[patches.partners]
    ends = np.where(odd[patches.partners, None], theirs[:, [1, 3]], theirs[:, [0, 2]])
    return np.any(patches.partner_corners[:, 1, None] == ends, axis=1)


def _with_middles(places: Array, middles: Integers) -> Array:
    return np.concatenate([places, places[middles].mean(axis=1)]) if len(middles) else places


def _without_crossings(
    orbits: PointOrbits, moved: Array, faces: Integers, middles: Integers
) -> tuple[Array, float, Array]:
    """Return the orbits' places, changed until no triangles cross.

    Where they do, points first go towards the means of their neighbours. What still crosses goes back
    towards the boundary of the ball of cells, where nothing crosses.

    Returns as well the share of the orbits that went back, and at which points (N,) triangles cross
    even so.
    """
    corners = np.repeat(orbits.number[:, None], 4, axis=1)
    of_points = np.concatenate([corners, orbits.number[middles].reshape(-1, 4)])
    share, changed, bad = np.ones(len(moved)), None, np.empty(0, np.int64)
    a, b = orbits.links
    for repair in range(REPAIRS):
        places = orbits.start + share[:, None] * (moved - orbits.start)
        points = _with_middles(orbits.places(places), middles)
        bad = np.union1d(
            crossing_pairs(points, faces, changed), Mesh(points, faces).thin_faces(SMALLEST_SINE)
        )
        hit = np.isin(np.arange(len(moved)), of_points[faces[bad]])
        if not np.any(share[hit] > 0):
            break
        if repair < SMOOTHINGS:
            hit[a[hit[b]]] = True
            moved = moved + np.where(hit[:, None], 0.5 * orbits.pull(moved), 0.0)
        else:
            share[hit] = np.maximum(share[hit] - SHARE_STEP, 0.0) if repair < LAST_STEP else 0.0
            np.minimum.at(share, a, share[b] + SHARE_STEP)  # neighbours follow half the way
        touched: Array = np.any(hit[of_points] | (share[of_points] < 1), axis=1)
        changed = np.any(touched[faces], axis=1)
    places = orbits.start + share[:, None] * (moved - orbits.start)
    crossing = np.isin(np.arange(len(orbits.number)), faces[bad])
    return places, float(np.mean(share < 1)), crossing


def _partner_triangles(
    points: Array, faces: Integers, owners: Integers, patches: Patches, tile: CellTile
) -> Integers:
    """Return for each triangle the one that the element behind it takes to it."""
    group = tile.complex.group
    centers = points[faces].mean(axis=1)
    cosets, shifts = patches.cosets[owners], patches.shifts[owners]
    rest = centers - group.translations[cosets] - shifts @ group.lattice.T
    back = np.einsum("nji,nj->ni", group.linear_parts[cosets], rest)
    # among the few triangles of the partner patch, the nearest
    order = np.argsort(owners, kind="stable")
    first = np.searchsorted(owners[order], patches.partners[owners])
    last = np.searchsorted(owners[order], patches.partners[owners], side="right")
    best, partners = np.full(len(faces), np.inf), np.zeros(len(faces), np.int64)
    for k in range(int((last - first).max())):
        other = order[np.minimum(first + k, last - 1)]
        distance = np.linalg.norm(centers[other] - back, axis=1)
        nearer = distance < best
        best[nearer], partners[nearer] = distance[nearer], other[nearer]
    return partners
