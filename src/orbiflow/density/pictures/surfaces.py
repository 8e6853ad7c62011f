"""Surfaces in space for the four identification spaces, and where to look at them from.

A surface is a function that takes chart points (N, 2), anywhere in the plane, to points (N, 3) in
space, and identified points to the same point. Torus and sphere are embedded; the Klein bottle and
the projective plane cannot be, and cross themselves along curves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arguments import as_whole
from orbiflow.arrays import Array
from orbiflow.density.spaces import RoundSpace, Space
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup

RING_RADIUS, TUBE_RADIUS = 1.0, 0.45
"""Radii of the torus: of its centre line, and of its tube."""

KLEIN_RADIUS = 2.2
"""Radius of the circle that carries the figure eight; above 2, so that the middle stays open."""

MAX_RESOLUTION = 250
"""Cells along an edge at most: their corners are numbered in 16 bits."""


class Mesh(NamedTuple):
    """Chart points (N, 2) of the square, edges included, and triangles (M, 3), numbers of points."""

    points: Tensor
    triangles: Array


def torus_ring(points: Tensor) -> Array:
    """Return ((R + r cos 2 pi y) cos 2 pi x, (R + r cos 2 pi y) sin 2 pi x, r sin 2 pi y)."""
    u, v = _turns(points)
    radius = RING_RADIUS + TUBE_RADIUS * np.cos(v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), TUBE_RADIUS * np.sin(v)], axis=-1)


def klein_figure_eight(points: Tensor) -> Array:
    """Return points of a figure eight that makes half a turn on its way round a circle.

    With u = 2 pi y and v = 2 pi x, ((R + s) cos u, (R + s) sin u, t) where
    s = cos(u/2) sin v - sin(u/2) sin 2v and t = sin(u/2) sin v + cos(u/2) sin 2v (Banchoff; Wolfram
    MathWorld, "Klein Bottle"). u + 2 pi changes the sign of both, and so does -v.
    """
    v, u = _turns(points)
    cos, sin = np.cos(u / 2), np.sin(u / 2)
    radius = KLEIN_RADIUS + cos * np.sin(v) - sin * np.sin(2 * v)
    height = sin * np.sin(v) + cos * np.sin(2 * v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), height], axis=-1)


def boy_surface(vectors: Array) -> Array:
    """Return points of Boy's surface for axes given as unit vectors (N, 3).

    A vector and its opposite have the same point. In the parametrisation of R. Bryant and R. Kusner
    (Kusner, Conformal geometry and complete minimal surfaces, 1987), with w in the unit disc and
    D = w^6 + sqrt(5) w^3 - 1,
    g1 = -3/2 Im(w (1 - w^4) / D), g2 = -3/2 Re(w (1 + w^4) / D), g3 = Im((1 + w^6) / D) - 1/2, the
    point is g / |g|^2. It is the same at w and -1 / conj(w). The axis of the threefold symmetry is
    that of the third coordinate.
    """
    x, y, z = np.where(vectors[:, 2:] > 0, -vectors, vectors).T
    w = (x + 1j * y) / (1 - z)
    d = w**6 + math.sqrt(5) * w**3 - 1
    # g times |D|^2: finite where D = 0, at the triple point
    g = np.stack(
        [
            -1.5 * (w * (1 - w**4) * d.conj()).imag,
            -1.5 * (w * (1 + w**4) * d.conj()).real,
            ((1 + w**6) * d.conj()).imag - 0.5 * abs(d) ** 2,
        ],
        axis=-1,
    )
    size = np.maximum((g**2).sum(axis=-1), np.finfo(float).tiny)
    return g * (abs(d) ** 2 / size)[:, None]


def immersion(space: Space) -> Callable[[Tensor], Array]:
    """Return the surface of a two-dimensional space: chart points (N, 2) to points (N, 3).

    The torus is a ring, the sphere the unit sphere in the user's frame (`Sphere.vectors`), the Klein
    bottle a figure-8 immersion, the projective plane Boy's surface.
    """
    if space.dim != 2:
        raise OrbiflowError(f"only spaces of two dimensions have a surface, not {space!r}")
    if isinstance(space, RoundSpace):
        surface = vector_immersion(space)
        return lambda points: surface(space.vectors(points))
    return torus_ring if space.is_torus else klein_figure_eight


def vector_immersion(space: Space) -> Callable[[Array], Array]:
    """Return the surface of a round space as a function of unit vectors (N, 3) in the data's frame."""
    return boy_surface if space.name == "projective-plane" else np.asarray


def mesh(space: Space, resolution: int) -> Mesh:
    """Return an even grid on the canonical square, whose edges a group identifies, in triangles."""
    immersion(space)
    as_whole(resolution, "resolution", 2, MAX_RESOLUTION)
    t = torch.linspace(0.0, 1.0, resolution + 1, dtype=torch.float64)
    points = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)
    number = np.arange((resolution + 1) ** 2).reshape(resolution + 1, -1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    corners = np.stack([a, b, c, a, c, d], axis=-1)
    return Mesh(points, corners.reshape(-1, 3))


def edge_pairs(group: CrystallographicGroup) -> list[tuple[Array, Array]]:
    """Return pairs of edges (2, 2) of the unit square that `group` identifies, start with start.

    Neighbouring edges both start at the corner where they meet.
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    edges = [corners[[0, 3]], corners[[1, 2]], corners[[0, 1]], corners[[3, 2]]]
    middle = np.full(2, 0.5)
    pairs: list[tuple[Array, Array]] = []
    for g in group.elements_near(middle, 1.5, source=middle)[1:]:
        for k, edge in enumerate(edges):
            for other in edges[k + 1 :]:
                image = g(edge)
                if np.allclose(image.mean(axis=0), other.mean(axis=0)):
                    turn = -1 if np.allclose(image[1], edge[1]) else 1
                    pairs.append((edge[::turn].copy(), image[::turn].copy()))
    return pairs


def off_cones(points: Tensor, margin: float = 1e-3) -> Tensor:
    """Move chart points (N, 2) within `margin` of a corner inwards: cone points have densities 0/0."""
    inward = 0.5 - points
    near = inward.abs().amin(dim=-1, keepdim=True) > 0.5 - margin
    return torch.where(near, points + margin * inward.sign(), points)


def normals(space: Space, points: Tensor) -> Array:
    """Return unit normals (N, 3) at points (N, 2) of the square, over its edges up to the sign."""
    surface, step = immersion(space), 1e-4
    if space.is_round:
        points = off_cones(points, 4e-3)
    first, second = (
        surface(points + step * axis) - surface(points - step * axis)
        for axis in torch.eye(2, dtype=points.dtype)
    )
    across = np.cross(first, second)
    return across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-300)


def _turns(points: Tensor) -> tuple[Array, Array]:
    x, y = 2 * math.pi * points.detach().double().cpu().numpy().T
    return x, y


EYE = 4.0
"""Distance of the eye from the surface's centre, in radii of the surface; also in the page."""

_RESOLUTION = 100
_HIDES, _CROWDS, _NEAR = 0.06, 0.18, 0.12
"""Distances in radii. What is within the first of a line of sight hides a place, unless it is within
the last of the place itself; what is within the second crowds the place."""


class Viewpoint(NamedTuple):
    """A place of the eye: `EYE` (cos p cos y, cos p sin y, sin p) radii from the surface's centre.

    - `yaw`, `pitch`: The angles y and p, in radians.
    - `cut`: How much of the surface is cut away in front, as the page's slider has it: what is above
      depth 1 - cut / 50, in radii towards the eye; nothing at 0.
    """

    yaw: float
    pitch: float
    cut: float = 0.0


def viewpoint(space: Space, place: Tensor) -> Viewpoint:
    """Return an eye that sees a chart point (2,) on the surface, as much from the front as it can.

    Rings are never seen from their edge, nor globes from their poles. Boy's surface encloses some
    places: for these the front is cut away.
    """
    surface = immersion(space)
    cloud = surface(mesh(space, _RESOLUTION).points)
    center = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
    radius = float(np.linalg.norm(cloud - center, axis=1).max())
    spot = (surface(place[None])[0] - center) / radius
    normal = normals(space, place[None])[0]
    if space.name == "sphere":
        pitch = np.clip([np.arctan2(spot[2], np.hypot(spot[0], spot[1]))], -0.9, 0.9)
    elif space.is_round:
        pitch = np.linspace(-1.2, 1.2, 17)
    else:  # rings are recognised from above or below
        pitch = np.concatenate([s * np.linspace(0.4, 1.2, 9) for s in (1, -1)])
    yaw = np.arctan2(spot[1], spot[0]) + np.linspace(0, 2 * np.pi, 36, endpoint=False)
    angles = np.stack(np.meshgrid(yaw, pitch, indexing="ij"), axis=-1).reshape(-1, 2)
    yaws, pitches = angles.T
    toward = [np.cos(pitches) * np.cos(yaws), np.cos(pitches) * np.sin(yaws), np.sin(pitches)]
    toward = np.stack(toward, axis=-1)
    sight = EYE * toward - spot
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    relative = (cloud - center) / radius - spot
    along = relative @ sight.T
    aside = (relative**2).sum(axis=1)[:, None] - along**2
    before = along > _NEAR
    hidden, crowded = ((before & (aside < w**2)).any(axis=0) for w in (_HIDES, _CROWDS))
    # rather from nearby than through a hole; of equals from above, as rings are usually drawn
    score = abs(sight @ normal) - 2.0 * hidden - 0.5 * crowded + 0.3 * toward @ spot
    score += 0.02 * np.sign(angles[:, 1])
    best = int(score.argmax())
    depth = min(1.0, float(toward[best] @ spot) + _NEAR / 2)
    return Viewpoint(*angles[best].tolist(), cut=50 * (1 - depth) if hidden[best] else 0.0)
