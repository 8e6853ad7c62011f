"""What to know before a solid is printed: its size, its thinnest part, what hangs over, how it lies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from manifold3d import Manifold
from scipy.spatial import ConvexHull

from orbiflow.arrays import Array
from orbiflow.solids.bodies import as_mesh
from orbiflow.solids.mesh import Mesh

STEEP = 45.0
"""Angle in degrees from upright beyond which a face needs a support."""

RAYS = 1500
"""Places on the surface at which the thickness is measured."""

THINNEST_SHARE = 0.005
"""Share of these places that may be thinner than what is called the thinnest part: edges."""

OPPOSITE = 0.8
"""Cosine of the angle from upright within which a line meets an opposite side."""

ON_BED = 0.3
"""Height in mm up to which a face lies on the bed, and needs no support."""


class PrintAdvice(NamedTuple):
    """What to know before a solid is printed.

    - `size`: Width, depth and height (3,) in mm as it lies.
    - `thinnest`: Thickness in mm of its thinnest part.
    - `overhang`: Share of its surface that hangs over by more than 45 degrees.
    - `sentences`: The same in words, with what to do.
    """

    size: Array
    thinnest: float
    overhang: float
    sentences: list[str]


def print_advice(body: Manifold, *, nozzle: float = 0.4, name: str = "The solid") -> PrintAdvice:
    """Return what to know before a body in mm is printed as it lies, z up.

    `nozzle` is the width of the printer's line in mm; `name` begins the sentences.
    """
    mesh = as_mesh(body)
    size = np.ptp(mesh.points, axis=0)
    thinnest, overhang = thinnest_part(body, mesh), overhang_share(mesh, (0.0, 0.0, 1.0))
    sides = " x ".join(f"{side:.0f}" for side in size)
    said = [f"{name} is {sides} mm on the bed and has {body.volume() / 1000:.1f} cm³."]
    if thinnest < 2 * nozzle:
        said.append(
            f"Its thinnest part is about {thinnest:.1f} mm, less than two lines of a {nozzle:g} mm "
            "nozzle: choose a larger size."
        )
    else:
        said.append(f"Its thinnest part is about {thinnest:.1f} mm.")
    if overhang > 0.01:
        said.append(
            f"{100 * overhang:.0f} % of its surface hangs over by more than {STEEP:.0f} degrees: print "
            "it with supports."
        )
    else:
        said.append("It needs no supports.")
    return PrintAdvice(size, thinnest, overhang, said)


def thinnest_part(body: Manifold, mesh: Mesh | None = None) -> float:
    """Return the thickness of a body's thinnest part: on lines inwards, to the opposite side.

    A side is opposite if the line meets it within 37 degrees of upright; what is thinner than that at a
    few places only is an edge.
    """
    mesh = mesh or as_mesh(body)
    lengths = np.linalg.norm(mesh.face_vectors, axis=1)
    # evenly over the surface, the same every time
    share = (np.arange(RAYS) + 0.5) / RAYS
    chosen = np.searchsorted(np.cumsum(lengths) / lengths.sum(), share)
    chosen = chosen[lengths[chosen] > 0]
    inwards = -mesh.face_vectors[chosen] / lengths[chosen, None]
    starts = mesh.corners[chosen].mean(axis=1)
    reach = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    depths = list[float]()
    for start, inward in zip(starts + 1e-6 * reach * inwards, inwards, strict=True):
        hits = body.ray_cast(start.tolist(), (start + reach * inward).tolist())
        if hits and np.dot(np.asarray(hits[0].normal), inward) > OPPOSITE:
            depths.append(float(np.linalg.norm(np.asarray(hits[0].position) - start)))
    return float(np.quantile(depths, THINNEST_SHARE)) if depths else reach


def overhang_share(mesh: Mesh, up: tuple[float, float, float]) -> float:
    """Return the share of a surface in mm that hangs over, if it lies with a direction up."""
    lengths = np.linalg.norm(mesh.face_vectors, axis=1)
    heights = mesh.corners @ np.asarray(up)
    leaning = mesh.face_vectors @ np.asarray(up) < -np.sin(np.radians(STEEP)) * lengths - 1e-12
    hanging = leaning & (heights.max(axis=1) > heights.min() + ON_BED)
    return float(lengths[hanging].sum() / lengths.sum())


def lying(mesh: Mesh) -> Array:
    """Return the rotation (3, 3) by which a mesh in mm lies steadily with the least overhang."""
    hull = ConvexHull(mesh.points)
    middle = mesh.centroid
    best, rotation = np.inf, np.eye(3)
    normals, numbers = np.unique(hull.equations[:, :3].round(4), axis=0, return_inverse=True)
    sizes = np.bincount(numbers.ravel(), _areas(mesh.points[hull.simplices]))
    for number in np.argsort(-sizes, kind="stable")[:24]:
        down = normals[number] / np.linalg.norm(normals[number])
        if not _is_steady(mesh.points[hull.simplices[numbers.ravel() == number]], down, middle):
            continue
        share = overhang_share(mesh, tuple((-down).tolist()))
        if share < best - 1e-9:
            best, rotation = share, _turned_down(down)
    return rotation


def _areas(corners: Array) -> Array:
    return np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )


def _is_steady(corners: Array, down: Array, middle: Array) -> bool:
    """Return whether a body with this centre of mass stands on triangles (n, 3, 3) of its hull."""
    for a, b, c in corners:
        sides = [np.cross(q - p, middle - p) @ down for p, q in ((a, b), (b, c), (c, a))]
        if min(sides) >= 0 or max(sides) <= 0:
            return True
    return False


def _turned_down(down: Array) -> Array:
    """Return the rotation (3, 3) that takes a unit vector to -z."""
    aside = np.cross(down, np.eye(3)[np.abs(down).argmin()])
    aside /= np.linalg.norm(aside)
    return np.stack([aside, np.cross(-down, aside), -down])
