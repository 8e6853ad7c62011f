"""Meshes as bodies of manifold3d, which unites, cuts and simplifies them, and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import ArrayLike

from orbiflow.errors import OrbiflowError
from orbiflow.solids.mesh import Mesh


def as_body(mesh: Mesh) -> Manifold:
    """Return a closed mesh as a body.

    Raises `OrbiflowError` for a mesh that is not closed, or whose faces are not all turned one way.
    """
    faces = np.ascontiguousarray(mesh.faces, np.uint64)
    body = Manifold(Mesh64(np.ascontiguousarray(mesh.points), faces))
    if body.status() != Error.NoError:
        raise OrbiflowError(f"the mesh is not the surface of a body: {body.status().name}")
    return body


def as_mesh(body: Manifold) -> Mesh:
    """Return the surface of a body."""
    mesh = body.to_mesh64()
    points = np.array(mesh.vert_properties)[:, :3]
    return Mesh(points, np.array(mesh.tri_verts).astype(np.int64))


def united(bodies: Sequence[Manifold]) -> Manifold:
    """Return the union of bodies."""
    return Manifold.batch_boolean(list(bodies), OpType.Add)


def moved_body(body: Manifold, linear: ArrayLike, shift: ArrayLike = (0.0, 0.0, 0.0)) -> Manifold:
    """Return a body under x -> linear x + shift; its faces turn if that is a reflection."""
    return body.transform(np.column_stack([np.asarray(linear, float), np.asarray(shift, float)]))


def common_volume(body: Manifold, other: Manifold) -> float:
    """Return the volume that two bodies share."""
    return abs((body ^ other).volume())
