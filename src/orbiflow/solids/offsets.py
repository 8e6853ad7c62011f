"""Bodies a little smaller or larger all around, so that printed copies go together."""

from __future__ import annotations

import numpy as np
import scipy.sparse
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.solids.bodies import as_body
from orbiflow.solids.mesh import Mesh

MITRE = 2.0
"""How far a corner moves at most, as a multiple of the distance."""

TRIES = 12
"""How often corners whose faces would turn over are moved less."""

MOST_TURNED = 0.5
"""Share of a surface whose faces may turn over before they are moved less."""


def offset_body(mesh: Mesh, distance: float) -> Manifold:
    """Return the body of a closed mesh with its faces moved by a distance: outwards, or inwards if < 0.

    Each point moves so that all faces about it do, as far as a point can. Where a part is too thin and
    faces would turn over, its points move less. What is made smaller is cut with the whole, and what
    is made larger joined to it, so that the one always holds the other.

    Raises `OrbiflowError` if the distance is too great for most of the body.
    """
    whole = as_body(mesh)
    if distance == 0:
        return whole
    steps, kept = distance * _unit_offsets(mesh), np.ones((len(mesh.points), 1))
    areas = np.linalg.norm(mesh.face_vectors, axis=1)
    moved = Mesh(mesh.points + steps, mesh.faces)
    turned = _turned(moved, mesh)
    if moved.volume <= 0 or areas[turned].sum() > MOST_TURNED * areas.sum():
        raise OrbiflowError(
            f"nothing is left of the solid {abs(distance):.3g} mm inside its surface; choose a larger "
            "size or a smaller clearance"
        )
    for _ in range(TRIES):
        if not turned.any():
            break
        kept[np.unique(mesh.faces[turned])] *= 0.5
        moved = Mesh(mesh.points + kept * steps, mesh.faces)
        turned = _turned(moved, mesh)
    grown = whole + as_body(moved) if distance > 0 else whole ^ as_body(moved)
    parts = grown.decompose()
    return max(parts, key=lambda part: part.volume()) if len(parts) > 1 else grown


def _turned(moved: Mesh, mesh: Mesh) -> Array:
    """Return which faces (M,) of a mesh have turned over."""
    return np.einsum("ij,ij->i", moved.face_vectors, mesh.face_vectors) <= 0


def _unit_offsets(mesh: Mesh) -> Array:
    """Return for each point the shift (N, 3) by which the planes of all faces about it move by 1.

    With more than three planes that is a compromise, faces counted by their angle at the point, and a
    sharp corner moves by `MITRE` at most.
    """
    normals = mesh.face_vectors
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    corners = mesh.corners
    angles = np.zeros((len(mesh.faces), 3))
    for k in range(3):
        first, second = (corners[:, (k + j) % 3] - corners[:, k] for j in (1, 2))
        lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        cosines = np.einsum("ij,ij->i", first, second) / np.maximum(lengths, 1e-300)
        angles[:, k] = np.arccos(np.clip(cosines, -1, 1))
    shape = len(mesh.points), len(mesh.faces)
    rows, columns = mesh.faces.ravel(), np.repeat(np.arange(len(mesh.faces)), 3)
    sums = scipy.sparse.csr_matrix((angles.ravel(), (rows, columns)), shape)
    squares = sums @ (normals[:, :, None] * normals[:, None]).reshape(-1, 9)
    total = np.maximum(np.asarray(sums.sum(axis=1)).reshape(-1, 1, 1), 1e-300)
    # along directions that no face has, a point stays
    matrices = squares.reshape(-1, 3, 3) / total + 1e-3 * np.eye(3)
    offsets = np.linalg.solve(matrices, (sums @ normals)[:, :, None] / total)[:, :, 0]
    lengths = np.linalg.norm(offsets, axis=1, keepdims=True)
    return offsets * np.minimum(1.0, MITRE / np.maximum(lengths, 1e-300))
