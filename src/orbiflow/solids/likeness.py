"""How much a solid looks like its target: what is shared of space, and of shadows from all sides."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from orbiflow.arrays import Array
from orbiflow.solids.distance import SignedDistance, points_inside
from orbiflow.solids.mesh import Mesh

GRAIN = 0.03  # of space and of shadows, in sides of a cube of the solid's volume
DETAIL = 0.05  # how near the surface must be for a part to be kept
SIDES = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), *((a, b, c) for a in (1,) for b in (1, -1) for c in (1, -1))]
)
"""The directions from which shadows are compared: along the axes and the diagonals of a cube."""


@dataclass(frozen=True)
class SolidLikeness:
    """How much a solid looks like its target; from 0 to 1, larger is better, but for `strain`.

    - `overlap`: Intersection over union (IoU) of both volumes after the best rigid motion.
    - `shadows`: The mean IoU of both shadows from seven directions.
    - `kept`: The share of the bent body's surface, thin parts weighing more, that is on the solid's.
    - `smooth`: The area of the bent body over the solid's, at most 1: crumbs and threads lower it.
    - `strain`: How much the body had to bend: its springs' mean change of length.
    """

    overlap: float
    shadows: float
    kept: float
    smooth: float
    strain: float

    @property
    def score(self) -> float:
        """What solids are ordered by."""
        bent = 1 - min(self.strain, 1.0)
        return self.shadows * (self.kept * bent) ** 0.5 * self.smooth

    def as_dict(self) -> dict[str, float]:
        """Return the same values, ready for JSON."""
        return {**asdict(self), "score": self.score}


def measured(
    tile: Mesh, target: Mesh, bent: Mesh, importance: Array, strain: float
) -> SolidLikeness:
    """Return how much a tile looks like its target.

    Args:
        tile: The solid.
        target: The target over it, moved rigidly.
        bent: The bent body of which the tile was made.
        importance: Of the bent body's points (N,).
        strain: Of the bent body.
    """
    both = [points_inside(mesh, GRAIN) for mesh in (tile, target)]
    cells = [{*map(bytes, np.rint(points / GRAIN).astype(np.int16))} for points in both]
    overlap = len(cells[0] & cells[1]) / len(cells[0] | cells[1])
    shadows = [
        _shadow_overlap(both[0], both[1], side)
        for side in SIDES / np.linalg.norm(SIDES, axis=1)[:, None]
    ]
    away = abs(SignedDistance.of_mesh(tile, GRAIN)(bent.points))
    kept = float(importance @ (away < DETAIL) / importance.sum())
    smooth = min(1.0, bent.area / tile.area)
    return SolidLikeness(overlap, float(np.mean(shadows)), kept, smooth, strain)


def _shadow_overlap(first: Array, second: Array, side: Array) -> float:
    """Return the IoU of the shadows of points (n, 3), which lie evenly, along a direction (3,)."""
    across = np.linalg.svd(side[None])[2][1:]
    flat = [points @ across.T / (1.5 * GRAIN) for points in (first, second)]
    cells = [{*map(bytes, np.floor(shadow).astype(np.int16))} for shadow in flat]
    return len(cells[0] & cells[1]) / len(cells[0] | cells[1])


def rigid_motion(source: Array, image: Array) -> tuple[Array, Array]:
    """Return the rotation (3, 3) and shift (3,) that bring points (n, 3) nearest to their images."""
    a, b = source.mean(axis=0), image.mean(axis=0)
    turn = Rotation.align_vectors(image - b, source - a)[0].as_matrix()
    return turn, b - turn @ a
