"""How faithful any shape is to a silhouette that was not bent into it: it is bent first."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array, Complex
from orbiflow.settings import as_array
from orbiflow.tiles.geometry import centroid, complex_points, orient, plane_points, signed_area
from orbiflow.tiles.likeness.bending_onto import bent_onto
from orbiflow.tiles.likeness.elastic import Elastic
from orbiflow.tiles.likeness.faithful import Fidelity, fidelity
from orbiflow.tiles.likeness.metrics import Overlap, as_region, best_overlay
from orbiflow.tiles.silhouette import sampled

TURNS = 24  # number of rotations tried for each orientation; the best `REFINED_TURNS` are refined
REFINED_TURNS = 3


def faithfulness(silhouette: ArrayLike, shape: ArrayLike, *, mirror: bool = True) -> Fidelity:
    """Return how much of a silhouette would be kept if it were bent into a shape.

    This takes some tenths of a second; the silhouette's triangulation is cached.

    Args:
        silhouette: The outline (n, 2), a simple polygon in either orientation.
        shape: Another one (m, 2), with any position, size and rotation.
        mirror: Whether the shape may be mirrored.

    Returns:
        The `Fidelity` of the best overlay; its `score` is 1 for the same shape, and near 0.5 for a
        tile of medium likeness.

    Raises `OrbiflowError` for a polygon that crosses itself, has no area, or is too thin to sample.

    >>> bar = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [0.0, 1.0]]
    >>> faithfulness(bar, [[5.0, 0.0], [5.0, 8.0], [3.0, 8.0], [3.0, 0.0]]).score > 0.99
    True
    """
    original, other = _ring(silhouette, "the silhouette"), _ring(shape, "the shape")
    body, overlap = _body(original.tobytes())
    z = complex_points(other)
    turns = np.exp(2j * np.pi * np.arange(TURNS) / TURNS).tolist()
    rough = [
        (overlap.iou(plane_points(turn * ring))[0], turn, ring)
        for ring in ([z, np.conj(z[::-1])] if mirror else [z])
        for turn in turns
    ]
    rough.sort(key=lambda overlay: -overlay[0])
    candidates: list[tuple[float, Complex]] = []
    for _, turn, ring in rough[:REFINED_TURNS]:
        factor, middle, _ = best_overlay(ring, overlap, turn)
        z = bent_onto(body, plane_points(factor * ring + middle))[:, None]
        candidates.append((float(body.cost(z)[0]), z[: body.size, 0]))
    cost, outline = min(candidates, key=lambda candidate: candidate[0])
    return fidelity(body.rest[: body.size], outline, cost)


def _ring(points: ArrayLike, what: str) -> Array:
    """Return the ring (n, 2), counter-clockwise about the origin, with area 1."""
    as_region(points, what)
    ring = orient(as_array(points, what, ("N", 2)), counter_clockwise=True)
    return np.ascontiguousarray((ring - centroid(ring)) / np.sqrt(signed_area(ring)))


@lru_cache(maxsize=4)
def _body(outline: bytes) -> tuple[Elastic, Overlap]:
    ring = np.frombuffer(outline).reshape(-1, 2).copy()
    return Elastic(sampled(ring).fine), Overlap(ring)
