"""From where a surface in space is seen first, so that a place on it is in front."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from torch import Tensor

from orbiflow.density.spaces.space import Space
from orbiflow.figures.immersions import immersion, mesh, normals
from orbiflow.symmetry.isometry import Array

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
