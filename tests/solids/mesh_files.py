"""Meshes to try things with, and their files as other programs write them."""

import io
import zipfile
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.solids import Mesh, reading
from orbiflow.solids.bodies import as_mesh
from orbiflow.solids.bounded import read_here
from orbiflow.solids.mesh import joined
from orbiflow.symmetry import CrystallographicGroup

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


def box(
    x: float = 1.0, y: float = 1.0, z: float = 1.0, at: tuple[float, float, float] = (0, 0, 0)
) -> Mesh:
    """A box of these sides, whose least corner is at a place."""
    return as_mesh(Manifold.cube((x, y, z)).translate(at))


def ball(
    radius: float = 1.0, at: tuple[float, float, float] = (0, 0, 0), segments: int = 24
) -> Mesh:
    return as_mesh(Manifold.sphere(radius, segments).translate(at))


def bare_reads(patch: pytest.MonkeyPatch) -> None:
    """Read 3MF and glTF without the process that bounds memory and time, which takes a second."""
    patch.setattr(reading, "read_bounded", read_here)


def inside_out(mesh: Mesh) -> Mesh:
    return Mesh(mesh.points, mesh.faces[:, ::-1])


def stl(mesh: Mesh) -> bytes:
    rows = np.zeros(len(mesh.faces), [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
    rows["c"] = mesh.corners
    return b"solid of another program".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes()


def stl_text(mesh: Mesh) -> bytes:
    lines = ["solid a box"]
    for corners in mesh.corners:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex {:.6e} {:.6e} {:.6e}".format(*corner) for corner in corners]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid a box", ""]).encode()


def obj(mesh: Mesh) -> bytes:
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*point) for point in mesh.points]
    return "\n".join([*lines, *("f {} {} {}".format(*(f + 1)) for f in mesh.faces), ""]).encode()


def three_mf(mesh: Mesh, unit: str = "millimeter", items: str = '<item objectid="1"/>') -> bytes:
    points = "".join('<vertex x="{:.9g}" y="{:.9g}" z="{:.9g}"/>'.format(*p) for p in mesh.points)
    faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in mesh.faces)
    return archive(
        f'<?xml version="1.0"?><model unit="{unit}" xmlns="{CORE}"><resources><object id="1">'
        f"<mesh><vertices>{points}</vertices><triangles>{faces}</triangles></mesh></object>"
        f'<object id="2"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>'
        f"</components></object></resources><build>{items}</build></model>"
    )


def archive(model: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("3D/3dmodel.model", model)
    return buffer.getvalue()


def cubic_group() -> CrystallographicGroup:
    """The translations of the unit cubes."""
    return CrystallographicGroup.generate(np.eye(3), name="P1")


def bumpy_cell(height: Callable[[Array], Array] | None = None, steps: int = 12) -> Mesh:
    """A tile of the unit cubes' translations: opposite faces are displaced alike.

    `height` of places (N, 2) in the unit square vanishes on its edges.
    """
    height = height or (
        lambda uv: 0.12 * np.sin(2 * np.pi * uv[:, 0]) * np.sin(np.pi * uv[:, 1]) ** 2
    )
    grid = np.stack(np.meshgrid(*[np.arange(steps + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange((steps + 1) ** 2).reshape(steps + 1, -1)
    a, b, c, d = (number[i, j].ravel() for i, j in SQUARE)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    sheets = list[Mesh]()
    for axis in range(3):
        points = np.zeros((len(grid), 3))
        points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = (grid / steps).T
        points[:, axis] = height(grid / steps)
        sheets += [Mesh(points, faces[:, ::-1]), Mesh(points + np.eye(3)[axis], faces)]
    whole = joined(sheets)
    points, numbers = np.unique(whole.points.round(9), axis=0, return_inverse=True)
    return Mesh(points, numbers.ravel()[whole.faces])


LESS, MORE = slice(None, -1), slice(1, None)
SQUARE = (LESS, LESS), (MORE, LESS), (MORE, MORE), (LESS, MORE)


def space_tile(
    tile: Mesh, group: CrystallographicGroup | None = None, figure: Mesh | None = None
) -> Any:
    """What is known of a solid, by default of the cubic group, whose figure is by default itself."""
    figure, group = figure or tile, group or cubic_group()
    known = {"group": group, "tile": tile, "target": figure, "bent": figure}
    return SimpleNamespace(**known, millimetres=30.0, upright=np.eye(3))
