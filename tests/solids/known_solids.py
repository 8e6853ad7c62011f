"""Groups, functions, bodies and solids for the tests of what fills space."""

from functools import cache

import numpy as np
from hypothesis import strategies as st
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.solids import Mesh
from orbiflow.solids.bodies import as_mesh
from orbiflow.solids.closing import CellTile, Function, close_tile
from orbiflow.solids.complexes import cell_complex
from orbiflow.symmetry import CrystallographicGroup, DirichletDomain, space_group

CELLS = {
    "P 1": (1.0, 1.1, 0.9, 80, 95, 100), "P -1": (1.0, 1.2, 0.9, 85, 100, 95),
    "P 1 21 1": (1.0, 1.2, 0.9, 90, 105, 90), "P 1 21/c 1": (1.0, 1.1, 1.2, 90, 100, 90),
    "C 1 2 1": (1.4, 1.0, 0.9, 90, 100, 90), "P 21 21 21": (1.0, 1.2, 0.9, 90, 90, 90),
    "P c a 21": (1.2, 1.0, 0.9, 90, 90, 90), "I 21 21 21": (1.0, 1.2, 0.9, 90, 90, 90),
    "P 41": (1.0, 1.0, 1.3, 90, 90, 90), "P 3": (1.0, 1.0, 0.8, 90, 90, 120),
    "P 31": (1.0, 1.0, 1.2, 90, 90, 120), "P 61": (1.0, 1.0, 1.6, 90, 90, 120),
    "R 3": (1.0, 1.0, 1.4, 90, 90, 120), "P 21 3": (1.0, 1.0, 1.0, 90, 90, 90),
}  # fmt: skip
"""Cells of groups of all kinds: without rotations, with axes of all orders, centred ones."""

names = st.sampled_from(sorted(CELLS))
seeds = st.integers(0, 2**31)


def group_named(name: str) -> CrystallographicGroup:
    """Return a group of `CELLS`, whose tiles have the volume 1."""
    group = space_group(name, CELLS[name])
    return group.conjugate((group.order / group.cell_volume) ** (1 / 3) * np.eye(3))


def random_function(group: CrystallographicGroup, seed: int) -> tuple[Function, Array]:
    """Return a smooth function that is large around a point (3,), and this point."""
    rng = np.random.default_rng(seed)
    middle = DirichletDomain(group).site
    waves, phases = rng.normal(0, 2.5, (4, 3)), rng.uniform(0, 2 * np.pi, 4)

    def function(points: Array) -> Array:
        offsets = points - middle
        bumps = np.sin(offsets @ waves.T + phases).sum(axis=1)
        return -(offsets**2).sum(axis=1) + 0.08 * bumps

    return function, middle


def random_tile(name: str, seed: int, cubes: int = 500) -> tuple[CellTile, Function]:
    """Return the ball of cells of a random function, and the function.

    As in a search, another grid is tried where one does not close.
    """
    group = group_named(name)
    function, middle = random_function(group, seed)
    for share in (1.0, 0.8, 0.65):
        grid = cell_complex(group, round(share * cubes))
        if (tile := close_tile(function, middle - 1, middle + 1, grid)).is_ball:
            break
    return tile, function


def dirichlet_solid(group: CrystallographicGroup) -> Mesh:
    """Return the points nearer to a site than to its images: each face is a fan about its middle."""
    from scipy.spatial import ConvexHull

    corners = DirichletDomain(group).corners()
    hull = ConvexHull(corners)
    points, faces = list(corners), []
    planes, which = np.unique(hull.equations.round(6), axis=0, return_inverse=True)
    for k, plane in enumerate(planes):
        ring = np.unique(hull.simplices[which == k])
        middle = corners[ring].mean(axis=0)
        first = corners[ring[0]] - middle
        across = np.cross(plane[:3], first)
        offsets = corners[ring] - middle
        angles = np.arctan2(offsets @ across, offsets @ first * np.linalg.norm(plane[:3]))
        ring = ring[np.argsort(angles)]
        faces += [[a, b, len(points)] for a, b in zip(ring, np.roll(ring, -1), strict=True)]
        points.append(middle)
    return Mesh(np.array(points), np.array(faces))


def of_volume_one(mesh: Mesh) -> Mesh:
    """Return a mesh scaled to volume 1 about its centre of mass, which becomes 0."""
    return mesh.moved(np.eye(3), -mesh.centroid).moved(mesh.volume ** (-1 / 3) * np.eye(3))


def ball(segments: int = 48) -> Mesh:
    """Return a ball of volume 1."""
    return of_volume_one(as_mesh(Manifold.sphere(1.0, segments)))


@cache
def creature() -> Mesh:
    """Return a body with a head and two legs, of volume 1."""
    trunk = Manifold.sphere(1.0, 40).scale((1.5, 0.9, 0.8))
    head = Manifold.sphere(0.5, 32).translate((1.7, 0.0, 0.6))
    legs = [Manifold.cylinder(1.5, 0.28, 0.28, 24).translate((x, 0.0, -1.6)) for x in (-0.8, 0.8)]
    whole = trunk + head + legs[0] + legs[1]
    return of_volume_one(as_mesh(whole.refine_to_length(0.2)))


def hooked_tile(*axes: int) -> Mesh:
    """A cube with a T-shaped tab on its faces ahead along some axes, and slots for them behind.

    A tab along axis a is wide along the next axis and runs all along the third: it slides along that.
    """
    body = Manifold.cube((1, 1, 1))
    for axis in axes:
        tab = _block(axis, (1.0, 1.1), (0.45, 0.55)) + _block(axis, (1.1, 1.2), (0.35, 0.65))
        body = (body + tab) - tab.translate((-np.eye(3)[axis]).tolist())
    return as_mesh(body)


def _block(axis: int, deep: tuple[float, float], wide: tuple[float, float]) -> Manifold:
    low, high = np.zeros(3), np.ones(3)
    for along, (start, end) in ((axis, deep), ((axis + 1) % 3, wide)):
        low[along], high[along] = start, end
    return Manifold.cube((high - low).tolist()).translate(low.tolist())
