"""Triangles from anybody's file made one closed body, or refused with what to do.

What can be done safely is done and said: holes that are small or flat are closed, faces turned one
way, overlapping bodies united, cavities filled, scraps left out. The rest is for a person to decide.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse
from manifold3d import Manifold, triangulate
from scipy.spatial import cKDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.solids.bodies import as_body, as_mesh, united
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.soup import Soup

MAX_FACES = 60_000
"""Triangles of a mesh that is read; finer ones are simplified."""

COARSEST = 0.03
"""The most that a surface moves where it is simplified, as a share of its size."""


SAME_PLACE = 1e-6
"""Distance, as a share of the size, within which points are one where the surface needs it."""

SMALL_HOLE = 0.03
"""Share of the surface's area that the lids of holes may have in all, unless they are flat."""

FLAT = 0.01
"""How far a hole's rim may be from a plane, as a share of its own size, to count as flat."""

SCRAP = 0.02
"""Volume, as a share of the largest piece's, below which a piece is a scrap."""

THIN = 1e-3
"""Least side of the box around a body, as a share of the greatest: what is thinner is flat."""

INNER_WALLS = (
    "has edges at which three or more faces meet: remove its inner walls and loose faces, as with Make "
    "Manifold of Blender's 3D Print Toolbox"
)

MOST_PATCHES = 2000
"""Pieces of surface at most; they are united one by one."""


def mended(soup: Soup, notes: list[str]) -> Mesh:
    """Return the one closed body that triangles bound, its faces counter-clockwise from outside.

    What was mended is added to `notes`.

    Raises `OrbiflowError` with what to do, as words that follow the name of a file.
    """
    mesh = _turned_alike(_cleaned(soup, notes), notes)
    mesh = _without_holes(mesh, notes)
    body = _one_body(_bodies(mesh, notes), notes)
    if body.num_tri() > MAX_FACES:
        notes.append(f"The mesh was simplified from {body.num_tri():,} triangles to {{}}.")
        body = simplified(body, MAX_FACES)
        if body.num_tri() > MAX_FACES:
            raise OrbiflowError(
                f"cannot be simplified to {MAX_FACES:,} triangles; simplify the mesh yourself"
            )
        notes[-1] = notes[-1].format(f"{body.num_tri():,}")
    return as_mesh(body)


def simplified(body: Manifold, most: int) -> Manifold:
    """Return a body of at most `most` triangles, or as few as leave it its looks."""
    box = np.array(body.bounding_box()).reshape(2, 3)
    size = float(np.linalg.norm(box[1] - box[0]))
    best, tolerance = body, 1e-5 * size
    # with a coarser tolerance the library breaks thin parts and has more triangles again
    while best.num_tri() > most and tolerance < COARSEST * size:
        tried, tolerance = body.simplify(tolerance), 1.6 * tolerance
        if 0 < tried.num_tri() < best.num_tri():
            best = tried
    return best


def _cleaned(soup: Soup, notes: list[str]) -> Mesh:
    """Return a mesh whose points are all used and apart, without degenerate and repeated faces."""
    points, faces, _ = soup
    if not len(faces):
        raise OrbiflowError("holds no triangles; export the mesh itself, not its points or curves")
    if not np.isfinite(points).all():
        raise OrbiflowError("has points that are not numbers (NaN or infinite); export it again")
    if faces.min() < 0 or faces.max() >= len(points):
        raise OrbiflowError("has faces of points that are not there; export it again")
    used, faces = np.unique(faces, return_inverse=True)
    points, faces = points[used], faces.reshape(-1, 3)
    sides = np.sort(np.ptp(points, axis=0))
    if sides[2] > 1e12 or 0 < sides[2] < 1e-9:
        raise OrbiflowError(f"has a mesh {sides[2]:.3g} mm across; choose another unit")
    if sides[0] <= THIN * sides[2]:
        raise OrbiflowError("holds a flat mesh, which is no body; give it a thickness")
    mesh = _with_faces(*np.unique(points, axis=0, return_inverse=True), faces)
    if not mesh.is_closed:
        mesh = _with_faces(*_merged(mesh.points, SAME_PLACE * sides[2]), mesh.faces)
    if (lost := len(faces) - len(mesh.faces)) > 0:
        notes.append(f"{_several(lost, 'degenerate or repeated face')} left out.")
    return mesh


def _with_faces(points: Array, numbers: Integers, faces: Integers) -> Mesh:
    """Return a mesh of merged points without faces that have two equal corners or are repeated."""
    faces = numbers.ravel()[faces]
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    return Mesh(points, faces[np.sort(first)])


def _merged(points: Array, distance: float) -> tuple[Array, Integers]:
    """Return points of which those within a distance are one, and the number of each in them."""
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    labels = _labels(pairs[:, 0], pairs[:, 1], len(points))
    first = np.unique(labels, return_index=True)[1]
    return points[first], labels


def _labels(first: Integers, other: Integers, count: int) -> Integers:
    """Return which connected part each of `count` nodes is of, given the ends of their edges."""
    graph = scipy.sparse.coo_matrix((np.ones(len(first)), (first, other)), (count, count))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1].astype(np.int64)


def _turned_alike(mesh: Mesh, notes: list[str]) -> Mesh:
    """Return a mesh whose faces run against one another along each edge that two of them share.

    Which side is outside is settled later, for each piece.
    """
    if mesh.is_closed:
        return mesh
    first, second, agree = _neighbours(mesh)
    count = len(mesh.faces)
    # the surface's double cover: a face and its other side; one of each is kept
    same = np.where(agree, 0, count)
    rows = np.concatenate([first, first + count])
    columns = np.concatenate([second + same, second + count - same])
    labels = _labels(rows, columns, 2 * count)
    ahead, back = labels[:count], labels[count:]
    if (ahead == back).any():
        raise OrbiflowError(
            "has a surface with one side only, like a Moebius strip; make it the boundary of a body"
        )
    turned = ahead > back
    if 2 * turned.sum() > count:
        turned = ~turned
    if not turned.any():
        return mesh
    notes.append(f"{_several(int(turned.sum()), 'face')} turned to agree with their neighbours.")
    return Mesh(mesh.points, np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces))


def _neighbours(mesh: Mesh) -> tuple[Integers, Integers, Integers]:
    """Return the faces (E,), (E,) at each edge of two, and whether they run against each other."""
    half = mesh.half_edges
    key = half.min(axis=1) * len(mesh.points) + half.max(axis=1)
    order = np.argsort(key, kind="stable")
    _, start, counts = np.unique(key[order], return_index=True, return_counts=True)
    pair = start[counts == 2]
    first, other = order[pair], order[pair + 1]
    return first // 3, other // 3, half[first, 0] != half[other, 0]


def _without_holes(mesh: Mesh, notes: list[str]) -> Mesh:
    """Return a mesh with lids on its holes; refuse holes that are large and not flat."""
    half = mesh.half_edges
    key = half.min(axis=1) * len(mesh.points) + half.max(axis=1)
    _, place, counts = np.unique(key, return_inverse=True, return_counts=True)
    rim = half[counts[place] == 1][:, ::-1]
    if not len(rim):
        return mesh
    following = dict(rim.tolist())
    if len(following) < len(rim):
        raise OrbiflowError(
            "has holes that touch one another; close them, as with Blender's 3D Print Toolbox"
        )
    loops = list[list[int]]()
    while following:
        loops.append([next(iter(following))])
        while (after := following.pop(loops[-1][-1], None)) != loops[-1][0]:
            if after is None:
                raise OrbiflowError(INNER_WALLS)
            loops[-1].append(after)
    lids = [_lid(mesh.points[loop]) for loop in loops]
    areas = [float(np.linalg.norm(_vector(mesh.points[loop]))) / 2 for loop in loops]
    curved = [k for k, (_, flat) in enumerate(lids) if not flat]
    if sum(areas[k] for k in curved) > SMALL_HOLE * mesh.area:
        size = max(float(np.ptp(mesh.points[loops[k]], axis=0).max()) for k in curved)
        raise OrbiflowError(
            f"has a hole {size:.3g} mm across; close it, as with Blender's 3D Print Toolbox"
        )
    notes.append(f"{_several(len(loops), 'hole')} closed.")
    faces = [np.array(loop)[lid] for loop, (lid, _) in zip(loops, lids, strict=True)]
    return Mesh(mesh.points, np.concatenate([mesh.faces, *faces]))


def _vector(ring: Array) -> Array:
    """Return twice the area that a ring (N, 3) encloses, as a normal (3,)."""
    around = ring - ring.mean(axis=0)
    return np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)


def _lid(ring: Array) -> tuple[Integers, bool]:
    """Return triangles (n, 3) that close a ring of points (N, 3), and whether it is flat."""
    around = ring - ring.mean(axis=0)
    axes = np.linalg.svd(around, full_matrices=False)[2]
    across = around @ axes.T
    flat = bool(abs(across[:, 2]).max() <= FLAT * np.ptp(across[:, 0]))
    if np.cross(axes[0], axes[1]) @ _vector(ring) < 0:
        across = across * (1, -1, 1)
    lid = np.array(triangulate([across[:, :2]])).astype(np.int64).reshape(-1, 3)
    if len(lid) == len(ring) - 2:
        return lid, flat
    fan = np.arange(1, len(ring) - 1)
    return np.stack([0 * fan, fan, fan + 1], axis=1), flat


def _bodies(mesh: Mesh, notes: list[str]) -> list[Manifold]:
    """Return the body of each piece of surface, all turned outwards."""
    first, second, _ = _neighbours(mesh)
    labels = _labels(first, second, len(mesh.faces))
    if (count := labels.max() + 1) > MOST_PATCHES:
        raise OrbiflowError(f"has {count:,} separate pieces; join them into one body")
    order = np.argsort(labels, kind="stable")
    patches = np.split(order, np.cumsum(np.bincount(labels))[:-1])
    pieces = [mesh.of_faces(patch) for patch in patches]
    open_area = sum(piece.area for piece in pieces if not piece.is_closed)
    if open_area > SCRAP * mesh.area:
        raise OrbiflowError(INNER_WALLS)
    if open_area > 0:
        notes.append("Loose faces were left out.")
    closed = [piece for piece in pieces if piece.is_closed]
    whole = max(closed, key=lambda piece: abs(piece.volume), default=None)
    if whole is None or abs(whole.volume) <= 1e-6 * np.prod(np.ptp(whole.points, axis=0)):
        raise OrbiflowError("encloses no volume; make it the surface of a body")
    if whole.volume < 0:
        notes.append("The surface was inside out, and was turned.")
    return [
        as_body(piece if piece.volume > 0 else Mesh(piece.points, piece.faces[:, ::-1]))
        for piece in closed
        if piece.volume
    ]


def _one_body(bodies: list[Manifold], notes: list[str]) -> Manifold:
    """Return the union of bodies as one piece without cavities and scraps."""
    if len(bodies) == 1:
        return bodies[0]
    whole = united(bodies)
    pieces = as_mesh(whole).pieces()
    outer = [piece for piece in pieces if piece.volume > 0]
    largest = outer[0].volume
    parts = [piece for piece in outer if piece.volume > SCRAP * largest]
    if len(parts) > 1:
        raise OrbiflowError(
            f"holds {len(parts)} bodies that do not touch; join them, or keep one of them"
        )
    hidden = sum(_is_within(body, bodies) for body in bodies)
    joined = len(bodies) - hidden - (len(outer) - 1)
    if joined > 1:
        notes.append(f"{joined} overlapping bodies were united.")
    if hidden or len(pieces) > len(outer):
        notes.append("Cavities inside the body were filled.")
    if len(outer) > 1:
        notes.append(f"{_several(len(outer) - 1, 'small separate piece')} left out.")
    return as_body(outer[0])


def _is_within(body: Manifold, others: list[Manifold]) -> bool:
    """Return whether a body is inside one of the others, as a cavity's surface is."""
    low, high = np.array(body.bounding_box()).reshape(2, 3)
    for other in others:
        box = np.array(other.bounding_box()).reshape(2, 3)
        inside = other is not body and (box[0] < low).all() and (high < box[1]).all()
        if inside and (body - other).is_empty():
            return True
    return False


def _several(count: int, what: str) -> str:
    """Return how many things there were, as the start of a sentence in the past."""
    return f"{count:,} {what} was" if count == 1 else f"{count:,} {what}s were"
