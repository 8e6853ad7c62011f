"""Co-deformation: a silhouette bends, as rigidly as it can, until it is a tile (design point 15).

Hundreds of placements side by side. First springs draw each outline to the nearest tile of its
class, which is taken anew after every step, and tighten; one factorization serves all placements
and all classes. Then each outline is held in the linear space of its placement's tiles and the
energy is minimised there: rotations in turn with one small linear system.

A search with few points knows a tile's corners to within a sixtieth of the outline. So each
placement then moves to the best of its neighbours until none is better: the lengths of two pairs of
edges change by a step, or all corners move along. Of the neighbours, those whose nearest tile is
near the present outline are worked out, by springs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import permutations
from math import gcd
from typing import NamedTuple

import numpy as np
import scipy.linalg
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.runtime import NEVER, Cancel
from orbiflow.tiles.geometry import plane_points, reverse, signed_area
from orbiflow.tiles.likeness import Elastic, ElasticBody, Pinned, Stiffness
from orbiflow.tiles.search.tile_space import Placements, TileSpace
from orbiflow.tiles.silhouette import Emphasis, Pins, Samples, Target, sampled, triangulate
from orbiflow.tiles.tilings import IsohedralClass

SPRING_STRENGTHS = tuple(np.geomspace(1.2, 3000.0, 3))  # strengths of the springs, stage by stage
ROUNDS = 3  # steps of choosing rotations and solving in each stage
NEIGHBOUR_ROUNDS = 2  # the same of each neighbour
FOLLOW_ROUNDS = 3  # the number of times that the inside follows a carved outline
LEAST_AREA = 0.1  # the area of a figure of area about 1 below which nothing is left of it


class BentTiles(NamedTuple):
    """C bent silhouettes that are tiles."""

    points: Complex  # (N, C) of the body; the first n rows are the tile's vertices
    linear: Array  # with `offset`: (C, 2, 2) and (C, 2), the map from the group's own frame
    offset: Array
    placements: Placements  # C of them, with the glide axes' final turns


def drawn_to_tiles(
    body: ElasticBody,
    kind: IsohedralClass,
    placements: Placements,
    *,
    strengths: tuple[float, ...] = SPRING_STRENGTHS,
    rounds: int = ROUNDS,
) -> tuple[Complex, TileSpace]:
    """Bend a body by springs that tighten: shapes (N, C), nearly tiles, and the space of the tiles."""
    space = TileSpace(kind, placements)
    z = np.repeat(body.rest[:, None], space.count, axis=1)
    for strength in strengths:
        space.turn(space.best_turns(z[: body.size].T))
        for _ in range(rounds):
            z = body.pulled(z, nearest_tiles(space, z), strength, 1)
    return z, space


def nearest_tiles(space: TileSpace, z: Complex) -> Complex:
    """Return the nearest tiles (n, C) to the outlines of shapes (N, C), point by point."""
    return space.in_order(space.nearest(z[: space.size].T).vertices).T


def sprung(body: ElasticBody, space: TileSpace, z: Complex, rounds: int) -> Complex:
    """Return shapes (N, C) that strong springs pull to tiles, whose glide axes turn to suit them."""
    if space.glides:
        space.turn(space.best_turns(z[: body.size].T))
    for _ in range(rounds):
        z = body.pulled(z, nearest_tiles(space, z), COMPARISON_STRENGTH, 1)
    return z


def held_on_tiles(body: ElasticBody, space: TileSpace, z: Complex, rounds: int) -> BentTiles:
    """Minimise the energy among tiles from shapes (N, C): outlines move in their placements' spaces."""
    condensed = body.condensed
    low = condensed.low
    parts = [_Reduced(condensed.outline, low, *space.matrices(k)) for k in range(space.count)]
    outline = np.empty((body.size, space.count), dtype=complex)
    for _ in range(rounds):
        forces = body.forces(z)
        pulls = condensed.forces(forces)
        for k, part in enumerate(parts):
            outline[:, k] = part.solve(pulls[:, k])
        z = condensed.whole(outline, forces)
    groups = [space.group(k, part.parameters) for k, part in enumerate(parts)]
    return BentTiles(
        z,
        np.array([linear for linear, _ in groups]).reshape(-1, 2, 2),
        np.array([offset for _, offset in groups]).reshape(-1, 2),
        space.placements._replace(turns=space.turns),
    )


def following(body: ElasticBody, outline: Complex, points: Complex) -> Complex:
    """Return a shape (N,) near `points` (N,) whose points on outlines are given (m,)."""
    condensed, z = body.condensed_to_outlines, points[:, None]
    for _ in range(FOLLOW_ROUNDS):
        z = condensed.whole(outline[:, None], body.forces(z))
    return z[:, 0]


def costs_of(body: ElasticBody, z: Complex) -> tuple[Array, NDArray[np.bool_]]:
    """Return what bending all figures costs (F, C) in shapes (N, C), and which shapes are sound.

    Sound ones do not cross themselves, nor do figures overlap.
    """
    costs, sound = np.empty((len(body.figures), z.shape[1])), np.ones(z.shape[1], dtype=bool)
    for k, (figure, places) in enumerate(zip(body.figures, body.places, strict=True)):
        shapes = z[places]
        rings = plane_points(shapes[: figure.size].T)
        area = signed_area(rings)
        sound &= np.asarray(shapely.is_valid(shapely.polygons(rings))) & (area > LEAST_AREA)
        costs[k] = figure.energy(shapes) / np.maximum(area, LEAST_AREA)
        costs[k] += figure.stiffness.pose * figure.displacement(shapes)
    if len(costs) > 1:
        sound &= np.asarray(shapely.is_valid(shapely.polygons(plane_points(z[: body.size].T))))
    return costs, sound


class _Reduced:
    """The outline's equations in the parameters of one placement's tiles."""

    def __init__(self, matrix: Array, low: Complex, real: Array, imaginary: Array) -> None:
        self.real, self.imaginary = real, imaginary
        stiffness = real.T @ (matrix @ real) + imaginary.T @ (matrix @ imaginary)
        less = low.conj().T @ (real + 1j * imaginary)
        stiffness -= (less.conj().T @ less).real
        # IH1 does not care about the offset
        stiffness[np.diag_indices_from(stiffness)] += 1e-10 * np.trace(stiffness) / len(stiffness)
        self.factor = scipy.linalg.cho_factor(stiffness, overwrite_a=True, check_finite=False)
        self.parameters = np.zeros(len(stiffness))

    def solve(self, force: Complex) -> Complex:
        right = self.real.T @ force.real + self.imaginary.T @ force.imag
        self.parameters = scipy.linalg.cho_solve(self.factor, right, check_finite=False)
        return self.real @ self.parameters + 1j * (self.imaginary @ self.parameters)


# Thin parts of a soft body are as stiff as others, and it may leave its pose: long limbs find a way
# where those of firmer bodies cross. In firmer ones bodies and heads are stiff, thin parts are not, and
# all keep their places, the more the stiffer. docs/likeness.md has the comparison.
BODIES = {
    "soft": Stiffness(salience=0.0),
    "firm": Stiffness(salience=-0.5, pose=60.0),
    "stiff": Stiffness(salience=-0.5, pose=600.0),
}


@dataclass(frozen=True, eq=False)
class Orientation:
    """A silhouette or its mirror image."""

    mirrored: bool  # whether the latter
    outline: Array  # (N, 2) its outline, counter-clockwise
    samples: Samples  # points of its outline, coarse to fine
    made: Callable[[str, Stiffness], Elastic]  # the body of a level of points and a stiffness
    plain: bool  # whether there is neither emphasis nor pins

    @cached_property
    def fine(self) -> Elastic:
        """The body of usual stiffness with all points: what costs are measured by."""
        return self.made("fine", Stiffness())

    def bodies(self, stiffness: Stiffness) -> tuple[Elastic, Elastic, Elastic]:
        """Return the bodies of a stiffness with few points, more and all."""
        middle = "fine" if len(self.samples.middle) == len(self.samples.fine) else "middle"
        fine = self.made("fine", stiffness)
        return self.made("coarse", stiffness), self.made(middle, stiffness), fine


@lru_cache(maxsize=4)  # one serves most classes
def orientations(
    target: Target,
    multiples: tuple[int, ...],
    phase: float,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    step: int = 6,
) -> tuple[Orientation, Orientation]:
    """Return the silhouette and its mirror image in the x axis, with a multiple of `step` points.

    The points begin at a `phase`, a share of the distance of two.
    """
    outline = np.asarray(target.normal)
    samples = sampled(outline, phase, multiples, step)
    # read backwards from the same first point: every k-th fine point stays beside a coarse one
    mirror = Samples(*(reverse(part) * (1.0, -1.0) for part in samples))

    def oriented(outline: Array, points: Samples, mirrored: bool) -> Orientation:
        meshes = {name: triangulate(ring) for name, ring in points._asdict().items()}

        @cache  # of a level and stiffness, when it is first asked for
        def made(level: str, stiffness: Stiffness) -> Elastic:
            ring: Array = getattr(points, level)
            mesh = meshes[level]
            vertices = mesh.points * ((1.0, -1.0) if mirrored else (1.0, 1.0))
            stiff = None if emphasis is None else emphasis.weight(vertices)
            if pins is None:
                return Elastic(ring, stiffness, stiff=stiff, mesh=mesh)
            parts, angle = pins.parts(vertices, mesh.triangles), pins.keep_angle
            return Pinned(ring, parts, stiffness, keep_angle=angle, stiff=stiff, mesh=mesh)

        return Orientation(mirrored, outline, points, made, emphasis is None and pins is None)

    return oriented(outline, samples, False), oriented(reverse(outline) * (1.0, -1.0), mirror, True)


# Strength of the springs by which neighbours are compared: nearly tiles, yet one matrix for all
COMPARISON_STRENGTH = 1500.0
CROSSING_COST = 100.0  # added to the cost of what crosses itself: more than anything simple costs
MAX_COST_RATIO = 0.998  # a neighbour is taken if it costs less than this much of what there is
MAX_MOVES = 8  # of each placement with each step


class Drawn(NamedTuple):
    """C shapes drawn to tiles of their placements by springs."""

    placements: Placements  # C of them
    points: Complex  # (N, C)
    # (C,) energy, springs and displacement; `CROSSING_COST` more of what crosses itself
    costs: Array

    def take(self, index: Integers) -> Drawn:
        """Return those at `index`."""
        return Drawn(self.placements.take(index), self.points[:, index], self.costs[index])


def shifted(
    body: Elastic,
    kind: IsohedralClass,
    placements: Placements,
    points: Complex,
    step: int,
    *,
    share: float,
    cancel: Cancel = NEVER,
) -> Drawn:
    """Move the corners of placements of shapes (N, C) until none of the `share` nearest costs less.

    Corners move by so many points in a `step`. Of those that have come to one placement, one is left.
    """
    drawn = _drawn(body, kind, placements, points)
    live = np.arange(len(drawn.costs))
    for _ in range(MAX_MOVES):
        cancel.check()
        owners, options = _neighbours(body, kind, drawn, live, step, share)
        if not len(owners):
            break
        tried = _drawn(body, kind, options, drawn.points[:, owners])
        live = _take_better(drawn, owners, tried)
    return _distinct(drawn)


def _drawn(body: Elastic, kind: IsohedralClass, placements: Placements, points: Complex) -> Drawn:
    space, n = TileSpace(kind, placements), body.size
    points = sprung(body, space, points, NEIGHBOUR_ROUNDS)
    rings = plane_points(points[:n].T)
    apart = (abs(points[:n] - nearest_tiles(space, points)) ** 2).mean(axis=0)
    area = np.maximum(signed_area(rings), LEAST_AREA)
    costs = (body.lenient_energy(points) + COMPARISON_STRENGTH * apart) / area
    costs += body.stiffness.pose * body.displacement(points)
    costs[~shapely.is_valid(shapely.polygons(rings))] += CROSSING_COST
    return Drawn(placements._replace(turns=space.turns), points, costs)


def _distinct(drawn: Drawn) -> Drawn:
    """Return them best first, no placement twice."""
    seen: dict[tuple[int, ...], int] = {}
    for k in np.argsort(drawn.costs, kind="stable").tolist():
        corners = (int(drawn.placements.starts[k]), *drawn.placements.lengths[k].tolist())
        seen.setdefault(corners, k)
    return drawn.take(np.array(list(seen.values()), dtype=np.int64))


def _neighbours(
    body: Elastic, kind: IsohedralClass, drawn: Drawn, live: Integers, step: int, share: float
) -> tuple[Integers, Placements]:
    """Return owners (M,) and their neighbours, for those at `live`: the share of the nearest tiles."""
    longer, later = _moves(kind, step)
    placements = drawn.placements
    owners = np.repeat(live, len(later))
    lengths = (placements.lengths[live][:, None] + longer).reshape(len(owners), longer.shape[1])
    starts = (placements.starts[live][:, None] + later).ravel() % body.size
    fits = (lengths >= 2).all(axis=1)
    owners, lengths, starts = owners[fits], lengths[fits], starts[fits]
    options = Placements(lengths, starts, placements.turns[owners])
    if share >= 1 or not len(owners):
        return owners, options
    apart = TileSpace(kind, options).distances(drawn.points[: body.size, owners].T)
    order = np.lexsort((apart, owners))
    rank = np.arange(len(order)) - np.searchsorted(owners[order], owners[order])
    count = np.bincount(owners, minlength=len(drawn.costs))[owners[order]]
    near = np.sort(order[rank < np.maximum(4, share * count)])
    return owners[near], options.take(near)


def _take_better(drawn: Drawn, owners: Integers, tried: Drawn) -> Integers:
    """Let each take the best that it has tried, in place; who has moved."""
    moved: list[int] = []
    for k in np.unique(owners):
        mine = np.flatnonzero(owners == k)
        best = mine[np.argmin(tried.costs[mine])]
        if tried.costs[best] < MAX_COST_RATIO * drawn.costs[k]:
            for old, new in zip(drawn.placements, tried.placements, strict=True):
                old[k] = new[best]
            drawn.points[:, k], drawn.costs[k] = tried.points[:, best], tried.costs[best]
            moved.append(int(k))
    return np.array(moved, dtype=np.int64)


@lru_cache(maxsize=64)
def _moves(kind: IsohedralClass, step: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return neighbours of a placement: what is added to lengths (M, K) and starts (M,).

    The edges of one class become longer and those of another shorter, with the first corner where it
    is, or moved so that one of the other corners stays; or all corners move.
    """
    still = np.zeros(len(kind.template()), dtype=np.int64)
    lengths, starts = [still, still], [step, -step]
    for growing, other in permutations((edge_class.edges for edge_class in kind.edge_classes), 2):
        change, common = still.copy(), gcd(len(growing), len(other))
        change[growing] += step * len(other) // common
        change[other] -= step * len(growing) // common
        corners = np.cumsum(change) - change
        low, high = int(corners.min()), int(corners.max())
        for start in sorted({0, -low, -high, -(low + high) // 2}):
            lengths.append(change)
            starts.append(start)
    return np.array(lengths), np.array(starts)
