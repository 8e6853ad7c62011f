"""What an outline keeps of the one that was bent into it: seven measures, and their gradients.

Outlines correspond point by point; points are complex numbers x + iy. The gradient of a measure f is
the complex number g of each point for which f grows by Re(conj(g) dz). `faithful` says what people
make of the measures.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from orbiflow.arrays import Array, Complex, Integers

PIECE_LENGTHS = (0.08, 0.25)  # the lengths of the pieces, as shares of the outline
# the offset of widths, in square roots of the area, below which differences matter little
WIDTH_OFFSET = 0.02
LARGEST_WIDTH = 1.0  # the largest radius of a disc inside that counts, in square roots of the area
LARGEST_STRETCH = 2.0  # the largest logarithm of a stretch that counts
CHORDS = 48  # the number of chords into which the outline is cut; their turning is compared
SMALL_MISFIT = 1e-7  # the misfit of a piece below which its root is smooth: it has a gradient at 0
SHORTEST = 1e-9  # the shortest side whose stretch is known
WRINKLE_STEPS = (1, 2, 4)  # the numbers of points between those whose directions are compared
LEAST_KINK = 0.02  # the angle in radians below which a change of direction counts by its square

Measured = tuple[float, Callable[[], Complex]]  # a value, and what computes the gradient (n,)


class Measures:
    """The measures of outlines (n,) against one at rest, both counter-clockwise and evenly spaced."""

    def __init__(self, rest: Complex) -> None:
        _, self.rest = _normal(rest)
        self._centered = self.rest - self.rest.mean()
        self.sides = abs(_steps(self.rest, 1))
        self.length = float(self.sides.sum())
        self._weight = (self.sides + _shifted(self.sides, 1)) / (2 * self.length)
        inside, outside = _discs(self.rest)
        self.thick, self._free = inside.width, outside.width
        share = np.sqrt(self.thick)
        self._share = share / share.sum()
        self._step = max(1, round(len(rest) / CHORDS))
        self._turns = abs(_turns(_steps(self.rest, self._step), self._step))
        self._fine_turns = [_turns(_steps(self.rest, step), step) for step in WRINKLE_STEPS]
        n = len(rest)
        short, long = (min(max(3, round(length * n / 2)), (n - 1) // 2) for length in PIECE_LENGTHS)
        self._pieces = _Pieces(self.rest, (short, long))

    def values(self, bent: Complex) -> Array:
        """Return the seven values of an outline, in the order of `Fidelity`."""
        _, z = _normal(bent)
        pieces, _ = self._pieces.misfits(z, self._share)
        return np.array([*pieces, *(value for value, _ in self._measured(z))])

    def gradients(self, bent: Complex) -> tuple[Array, Complex]:
        """Return the seven values of an outline, and their gradients (7, n)."""
        size, z = _normal(bent)
        pieces, of_pieces = self._pieces.misfits(z, self._share)
        measured = self._measured(z)
        along = np.vstack([of_pieces(), *(gradient() for _, gradient in measured)])
        # a larger outline is made smaller again
        grows = (np.conj(along) @ z).real
        along = (along - grows[:, None] * _area_gradient(z) / 2) / size
        return np.array([*pieces, *(value for value, _ in measured)]), along

    def wrinkles(self, ring: Complex, places: Array) -> tuple[float, Complex, Array]:
        """Return by how many radians a ring turns elsewhere than the outline at rest.

        The sum over its vertices of the change of the angle between steps, as the mean over steps of
        one vertex and more: a ring that bends at few places has fewer wrinkles than a bumpy one. The
        turning at rest is shared out to the two vertices next to where each point lies.

        Args:
            ring: The ring (n,), whose vertices need not be points of the outline.
            places: Where the outline's points (n,) lie on it, in vertices from the first.

        Returns:
            The wrinkles, and their gradients (n,) in the ring and in the places.
        """
        n = len(ring)
        below = np.floor(places).astype(np.int64)
        share, low, high = places - below, below % n, (below + 1) % n
        total, along, sliding = 0.0, np.zeros_like(ring), np.zeros(n)
        for step, turns in zip(WRINKLE_STEPS, self._fine_turns, strict=True):
            weight = 1 / (step * len(WRINKLE_STEPS))
            meant = np.bincount(low, (1 - share) * turns, n) + np.bincount(high, share * turns, n)
            chords = _steps(ring, step)
            change = (_turns(chords, step) - meant + np.pi) % (2 * np.pi) - np.pi
            size = np.sqrt(change**2 + LEAST_KINK**2)
            slope = weight * change / size
            total += weight * float((size - LEAST_KINK).sum())
            along += _turned(chords, step, slope)
            sliding += turns * (slope[low] - slope[high])
        return total, along, sliding

    def _measured(self, z: Complex) -> tuple[Measured, ...]:
        """Return the values that follow those of pieces."""
        inside, outside = _discs(z)
        thinned, merged = self._thinned(z, inside), self._merged(z, outside)
        return self._stretched(z), thinned, self._blunted(z), self._moved(z), merged

    def _stretched(self, z: Complex) -> Measured:
        step = _steps(z, 1)
        now = np.maximum(abs(step), SHORTEST)
        log = np.log(now / np.maximum(self.sides, SHORTEST))
        counts = abs(log) < LARGEST_STRETCH

        def gradient() -> Complex:
            return _stepped(2 * self._weight * log * counts / now**2 * step, 1)

        return float(np.where(counts, log**2, LARGEST_STRETCH**2) @ self._weight), gradient

    def _thinned(self, z: Complex, discs: _Discs) -> Measured:
        width = discs.width
        log = np.log(self.thick / width)

        def gradient() -> Complex:
            return discs.gradient(z, -2 * self._weight * log / width)

        return float(self._weight @ log**2), gradient

    def _merged(self, z: Complex, discs: _Discs) -> Measured:
        width = discs.width
        log = np.maximum(np.log(self._free / width), 0.0)

        def gradient() -> Complex:
            return discs.gradient(z, -2 * self._weight * log / width)

        return float(self._weight @ log**2), gradient

    def _blunted(self, z: Complex) -> Measured:
        chords = _steps(z, self._step)
        turns = _turns(chords, self._step)
        less = self._turns - abs(turns)

        def gradient() -> Complex:
            return _turned(
                chords, self._step, np.where(less > 0, -np.sign(turns), 0.0) / self._step
            )

        return float(np.maximum(less, 0).sum() / self._step), gradient

    def _moved(self, z: Complex) -> Measured:
        centered, goal, n = z - z.sum() / len(z), self._centered, len(z)
        factor = _product(centered, goal) / _product(centered, centered).real
        missed = factor * centered - goal

        def gradient() -> Complex:
            return 2 / n * (abs(factor) ** 2 * centered - np.conj(factor) * goal)

        return _product(missed, missed).real / n, gradient


class _Discs(NamedTuple):
    """The largest discs on one side of an outline that touch each of its points."""

    ends: Integers  # (n,) the other point that each touches
    towards: Complex  # (n,) the unit vector towards its middle
    depth: Array  # (n,) how far the other point is, along this vector
    radius: Array  # (n,) at most `LARGEST_WIDTH`
    side: int  # 1 inside, to the left of the outline, and -1 outside

    @property
    def width(self) -> Array:
        """The radii (n,), smoothed along the outline, and larger by `WIDTH_OFFSET`."""
        return _smooth(self.radius) + WIDTH_OFFSET

    def gradient(self, z: Complex, along: Array) -> Complex:
        """Return the gradient (n,) in the points of what has a gradient (n,) in `width`."""
        ends, towards, n = self.ends, self.towards, len(z)
        sides = np.maximum(abs(_shifted(z, -1) - _shifted(z, 1)), 1e-300)
        share = np.where(self.radius < LARGEST_WIDTH, _smooth(along), 0.0)
        share = share / np.maximum(self.depth, 1e-300)
        apart = z[ends] - z
        steep = share * self.radius * towards  # of the depth
        pulled = share * apart - steep
        at_ends = np.bincount(ends, pulled.real, n) + 1j * np.bincount(ends, pulled.imag, n)
        # the vectors turn with the outline
        tilt = steep * (np.conj(apart) * -1j * self.side * towards).real / sides
        return at_ends - pulled + _shifted(tilt, 1) - _shifted(tilt, -1)


class _Pieces:
    """The pieces of an outline about each of its points, short and long: `halves` points each way."""

    def __init__(self, rest: Complex, halves: tuple[int, int]) -> None:
        self.rest, self.halves = rest, halves
        self.count = 2.0 * np.array(halves)[:, None] + 1
        self.sum, square = self.windows(np.stack([rest, rest * np.conj(rest)])[:, None])
        self.square = square.real - abs(self.sum) ** 2 / self.count

    def windows(self, values: Complex) -> Complex:
        """Return sums (K, 2, n) over short and long pieces, of values (K, 2, n) or (K, 1, n)."""
        n, most = values.shape[-1], max(self.halves)
        padded = [values[..., -most - 1 :], values, values[..., :most]]
        total = np.cumsum(np.concatenate(padded, axis=-1), axis=-1)
        sums = np.empty((len(values), 2, n), dtype=complex)
        for k, half in enumerate(self.halves):
            cumulated, middle = total[:, k % total.shape[1]], most + 1
            high, low = cumulated[:, middle + half :], cumulated[:, middle - half - 1 :]
            np.subtract(high[:, :n], low[:, :n], out=sums[:, k])
        return sums

    def misfits(self, z: Complex, share: Array) -> tuple[Array, Callable[[], Complex]]:
        """Return means (2,), with weights (n,), of roots of misfits after the best motions.

        And what computes their gradients (2, n).
        """
        rest, count = self.rest, self.count
        sums, square, common = self.windows(
            np.stack([z, z * np.conj(z), np.conj(rest) * z])[:, None]
        )
        common -= np.conj(self.sum) * sums / count
        sizes = self.square + square.real - (sums.real**2 + sums.imag**2) / count
        size = abs(common)
        misfit = np.maximum(1 - 2 * size / sizes, 0.0)
        root = np.sqrt(misfit + SMALL_MISFIT)

        def gradient() -> Complex:
            slope = share * (misfit + 2 * SMALL_MISFIT) / root**3  # of half the misfit
            turned = -slope / sizes * common / np.maximum(size, 1e-300)
            larger = slope * size / sizes**2
            parts = self.windows(np.stack([turned, turned * self.sum, larger, larger * sums]))
            along = rest * parts[0] - parts[1] / count
            return along + 2 * (z * parts[2] - parts[3] / count)

        return (misfit / root) @ share, gradient


def _normal(z: Complex) -> tuple[float, Complex]:
    """Return the root of the area, and the outline about the origin with area 1."""
    about = z - z.sum() / len(z)
    size = float(np.sqrt(abs(_product(about, _shifted(about, -1)).imag) / 2))
    return size, about / size


def _product(a: Complex, b: Complex) -> complex:
    """Return the sum of conj(a) b."""
    return complex(np.vdot(a, b))  # pyright: ignore[reportUnknownArgumentType]


def _area_gradient(z: Complex) -> Complex:
    return -0.5j * (_shifted(z, -1) - _shifted(z, 1))


def _shifted(values: Array | Complex, by: int) -> Any:
    """Return what `numpy.roll` does, in a fifth of its time."""
    return np.concatenate([values[-by:], values[:-by]])


def _steps(z: Complex, step: int) -> Complex:
    return _shifted(z, -step) - z


def _stepped(along: Complex, step: int) -> Complex:
    """Return the gradient in the points of what has a gradient (n,) in `_steps`."""
    return _shifted(along, step) - along


def _turns(chords: Complex, step: int) -> Array:
    """Return the angles (n,) in radians by which chords of some steps turn, counter-clockwise."""
    turned = chords * np.conj(_shifted(chords, step))
    return np.arctan2(turned.imag, turned.real)


def _turned(chords: Complex, step: int, along: Array) -> Complex:
    """Return the gradient in the points of what has a gradient (n,) in `_turns` of chords."""
    pulls = (along - _shifted(along, -step)) * 1j * chords / np.maximum(abs(chords) ** 2, 1e-300)
    return _stepped(pulls, step)


def _discs(z: Complex) -> tuple[_Discs, _Discs]:
    """Return the largest discs inside and outside of an outline that touch each point.

    They are found as by Ma, Bae and Choi (3D medial axis point approximation, 2012).
    """
    n = len(z)
    index = np.arange(n)
    inward = 1j * (_shifted(z, -1) - _shifted(z, 1))
    inward /= np.maximum(abs(inward), 1e-300)
    x, y, ones, far = z.real, z.imag, np.ones(n), (z * z.conj()).real
    # by products of matrices: sums of outer ones take four times as long
    level = (np.conj(inward) * z).real
    depth = np.column_stack([inward.real, inward.imag, -level]) @ np.stack([x, y, ones])
    square = np.column_stack([-2 * x, -2 * y, far, ones]) @ np.stack([x, y, ones, far])
    np.maximum(square, 1e-300, out=square)  # points may coincide
    curvature = np.divide(depth, square, out=square)  # half of that of the disc
    curvature.ravel()[_near(n)] = 0

    def largest(ends: Integers, side: int) -> _Discs:
        least = np.maximum(side * curvature[index, ends], 0.5 / LARGEST_WIDTH)
        return _Discs(ends, side * inward, side * depth[index, ends], 0.5 / least, side)

    return largest(curvature.argmax(axis=1), 1), largest(curvature.argmin(axis=1), -1)


@lru_cache(maxsize=16)
def _near(n: int) -> Integers:
    """Return where in a flat (n, n) matrix pairs of points are that are two steps apart at most."""
    index = np.arange(n)[:, None]
    return (index * n + (index + np.arange(-2, 3)) % n).ravel()


def _smooth(values: Array) -> Array:
    return (_shifted(values, 1) + 2 * values + _shifted(values, -1)) / 4
