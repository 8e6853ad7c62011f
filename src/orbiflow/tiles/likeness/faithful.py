"""How faithful a bent outline is to its silhouette, as people judge it, point by point.

People's judgement of bent silhouettes depends on six measures, most of them independent of the pose
(docs/likeness.md has the evidence); a seventh avoids threads that no cutter can make:

- `pieces`: how well pieces of the outline are kept, each compared after its own best motion
  (Procrustes; Gower, 1975), by the mean of the roots: a few pieces may be lost, the rest should be
  exact. Small pieces show corners and toes, middle ones limbs and heads, large ones the whole. The
  weight of a piece is the root of the body's thickness there, larger for a head than for a leg.
- `notches`: where the space outside has become narrower: slits, notches and folds that the
  silhouette does not have. The width is that of the largest disc outside that touches the outline
  (the outer medial axis; found as by Ma, Bae and Choi, 3D medial axis point approximation, 2012).
- `narrowed`: the same inside: limbs and bodies that have become thin.
- `cost`: the cost of bending (`Elastic.cost`): energy, and displacement from the pose.
- `necks`: how much narrower than half the inside has become at its worst place: threads.

Outlines correspond point by point: this compares a shape with the one that was bent into it.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import as_array
from orbiflow.arrays import Array, Complex
from orbiflow.tiles.geometry import centroid, complex_points, orient, plane_points, signed_area
from orbiflow.tiles.likeness.bending_onto import bent_onto
from orbiflow.tiles.likeness.elastic import Elastic
from orbiflow.tiles.likeness.metrics import Overlap, as_region, best_overlay
from orbiflow.tiles.silhouette import sampled

PIECE_LENGTHS = (0.04, 0.15, 0.4)  # the lengths of the pieces, as shares of the outline
# the offset of widths, in square roots of the area, below which differences matter little
WIDTH_OFFSET = 0.02
# the values of three pieces, `notches`, `narrowed` and `cost` in a tile of medium likeness
USUAL_VALUES = (0.12, 0.16, 0.13, 0.3, 0.037, 0.25)
# the weights of their logarithms, the inverse of how much these vary over a silhouette's tiles
WEIGHTS = (6.5, 6.5, 6.5, 2.6, 2.3, 6.5)
NEGLIGIBLE_SHARE = 0.3  # the share of the usual values below which differences matter little


@dataclass(frozen=True)
class Fidelity:
    """How much of an outline is kept in its bending. Values are from 0; smaller is better.

    - `pieces`: The misfits of pieces of three lengths, small to large.
    - `notches`, `narrowed`, `necks`, `cost`: See the module.
    """

    pieces: tuple[float, float, float]
    notches: float
    narrowed: float
    necks: float
    cost: float

    @property
    def damage(self) -> float:
        """The overall damage, about 0 for a tile of medium likeness; smaller is better.

        `necks` plus the weighted logarithms of the other values, relative to usual ones.
        """
        values = (*self.pieces, self.notches, self.narrowed, self.cost)
        relative = [value / usual for value, usual in zip(values, USUAL_VALUES, strict=True)]
        parts = np.log((NEGLIGIBLE_SHARE + np.array(relative)) / (NEGLIGIBLE_SHARE + 1))
        return self.necks + float(np.dot(WEIGHTS, parts))

    @property
    def score(self) -> float:
        """The score 1 / (1 + exp(damage / 4)), larger is better.

        It is 0.5 for a tile of medium likeness and 1 for no change.
        """
        return 1 / (1 + math.exp(min(self.damage / 4, 700.0)))


def fidelity(rest: Complex, bent: Complex, cost: float) -> Fidelity:
    """Compare an outline with what it was bent from, at a cost `Elastic.cost`.

    Outlines (n,) x + iy are counter-clockwise and nearly evenly spaced, and their points correspond.

    >>> square = np.array([0, 1, 2, 2 + 1j, 2 + 2j, 1 + 2j, 2j, 1j])
    >>> fidelity(square, 3 * square * 1j + 7, 0.0).score > 0.999
    True
    """
    rest, bent = (z / np.sqrt(abs(signed_area(plane_points(z)))) for z in (rest, bent))
    weight = abs(np.roll(rest, -1) - rest)
    weight /= weight.sum()
    outside = np.log(_clearance(rest) / _clearance(bent))
    thick = _clearance(rest, inside=True)
    inside = np.log(thick / _clearance(bent, inside=True))
    small, middle, large = (
        float(np.average(np.sqrt(_misfits(rest, bent, length)), weights=np.sqrt(thick)))
        for length in PIECE_LENGTHS
    )
    return Fidelity(
        (small, middle, large),
        float((weight * np.maximum(outside, 0) ** 2).sum()),
        float((weight * np.maximum(inside, 0) ** 2).sum()),
        max(0.0, float(inside.max()) - math.log(2.0)),
        cost,
    )


def _misfits(rest: Complex, bent: Complex, length: float) -> Array:
    """Return, for the piece about each point, the misfit (n,) after the best motion, 0 to 1."""
    n = len(rest)
    half = min(max(3, round(length * n / 2)), (n - 1) // 2)
    index = (np.arange(n)[:, None] + np.arange(-half, half + 1)) % n
    a, b = rest[index], bent[index]
    a, b = a - a.mean(axis=1, keepdims=True), b - b.mean(axis=1, keepdims=True)
    sizes = (abs(a) ** 2).sum(axis=1) + (abs(b) ** 2).sum(axis=1)
    common = abs((np.conj(a) * b).sum(axis=1))
    return np.maximum(1 - 2 * common / sizes, 0.0)


def _clearance(z: Complex, *, inside: bool = False) -> Array:
    """Return the radius (n,) of the largest disc outside that touches each point, at most 1."""
    z = z[::-1] if inside else z
    n = len(z)
    along = np.roll(z, -1) - np.roll(z, 1)
    inward = 1j * along / np.maximum(abs(along), 1e-300)
    apart = z[None, :] - z[:, None]
    depth = -(np.conj(inward)[:, None] * apart).real
    with np.errstate(divide="ignore"):
        radius = np.where(depth > 1e-9, abs(apart) ** 2 / (2 * np.maximum(depth, 1e-9)), np.inf)
    own = np.arange(n)
    for near in range(-2, 3):
        radius[own, (own + near) % n] = np.inf
    least = np.minimum(radius.min(axis=1), 1.0)
    smooth = (np.roll(least, 1) + 2 * least + np.roll(least, -1)) / 4 + WIDTH_OFFSET
    return smooth[::-1] if inside else smooth


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
    own, other = _ring(silhouette, "the silhouette"), _ring(shape, "the shape")
    body, overlap = _body(own.tobytes())
    z = complex_points(other)
    turns = np.exp(2j * np.pi * np.arange(TURNS) / TURNS).tolist()
    rough = [
        (overlap.iou(plane_points(turn * ring))[0], turn, ring)
        for ring in ([z, np.conj(z[::-1])] if mirror else [z])
        for turn in turns
    ]
    rough.sort(key=lambda overlay: -overlay[0])
    found: list[tuple[float, Complex]] = []
    for _, turn, ring in rough[:REFINED_TURNS]:
        factor, middle, _ = best_overlay(ring, overlap, turn)
        z = bent_onto(body, plane_points(factor * ring + middle))[:, None]
        found.append((float(body.cost(z)[0]), z[: body.size, 0]))
    cost, outline = min(found, key=lambda one: one[0])
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
