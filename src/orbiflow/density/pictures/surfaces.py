"""Surfaces in space for the four identification spaces: functions of chart points.

Every function takes chart points (N, 2), anywhere in the plane, to points (N, 3) of a surface, and
identified points to the same point. Torus and sphere are embedded; the Klein bottle and the
projective plane cannot be, and cross themselves along curves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, cast

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.spaces import RoundSpace, Space
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup

RING_RADIUS, TUBE_RADIUS = 1.0, 0.45
"""Of the torus: of its centre line, and of its tube."""

KLEIN_RADIUS = 2.2
"""Of the circle along which the figure eight is carried; above 2, so that the middle stays open."""

MAX_RESOLUTION = 250
"""Cells along an edge: their corners are numbered in 16 bits."""


class Mesh(NamedTuple):
    """Triangles of the canonical square.

    - `points`: chart points (N, 2), float64, the square's edges included.
    - `triangles`: (M, 3) indices into them, int64.
    """

    points: Tensor
    triangles: Array


def torus_ring(points: Tensor) -> Array:
    """Ring ((R + r cos 2 pi y) cos 2 pi x, (R + r cos 2 pi y) sin 2 pi x, r sin 2 pi y)."""
    u, v = _turns(points)
    radius = RING_RADIUS + TUBE_RADIUS * np.cos(v)
    return np.stack([radius * np.cos(u), radius * np.sin(u), TUBE_RADIUS * np.sin(v)], axis=-1)


def klein_figure_eight(points: Tensor) -> Array:
    """The figure-8 immersion: a figure eight that makes half a turn on its way round a circle.

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
    """Boy's surface of axes given as unit vectors (N, 3): the same for a vector and its opposite.

    Of the parametrisation of R. Bryant and R. Kusner (Kusner, Conformal geometry and complete minimal
    surfaces, 1987): with w in the unit disc and D = w^6 + sqrt(5) w^3 - 1,
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
    """The surface of a two-dimensional space: chart points (N, 2) to points (N, 3).

    A ring for the torus, the unit sphere in the user's frame (`Sphere.vectors`), the figure-8
    immersion for the Klein bottle, Boy's surface for the projective plane.

    Raises:
        OrbiflowError: for a space that has no surface here.
    """
    if space.name not in _IMMERSIONS or space.dim != 2:
        raise OrbiflowError(f"only spaces of two dimensions have a surface, not {space!r}")
    return _IMMERSIONS[space.name](space)


def of_vectors(space: Space) -> Callable[[Array], Array]:
    """The surface of a round space as a function of unit vectors (N, 3) in the data's frame."""
    return boy_surface if space.name == "projective-plane" else np.asarray


def _of_round(space: Space) -> Callable[[Tensor], Array]:
    vectors, surface = cast(RoundSpace, space).vectors, of_vectors(space)
    return lambda points: surface(vectors(points))


_IMMERSIONS: dict[str, Callable[[Space], Callable[[Tensor], Array]]] = {
    "torus": lambda _: torus_ring,
    "klein-bottle": lambda _: klein_figure_eight,
    "sphere": _of_round,
    "projective-plane": _of_round,
}


def mesh(space: Space, resolution: int) -> Mesh:
    """An even grid on the canonical square, cut into 2 resolution^2 triangles.

    The groups take the grid's points on the edges to each other, so the surface closes.

    Args:
        resolution: cells along an edge, 2 to `MAX_RESOLUTION`.

    Raises:
        OrbiflowError: for another resolution, or a space that is not two-dimensional.
    """
    immersion(space)
    if isinstance(resolution, bool) or not 2 <= resolution <= MAX_RESOLUTION:
        raise OrbiflowError(f"resolution must be 2 to {MAX_RESOLUTION}, got {resolution!r}")
    t = torch.linspace(0.0, 1.0, resolution + 1, dtype=torch.float64)
    points = torch.stack(torch.meshgrid(t, t, indexing="ij"), dim=-1).reshape(-1, 2)
    number = np.arange((resolution + 1) ** 2).reshape(resolution + 1, -1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    corners = np.stack([a, b, c, a, c, d], axis=-1)
    return Mesh(points, corners.reshape(-1, 3))


class EdgePair(NamedTuple):
    """Two edges of the square that are one: (2, 2) each, from start to end in the same sense."""

    first: Array
    second: Array


def edge_pairs(group: CrystallographicGroup) -> list[EdgePair]:
    """The edges of the unit square that `group` identifies.

    Of neighbouring edges, both start at the corner where they meet.
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    edges = [corners[[0, 3]], corners[[1, 2]], corners[[0, 1]], corners[[3, 2]]]
    middle = np.full(2, 0.5)
    pairs: list[EdgePair] = []
    for g in group.elements_near(middle, 1.5, source=middle)[1:]:
        for k, edge in enumerate(edges):
            for other in edges[k + 1 :]:
                image = g(edge)
                if np.allclose(image.mean(axis=0), other.mean(axis=0)):
                    turn = -1 if np.allclose(image[1], edge[1]) else 1
                    pairs.append(EdgePair(edge[::turn].copy(), image[::turn].copy()))
    return pairs


def off_cones(points: Tensor, margin: float = 1e-3) -> Tensor:
    """Chart points (N, 2) of the square, those within `margin` of a corner moved inwards by it.

    At the cone points of sphere and projective plane the area factor is 0, a density is 0/0 there.
    """
    inward = 0.5 - points
    near = inward.abs().amin(dim=-1, keepdim=True) > 0.5 - margin
    return torch.where(near, points + margin * inward.sign(), points)


def normals(space: Space, points: Tensor) -> Array:
    """Unit normals (N, 3) of the immersed surface at points (N, 2) of the square.

    Continuous over the square, and up to the sign over its edges.
    """
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
_WIDTH, _AROUND, _NEAR = 0.06, 0.18, 0.12
"""In radii: what is within the first of a line of sight, and beyond the last, hides the place; within
the second, what is around the place."""


class Viewpoint(NamedTuple):
    """Where the eye is: `EYE` (cos p cos y, cos p sin y, sin p) radii from the surface's centre.

    - `yaw`, `pitch`: y and p, in radians.
    - `cut`: how much of the surface is cut away in front, as the page's slider has it: what is above
      depth 1 - cut / 50, in radii towards the eye; nothing at 0.
    """

    yaw: float
    pitch: float
    cut: float = 0.0


def viewpoint(space: Space, place: Tensor) -> Viewpoint:
    """An eye that looks at a place of the space's surface.

    Nothing hides the place, and the surface is seen as much from the front as can be. Rings are never
    seen from their edge, nor globes from their poles. Boy's surface encloses some places: for these
    the front is cut away.

    Args:
        space: of two dimensions.
        place: chart point (2,).

    Raises:
        OrbiflowError: for a space without a surface.
    """
    surface = immersion(space)
    cloud = surface(mesh(space, _RESOLUTION).points)
    center = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
    radius = float(np.linalg.norm(cloud - center, axis=1).max())
    spot = (surface(place[None])[0] - center) / radius
    normal = normals(space, place[None])[0]
    angles = _candidates(space, spot)
    toward = _directions(angles)
    sight = EYE * toward - spot
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    relative = (cloud - center) / radius - spot
    along = relative @ sight.T
    aside = (relative**2).sum(axis=1)[:, None] - along**2
    before = along > _NEAR
    hidden, crowded = ((before & (aside < w**2)).any(axis=0) for w in (_WIDTH, _AROUND))
    # rather near than through a hole; of equals from above: that is how rings are drawn
    score = abs(sight @ normal) - 2.0 * hidden - 0.5 * crowded + 0.3 * toward @ spot
    score += 0.02 * np.sign(angles[:, 1])
    best = int(score.argmax())
    depth = min(1.0, float(toward[best] @ spot) + _NEAR / 2)
    return Viewpoint(*angles[best].tolist(), cut=50 * (1 - depth) if hidden[best] else 0.0)


def _candidates(space: Space, spot: Array) -> Array:
    """(M, 2) angles: all round, and heights at which the surface is recognised."""
    yaw = np.arctan2(spot[1], spot[0]) + np.linspace(0, 2 * np.pi, 36, endpoint=False)
    pitch = _HEIGHTS[space.name](spot)
    return np.stack(np.meshgrid(yaw, pitch, indexing="ij"), axis=-1).reshape(-1, 2)


def _ring(spot: Array) -> Array:
    del spot
    return np.concatenate([s * np.linspace(0.4, 1.2, 9) for s in (1, -1)])


def _globe(spot: Array) -> Array:
    own = float(np.arctan2(spot[2], np.hypot(spot[0], spot[1])))
    return np.clip([own], -0.9, 0.9)


def _any(spot: Array) -> Array:
    del spot
    return np.linspace(-1.2, 1.2, 17)


_HEIGHTS: dict[str, Callable[[Array], Array]] = {
    "torus": _ring,
    "klein-bottle": _ring,
    "sphere": _globe,
    "projective-plane": _any,
}
"""Pitches that are tried for a place on the surface, by the name of the space."""


def _directions(angles: Array) -> Array:
    yaw, pitch = angles.T
    return np.stack([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)], -1)
