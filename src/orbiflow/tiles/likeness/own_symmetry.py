"""How near a silhouette is to a symmetry of its own: what is left of it if it bends into one.

The silhouette is bent, as a search bends it, until its outline is its own image in a mirror or under
a half-turn. It need not tile, so this is about the most that a tile with that symmetry can keep.
"""

from typing import NamedTuple

import numpy as np
import shapely

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.geometry import plane_points
from orbiflow.tiles.likeness.elastic import Elastic
from orbiflow.tiles.likeness.faithful import fidelity
from orbiflow.tiles.likeness.metrics import iou
from orbiflow.tiles.silhouette import sampled

MAX_PAIRINGS = 12  # mirrors that are tried, by how well the directions of the outline agree
SPRING_STRENGTHS = tuple(np.geomspace(1.2, 3000.0, 9))  # strengths, stage by stage
ROUNDS = 3  # steps in each stage
NEAR_SYMMETRIC_SCORE = 0.77  # a silhouette is near to symmetric from here; docs/likeness.md


class NearSymmetry(NamedTuple):
    """Scores of a silhouette bent into a symmetric shape, times its IoU with the silhouette, 0 to 1."""

    mirror: float
    half_turn: float

    @property
    def stabiliser(self) -> str:
        """The symmetry that it nearly has: "D1" for a mirror, "C2" for a half-turn, "C1" for none."""
        if max(self) < NEAR_SYMMETRIC_SCORE:
            return "C1"
        return "D1" if self.mirror >= self.half_turn - 1e-9 else "C2"  # equal up to rounding


def near_symmetry(outline: Array) -> NearSymmetry:
    """Return how near a counter-clockwise outline (N, 2) of area 1 is to a mirror and a half-turn.

    >>> bar = np.array([[-1.0, -0.25], [1.0, -0.25], [1.0, 0.25], [-1.0, 0.25]])
    >>> near_symmetry(bar).stabiliser
    'D1'
    """
    body = Elastic(sampled(outline).coarse)
    ring = body.rest[: body.size]
    steps, points = np.roll(ring, -1) - ring, np.arange(body.size)
    sums = (np.arange(body.size)[:, None] - points) % body.size  # point i is the image of c - i
    agreement = abs((steps * steps[sums - 1]).sum(axis=1))
    mirrors = sums[np.argsort(-agreement, kind="stable")[:MAX_PAIRINGS]]
    opposite = (points + body.size // 2)[None] % body.size
    return NearSymmetry(
        _score(body, mirrors, mirrored=True), _score(body, opposite, mirrored=False)
    )


def _score(body: Elastic, images: Integers, *, mirrored: bool) -> float:
    """Return the best score of the body bent until its points (C, n) are images of each other."""
    z = np.repeat(body.rest[:, None], len(images), axis=1)
    for strength in SPRING_STRENGTHS:
        for _ in range(ROUNDS):
            goal = _symmetric(z[: body.size].T, images, mirrored=mirrored)
            z = body.pulled(z, goal.T, strength, 1)
    costs = body.cost(z)
    best, n = int(np.argmin(costs)), body.size
    score = fidelity(body.rest[:n], z[:n, best], float(costs[best])).score
    rings = (plane_points(shape[:n] - shape[:n].mean()) for shape in (body.rest, z[:, best]))
    before, after = (shapely.Polygon(ring).buffer(0) for ring in rings)
    return score * iou(before, after)


def _symmetric(outlines: Complex, images: Integers, *, mirrored: bool) -> Complex:
    """Return the symmetric outlines (C, n) that are nearest to these."""
    middle = outlines.mean(axis=1, keepdims=True)
    centered = outlines - middle
    other = np.take_along_axis(centered, images, axis=1)
    if not mirrored:
        return middle + (centered - other) / 2
    axis = np.exp(1j * np.angle((centered * other).sum(axis=1, keepdims=True)))
    return middle + (centered + axis * np.conj(other)) / 2
