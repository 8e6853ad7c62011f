"""Carving: the outlines of bent tiles move to the highest mark among the tiles of their placement.

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

Where several figures share a tile, the points of the paths between them are free as well, and a soft
minimum of all marks climbs, since the mark of the better figure helps nobody.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np
import scipy.linalg
import scipy.optimize

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.likeness import Elastic, ElasticBody, Gaps, mark_gradient
from orbiflow.tiles.search.tile_space import TileSpace

SLIDING_STEPS, LAST_STEPS = 60, 20  # the largest numbers of steps while points slide, and after it
STEPS_APART = 20  # of these, those after which it is looked anew where gaps are missing
RACE_STEPS, MAX_BEHIND = 20, 0.05  # steps of carving, and marks behind another, after which it ends
STALLED_STEPS, STALLED_GAIN = 5, 0.005  # steps that end it, if they gain fewer marks together
HOPELESS_COST = 20.0  # in marks, after the first steps apart: too many gaps are missing
SOFTNESS = 0.4  # marks by which one figure may be better before the others alone count
NO_MARK = 20.0  # of a figure that may have any shape: above all marks, so that it never counts
WRINKLE_COST = 0.12  # in marks a radian by which the tile turns elsewhere than the silhouette
GAP_COST = 1.0  # in marks for each point that has no gap at all
UNEVEN_COST = 0.1  # in marks for a mean square of 1 of how much nearer points lie than vertices
SLIDES = 36  # the number of pieces of the spline by which points slide
SLIDE_UNIT = 1.0  # the step of the splines that counts like one of the outline
MIN_POINT_DISTANCE = 0.3  # the least distance of successive points, in vertices
CORNER_REACH = 3  # how many points to either side of a tile's corner move so that one lies there


class Carved(NamedTuple):
    """A figure's outline in a tile, which is the tile's own if there is one figure."""

    ring: Complex  # (n,) its vertices
    places: Array  # (n,) where the silhouette's points lie on it, in vertices from the first
    corners: Integers  # (K,) the points of the silhouette that lie at its corners, if any are to
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

    def enter(self, cost: float) -> None:
        """Take what one more tile costs after so many steps, or raise `BehindError`."""
        if cost > self._best + MAX_BEHIND:
            raise BehindError
        self._best = min(self._best, cost)


def _watch(race: Race | None) -> Callable[..., None]:
    """Return what is called after each step of a climb; it ends one that hardly rises any more."""
    costs: list[float] = []

    def watch(intermediate_result: scipy.optimize.OptimizeResult) -> None:
        costs.append(float(intermediate_result.fun))
        if race is not None and len(costs) == RACE_STEPS:
            race.enter(costs[-1])
        if len(costs) > STALLED_STEPS and costs[-1 - STALLED_STEPS] - costs[-1] < STALLED_GAIN:
            raise StopIteration

    return watch


def carved(
    body: ElasticBody,
    space: TileSpace,
    figures: Sequence[Carved],
    *,
    room: float = 0.0,
    race: Race | None = None,
    most_steps: tuple[int, int] = (SLIDING_STEPS, LAST_STEPS),
    shapeless: Collection[int] = (),
) -> list[Carved]:
    """Return the tile of the highest mark near a tile of the space's only placement, as its figures.

    It may cross itself. With `room`, in square roots of the area, parts of outlines move apart until
    there is so much between them. `most_steps` are those while points slide, and after it. The figures
    that are `shapeless` may have any shape. Raises `BehindError` if it falls behind in a race, or if
    parts are so far into each other that they do not come apart.
    """
    hill = _Hill(body, space, [figure.ring for figure in figures], shapeless)

    def climbed(start: Array, fixed: list[Array] | None = None) -> Array:
        steps = most_steps[0] if fixed is None else most_steps[1]
        rounds = max(1, steps // STEPS_APART) if room else 1
        for number in range(rounds):
            climb = scipy.optimize.minimize(
                hill.lost,
                start,
                (fixed, hill.gaps(start, room) if room else []),
                jac=True,
                method="L-BFGS-B",
                callback=_watch(None if fixed else race),
                options={"maxiter": steps // rounds, "maxcor": 20},
            )
            if number == 0 and room and climb.fun > HOPELESS_COST:
                raise BehindError
            start = climb.x
        return start

    best = climbed(hill.start(figures))
    slides = map(calmed, hill.slides(best))
    laid = [
        cornered(numbers + slide, figure.corners)
        for numbers, slide, figure in zip(hill.numbers, slides, figures, strict=True)
    ]
    best = climbed(best, [places for places, _ in laid])
    vertices, group = hill.tile(best)
    rings = (vertices[places] for places in hill.places)
    return [Carved(ring, *layout, *group) for ring, layout in zip(rings, laid, strict=True)]


class _Hill:
    """What figures lose, by parameters: of their vertices, then of how the points of each slide."""

    def __init__(
        self,
        body: ElasticBody,
        space: TileSpace,
        rings: Sequence[Complex],
        shapeless: Collection[int],
    ) -> None:
        self.body, self.space, self.shapeless = body, space, shapeless
        self.measures = [figure.measures for figure in body.figures]
        self.places = body.ring_places
        self.numbers = [np.arange(len(places)) for places in self.places]
        self.splines = list(map(spline_basis, body.figures, rings))
        real, imaginary = space.matrices(0)
        self.tile_count = real.shape[1]
        within = body.outer - body.size
        # the tiles, then x and y of each point within the paths that figures share
        columns = np.zeros((body.outer, self.tile_count + 2 * within), dtype=complex)
        columns[: body.size, : self.tile_count] = real + 1j * imaginary
        columns[body.size :, self.tile_count :] = np.kron(np.eye(within), [1, 1j])
        matrix = body.condensed_to_outlines.outline
        self.root = scipy.linalg.cholesky(_stiffness(matrix, columns, 1e-6), lower=True)
        basis = scipy.linalg.solve_triangular(self.root, columns.T, lower=True).T
        self.count = basis.shape[1]
        # x and y of each vertex
        self.basis = np.stack([basis.real, basis.imag], axis=1).reshape(-1, self.count)
        self.across = np.ascontiguousarray(self.basis.T)

    def start(self, figures: Sequence[Carved]) -> Array:
        """Return the parameters of figures."""
        vertices = self.body.on_outlines(figure.ring for figure in figures)
        first = scipy.linalg.lstsq(self.basis, vertices.view(float), lapack_driver="gelsy")[0]
        slides = [
            np.linalg.lstsq(spline, figure.places - numbers, rcond=None)[0]
            for spline, figure, numbers in zip(self.splines, figures, self.numbers, strict=True)
        ]
        return np.concatenate([first, *slides])

    def tile(self, parameters: Array) -> tuple[Complex, tuple[Array, Array]]:
        """Return the vertices (m,), and the map from the group's own frame."""
        first = parameters[: self.count]
        placed = scipy.linalg.solve_triangular(self.root, first, lower=True, trans="T")
        return self._vertices(parameters), self.space.group(0, placed[: self.tile_count])

    def _vertices(self, parameters: Array) -> Complex:
        return (self.basis @ parameters[: self.count]).view(complex)

    def slides(self, parameters: Array) -> list[Array]:
        """Return by how many vertices the points (n_k,) of each figure slide."""
        amounts = parameters[self.count :].reshape(-1, SLIDES)
        return [spline @ amount for spline, amount in zip(self.splines, amounts, strict=True)]

    def gaps(self, parameters: Array, room: float) -> list[tuple[Integers, Gaps]]:
        """Return where room is missing: within each figure, and around several."""
        z = self._vertices(parameters)
        rings = self.places if len(self.places) == 1 else [*self.places, np.arange(self.body.size)]
        return [(ring, Gaps(z[ring], room)) for ring in rings]

    def lost(
        self, parameters: Array, fixed: list[Array] | None, gaps: list[tuple[Integers, Gaps]]
    ) -> tuple[float, Array]:
        """Return what is lost, and its gradient; points slide unless their places are fixed."""
        z, share = self._vertices(parameters), 1 / len(self.places)
        slides = self.slides(parameters) if fixed is None else []
        places = fixed or [n + slide for n, slide in zip(self.numbers, slides, strict=True)]
        marks, rises, laid = list[float](), list[Complex](), list[Laid]()
        for k, (measures, at) in enumerate(zip(self.measures, self.places, strict=True)):
            laid.append((Laid.smoothly if fixed is None else Laid.straight)(places[k]))
            mark, rise = mark_gradient(measures, laid[k].points(z[at]))
            marks.append(NO_MARK if k in self.shapeless else mark)
            rises.append(0 * rise if k in self.shapeless else rise)
        least, weights = _soft_minimum(np.array(marks))
        cost, uneven_cost = -least, 0.0
        down, sliding = np.zeros(len(z), dtype=complex), list[Array]()
        for k, (measures, at) in enumerate(zip(self.measures, self.places, strict=True)):
            ring, rise = z[at], weights[k] * rises[k]
            wrinkles, bumpy, shifted = measures.wrinkles(ring, places[k])
            cost += share * WRINKLE_COST * wrinkles
            down[at] += share * WRINKLE_COST * bumpy - laid[k].gradient(rise)
            if fixed is None:
                uneven = np.roll(slides[k], -1) - slides[k]
                uneven_cost += share * UNEVEN_COST * float((uneven**2).mean())
                slope = share * WRINKLE_COST * shifted - laid[k].slide_gradient(ring, rise)
                slope += share * UNEVEN_COST * 2 / len(at) * (np.roll(uneven, 1) - uneven)
                sliding.append(self.splines[k].T @ slope)
        for at, gap in gaps:
            missing, apart = gap.missing(z[at])
            cost, down[at] = cost + GAP_COST * missing, down[at] + GAP_COST * apart
        steep = self.across @ down.view(float)
        ends = sliding or [np.zeros(SLIDES) for _ in self.places]
        return cost + uneven_cost, np.concatenate([steep, *ends])


def _soft_minimum(marks: Array) -> tuple[float, Array]:
    """Return about the least of marks (F,), and its gradient (F,)."""
    least = float(marks.min())
    weights = np.exp((least - marks) / SOFTNESS)
    total = float(weights.sum())
    return least - SOFTNESS * math.log(total / len(marks)), weights / total


def spline_basis(body: Elastic, ring: Complex) -> Array:
    """Return splines (n, `SLIDES`) of unit stiffness, if points slide by so many vertices."""
    n = body.size
    at = np.arange(n)[:, None] * SLIDES / n - np.arange(SLIDES)
    far = abs((at + SLIDES / 2) % SLIDES - SLIDES / 2)
    spline = np.where(far < 1, 2 / 3 - far**2 + far**3 / 2, np.maximum(2 - far, 0) ** 3 / 6)
    moved = spline * ((np.roll(ring, -1) - np.roll(ring, 1)) / 2)[:, None]
    root = scipy.linalg.cholesky(_stiffness(body.condensed.outline, moved, 1e-3), lower=True)
    return SLIDE_UNIT * scipy.linalg.solve_triangular(root, spline.T, lower=True).T


def _stiffness(matrix: Array, columns: Complex, least: float) -> Array:
    """Return the stiffness (d, d) of outlines with a matrix (n, n) that move along columns (n, d)."""
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
    if not len(corners):
        return places, corners
    n = len(places)
    first = corners - corners[0]
    away = (places - corners[0] - first[:, None] % n + n / 2) % n - n / 2
    points = abs(away).argmin(axis=1)
    nearest = (points - points[0]) % n
    for k in range(1, len(nearest)):  # no two at one point
        nearest[k] = max(nearest[k], nearest[k - 1] + 1)
    moved = -away[np.arange(len(nearest)), (nearest + points[0]) % n]
    fixed = dict(zip(nearest.tolist(), moved.tolist(), strict=True))
    for at in nearest.tolist():
        for beyond in (at - CORNER_REACH - 1, at + CORNER_REACH + 1):
            if all(abs((beyond - k + n / 2) % n - n / 2) > CORNER_REACH for k in nearest.tolist()):
                fixed[beyond % n] = 0.0
    anchors = np.array(sorted(fixed))
    shift = np.interp(
        np.arange(n), anchors, np.array([fixed[k] for k in anchors.tolist()]), period=n
    )
    return places + np.roll(shift, points[0]), (nearest + points[0]) % n
