"""Carving of two figures at once: their tiling climbs to the highest mark of the worse one.

As for one silhouette (`carving`), by L-BFGS in the linear space of the union's tiles; the points of the
path that the figures share are free as well, and each figure's points slide along its own outline. What
climbs is a soft minimum of both marks, since the mark of the better one helps nobody.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
import scipy.optimize

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.geometry import plane_points
from orbiflow.tiles.likeness import (
    Gaps,
    Measures,
    mark_gradient,
    mixing_factor,
    neck_factor,
    neck_up_to,
    score_of,
)
from orbiflow.tiles.search.carving import (
    SLIDES,
    STEPS_APART,
    UNEVEN_COST,
    WRINKLE_COST,
    Laid,
    calmed,
    spline_basis,
)
from orbiflow.tiles.search.pair_bending import BentPair
from orbiflow.tiles.tilings import Tiling

NO_MARK = 20.0  # of a figure that may have any shape: above all marks, so that it never counts
SOFTNESS = 0.4  # marks by which one figure may be better before the other one alone counts
ROOM = 0.012  # the gaps that carving apart leaves, in square roots of the mean area


class _Part(NamedTuple):
    """What carving needs of one figure."""

    measures: Measures
    places: Integers  # (n,) of its outline's points among the pair's
    spline: Array  # (n, `SLIDES`) how its points slide
    has_mark: bool = True  # whether it is to be like its silhouette


@dataclass(frozen=True, eq=False)
class CarvedPair(BentPair):
    """A pair that was carved: its outlines are those of two tiles."""

    slides: tuple[Array, Array]  # (n_k,) by how many vertices points of the figures slide
    laid: tuple[Complex, Complex]  # (n_k,) where they lie
    linear: Array  # with `offset`: the map from the group's own frame
    offset: Array

    @property
    def tiling(self) -> Tiling:
        """The tiling of both figures' polygons."""
        group = self.kind.group().conjugate(self.linear, self.offset)
        return Tiling(group, [plane_points(ring) for ring in self.body.rings(self.points)])

    @cached_property
    def factor(self) -> float:
        """What is left of its score: 1, less where a neck is too thin, 0 if something crosses."""
        if not self.sound:
            return 0.0
        polygons = [plane_points(ring) for ring in self.body.rings(self.points)]
        width = self.figures.min_neck
        return min(neck_factor(neck_up_to(own, width), width) for own in polygons)

    @property
    def scores(self) -> tuple[float, float]:
        """What pairs are ordered by: how probably people like the worse figure, and the better.

        They are less where copies of one figure lie side by side.
        """
        low, high = sorted(score_of(mark) for mark in self.marks)
        factor = self.factor * mixing_factor(self.mixed)
        return low * factor, high * factor

    def __getstate__(self) -> dict[str, Any]:
        return {**super().__getstate__(), "factor": self.factor}

    @property
    def outlines(self) -> tuple[Complex, Complex]:
        return self.laid


def carved_pair(pair: BentPair, steps: int) -> CarvedPair:
    """Carve a pair, by so many steps while points slide and after it.

    If something crosses, or a neck is thin, it is carved apart. Where users say which parts matter, the
    pair stays as it is bent.
    """
    if not pair.figures.plain:
        return _uncarved(pair)
    found = _carved(pair, steps, 0.0)
    return (
        found
        if found.factor == 1
        else max(found, _carved(pair, steps, ROOM), key=lambda own: own.scores)
    )


def _uncarved(pair: BentPair) -> CarvedPair:
    """Return a bent pair with its tile's frame, which its outline gives."""
    space, n = pair.space, pair.body.size
    real, imaginary = space.matrices(0)
    whole = np.concatenate([real, imaginary])
    outline = pair.points[:n]
    parameters = scipy.linalg.lstsq(whole, np.concatenate([outline.real, outline.imag]))[0]
    points = pair.points.copy()
    points[:n] = real @ parameters + 1j * (imaginary @ parameters)
    rings = pair.body.rings(points)
    known = pair.figures, pair.level, pair.glue, pair.kind, pair.placement, points
    slides = np.zeros(len(rings[0])), np.zeros(len(rings[1]))
    return CarvedPair(*known, slides, rings, *space.group(0, parameters))


def _carved(pair: BentPair, steps: int, room: float) -> CarvedPair:
    body, space, n = pair.body, pair.space, pair.body.size
    real, imaginary = space.matrices(0)
    # the union's tiles, then x and y of each point within the path
    columns = np.zeros((body.outer, real.shape[1] + 2 * (body.outer - n)), dtype=complex)
    columns[:n, : real.shape[1]] = real + 1j * imaginary
    columns[n:, real.shape[1] :] = np.kron(np.eye(body.outer - n), [1, 1j])
    inverse = np.linalg.inv(body.matrix[body.outer :, body.outer :])
    follow = -inverse @ body.matrix[body.outer :, : body.outer]
    stiff = _stiffness(
        body.matrix[: body.outer, : body.outer],
        body.matrix[: body.outer, body.outer :] @ follow,
        columns,
    )
    root = scipy.linalg.cholesky(stiff, lower=True)
    basis: Complex = scipy.linalg.solve_triangular(root, columns.T, lower=True).T.astype(complex)
    has_mark = (True, not pair.figures.background)
    parts = [
        _Part(
            part.measures,
            places[: part.size],
            spline_basis(part, pair.points[places[: part.size]]),
            counts,
        )
        for part, places, counts in zip(body.parts, body.places, has_mark, strict=True)
    ]
    climb = _Climb(basis, parts, n)
    outline = pair.points[: body.outer]
    whole = np.concatenate([basis.real, basis.imag])
    start = scipy.linalg.lstsq(whole, np.concatenate([outline.real, outline.imag]))[0]
    slides = [np.zeros(SLIDES) for _ in parts]
    if isinstance(pair, CarvedPair):
        slides = [
            np.linalg.lstsq(own.spline, slide, rcond=None)[0]
            for own, slide in zip(parts, pair.slides, strict=True)
        ]
    best = climb.best(np.concatenate([start, *slides]), steps, room)
    fixed = [calmed(slide) for slide in climb.slides(best)]
    best = climb.best(best, steps, room, fixed)
    z = np.concatenate([climb.outline(best), pair.points[body.outer :]])[:, None]
    for _ in range(3):
        z[body.outer :] = follow @ z[: body.outer] + inverse @ body.forces(z)[body.outer :]
    laid = [
        Laid.straight(np.arange(len(own.places)) + slide).points(z[own.places, 0])
        for own, slide in zip(parts, fixed, strict=True)
    ]
    parameters = scipy.linalg.solve_triangular(root, best[: len(start)], lower=True, trans="T")
    group = space.group(0, parameters[: real.shape[1]])
    known = pair.figures, pair.level, pair.glue, pair.kind, pair.placement, z[:, 0]
    return CarvedPair(*known, (fixed[0], fixed[1]), (laid[0], laid[1]), *group)


def _stiffness(matrix: Array, condensed: Array, columns: Complex) -> Array:
    """Return the stiffness (d, d) of outlines that move along columns (n, d)."""
    matrix = matrix + condensed
    stiff = columns.real.T @ matrix @ columns.real + columns.imag.T @ matrix @ columns.imag
    stiff[np.diag_indices_from(stiff)] += 1e-6 * np.trace(stiff) / len(stiff)
    return stiff


class _Climb:
    """The cost of a pair by parameters: of its tiles, then of both figures' slides."""

    def __init__(self, basis: Complex, parts: list[_Part], size: int) -> None:
        self.basis, self.parts, self.size = basis, parts, size
        self.back = np.ascontiguousarray(basis.conj().T)
        self.count = basis.shape[1]

    def outline(self, parameters: Array) -> Complex:
        return self.basis @ parameters[: self.count]

    def slides(self, parameters: Array) -> list[Array]:
        """Return by how many vertices the points of both figures slide."""
        own = parameters[self.count :].reshape(len(self.parts), SLIDES)
        return [part.spline @ slide for part, slide in zip(self.parts, own, strict=True)]

    def best(
        self, start: Array, steps: int, room: float, fixed: list[Array] | None = None
    ) -> Array:
        """Climb by so many steps, while points slide, or with slides that are fixed."""
        rounds = max(1, steps // STEPS_APART) if room else 1
        for _ in range(rounds):
            gaps = self._gaps(start, room) if room else []
            start = scipy.optimize.minimize(
                self.lost,
                start,
                (fixed, gaps),
                jac=True,
                method="L-BFGS-B",
                options={"maxiter": steps // rounds, "maxcor": 20},
            ).x
        return start

    def _gaps(self, parameters: Array, room: float) -> list[tuple[Integers, Gaps]]:
        """Return where room is missing: within each figure, and around both."""
        z = self.outline(parameters)
        rings = [*(part.places for part in self.parts), np.arange(self.size)]
        return [(own, Gaps(z[own], room)) for own in rings]

    def lost(
        self, parameters: Array, fixed: list[Array] | None, gaps: list[tuple[Integers, Gaps]]
    ) -> tuple[float, Array]:
        """Return what is lost, and its gradient."""
        z, along, cost = self.outline(parameters), np.zeros(len(self.basis), dtype=complex), 0.0
        marks, rises, steep = list[float](), list[Complex](), list[Array]()
        sliding = list[Array]()
        for part, slide in zip(self.parts, fixed or self.slides(parameters), strict=True):
            ring, n = z[part.places], len(part.places)
            places = np.arange(n) + slide
            laid = Laid.smoothly(places) if fixed is None else Laid.straight(places)
            mark, rise = mark_gradient(part.measures, laid.points(ring))
            if not part.has_mark:
                mark, rise = NO_MARK, 0 * rise
            wrinkles, bumpy, shifted = part.measures.wrinkles(ring, places)
            marks.append(mark)
            rises.append(laid.gradient(rise))
            cost += WRINKLE_COST / 2 * wrinkles
            along[part.places] += WRINKLE_COST / 2 * bumpy
            if fixed is None:
                uneven = np.roll(slide, -1) - slide
                cost += UNEVEN_COST / 2 * float((uneven**2).mean())
                slope = WRINKLE_COST / 2 * shifted + UNEVEN_COST / n * (np.roll(uneven, 1) - uneven)
                steep.append(part.spline.T @ slope)
                sliding.append(part.spline.T @ laid.slide_gradient(ring, rise))
        for own, gap in gaps:
            missing, apart = gap.missing(z[own])
            cost += missing
            along[own] += apart
        least = min(marks)
        weights = np.exp((least - np.array(marks)) / SOFTNESS)
        total = float(weights.sum())
        cost -= least - SOFTNESS * float(np.log(total / len(marks)))
        for k, (part, rise) in enumerate(zip(self.parts, rises, strict=True)):
            along[part.places] -= weights[k] / total * rise
            if fixed is None:
                steep[k] -= weights[k] / total * sliding[k]
        ends = steep or [np.zeros(SLIDES) for _ in self.parts]
        return cost, np.concatenate([(self.back @ along).real, *ends])


def finer_slides(pair: CarvedPair, found: BentPair) -> CarvedPair:
    """Return a finer one of a carved pair with its slides."""
    multiple = found.body.parts[0].size // pair.body.parts[0].size

    def more(slide: Array) -> Array:
        at = np.arange(multiple * len(slide)) / multiple
        return multiple * np.interp(at, np.arange(len(slide) + 1), np.append(slide, slide[0]))

    known = found.figures, found.level, found.glue, found.kind, found.placement, found.points
    slides = more(pair.slides[0]), more(pair.slides[1])
    return CarvedPair(*known, slides, found.body.rings(found.points), pair.linear, pair.offset)
