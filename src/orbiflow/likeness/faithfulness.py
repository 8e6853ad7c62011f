"""How much of a silhouette is left in any other shape, wherever its limbs point.

`fidelity` compares outlines point by point; here only the shape is known. It is laid over the
silhouette by the similarity of largest IoU, points correspond so that bending the one into the other
costs least (`laid_on`), and what that leaves of the outline is the `Fidelity`. So no pose counts, a
bent limb costs little, and lost, merged and spurious parts cost what they cost in a bent tile.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import numbers
from orbiflow.geometry import centroid, complex_points, orient, plane_points, signed_area
from orbiflow.likeness.elastic import Array, Complex, Elastic
from orbiflow.likeness.fidelity import Fidelity, fidelity
from orbiflow.likeness.laid import laid_on
from orbiflow.likeness.metrics import as_region
from orbiflow.likeness.overlap import Overlap, overlaid
from orbiflow.silhouette.sampling import sampled

TURNS = 24
"""Turns of either hand that are tried, of which the best `TRIED` are worked out."""

TRIED = 3


def faithfulness(silhouette: ArrayLike, shape: ArrayLike, *, mirror: bool = True) -> Fidelity:
    """What bending a silhouette into a shape would leave of it.

    Some tenths of a second; the silhouette's triangulation is kept for the next shape.

    Args:
        silhouette: (n, 2) its outline, a simple polygon in either sense.
        shape: (m, 2) another one, in any place, size and turn.
        mirror: whether the shape's mirror image is as good.

    Returns:
        The `Fidelity` of the best laying that is found; its `score` is 1 for the same shape, near
        0.5 for a tile of middling likeness.

    Raises:
        OrbiflowError: for a polygon that crosses itself, has no area, or is too thin to sample.

    >>> bar = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [0.0, 1.0]]
    >>> faithfulness(bar, [[5.0, 0.0], [5.0, 8.0], [3.0, 8.0], [3.0, 0.0]]).score > 0.99
    True
    """
    own, other = _ring(silhouette, "the silhouette"), _ring(shape, "the shape")
    body, overlap = _body(own.tobytes())
    turns = np.exp(2j * np.pi * np.arange(TURNS) / TURNS).tolist()
    rough = [
        _Laying(overlap.iou(plane_points(turn * ring))[0], turn, ring)
        for ring in _hands(other, mirror=mirror)
        for turn in turns
    ]
    rough.sort(key=lambda laying: -laying.iou)
    found: list[tuple[float, Complex]] = []
    for laying in rough[:TRIED]:
        factor, middle, _ = overlaid(laying.ring, overlap, laying.turn)
        z = laid_on(body, plane_points(factor * laying.ring + middle))[:, None]
        found.append((float(body.cost(z)[0]), z[: body.size, 0]))
    cost, outline = min(found, key=lambda one: one[0])
    return fidelity(body.rest[: body.size], outline, cost)


class _Laying(NamedTuple):
    """A ring (m,) about the origin, of area 1, turned by `turn`, and its IoU with the silhouette."""

    iou: float
    turn: complex
    ring: Complex


def _hands(ring: Array, *, mirror: bool) -> list[Complex]:
    z = complex_points(ring)
    return [z, np.conj(z[::-1])] if mirror else [z]


def _ring(points: ArrayLike, what: str) -> Array:
    """(n, 2) counter-clockwise about the origin, of area 1."""
    as_region(points, what)
    ring = orient(numbers(points, what, ("N", 2)), counter_clockwise=True)
    return np.ascontiguousarray((ring - centroid(ring)) / np.sqrt(signed_area(ring)))


@lru_cache(maxsize=4)
def _body(outline: bytes) -> tuple[Elastic, Overlap]:
    ring = np.frombuffer(outline).reshape(-1, 2).copy()
    return Elastic(sampled(ring).fine), Overlap(ring)
