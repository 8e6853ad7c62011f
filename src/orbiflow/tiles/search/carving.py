"""Carving: the outline of a bent tile moves to the highest mark among the tiles of its placement.

Bending spreads what must change over the whole outline, as its energy is quadratic. Eyes would rather
have a few places changed and the rest exact: that is what the mark says (`likeness.faithful`). So the
best tile of a class climbs from where bending leaves it, by L-BFGS (Liu and Nocedal, On the limited
memory BFGS method for large scale optimization, 1989) in the linear space of its placement's tiles,
with the body's stiffness as the metric. The mark does not see wrinkles, so these cost something, too;
and where an outline has crossed itself, or has thin necks, what is missing to a gap costs more than
what the mark can gain.

Edges of a tile that fit each other have equal numbers of vertices. Bent, one vertex is one point of the
silhouette, so both edges would have to show equal lengths of it. Carved, the silhouette's points slide
along the tile's outline instead, by a spline: first along a smooth curve through its vertices, so that
the mark has a gradient everywhere, and then they stay where they are, on its sides.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.optimize

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.likeness import Elastic, Gaps, mark_gradient
from orbiflow.tiles.search.tile_space import TileSpace

SLIDING_STEPS, LAST_STEPS = 60, 20  # the largest numbers of steps while points slide, and after it
STEPS_APART = 20  # of these, those after which it is looked anew where gaps are missing
RACE_STEPS, MAX_BEHIND = 20, 0.05  # steps of carving, and marks behind another, after which it ends
WRINKLE_COST = 0.12  # in marks a radian by which the tile turns elsewhere than the silhouette
GAP_COST = 1.0  # in marks for each point that has no gap at all
UNEVEN_COST = 0.1  # in marks for a mean square of 1 of how much nearer points lie than vertices
SLIDES = 36  # the number of pieces of the spline by which points slide
SLIDE_UNIT = 1.0  # the step of the splines that counts like one of the outline
MIN_POINT_DISTANCE = 0.3  # the least distance of successive points, in vertices
CORNER_REACH = 3  # how many points to either side of a tile's corner move so that one lies there


class Carved(NamedTuple):
    """A carved tile."""

    ring: Complex  # (n,) its vertices
    places: Array  # (n,) where the silhouette's points lie on it, in vertices from the first
    corners: Integers  # (K,) the points of the silhouette that lie at its corners
    linear: Array  # with `offset`: the map from the group's own frame
    offset: Array

    @property
    def in_order(self) -> bool:
        """Whether the silhouette's points follow each other on the tile."""
        return bool((np.diff(self.places, append=self.places[0] + len(self.places)) > 0).all())

    @property
    def outline(self) -> Complex:
        """The silhouette's points (n,) on the tile."""
        return Laid.straight(self.places).points(self.ring)


class BehindError(Exception):
    """A tile is so far behind another, early in its carving, that it would hardly win."""


class Race:
    """Gives up tiles that are far behind another after as many steps (`RACE_STEPS`)."""

    def __init__(self) -> None:
        self._best = math.inf

    def watch(self) -> Callable[..., None]:
        """Return what is called after each step of one more tile; it raises `BehindError`."""
        steps = itertools.count(1)

        def watch(intermediate_result: scipy.optimize.OptimizeResult) -> None:
            if next(steps) == RACE_STEPS:
                cost = float(intermediate_result.fun)
                if cost > self._best + MAX_BEHIND:
                    raise BehindError
                self._best = min(self._best, cost)

        return watch


def carved(
    body: Elastic,
    space: TileSpace,
    ring: Complex,
    corners: Integers,
    *,
    room: float = 0.0,
    race: Race | None = None,
) -> Carved:
    """Return the tile of the highest mark near a tile (n,) of the space's only placement.

    It may cross itself. With `room`, in square roots of the area, parts of the outline move apart until
    there is so much between them. `corners` are the vertices at the tile's corners. Raises
    `BehindError` if it falls behind in a race.
    """
    basis, root = _basis(body, space)
    spline = spline_basis(body, ring)
    count, own = basis.shape[1], np.arange(body.size)
    whole = np.stack([basis.real, basis.imag], axis=1).reshape(-1, count)  # x and y of each vertex
    across = np.ascontiguousarray(whole.T)

    def lost(parameters: Array, fixed: Array | None, gaps: Gaps | None) -> tuple[float, Array]:
        ring = (whole @ parameters[:count]).view(complex)
        slide = spline @ parameters[count:]
        places = own + slide if fixed is None else fixed
        laid = Laid.smoothly(places) if fixed is None else Laid.straight(places)
        mark, rise = mark_gradient(body.measures, laid.points(ring))
        wrinkles, bumpy, shifted = body.measures.wrinkles(ring, places)
        cost, down = WRINKLE_COST * wrinkles - mark, WRINKLE_COST * bumpy - laid.gradient(rise)
        if gaps is not None:
            missing, apart = gaps.missing(ring)
            cost, down = cost + GAP_COST * missing, down + GAP_COST * apart
        steep = across @ down.view(float)
        if fixed is not None:
            return cost, np.append(steep, np.zeros(SLIDES))
        uneven = np.roll(slide, -1) - slide
        cost += UNEVEN_COST * float((uneven**2).mean())
        sliding = WRINKLE_COST * shifted - laid.slide_gradient(ring, rise)
        sliding += UNEVEN_COST * 2 / body.size * (np.roll(uneven, 1) - uneven)
        return cost, np.concatenate([steep, spline.T @ sliding])

    def climbed(start: Array, fixed: Array | None = None) -> Array:
        steps = SLIDING_STEPS if fixed is None else LAST_STEPS
        rounds = steps // STEPS_APART if room else 1
        for _ in range(rounds):
            gaps = Gaps((whole @ start[:count]).view(complex), room) if room else None
            start = scipy.optimize.minimize(
                lost,
                start,
                (fixed, gaps),
                jac=True,
                method="L-BFGS-B",
                callback=race.watch() if race and fixed is None else None,
                options={"maxiter": steps // rounds, "maxcor": 20},
            ).x
        return start

    start = scipy.linalg.lstsq(whole, ring.view(float), lapack_driver="gelsy")[0]
    best = climbed(np.append(start, np.zeros(SLIDES)))
    places, points = cornered(own + calmed(spline @ best[count:]), corners)
    best = climbed(best, places)[:count]
    parameters = scipy.linalg.solve_triangular(root, best, lower=True, trans="T")
    return Carved(basis @ best, places, points, *space.group(0, parameters))


def _basis(body: Elastic, space: TileSpace) -> tuple[Complex, Array]:
    """Return the tiles (n, d) of unit stiffness, and the factor (d, d) that makes them from others."""
    real, imaginary = space.matrices(0)
    columns = real + 1j * imaginary
    root = scipy.linalg.cholesky(_stiffness(body, columns, 1e-6), lower=True)
    return scipy.linalg.solve_triangular(root, columns.T, lower=True).T, root


def spline_basis(body: Elastic, ring: Complex) -> Array:
    """Return splines (n, `SLIDES`) of unit stiffness, if points slide by so many vertices."""
    n = body.size
    at = np.arange(n)[:, None] * SLIDES / n - np.arange(SLIDES)
    far = abs((at + SLIDES / 2) % SLIDES - SLIDES / 2)
    spline = np.where(far < 1, 2 / 3 - far**2 + far**3 / 2, np.maximum(2 - far, 0) ** 3 / 6)
    moved = spline * ((np.roll(ring, -1) - np.roll(ring, 1)) / 2)[:, None]
    root = scipy.linalg.cholesky(_stiffness(body, moved, 1e-3), lower=True)
    return SLIDE_UNIT * scipy.linalg.solve_triangular(root, spline.T, lower=True).T


def _stiffness(body: Elastic, columns: Complex, least: float) -> Array:
    """Return the stiffness (d, d) of an outline that moves along columns (n, d)."""
    matrix = body.condensed.outline
    real, imaginary = columns.real, columns.imag
    stiff = real.T @ (matrix @ real) + imaginary.T @ (matrix @ imaginary)
    stiff[np.diag_indices_from(stiff)] += least * np.trace(stiff) / len(stiff)
    return stiff


class Laid(NamedTuple):
    """Points of the silhouette on a ring (n,): means of its vertices."""

    at: Integers  # (n, k) of which vertices
    weights: Array  # (n, k)
    slopes: Array  # (n, k) how the weights change with the place

    @classmethod
    def straight(cls, places: Array) -> Laid:
        """Lay points on the sides of the ring."""
        return cls._of(places, np.array([[1.0, -1.0], [0.0, 1.0]]), 0)

    @classmethod
    def smoothly(cls, places: Array) -> Laid:
        """Lay points on Catmull and Rom's cubics through the vertices, which have no kinks."""
        cubics = [[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]]
        return cls._of(places, np.array(cubics) / 2, -1)

    @classmethod
    def _of(cls, places: Array, polynomials: Array, first: int) -> Laid:
        below = np.floor(places).astype(np.int64)
        powers = np.vander(places - below, polynomials.shape[1], increasing=True)
        at = (below[:, None] + np.arange(first, first + len(polynomials))) % len(places)
        degrees: Array = np.arange(1.0, polynomials.shape[1])
        slopes = (powers[:, :-1] * degrees) @ polynomials[:, 1:].T
        return cls(at, powers @ polynomials.T, slopes)

    def points(self, ring: Complex) -> Complex:
        """Return the points (n,) on a ring."""
        return (self.weights * ring[self.at]).sum(axis=1)

    def gradient(self, along: Complex) -> Complex:
        """Return the gradient in the ring of what has a gradient (n,) in the points."""
        pulled, at, n = (self.weights * along[:, None]).ravel(), self.at.ravel(), len(along)
        return np.bincount(at, pulled.real, n) + 1j * np.bincount(at, pulled.imag, n)

    def slide_gradient(self, ring: Complex, along: Complex) -> Array:
        """Return the same in the places on the ring."""
        return (np.conj(along) * (self.slopes * ring[self.at]).sum(axis=1)).real


def calmed(slide: Array) -> Array:
    """Return slides (n,) in proportion, so small that points keep their order and a distance."""
    return slide * min(
        1.0, (1 - MIN_POINT_DISTANCE) / max((slide - np.roll(slide, -1)).max(), 1e-9)
    )


def cornered(places: Array, corners: Integers) -> tuple[Array, Integers]:
    """Return places (n,) of which some are moved to the corners, and which points (K,) these are."""
    n = len(places)
    first = corners - corners[0]
    away = (places - corners[0] - first[:, None] % n + n / 2) % n - n / 2
    points = abs(away).argmin(axis=1)
    own = (points - points[0]) % n
    for k in range(1, len(own)):  # no two at one point
        own[k] = max(own[k], own[k - 1] + 1)
    moved = -away[np.arange(len(own)), (own + points[0]) % n]
    fixed = dict(zip(own.tolist(), moved.tolist(), strict=True))
    for at in own.tolist():
        for beyond in (at - CORNER_REACH - 1, at + CORNER_REACH + 1):
            if all(abs((beyond - k + n / 2) % n - n / 2) > CORNER_REACH for k in own.tolist()):
                fixed[beyond % n] = 0.0
    known = np.array(sorted(fixed))
    shift = np.interp(np.arange(n), known, np.array([fixed[k] for k in known.tolist()]), period=n)
    return places + np.roll(shift, points[0]), (own + points[0]) % n
