"""From a silhouette to its tile as rigidly as can be: what is seen when it bends.

Each triangle turns and stretches evenly on its way, and the points follow as well as they can (Alexa,
Cohen-Or and Levin, As-rigid-as-possible shape interpolation, 2000): limbs swing, where straight lines
would make them shrink and grow again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from orbiflow.errors import OrbiflowError
from orbiflow.escher.carried import Bending
from orbiflow.symmetry.isometry import Array


class BendingWay:
    """Silhouettes on the way from the one at rest to the tile.

    Args:
        bending: the map between the two.

    Raises:
        OrbiflowError: if its triangles have no single outline.
    """

    def __init__(self, bending: Bending) -> None:
        self.rest, self.images = bending.rest, bending.images
        triangles = bending.triangles
        self.ring = _outline(triangles)
        corners, images = self.rest[triangles], self.images[triangles]
        sides, moved = (
            np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]], axis=2) for c in (corners, images)
        )
        inverse = np.linalg.inv(sides)
        linear = moved @ inverse
        # polar decomposition of 2 x 2 matrices that turn nothing over
        self._angle = np.arctan2(
            linear[:, 1, 0] - linear[:, 0, 1], linear[:, 0, 0] + linear[:, 1, 1]
        )
        self._angle = _continuous(self._angle)
        self._stretch = _rotations(-self._angle) @ linear
        # rows of a triangle's gradient: J = P @ gradient, P the three corners as columns
        gradient = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        area = np.abs(np.linalg.det(sides))[:, None, None]
        self._gradient, self._triangles = area * gradient, triangles
        blocks = area * gradient @ np.swapaxes(gradient, 1, 2)
        rows = np.repeat(triangles[:, :, None], 3, axis=2)
        columns = np.swapaxes(rows, 1, 2)
        count = len(self.rest)
        matrix = coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
        # the whole may be shifted: hold one point, and shift all afterwards
        anchor = coo_array(([area.mean()], ([0], [0])), shape=(count, count))
        self._solver = splu(csc_array(matrix + anchor))

    def at(self, share: float) -> Array:
        """(n, 2) the outline at 0 (as it is) to 1 (the tile), in the target's normal form."""
        turned = _rotations(share * self._angle)
        linear = turned @ ((1 - share) * np.eye(2) + share * self._stretch)
        pull = self._gradient @ np.swapaxes(linear, 1, 2)
        right = np.zeros_like(self.rest)
        np.add.at(right, self._triangles, pull)
        points = self._solver.solve(right)
        middle = (1 - share) * self.rest.mean(axis=0) + share * self.images.mean(axis=0)
        return (points - points.mean(axis=0) + middle)[self.ring]


def _rotations(angles: Array) -> Array:
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


def _continuous(angles: Array) -> Array:
    """Angles within half a turn of their mean direction: beyond it a limb has turned the other way."""
    mean = float(np.angle(np.exp(1j * angles).sum()))
    return mean + np.angle(np.exp(1j * (angles - mean)))


def _outline(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Points of the sides that one triangle alone has, in order."""
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    known = {(int(a), int(b)) for a, b in ends}
    after = {a: b for a, b in known if (b, a) not in known}
    ring = [min(after)]
    while len(ring) <= len(after) and (follower := after[ring[-1]]) != ring[0]:
        ring.append(follower)
    if len(ring) != len(after):
        raise OrbiflowError("the bending's triangles do not fill one outline")
    return np.array(ring)
