"""How much of a silhouette is left in its bent outline, as eyes see it: pose-blind, point by point.

Three of four things together predict what people say of bent silhouettes (docs/likeness.md has the
evidence); the other, `necks`, keeps threads away that no cutter can make:

- `parts`: how well short pieces of the outline are kept, each compared after its own best motion
  (Procrustes; Gower, 1975), by the mean of the roots: a few pieces may be lost, the rest is to be
  exact. Where limbs bend, the pieces between the joints keep their shape.
- `notches`: where the space outside has become narrower than it was: slits, notches and folds that
  the silhouette does not have. The width is that of the largest disc outside that touches the outline
  (the outer medial axis; found as by Ma, Bae and Choi, 3D medial axis point approximation, 2012).
- `necks`: how much narrower the inside has become at its worst place beyond half: threads.
- `moved`: mean squared distance from the best similar copy.

Outlines are given point by point: this compares a shape with what it was bent from, not any two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbiflow.geometry import best_similarity, plane_points, signed_area

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

PIECE = 0.04
"""Length of the pieces, as a share of the outline."""

CLEAR = 0.02
"""Added to widths outside, in square roots of the area: below it, differences matter little."""

POWERS = (5.6, 1.1, 0.5)
"""Of parts, notches and moved in the damage; fitted to blind marks within targets."""

THREADS = 2.0
"""Of necks in the damage, as an exponent."""

USUAL = (0.16, 0.05, 0.004)
"""Their values in a tile of middling likeness."""


@dataclass(frozen=True)
class Fidelity:
    """What bending left of an outline; all values from 0, smaller is better, but for `score`.

    - `parts`, `notches`, `moved`, `necks`: see the module.
    """

    parts: float
    notches: float
    moved: float
    necks: float

    @property
    def score(self) -> float:
        """From 0 to 1, larger is better; 0.5 for a tile of middling likeness, 1 for no change.

        1 / (1 + d^(1/4)), with d the product of the first three over their usual values, each to its
        power, times exp(`THREADS` necks).
        """
        values = (self.parts, self.notches, self.moved)
        damage = sum(
            power * math.log(max(value, 1e-6) / usual)
            for value, usual, power in zip(values, USUAL, POWERS, strict=True)
        )
        damage += THREADS * self.necks
        return 1 / (1 + math.exp(min(damage / 4, 700.0)))


def fidelity(rest: Complex, bent: Complex) -> Fidelity:
    """Compare an outline with what it was bent from.

    Args:
        rest, bent: (n,) x + iy, counter-clockwise, nearly evenly spaced; point k of the one became
            point k of the other.

    >>> square = np.array([0, 1, 2, 2 + 1j, 2 + 2j, 1 + 2j, 2j, 1j])
    >>> fidelity(square, 3 * square * 1j + 7).score > 0.999
    True
    """
    rest, bent = (z / np.sqrt(abs(signed_area(plane_points(z)))) for z in (rest, bent))
    weight = abs(np.roll(rest, -1) - rest)
    weight /= weight.sum()
    narrower = np.log(_clearance(rest) / _clearance(bent))
    thinner = np.log(_clearance(rest, inside=True) / _clearance(bent, inside=True))
    return Fidelity(
        float(np.sqrt(_misfits(rest, bent)).mean()),
        float((weight * np.maximum(narrower, 0) ** 2).sum()),
        _moved(rest, bent),
        max(0.0, float(thinner.max()) - math.log(2.0)),
    )


def _misfits(rest: Complex, bent: Complex) -> Array:
    """(n,) of the piece about each point: squared distance after the best motion, relative, 0 to 1."""
    n = len(rest)
    half = min(max(3, round(PIECE * n / 2)), (n - 1) // 2)
    index = (np.arange(n)[:, None] + np.arange(-half, half + 1)) % n
    a, b = rest[index], bent[index]
    a, b = a - a.mean(axis=1, keepdims=True), b - b.mean(axis=1, keepdims=True)
    sizes = (abs(a) ** 2).sum(axis=1) + (abs(b) ** 2).sum(axis=1)
    common = abs((np.conj(a) * b).sum(axis=1))
    return np.maximum(1 - 2 * common / sizes, 0.0)


def _clearance(z: Complex, *, inside: bool = False) -> Array:
    """(n,) radius of the largest disc outside that touches the outline at each point, at most 1."""
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
    smooth = (np.roll(least, 1) + 2 * least + np.roll(least, -1)) / 4 + CLEAR
    return smooth[::-1] if inside else smooth


def _moved(rest: Complex, bent: Complex) -> float:
    factor = complex(best_similarity(rest, bent))
    apart = (bent - bent.mean()) - factor * (rest - rest.mean())
    return float((abs(apart) ** 2).mean() / max(abs(factor) ** 2, 1e-12))
