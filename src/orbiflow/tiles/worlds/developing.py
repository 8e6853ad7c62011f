"""The conformal map that takes a plane pattern of rotations to a sphere or the hyperbolic plane.

A plane group of rotations is the pattern of a sphere with cone points, its centres of rotation. A world
in which as many centres have other orders is the same surface with other cone points, and there is one
conformal map of the surfaces that keeps the centres. With a coordinate z of the plane and s of the
world's stereographic picture, s is a quotient of solutions of y'' + Q y = 0, with Q as in `potential`
(Schwarz 1873; Poincaré 1884). Two solutions are one spinor; going around a centre multiplies it by a
matrix, and the world's metric is the Hermitian form that all these keep. With three kinds of centres
there always is one. With four, those of half-turns, the free constant of Q is found for which there is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from orbiflow.arrays import Array, Complex
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.worlds.curved import curvature, motions_of_spinors, norms, undone, vectors_of
from orbiflow.tiles.worlds.pattern import Around, Pattern
from orbiflow.tiles.worlds.potential import ROUND, Potential, Series

STEP = 0.4  # of the distance to the next centre, at most, from one series to the next
NEWTON_STEPS, ENOUGH = 40, 1e-13  # for the free constant, times the cell's area
DIFFERENCE = 1e-6  # of the free constant, for its slope
WIDEST = 1e-9  # of a Hermitian form's singular value: motions keep none


@dataclass(frozen=True, eq=False)
class Way:
    """Points along a straight line, each within reach of the next one's series."""

    around: Around

    @classmethod
    def of(cls, pattern: Pattern, start: complex, end: complex) -> Way:
        """Return the way from one point to another; it must not come to a centre."""
        places = [start]
        while True:
            here = places[-1]
            step = STEP * float(np.abs(pattern.to_centres(np.array([here]))).min())
            if abs(end - here) <= step:
                break
            places.append(here + step * (end - here) / abs(end - here))
        return cls(pattern.around(np.array([*places, end])))

    def along(self, potential: Potential) -> tuple[Series, Complex]:
        """Return solutions about the end (1,), and what takes them to those about the start (2, 2)."""
        points, rows = self.around.points, np.arange(len(self.around.points))
        every, halves = potential.about_points(self.around), (points[1:] + points[:-1]) / 2
        before, after = (every.take(chosen).wronskians(halves) for chosen in (rows[:-1], rows[1:]))
        matrix = np.eye(2, dtype=np.complex128)
        for step in before @ np.linalg.inv(after):
            matrix = matrix @ step
        return every.take(rows[-1:]), matrix


@dataclass(frozen=True, eq=False)
class Development:
    """The map from a pattern's plane to another world, about the middle of a polygon of centres.

    - `potential`: The equation.
    - `start`: The matrix (2, 2) by which the solutions about the middle are multiplied, so that the
      first corner goes to (0, 0, 1) and the second to one with y = 0.
    - `frames`: The same (k, 2, 2) for the solutions about each corner.
    """

    potential: Potential
    start: Complex
    frames: Complex

    @classmethod
    def of(cls, pattern: Pattern, orders: tuple[int, ...]) -> Development:
        """Return the map of a pattern to the world with such orders at the corners.

        Raises:
            OrbiflowError: If there is no such world.
        """
        potential, ways = Potential(pattern, orders), _ways(pattern)
        if len(orders) == 4:
            potential = _with_form(potential, ways)
        frames = _at_corners(potential, ways)
        start, sign = _kept_form(_turns(frames, orders))
        if sign != curvature(orders):
            raise OrbiflowError(f"no world of the orders {orders} was found; this is a bug")
        ends = start @ frames[:2, :, 1, None]
        start = _placed(ends[..., 0], sign) @ start
        return cls(potential, start, start @ frames)

    @property
    def orders(self) -> tuple[int, ...]:
        """The orders of the corners (k,) in the world."""
        return self.potential.orders

    @property
    def sign(self) -> int:
        """Whether the world is curved as a sphere, 1, or hyperbolic, -1."""
        return curvature(self.orders)

    @cached_property
    def corners(self) -> Array:
        """The corners of the polygon in the world, as vectors (k, 3)."""
        return vectors_of(self.frames[..., 1], self.sign)

    @cached_property
    def rotations(self) -> Array:
        """The motions (k, 3, 3) of the world that turn about the corners by 2 pi / order."""
        return motions_of_spinors(_turns(self.frames, self.orders), self.sign)

    def frame(self, corner: int) -> Array:
        """Return the motion (3, 3) from (0, 0, 1) to a corner, its first axis towards the next one."""
        ends = self.frames[[corner, (corner + 1) % len(self.orders)], :, 1]
        return undone(motions_of_spinors(_placed(ends, self.sign), self.sign), self.sign)

    def reached(self, point: complex) -> Complex:
        """Return the solutions and their derivatives (2, 2) at a point, straight from the middle."""
        pattern = self.potential.pattern
        series, matrix = Way.of(pattern, pattern.middle, point).along(self.potential)
        return self.start @ matrix @ series.wronskians(np.array([point]))[0]


@lru_cache(maxsize=4)
def _ways(pattern: Pattern) -> tuple[Way, ...]:
    """Return the ways from the middle to where the corners' own series begin."""
    corners, middle = pattern.corners, pattern.middle
    away = middle - corners
    reach = pattern.around_centres.reach[np.abs(pattern.to_centres(corners)).argmin(axis=1)]
    before = corners + ROUND * np.minimum(reach, np.abs(away)) * away / np.abs(away)
    return tuple(Way.of(pattern, middle, complex(end)) for end in before)


def _at_corners(potential: Potential, ways: tuple[Way, ...]) -> Complex:
    """Return matrices (k, 2, 2) from the solutions about the corners to those about the middle."""
    matrices = list[Complex]()
    for way in ways:
        end = way.around.points[-1:]
        series, matrix = way.along(potential)
        corner = potential.about_centres(end).wronskians(end)[0]
        matrices.append(matrix @ series.wronskians(end)[0] @ np.linalg.inv(corner))
    return np.stack(matrices)


def _turns(frames: Complex, orders: tuple[int, ...]) -> Complex:
    """Return the matrices (k, 2, 2), of determinant 1, of turns about corners."""
    half = np.exp(1j * np.pi / np.array(orders))
    turns = np.stack([half, 1 / half], axis=-1)[:, :, None] * np.eye(2)
    return frames @ turns @ np.linalg.inv(frames)


def _with_form(potential: Potential, ways: tuple[Way, ...]) -> Potential:
    """Return the potential whose free constant makes traces of products of turns real, by Newton.

    Turns of known orders whose product is the identity keep a Hermitian form if the traces of these
    three products are real (Fricke). Two of them are not enough: a rectangle's are real for each real
    constant.
    """

    def traces(free: complex) -> Complex:
        tried = replace(potential, free=free)
        a, b, c, _ = _turns(_at_corners(tried, ways), tried.orders)
        return np.array([np.trace(a @ b), np.trace(b @ c), np.trace(a @ c)])

    unit, free = 1 / potential.pattern.elliptic.area, 0j
    for _ in range(NEWTON_STEPS):
        now = traces(free)
        slope = (traces(free + DIFFERENCE * unit) - now) / (DIFFERENCE * unit)
        step = complex(*np.linalg.lstsq(np.column_stack([slope.imag, slope.real]), now.imag)[0])
        free -= step
        if abs(step) < ENOUGH * unit:
            break
    return replace(potential, free=free)


def _kept_form(matrices: Complex) -> tuple[Complex, int]:
    """Return what takes the form that matrices (k, 2, 2) keep to |y2|^2 + sign |y1|^2, and the sign.

    Raises:
        OrbiflowError: If they keep none.
    """
    basis: Any = np.array(
        [[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 1], [1, 0]], [[0, 1j], [-1j, 0]]]
    )
    back = np.conj(np.swapaxes(matrices, -1, -2))
    left = (back[:, None] @ basis @ matrices[:, None] - basis).swapaxes(0, 1).reshape(4, -1)
    _, sizes, rows = np.linalg.svd(np.concatenate([left.real, left.imag], axis=1).T)
    if sizes[-1] > WIDEST * sizes[0]:
        raise OrbiflowError("the turns about the centres keep no form; this is a bug")
    form = np.einsum("k,kij->ij", rows[-1], basis)
    # at the middle, a point of the world, the first solution is 1 and the second 0
    form = form if form[0, 0].real > 0 else -form
    sizes, axes = np.linalg.eigh(form)  # the greater value last
    return np.sqrt(np.abs(sizes))[:, None] * np.conj(axes.T), 1 if sizes[0] > 0 else -1


def _placed(ends: Complex, sign: int) -> Complex:
    """Return the motion of spinors that takes the first of two to 0, the second to a positive one."""
    (p, q), scale = ends[0], np.sqrt(norms(ends[0], sign))
    motion = np.array([[q, -p], [sign * np.conj(p), np.conj(q)]]) / scale
    first, second = motion @ ends[1]
    half = np.exp(0.5j * np.angle(first / second))
    turn: Any = np.diag([1 / half, half])
    return turn @ motion
