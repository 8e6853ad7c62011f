"""Conformal maps from a flat triangle to a spherical or hyperbolic one, vertex to vertex.

The triangles have angles pi / a, pi / b, pi / c with 1/a + 1/b + 1/c = 1, and pi / p, pi / q, pi / r.
Both are images of the upper half-plane by Schwarz triangle functions, quotients of solutions of the
hypergeometric equation (Schwarz, 1873; Nehari, Conformal Mapping, 1952, chapter V). With w on the
half-plane and z on the flat triangle, the other map s is a quotient of solutions of y'' + Q y = 0,
where 2 Q = {s, w} (dw/dz)^2 - {z, w} (dw/dz)^2 is an elliptic function of z. Near a vertex all is a
power series in z^a, which converges up to the nearest other vertex; each point of the triangle is well
within such a disc, so that some seventy terms give all digits.

Points of the sphere are unit vectors. Those of the hyperbolic plane are vectors (x, y, t) with
t^2 - x^2 - y^2 = 1, so that motions of both are matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.special import beta, gamma

from orbiflow.arrays import Array, Complex
from orbiflow.errors import OrbiflowError

TERMS = 72  # of the series
AT_VERTEX = 1e-9  # of the reach: nearer points are the vertex, where a root would enlarge rounding
NEWTON_STEPS = 60  # at most, of the inverse
ENOUGH = 1e-15  # of the triangle's size, below which a step of the inverse ends it

STEEP = 0.99  # of a direction: one that is nearer to the second axis has another one upwards

Orders = tuple[int, int, int]


def curvature(orders: Orders) -> int:
    """Return 1 for a triangle on the sphere, -1 on the hyperbolic plane, 0 on the flat one.

    >>> curvature((2, 3, 5)), curvature((2, 3, 7)), curvature((4, 4, 2))
    (1, -1, 0)
    """
    p, q, r = orders
    excess = q * r + p * r + p * q - p * q * r
    return (excess > 0) - (excess < 0)


def form(curved: int) -> Array:
    """Return the diagonal (3,) of the form that motions keep: x^2 + y^2 + t^2, or - t^2."""
    return np.array([1.0, 1.0, float(curved)])


def undone(motions: Array, curved: int) -> Array:
    """Return the inverses of motions (..., 3, 3): their transposes, by the form."""
    diagonal = form(curved)
    return diagonal[:, None] * np.swapaxes(motions, -1, -2) * diagonal


def vectors_of(s: Complex, curved: int) -> Array:
    """Return the points (..., 3) of a stereographic picture, or of Poincaré's disc."""
    square = (s * np.conj(s)).real
    return np.stack([2 * s.real, 2 * s.imag, 1 - curved * square], -1) / (
        1 + curved * square[..., None]
    )


def disc_of(vectors: Array) -> Complex:
    """Return the stereographic picture, or that in Poincaré's disc, of points (..., 3)."""
    return (vectors[..., 0] + 1j * vectors[..., 1]) / (1 + vectors[..., 2])


@dataclass(frozen=True, eq=False)
class Corner:
    """The map near a vertex of the flat triangle, which is 0; the next vertex is at `length`.

    - `order`, `other`: The vertex's orders, in the flat triangle and in the other one.
    - `reach`: The distance of the nearest other vertex, at which X = (z / reach)^order is 1.
    - `upper`, `lower`: Series in X whose quotient, times `factor` (z / reach)^(order / other), is s.
    """

    order: int
    other: int
    length: float
    reach: float
    factor: float
    upper: Array
    lower: Array

    @classmethod
    def of(cls, flat: Orders, curved: Orders) -> Corner:
        """Return the corner at the first vertex of two triangles."""
        a, b, c = flat
        length = float(beta(1 / a, 1 / b))
        reach = min(length, float(beta(1 / a, 1 / c)))
        w = _half_plane(a, b, reach)
        q, share = _potential(flat, curved, w), a / curved[0]
        upper, lower = (_solution((1 + e * share) / 2, a, q) for e in (1, -1))
        # w = w[0] X (1 + ...), and s = w^(1/p) (1 + ...) times what makes the opposite side straight
        to_next = _side(curved) / _at_one(curved)
        return cls(a, curved[0], length, reach, to_next * w[0] ** (1 / curved[0]), upper, lower)

    def at(self, z: Complex) -> Complex:
        """Return s for points near the vertex."""
        scaled = np.where(np.abs(z) < AT_VERTEX * self.reach, 0, z / self.reach)
        x = scaled**self.order
        root = np.abs(scaled) ** (self.order / self.other) * np.exp(
            1j * self.order / self.other * np.angle(scaled)
        )
        return self.factor * root * _value(self.upper, x) / _value(self.lower, x)

    def slope(self, z: Complex) -> Complex:
        """Return ds/dz over s, times z: s'/s is this over z."""
        x = (z / self.reach) ** self.order
        steps = np.arange(TERMS)
        logs = _value(steps * self.upper, x) / _value(self.upper, x)
        logs -= _value(steps * self.lower, x) / _value(self.lower, x)
        return self.order / self.other + self.order * logs

    def back(self, s: Complex) -> Complex:
        """Return the points near the vertex for s, by Newton's method for the logarithms."""
        power = self.other / self.order
        z = self.reach * np.abs(s / self.factor) ** power * np.exp(1j * power * np.angle(s))
        z = np.where(np.abs(z) > self.reach, self.reach * z / np.maximum(np.abs(z), 1e-300), z)
        zero = np.abs(z) < AT_VERTEX * self.reach
        z, goal = np.where(zero, self.reach, z), np.where(zero, self.factor, s)
        for _ in range(NEWTON_STEPS):
            found = self.at(z)
            step = np.log(goal / found) / self.slope(z)
            step = step / np.maximum(1, 2 * np.abs(step))
            z = z * np.exp(step)
            if np.where(zero, 0, np.abs(step)).max(initial=0.0) < ENOUGH * 4:
                break
        return np.where(zero, 0, z)


def _value(series: Array, x: Complex) -> Complex:
    found = np.full(np.shape(x), series[-1], dtype=np.complex128)
    for coefficient in series[-2::-1]:
        found = found * x + coefficient
    return found


def _power(series: Array, exponent: float) -> Array:
    """Return a power of a series, by Euler's recurrence."""
    found = np.zeros(len(series))
    found[0] = series[0] ** exponent
    for n in range(1, len(series)):
        k = np.arange(1, n + 1)
        found[n] = ((exponent * k - (n - k)) * series[k] * found[n - k]).sum() / (n * series[0])
    return found


def _half_plane(a: int, b: int, reach: float) -> Array:
    """Return u with w = X u(X), where dw/dz = w^(1 - 1/a) (1 - w)^(1 - 1/b) and X = (z / reach)^a."""
    u = np.zeros(TERMS)
    u[0] = float(a) ** -a * reach**a
    scale = a * u[0] ** (1 / a)
    for n in range(1, TERMS):
        known = _power(u[: n + 1], 1 - 1 / a)
        rest = _power(np.concatenate([[1.0], -u[:n]]), 1 - 1 / b)
        u[n] = scale * (known @ rest[::-1]) / (a * n + 1)
    return u


def _potential(flat: Orders, curved: Orders, u: Array) -> Array:
    """Return the series of z^2 Q."""

    def times(one: Array, two: Array) -> Array:
        return np.convolve(one, two)[:TERMS]

    first, second, third = (1 / m**2 - 1 / n**2 for m, n in zip(flat, curved, strict=True))
    w = np.concatenate([[0.0], u[:-1]])
    odds = times(w, _power(np.concatenate([[1.0], -u[:-1]]), -1.0))  # w / (1 - w)
    rate = times(flat[0] * np.arange(1, TERMS + 1) * u, _power(u, -1.0))  # z w' / w
    inner = first / 2 * np.eye(1, TERMS)[0] + second / 2 * times(odds, odds)
    inner += (first + second - third) / 2 * odds
    return times(times(rate, rate), inner) / 2


def _solution(exponent: float, order: int, potential: Array) -> Array:
    """Return the solution z^exponent (1 + ...) of z^2 y'' + z^2 Q y = 0, by Frobenius's recurrence."""
    found = np.zeros(TERMS)
    found[0] = 1.0
    for n in range(1, TERMS):
        e = exponent + order * n
        found[n] = -(potential[1 : n + 1] @ found[n - 1 :: -1][:n]) / (e * (e - 1) + potential[0])
    return found


def _side(orders: Orders) -> float:
    """Return tan or tanh of half the side between the first two vertices."""
    one, two, three = (np.pi / order for order in orders)
    cosine = (np.cos(three) + np.cos(one) * np.cos(two)) / (np.sin(one) * np.sin(two))
    return float(np.sqrt(abs((1 - cosine) / (1 + cosine))))


def _at_one(orders: Orders) -> float:
    """Return what w^(1/p) F(a, b; c; w) / F(a - c + 1, b - c + 1; 2 - c; w) is at 1 (Gauss)."""
    one, two, three = (1 / order for order in orders)
    a, b, c = (1 + one - two - three) / 2, (1 + one - two + three) / 2, 1 + one
    found: Any = (
        gamma(c) * gamma(1 - a) * gamma(1 - b) / (gamma(2 - c) * gamma(c - a) * gamma(c - b))
    )
    return float(found)


class TriangleMap:
    """The conformal map from a flat triangle to another, with their vertices in the same order.

    - `vertices`: Those of the flat triangle (3,), counter-clockwise, the first 0, the second real.
    - `frames`: The motions (3, 3) that take the first corner of the other one, (0, 0, 1), to each.
    - `corners`: Its vertices (3, 3), as vectors.
    - `mirrors`: The reflections (3, 3, 3) in its sides; side k is opposite to vertex k.
    """

    def __init__(self, flat: Orders, curved: Orders) -> None:
        if curvature(flat) or min(flat) < 2 or min(curved) < 2 or not curvature(curved):
            raise OrbiflowError(
                f"there is no map of a flat triangle of the orders {flat} to one of {curved}"
            )
        self.flat, self.curved, self.sign = flat, curved, curvature(curved)
        turns = [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
        self._corners = [Corner.of(_taken(flat, own), _taken(curved, own)) for own in turns]
        first = self._corners[0].length
        third = float(beta(1 / flat[0], 1 / flat[2])) * np.exp(1j * np.pi / flat[0])
        self.vertices: Complex = np.array([0, first, third])
        self.frames, place = list[Array](), np.eye(3)
        for k, own in enumerate(turns):
            self.frames.append(place)
            # to the next vertex, and there to the one after it
            along = _shifted(2 * np.arctan(_side(_taken(curved, own))), self.sign)
            if self.sign < 0:
                along = _shifted(2 * np.arctanh(_side(_taken(curved, own))), self.sign)
            place = place @ along @ turned(np.pi - np.pi / curved[(k + 1) % 3])
        self.corners: Array = np.stack([frame[:, 2] for frame in self.frames])

    @cached_property
    def mirrors(self) -> Array:
        """The reflections in the sides."""
        diagonal, found = form(self.sign), list[Array]()
        for k in range(3):
            one, two = self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]
            normal = diagonal * np.cross(one, two)
            normal = normal / np.sqrt((normal * diagonal) @ normal)
            found.append(np.eye(3) - 2 * np.outer(normal, normal * diagonal))
        return np.stack(found)

    def _local(self, z: Complex) -> tuple[Array, list[Complex]]:
        """Return for each point the corner that it is nearest to, and it as each corner sees it."""
        seen: list[Complex] = []
        for k, corner in enumerate(self._corners):
            side = self.vertices[(k + 1) % 3] - self.vertices[k]
            seen.append((z - self.vertices[k]) * (corner.length / side))
        far = [
            np.abs(own / corner.reach) ** corner.order
            for own, corner in zip(seen, self._corners, strict=True)
        ]
        return np.argmin(np.stack(far), axis=0), seen

    def forward(self, z: Complex) -> Array:
        """Return the vectors (..., 3) of points of the flat triangle."""
        nearest, seen = self._local(z)
        found = np.zeros((*np.shape(z), 3))
        for k, corner in enumerate(self._corners):
            mine = nearest == k
            local = vectors_of(corner.at(seen[k][mine]), self.sign)
            found[mine] = local @ self.frames[k].T
        return found

    def inverse(self, vectors: Array) -> Complex:
        """Return the points of the flat triangle for vectors (..., 3) of the other one."""
        seen: list[Complex] = []
        for frame in self.frames:
            seen.append(disc_of(vectors @ undone(frame, self.sign).T))
        far = [
            np.abs(own / corner.factor) ** (corner.other / corner.order) / corner.reach
            for own, corner in zip(seen, self._corners, strict=True)
        ]
        nearest = np.argmin(np.stack(far), axis=0)
        found = np.zeros(np.shape(nearest), dtype=np.complex128)
        for k, corner in enumerate(self._corners):
            mine = nearest == k
            side = self.vertices[(k + 1) % 3] - self.vertices[k]
            local = corner.back(seen[k][mine]) * (side / corner.length)
            found[mine] = self.vertices[k] + local
        return found

    def scale(self, z: Complex) -> Array:
        """Return by how much lengths grow at points of the flat triangle that are no vertices."""
        nearest, seen = self._local(z)
        found = np.zeros(np.shape(z))
        for k, corner in enumerate(self._corners):
            mine = nearest == k
            own = seen[k][mine]
            s = corner.at(own)
            rate = np.abs(corner.slope(own) * s / own)
            unit = corner.length / abs(self.vertices[(k + 1) % 3] - self.vertices[k])
            found[mine] = unit * 2 * rate / (1 + self.sign * np.abs(s) ** 2)
        return found


@lru_cache(maxsize=64)
def triangle_map(flat: Orders, curved: Orders) -> TriangleMap:
    """Return the map of a flat triangle to another, worked out once."""
    return TriangleMap(flat, curved)


def _taken(orders: Orders, places: Sequence[int]) -> Orders:
    one, two, three = (orders[k] for k in places)
    return one, two, three


def facing(ahead: Array) -> Array:
    """Return the rotation that takes a direction (3,) to (0, 0, 1)."""
    steepest = np.eye(3)[1 if abs(ahead[1]) < STEEP else 0]
    right = np.cross(steepest, ahead)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])


def turned(angle: float) -> Array:
    """Return the rotation (3, 3) about the third axis by an angle."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _shifted(length: float, sign: int) -> Array:
    """Return the motion along the first axis by a length."""
    cos, sin = (np.cos, np.sin) if sign > 0 else (np.cosh, np.sinh)
    c, s = float(cos(length)), float(sin(length))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-sign * s, 0.0, c]])
