"""Plane groups of rotations as surfaces with cone points, and their elliptic functions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.symmetry import CrystallographicGroup, Isometry, reduced_basis, symmetry_elements

FLAT: dict[str, tuple[int, ...]] = {
    "p3": (3, 3, 3),
    "p4": (4, 4, 2),
    "p6": (6, 3, 2),
    "p2": (2, 2, 2, 2),
    "pgg": (2, 2, 2, 2),
}
"""The orders of rotation centres around a polygon of them, of groups that go to other worlds."""

TERMS = 64  # of a series
NOMES = 8  # terms of sums over the nome, which is at most exp(-pi sqrt 3)
NEAR = 1e-7  # of a lattice vector: places that are one


@dataclass(frozen=True, eq=False)
class Weierstrass:
    """Weierstrass's elliptic function of the lattice of a reduced basis."""

    first: complex
    second: complex

    @cached_property
    def _nome(self) -> complex:
        return complex(np.exp(2j * np.pi * self.second / self.first))

    def _eisenstein(self, power: int) -> complex:
        """Return the sum of n^power q^n / (1 - q^n)."""
        n = np.arange(1, NOMES + 1)
        return complex((n**power * self._nome**n / (1 - self._nome**n)).sum())

    @property
    def invariants(self) -> tuple[complex, complex]:
        """Both invariants g2 and g3."""
        unit = 2 * np.pi / self.first
        second = unit**4 / 12 * (1 + 240 * self._eisenstein(3))
        return second, unit**6 / 216 * (1 - 504 * self._eisenstein(5))

    @property
    def area(self) -> float:
        """The area of the lattice's cell."""
        return float((np.conj(self.first) * self.second).imag)

    @property
    def constant(self) -> complex:
        """The constant G: Eisenstein's series of weight 2, made symmetric."""
        unit = (np.pi / self.first) ** 2 / 3 * (1 - 24 * self._eisenstein(1))
        return complex(unit - np.pi / self.area * np.conj(self.first) / self.first)

    def nearest(self, z: Complex) -> Complex:
        """Return differences z by the shortest vectors that the lattice leaves."""
        basis = np.array([[self.first.real, self.second.real], [self.first.imag, self.second.imag]])
        shares = np.linalg.solve(basis, np.stack([z.real, z.imag]).reshape(2, -1))
        reduced = z - (np.array([self.first, self.second]) @ np.round(shares)).reshape(np.shape(z))
        around = [a * self.first + b * self.second for a in (-1, 0, 1) for b in (-1, 0, 1)]
        every = np.stack([reduced + shift for shift in around])
        return np.take_along_axis(every, np.abs(every).argmin(axis=0)[None], axis=0)[0]

    def series(self, z: Complex, scale: Array) -> Complex:
        """Return the coefficients (..., TERMS) of s^2 P(z + s x), for points z and scales s."""
        n = np.arange(-NOMES, NOMES + 1).reshape(-1, *(1,) * np.ndim(z))
        u, unit = np.exp(2j * np.pi * self.nearest(z) / self.first), 2j * np.pi / self.first
        # far terms are small, whichever way: u is not far from the unit circle
        other = self._nome ** np.abs(n) * np.where(n < 0, 1 / u, u)
        sums = (other / (1 - other) ** 2).sum(axis=0)
        odd = (np.where(n < 0, -1, 1) * other * (1 + other) / (1 - other) ** 3).sum(axis=0)
        terms = np.zeros((*np.shape(z), TERMS), dtype=np.complex128)
        terms[..., 0] = scale**2 * unit**2 * (1 / 12 + sums - 2 * self._eisenstein(1))
        terms[..., 1] = scale**3 * unit**3 * odd
        last = self.invariants[0] * scale**4 / 2
        for k in range(TERMS - 2):
            square = (terms[..., : k + 1] * terms[..., k::-1][..., : k + 1]).sum(axis=-1)
            terms[..., k + 2] = (6 * square - (last if k == 0 else 0)) / ((k + 2) * (k + 1))
        return terms

    def series_at_pole(self, scale: float) -> Complex:
        """Return the coefficients (TERMS,) of (s x)^2 P(s x)."""
        second, third = self.invariants
        c = np.zeros(TERMS // 2, dtype=np.complex128)  # of z^(2 n - 2)
        c[0], c[2], c[3] = 1.0, second / 20, third / 28
        for n in range(4, len(c)):
            c[n] = 3 * (c[2 : n - 1] @ c[n - 2 : 1 : -1]) / ((2 * n + 1) * (n - 3))
        terms = np.zeros(TERMS, dtype=np.complex128)
        terms[::2] = c * scale ** (2 * np.arange(len(c)))
        return terms


class Around(NamedTuple):
    """What lies around points (N,): the distance `reach` (N,) of the next centre, and the coefficients
    `terms` (J, N, TERMS) of reach^2 times Weierstrass's function about each centre of a cell.
    """

    points: Complex
    reach: Array
    terms: Complex


@dataclass(frozen=True, eq=False)
class Pattern:
    """The rotation centres of a plane group.

    - `elliptic`: Weierstrass's function of its lattice.
    - `corners`: Centres (k,) of a polygon, counter-clockwise, without others in it.
    - `kinds`: Numbers (k,) that are the same for corners that the group takes to each other.
    - `centres`, `corner_of`: All centres of a cell (J,), and a corner that the group takes to each.
    - `flat`: The orders (k,) of the corners.
    """

    elliptic: Weierstrass
    corners: Complex
    kinds: tuple[int, ...]
    centres: Complex
    corner_of: Integers
    flat: Integers

    @classmethod
    def near(cls, group: CrystallographicGroup, point: Array) -> Pattern:
        """Return that of a group of `FLAT`, with a polygon near a point (2,)."""
        flat, goal = FLAT[group.name], complex(*point)
        size = float(np.sqrt(group.cell_volume))
        centers = symmetry_elements(group, point, 1.5 * size).centers
        places = {
            order: [complex(*c.point) for c in centers if c.order == order] for order in set(flat)
        }
        every = (
            _parallelograms(group, places[2]) if len(flat) == 4 else _triangles(flat, places, size)
        )
        corners = min(every, key=lambda polygon: abs(polygon.mean() - goal))
        elliptic = Weierstrass(
            *(complex(*vector) for vector in _positive(reduced_basis(group.lattice)).T)
        )
        centres, corner_of, kinds = list[complex](), list[int](), list[int]()
        for k, corner in enumerate(corners):
            images = group.images(np.array([corner.real, corner.imag])) @ (1, 1j)
            before = len(centres)
            for place in images:
                away = (
                    elliptic.nearest(place - np.array(centres)) if centres else np.array([np.inf])
                )
                if np.abs(away).min() > NEAR * abs(elliptic.first):
                    centres.append(complex(place))
                    corner_of.append(k)
                elif (first := corner_of[int(np.abs(away).argmin())]) < k:
                    kinds.append(kinds[first])
                    break
            if len(centres) > before:
                kinds.append(max(kinds, default=-1) + 1)
        return cls(
            elliptic, corners, tuple(kinds), np.array(centres), np.array(corner_of), np.array(flat)
        )

    @classmethod
    def about(cls, lattice: Array, point: complex) -> Pattern:
        """Return that of a lattice (2, 2) and half-turns about a point, the first corner."""
        about = np.array([point.real, point.imag])
        turn = Isometry(-np.eye(2), 2 * about)
        pattern = cls.near(CrystallographicGroup.generate(lattice, [turn], name="p2"), about)
        first = int(np.abs(pattern.corners - point).argmin())
        # of half-turns each corner is a kind of its own, all alike
        return replace(
            pattern,
            corners=np.roll(pattern.corners, -first),
            corner_of=(pattern.corner_of - first) % 4,
        )

    @property
    def middle(self) -> complex:
        """The middle of the corners."""
        return complex(self.corners.mean())

    def to_centres(self, points: Complex) -> Complex:
        """Return the vectors (N, J) from the nearest image of each centre to points (N,)."""
        return self.elliptic.nearest(points[:, None] - self.centres)

    def around(self, points: Complex) -> Around:
        """Return what lies around points (N,) that are no centres."""
        away = self.to_centres(points).T
        reach = np.abs(away).min(axis=0)
        return Around(points, reach, self.elliptic.series(away, np.broadcast_to(reach, away.shape)))

    @cached_property
    def around_centres(self) -> Around:
        """What lies around the centres of a cell; about itself, each has coefficients that begin with
        the power -2 instead of 0."""
        away = self.to_centres(self.centres).T
        np.fill_diagonal(away, np.inf)
        sides = np.abs([self.elliptic.first, self.elliptic.second])
        reach = np.minimum(np.abs(away).min(axis=0), sides.min())
        np.fill_diagonal(away, 0.5 * self.elliptic.first)
        terms = self.elliptic.series(away, np.broadcast_to(reach, away.shape))
        for j, scale in enumerate(reach):
            terms[j, j] = self.elliptic.series_at_pole(float(scale))
        return Around(self.centres, reach, terms)

    def clearance(self, points: Complex) -> Array:
        """Return how near (N,) straight lines from the middle to points (N,) come to a centre."""
        shares = np.linspace(0, 1, 33)[:, None]
        every = self.middle + shares * (points - self.middle)
        return np.abs(self.to_centres(every.ravel())).min(axis=1).reshape(every.shape).min(axis=0)


def _triangles(
    flat: tuple[int, ...], places: dict[int, list[complex]], size: float
) -> list[Complex]:
    """Return triangles of centres with the angles pi / order."""
    ends = [np.exp(1j * np.pi / order) for order in flat]
    triangles = list[Complex]()
    for first in places[flat[0]]:
        others = [place for place in places[flat[1]] if abs(place - first) > NEAR * size]
        if not others:
            continue
        least = min(abs(place - first) for place in others)
        for second in (place for place in others if abs(place - first) < (1 + NEAR) * least):
            # the third is where the sides from both meet
            side = second - first
            left, right = side * ends[0], -side * np.conj(ends[1])
            t = (side * np.conj(right)).imag / (left * np.conj(right)).imag
            third = first + t * left
            if any(abs(place - third) < NEAR * size for place in places[flat[2]]):
                triangles.append(np.array([first, second, third]))
    return triangles


def _parallelograms(group: CrystallographicGroup, places: list[complex]) -> list[Complex]:
    """Return the parallelograms of centres of half-turns, halves of the shortest lattice vectors."""
    first, second = (complex(*vector) / 2 for vector in _positive(reduced_basis(group.lattice)).T)
    return [np.array([at, at + first, at + first + second, at + second]) for at in places]


def _positive(basis: Array) -> Array:
    return basis if np.linalg.det(basis) > 0 else basis * [1.0, -1.0]
