"""The equation y'' + Q y = 0 whose quotients of solutions bend a plane pattern.

    Q(z) = sum over centres w of a cell (1 - (m / n)^2) / 4 (P(z - w) + G) + c,

where m and n are a centre's orders in the plane and in the other world, P is Weierstrass's function
of the lattice and G the constant with which the integral of P + G along a lattice vector b is
-pi conj(b) / area. So a quotient of solutions is (z - w)^(m / n) times a series near a centre.
Solutions are power series about centres (Frobenius) and about other points, exact to rounding within
some half of the distance to the next centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.worlds.pattern import TERMS, Around, Pattern

ROUND = 0.35  # of the way from a centre to the next: nearer points have its series
AT_CENTRE = 1e-9  # of that way: nearer points are the centre, where a root would enlarge rounding


class Series(NamedTuple):
    """Pairs of solutions about points (M,): x^exponent times one in x^power, x = (z - origin) / reach.

    - `origin`, `reach`: The points (M,), and the distance of the next centre.
    - `power`: The centre's order in the plane (M,); 1 about points that are no centres.
    - `exponents`: (M, 2) of both solutions.
    - `terms`: (M, 2, TERMS).
    - `ahead`: (M,) of absolute value 1, about which arguments are at most pi.
    """

    origin: Complex
    reach: Array
    power: Integers
    exponents: Array
    terms: Complex
    ahead: Complex

    def take(self, index: Integers) -> Series:
        """Return those at an index."""
        return Series(*(cast(Any, part)[index] for part in self))

    def spinors(self, points: Complex) -> Complex:
        """Return the solutions (M, 2) at points (M,), times a factor of both: centres are allowed."""
        return self._values(points, self.exponents - self.exponents.min(axis=1, keepdims=True))[0]

    def wronskians(self, points: Complex) -> Complex:
        """Return the solutions at points (M,) and their derivatives, (M, 2, 2)."""
        values, slopes = self._values(points, self.exponents)
        return np.stack([values, slopes], axis=-1)

    def _values(self, points: Complex, exponents: Array) -> tuple[Complex, Complex]:
        x: Complex = (points - self.origin) / self.reach
        x = np.where(np.abs(x) < AT_CENTRE, 0j, x)
        turns = np.angle(self.ahead) + np.angle(x / self.ahead)
        logs = np.log(np.maximum(np.abs(x), 1e-300)) + 1j * turns
        roots, powers = np.exp(exponents * logs[:, None]), (x**self.power)[:, None]
        values = _horner(self.terms, powers)
        slopes = _horner(np.arange(1, TERMS) * self.terms[..., 1:], powers)
        slopes = slopes * (self.power * x ** (self.power - 1))[:, None]
        apart = np.where(x == 0, 1, x)[:, None]  # at a centre slopes are not asked for
        slopes = slopes + np.where(exponents == 0, 0, exponents * values / apart)
        return roots * values, roots * slopes / self.reach[:, None]


def _horner(terms: Complex, x: Complex) -> Complex:
    total = terms[..., -1]
    for k in range(terms.shape[-1] - 2, -1, -1):
        total = total * x + terms[..., k]
    return total


@dataclass(frozen=True, eq=False)
class Potential:
    """The potential of a pattern whose corners have other orders (k,); `free` is the constant c."""

    pattern: Pattern
    orders: tuple[int, ...]
    free: complex = 0j

    @cached_property
    def _orders(self) -> Array:
        """The orders (J,) of a cell's centres, in the plane over those in the other world."""
        corner = self.pattern.corner_of
        return self.pattern.flat[corner] / np.array(self.orders)[corner]

    @cached_property
    def _strengths(self) -> Array:
        return (1 - self._orders**2) / 4

    @cached_property
    def _constant(self) -> complex:
        return complex(self._strengths.sum() * self.pattern.elliptic.constant + self.free)

    def about(self, around: Around) -> Series:
        """Return solutions about points (N,), or about the nearest centre where it is near."""
        at_points, centres = self.about_points(around), self.about_centres(around.points)
        near = np.abs(around.points - centres.origin) < ROUND * centres.reach
        parts = zip(centres, at_points, strict=True)
        return Series(
            *(
                np.where(near.reshape(-1, *(1,) * (at_centre.ndim - 1)), at_centre, at_point)
                for at_centre, at_point in parts
            )
        )

    def about_points(self, around: Around) -> Series:
        """Return those about points (N,) that are no centres: to first order 1 and (z - p) / reach."""
        points, reach, elliptic = around
        potential = np.einsum("j,jnk->nk", self._strengths, elliptic)
        potential[:, 0] += self._constant * reach**2
        terms = np.zeros((len(points), 2, TERMS), dtype=np.complex128)
        terms[:, 0, 0] = terms[:, 1, 1] = 1.0
        for k in range(TERMS - 2):
            sums = (potential[:, None, : k + 1] * terms[..., k::-1][..., : k + 1]).sum(axis=-1)
            terms[..., k + 2] = -sums / ((k + 2) * (k + 1))
        ones = np.ones(len(points), dtype=np.complex128)
        return Series(
            points, reach, np.ones(len(points), int), np.zeros((len(points), 2)), terms, ones
        )

    def about_centres(self, points: Complex) -> Series:
        """Return solutions about the centres nearest to points (N,), with arguments about theirs."""
        away = self.pattern.to_centres(points)
        near = np.abs(away).argmin(axis=1)
        exponents, terms = self._about_centres
        offset = away[np.arange(len(points)), near]
        power, reach = (
            self.pattern.flat[self.pattern.corner_of[near]],
            self.pattern.around_centres.reach,
        )
        ahead: Complex = offset / np.abs(offset)
        return Series(points - offset, reach[near], power, exponents[near], terms[near], ahead)

    @cached_property
    def _about_centres(self) -> tuple[Array, Complex]:
        """The exponents (J, 2) and series (J, 2, TERMS) about a cell's centres, by Frobenius."""
        _, reach, elliptic = self.pattern.around_centres
        count = len(reach)
        exponents = np.stack([1 + self._orders, 1 - self._orders], axis=1) / 2
        terms = np.zeros((count, 2, TERMS), dtype=np.complex128)
        terms[..., 0] = 1.0
        for j, order in enumerate(self.pattern.flat[self.pattern.corner_of].tolist()):
            potential = self._strengths[j] * elliptic[j, j]
            others = np.arange(count) != j
            potential[2:] += (self._strengths[others] @ elliptic[others, j])[:-2]
            potential[2] += self._constant * reach[j] ** 2
            potential = potential[::order]  # the others are 0, as the centre's rotation keeps it
            for n in range(1, len(potential)):
                e = exponents[j] + order * n
                sums = terms[j, :, n - 1 :: -1][:, :n] @ potential[1 : n + 1]
                terms[j, :, n] = -sums / (e * (e - 1) + potential[0])
        return exponents, terms
