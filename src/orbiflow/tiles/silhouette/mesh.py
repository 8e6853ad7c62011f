"""Triangulations of silhouettes, fine along the outline and coarser inside."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import Delaunay, Voronoi

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import doubled_areas, subdivided

MAX_HALVINGS = 24  # the number of times that missing sides of the outline are halved
MOST_PIECES = 200  # of sides, for each of the outline: more come only where points coincide
FLAT_AREA = 1e-12  # twice the area, in areas of the polygon, below which a triangle counts as flat


PIECES_PER_SIDE = 3  # number of parts of each side of the outline: more make the medial axis finer
DISC_OVERREACH = 1.02  # the factor of the discs' radii that makes up for the size of triangles


@dataclass(frozen=True, eq=False)
class SilhouetteMesh:
    """The triangles (M, 3), counter-clockwise, that fill a polygon of `size` n.

    `points` (N, 2) are the polygon's n vertices, then points on its `sides` (k,) at `shares` (k,) of
    their length, 0 to 1, then those inside.
    """

    points: Array
    triangles: Integers
    sides: Integers
    shares: Array
    size: int

    @cached_property
    def local_thickness(self) -> Array:
        """The radius (M,) of the largest disc inside that covers each triangle's middle.

        This is the local thickness of Hildebrand and Rüegsegger (1997), over discs about the Voronoi
        vertices of points on the outline, which lie near the medial axis.
        """
        ring = self.points[: self.size]
        outline = shapely.LinearRing(ring)
        shapely.prepare(outline)

        def radii(centers: Array) -> Array:
            return shapely.distance(cast(NDArray[np.object_], shapely.points(centers)), outline)

        centers = Voronoi(subdivided(ring, PIECES_PER_SIDE)).vertices
        centers = centers[shapely.contains_xy(shapely.Polygon(ring), centers[:, 0], centers[:, 1])]
        middle = self.points[self.triangles].mean(axis=1)
        thickness = radii(middle)
        if not len(centers):
            return thickness
        radius = radii(centers)
        largest = np.argsort(-radius)
        centers, radius = centers[largest], radius[largest]
        square = (DISC_OVERREACH * radius) ** 2 - (centers**2).sum(axis=1)
        for part in np.array_split(np.arange(len(middle)), len(middle) // 512 + 1):  # bounds memory
            middles = middle[part]
            covers = (middles**2).sum(axis=1)[:, None] - 2 * middles @ centers.T <= square
            first = covers.argmax(axis=1)
            covering = np.where(covers[np.arange(len(part)), first], radius[first], 0.0)
            thickness[part] = np.maximum(thickness[part], covering)
        return thickness


def triangulate(ring: Array, spacing: float | None = None) -> SilhouetteMesh:
    """Triangulate the inside of a simple, counter-clockwise ring (n, 2), with its sides.

    This is a Delaunay triangulation of the vertices and of points inside. Sides of the polygon that
    are not sides of triangles are halved until they are (Ruppert's first rule). Sides of triangles
    that connect two points of the outline through the inside are halved, so that every triangle can
    follow when the outline moves. Next to the outline inner points are `spacing` apart, by default the
    mean length of a side. Raises `OrbiflowError` for a ring that crosses itself, has a point
    twice or is too thin.
    """
    polygon, n = shapely.Polygon(ring), len(ring)
    if not polygon.is_valid or not polygon.area > 0 or len(np.unique(ring, axis=0)) < n:
        raise OrbiflowError(
            "a polygon that crosses itself, has a point twice or has no area cannot be triangulated"
        )
    spacing = spacing or polygon.exterior.length / n
    inside = _inside(polygon, spacing)
    number, after = np.arange(n), (np.arange(n) + 1) % n
    # pieces of sides: the indices of their ends, the side, and between which shares of its length
    pieces = np.stack([number, after, number, np.zeros(n), np.ones(n)], axis=1)
    extra, placed = np.zeros((0, 2)), np.zeros((0, 2))  # points on sides; their side and share
    for _ in range(MAX_HALVINGS):
        points = np.concatenate([ring, extra, inside])
        triangles = Delaunay(points).simplices.astype(np.int64)
        missing = ~_are_sides(pieces[:, :2].astype(np.int64), triangles, len(points))
        if len(pieces) > MOST_PIECES * n:
            break
        if not missing.any():
            sides = placed[:, 0].astype(np.int64)
            return _divided(
                _kept(SilhouetteMesh(points, triangles, sides, placed[:, 1], n), polygon)
            )
        start, end, side, low, high = pieces[missing].T
        middle, at = (low + high) / 2, side.astype(np.int64)
        fresh = n + len(extra) + np.arange(len(middle))
        extra = np.concatenate([extra, ring[at] + middle[:, None] * (ring[after[at]] - ring[at])])
        placed = np.concatenate([placed, np.stack([side, middle], axis=1)])
        near = shapely.distance(shapely.points(inside), shapely.MultiPoint(extra))
        inside = inside[near > spacing / 4]
        halves = [(start, fresh, side, low, middle), (fresh, end, side, middle, high)]
        pieces = np.concatenate([pieces[~missing], *(np.stack(half, axis=1) for half in halves)])
    raise OrbiflowError(
        "the silhouette is too thin somewhere to be triangulated: simplify or thicken it there"
    )


def _inside(polygon: shapely.Polygon, spacing: float) -> Array:
    """Return points inside on triangular grids, wider farther from the outline."""
    xmin, ymin, xmax, ymax = polygon.bounds
    layers: list[Array] = []
    for level, (least, most) in enumerate(((0.6, 1.7), (1.7, 4.5), (4.5, np.inf))):
        step = spacing * 2**level
        x = np.arange(xmin, xmax + step, step)
        y = np.arange(ymin, ymax + step, step * np.sqrt(3) / 2)
        grid = np.stack(np.meshgrid(x, y), axis=-1)
        grid[1::2, :, 0] += step / 2
        points = grid.reshape(-1, 2)
        points = points[shapely.contains_xy(polygon, points[:, 0], points[:, 1])]
        depth = shapely.distance(shapely.points(points), polygon.exterior) / spacing
        layers.append(points[(depth >= least) & (depth < most)])
    return np.concatenate(layers)


def _are_sides(ends: Integers, triangles: Integers, count: int) -> NDArray[np.bool_]:
    pairs = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    )
    keys = np.unique(pairs[:, 0] * count + pairs[:, 1])
    wanted = np.sort(ends, axis=1)
    return np.isin(wanted[:, 0] * count + wanted[:, 1], keys)


def _kept(mesh: SilhouetteMesh, polygon: shapely.Polygon) -> SilhouetteMesh:
    """Return the triangles inside the polygon, counter-clockwise, and the points that they use."""
    middle = mesh.points[mesh.triangles].mean(axis=1)
    area = doubled_areas(mesh.points, mesh.triangles)
    triangles = np.where((area < 0)[:, None], mesh.triangles[:, ::-1], mesh.triangles)
    inside = cast(NDArray[np.bool_], shapely.contains_xy(polygon, *middle.T))
    flat = abs(area) < FLAT_AREA * polygon.area
    triangles = _without_flat(triangles[inside & ~flat], mesh.triangles[flat])
    used = np.zeros(len(mesh.points), dtype=bool)
    used[: mesh.size + len(mesh.sides)] = True
    used[triangles] = True
    index = np.cumsum(used) - 1
    return replace(mesh, points=mesh.points[used], triangles=index[triangles])


def _without_flat(triangles: Integers, flat: Integers) -> Integers:
    """Divide the neighbour of each flat triangle whose middle vertex is in no other triangle."""
    vertices = set(triangles.ravel().tolist())
    lost = [(row, k) for row in flat.tolist() for k in range(3) if row[k] not in vertices]
    for row, k in lost:
        b, ends = row[k], {row[k - 1], row[k - 2]}
        for t, triangle in enumerate(triangles.tolist()):
            if ends <= set(triangle):
                i = next(i for i in range(3) if triangle[i] not in ends)
                apex, start, end = triangle[i], triangle[i - 2], triangle[i - 1]
                triangles = np.concatenate([triangles, [[apex, b, end]]])
                triangles[t] = apex, start, b
                break
    return triangles.astype(np.int64)


def _divided(mesh: SilhouetteMesh) -> SilhouetteMesh:
    """Halve every side that crosses the inside between two points of the outline."""
    on_outline = mesh.size + len(mesh.sides)
    if len(mesh.points) == 3:  # no side crosses, and yet nothing could follow
        middle = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])
        points = np.concatenate([mesh.points, mesh.points.mean(axis=0, keepdims=True)])
        return replace(mesh, points=points, triangles=middle)
    sides = np.stack([np.roll(mesh.triangles, 1, axis=1), mesh.triangles], axis=-1).reshape(-1, 2)
    first, second = sides[(sides < on_outline).all(axis=1)].T
    crossing = np.intersect1d(first * on_outline + second, second * on_outline + first)
    ends = np.stack(np.divmod(crossing, on_outline), axis=1)
    ends = ends[ends[:, 0] < ends[:, 1]]
    middle = {(a, b): len(mesh.points) + k for k, (a, b) in enumerate(ends.tolist())}
    triangles: list[tuple[int, int, int]] = []
    for a, b, c in mesh.triangles.tolist():
        triangles += _pieces(
            (a, b, c), [middle.get((min(u, v), max(u, v))) for u, v in ((a, b), (b, c), (c, a))]
        )
    points = np.concatenate([mesh.points, mesh.points[ends].mean(axis=1)])
    return replace(mesh, points=points, triangles=np.array(triangles, dtype=np.int64))


def _pieces(corners: tuple[int, int, int], middles: list[int | None]) -> list[tuple[int, int, int]]:
    """Return the pieces of a triangle whose sides ab, bc, ca have these middles or none."""
    a, b, c = corners
    count = sum(m is not None for m in middles)
    if count == 0:
        return [corners]
    while middles[0] is None or (count == 2 and middles[1] is None):
        a, b, c = b, c, a
        middles = [*middles[1:], middles[0]]
    ab, bc, ca = middles
    assert ab is not None
    if bc is None:
        return [(a, ab, c), (ab, b, c)]
    if ca is None:
        return [(ab, b, bc), (a, ab, bc), (a, bc, c)]
    return [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]


def harmonic(mesh: SilhouetteMesh, outline: Array) -> Array:
    """Return values (N, 2) at all points, from those on the outline: inside the mean of neighbours."""
    import scipy.sparse as sparse
    import scipy.sparse.linalg as solvers

    fixed, count = len(outline), len(mesh.points)
    ends = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    links: Any = sparse.csr_matrix((np.ones(len(ends)), ends.T), shape=(count, count))
    links = links + links.T
    degrees: Any = sparse.diags(np.asarray(links.sum(axis=1)).ravel())
    laplacian: Any = (degrees - links).tocsc()[fixed:]
    inner: Any = solvers.spsolve(laplacian[:, fixed:], -(laplacian[:, :fixed] @ outline))
    return np.concatenate([outline, np.reshape(inner, (-1, 2))])
