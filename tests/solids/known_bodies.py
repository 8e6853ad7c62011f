"""Closed meshes whose measures are known."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold

from orbiflow.solids import Mesh
from orbiflow.solids.bodies import as_mesh


def of_volume_one(mesh: Mesh) -> Mesh:
    """Return a mesh scaled to volume 1 about its centre of mass, which becomes 0."""
    return mesh.moved(np.eye(3), -mesh.centroid).moved(mesh.volume ** (-1 / 3) * np.eye(3))


def ball(segments: int = 48) -> Mesh:
    """Return a ball of volume 1."""
    return of_volume_one(as_mesh(Manifold.sphere(1.0, segments)))


def creature() -> Mesh:
    """Return a body with a head and two legs, of volume 1."""
    trunk = Manifold.sphere(1.0, 40).scale((1.5, 0.9, 0.8))
    head = Manifold.sphere(0.5, 32).translate((1.7, 0.0, 0.6))
    legs = [Manifold.cylinder(1.5, 0.28, 0.28, 24).translate((x, 0.0, -1.6)) for x in (-0.8, 0.8)]
    whole = trunk + head + legs[0] + legs[1]
    return of_volume_one(as_mesh(whole.refine_to_length(0.2)))
