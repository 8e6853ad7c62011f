"""The least bending of a silhouette onto a given outline.

This is for shapes that were not found by bending. Points of the silhouette's outline slide along
the other one and the energy is minimised: linear equations in how far each slides, and in the size
of the other outline, alternate with the choice of rotations. The descent starts from the
correspondence of `corresponding`, so the outlines must lie over each other. It ends in a local
minimum, whose energy is an upper bound of the least one.
"""

from typing import NamedTuple

import numpy as np
import scipy.linalg

from orbiflow.arrays import Array, Complex
from orbiflow.tiles.geometry import (
    arc_lengths,
    complex_points,
    plane_points,
    points_along,
    resampled,
)
from orbiflow.tiles.likeness.elastic import Elastic

PLACES_PER_POINT = 6  # the number of places on the second outline for each point of the first
MAX_STEP_RATIO = 6  # the largest step between places, in usual steps
FIRST_PLACES = 6  # the number of places that are tried for the first point


def corresponding(
    ring: Array, other: Array, near: float = 0.4, stretch: float = 1.0, count: int = 96
) -> Array:
    """Return the arc lengths (n,) on a ring (M, 2) that correspond to the points of a ring (n, 2).

    Both are counter-clockwise and lie over each other, the first with area about 1. The distance
    `near`, in square roots of the area, costs as much as a right angle between the directions;
    `stretch` is the cost of stretching or shrinking a step by a factor of e. `count` points are
    matched; those between follow in proportion. Lengths increase by less than a round.
    """
    along = arc_lengths(ring)
    points = resampled(ring, count)
    places = count * PLACES_PER_POINT
    cost = _differences(points, resampled(other, places), near)
    first = int(cost.min(axis=1).argmin())
    cost = np.roll(cost, -first, axis=0)
    steps = _best_of(cost, _first_places(cost[0]), stretch)
    at = np.append(steps, steps[0] + places) / places * arc_lengths(other)[-1]
    # the k-th matched point lies at (first + k) / count of the length
    matched = (first + np.arange(count + 1)) / count * along[-1]
    knots = np.concatenate([matched[:-1] - along[-1], matched])
    values = np.concatenate([at[:-1] - arc_lengths(other)[-1], at])
    return np.interp(along[:-1], knots, values)


def _differences(points: Array, places: Array, near: float) -> Array:
    """Return the costs (n, m) of matching a point with a place."""
    x, y = complex_points(points), complex_points(places)
    tangents, other = (np.roll(z, -k) - np.roll(z, k) for z, k in ((x, 1), (y, PLACES_PER_POINT)))
    tangents, other = (step / np.maximum(abs(step), 1e-12) for step in (tangents, other))
    apart = abs(x[:, None] - y[None]) ** 2 / near**2
    return apart + 1 - (np.conj(tangents)[:, None] * other[None]).real


def _first_places(cost: Array) -> list[int]:
    """Return places for the first point, no two of them side by side."""
    chosen: list[int] = []
    for place in np.argsort(cost, kind="stable").tolist():
        gaps = [abs(place - other) for other in chosen]
        if all(min(gap, len(cost) - gap) > PLACES_PER_POINT for gap in gaps):
            chosen.append(place)
        if len(chosen) == FIRST_PLACES:
            break
    return chosen


def _best_of(cost: Array, begin: list[int], stretch: float) -> Array:
    """Return the best increasing places (n,), the first of them one of the places in `begin`."""
    n, m = cost.shape
    length = np.arange(1, MAX_STEP_RATIO * PLACES_PER_POINT + 1)
    price = stretch * np.log(length / PLACES_PER_POINT) ** 2
    best, least = np.zeros(n), np.inf
    for start in begin:
        turned = np.roll(cost, -start, axis=1)
        total = np.full(m + 1, np.inf)
        total[0] = turned[0, 0]
        came = np.zeros((n + 1, m + 1), dtype=np.int64)
        for i in range(1, n + 1):
            last = i == n  # the first point again
            padded = np.concatenate([np.full(len(length), np.inf), total])
            windows = np.lib.stride_tricks.sliding_window_view(padded, len(length))[: m + 1]
            sums = windows[:, ::-1] + price
            came[i] = sums.argmin(axis=1)
            total = sums[np.arange(m + 1), came[i]]
            total = total + (0.0 if last else np.append(turned[i], turned[i, 0]))
        if total[m] < least:
            least, place, path = float(total[m]), m, np.zeros(n)
            for i in range(n, 0, -1):
                place -= int(length[came[i, place]])
                path[i - 1] = place
            best = path + start
    return best


# the values of `near` and `stretch` of `corresponding` that are tried
STARTS = ((0.15, 0.5), (0.4, 1.0), (0.8, 2.0), (0.4, 4.0))
# the steps of each start, and of the best one: with the energy, then with the forgiving energy
TRIAL_STEPS, ENERGY_STEPS, SOFTENINGS, STEPS_PER_SOFTENING = 3, 20, 4, 5
MAX_SLIDE = 2.0  # the largest slide of a point in one step, in spacings
MIN_GAP = 0.02  # the least distance along the outline of consecutive points, in spacings


def bent_onto(body: Elastic, ring: Array) -> Complex:
    """Return the body (N,) bent so that its outline's points lie on a ring, in order.

    The simple counter-clockwise ring (M, 2) lies over the silhouette. Points of the outline come to lie
    on a copy of it about the origin whose size suits the body best.
    """
    tried = [_start(body, ring, near, stretch) for near, stretch in STARTS]
    slide, z = min(tried, key=lambda shape: _objective(body, shape[1]))
    for _ in range(ENERGY_STEPS):
        slide, z = _step(body, slide, z)
    for _ in range(SOFTENINGS):
        soft = body.forgiving(z)
        for _ in range(STEPS_PER_SOFTENING):
            slide, z = _step(soft, slide, z)
    return z[:, 0]


class _Slide(NamedTuple):
    """Points at arc lengths `at` (n,) of a ring, which is made larger by `scale`."""

    ring: Array
    at: Array
    scale: float

    def points(self) -> Complex:
        return self.scale * complex_points(points_along(self.ring, self.at))

    def tangents(self) -> Complex:
        sides = np.roll(self.ring, -1, axis=0) - self.ring
        unit = complex_points(sides / np.linalg.norm(sides, axis=1, keepdims=True))
        knots = arc_lengths(self.ring)
        at: Array = self.at % knots[-1]
        side = np.searchsorted(knots, at, side="right") - 1
        return unit[np.clip(side, 0, len(unit) - 1)]


def _start(body: Elastic, ring: Array, near: float, stretch: float) -> tuple[_Slide, Complex]:
    at = corresponding(plane_points(body.rest[: body.size]), ring, near, stretch)
    slide = _Slide(ring, _separated(at, arc_lengths(ring)[-1]), 1.0)
    z = body.pulled(body.rest[:, None], slide.points()[:, None], 600.0, 4)
    for _ in range(TRIAL_STEPS):
        slide, z = _step(body, slide, z)
    return slide, z


def _step(body: Elastic, slide: _Slide, z: Complex) -> tuple[_Slide, Complex]:
    """Slide once, by half the way or less where all of it would cost more; the inside follows."""
    condensed, forces = body.condensed, body.forces(z)
    p, along = slide.points(), slide.scale * slide.tangents()
    pull = condensed.forces(forces)[:, 0]
    matrix, low = condensed.outline, condensed.low
    product = matrix @ p.real + 1j * (matrix @ p.imag)
    hessian = np.empty((len(p) + 1, len(p) + 1))
    hessian[:-1, :-1] = matrix * (np.conj(along)[:, None] * along[None]).real
    hessian[:-1, -1] = hessian[-1, :-1] = (np.conj(along) * product).real
    hessian[-1, -1] = np.vdot(p, product).real
    less = low.conj().T @ np.concatenate([np.diag(along), p[:, None]], axis=1)
    hessian -= (less.conj().T @ less).real
    product -= low @ (low.conj().T @ p)
    gap = pull - product
    right = np.append((np.conj(along) * gap).real, np.vdot(p, gap).real)
    hessian[np.diag_indices_from(hessian)] += 1e-8 * np.trace(hessian) / len(hessian)
    way = scipy.linalg.solve(hessian, right, assume_a="pos", check_finite=False)
    size = arc_lengths(slide.ring)[-1]
    reach = MAX_SLIDE * size / len(p)
    stay = condensed.whole(p[:, None], forces)
    least = _objective(body, stay)
    for share in (1.0, 0.5, 0.2, 0.05):
        further = _Slide(
            slide.ring,
            _separated(slide.at + share * np.clip(way[:-1], -reach, reach), size),
            slide.scale * (1 + share * float(np.clip(way[-1], -0.2, 0.2))),
        )
        moved = condensed.whole(further.points()[:, None], forces)
        if _objective(body, moved) < least:
            return further, moved
    return slide, stay


def _objective(body: Elastic, z: Complex) -> float:
    """Return the objective of the descent: the energy and that of the pose."""
    copy, _ = body.copies(z)
    return float(body.energy(z)[0] + body.stiffness.pose * (abs(z - copy) ** 2).mean())


def _separated(at: Array, size: float) -> Array:
    """Return places (n,) on a closed line, moved as little as order and a least distance require."""
    n = len(at)
    spaced = np.arange(n) * (MIN_GAP * size / n)
    turn = size - n * (MIN_GAP * size / n)  # what is left of a round
    three = np.concatenate([at - spaced - turn, at - spaced, at - spaced + turn])
    up = np.maximum.accumulate(three)
    down = np.minimum.accumulate(three[::-1])[::-1]
    return ((up + down) / 2)[n : 2 * n] + spaced
