"""How two figures bend, as rigidly as they can, until their union is a tile (design point 21).

All is as for one silhouette (`co_deformation`), with a body of two parts. A pair costs what both
figures do and, once more, what the worse one does: nobody looks at a pair of which one is spoilt.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import product
from typing import Any, TypeVar

import numpy as np

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.geometry import apart, best_similarity, reverse, ring_length
from orbiflow.tiles.likeness import Elastic, Stiffness, kept_of
from orbiflow.tiles.search.bending import followed
from orbiflow.tiles.search.co_deformation import (
    BODIES,
    COMPARISON_STRENGTH,
    CROSSING_COST,
    MAX_COST_RATIO,
    costs_of,
    drawn_to_tiles,
    held_on_tiles,
    nearest_tiles,
    sprung,
)
from orbiflow.tiles.search.gluing import Placement
from orbiflow.tiles.search.pair_body import Glue, PairBody
from orbiflow.tiles.search.tile_space import Placements, TileSpace
from orbiflow.tiles.silhouette import CORNER_DEPTH, important_vertices, triangulate, with_corners
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class

MULTIPLES = (1, 2, 8)  # points of each level for each point of the first
HELD_ROUNDS = 5  # steps of the minimisation among tiles
SPRUNG_ROUNDS = 3  # steps of springs that compare neighbours
BACKGROUND = Stiffness(salience=0.0, pose=0.0)  # of a figure that may have any shape
BACKGROUND_STIFFNESS = 0.03  # of it, relative to others
CROSSING_MARKS = 1.0  # less for a pair in which something crosses, before it is carved
TWIN_DISTANCE = 4e-4  # mean squared distance of both outlines below which pairs are twins
MOST_CHANGED = 3  # steps by which lengths of edges change at a time, in all
BEST_OF_GLUE = 5  # neighbours of each neighbouring glue that are worked out


Pair = TypeVar("Pair", bound="BentPair")
Stiff = Callable[[Array], Array]
"""How much stiffer than usual a silhouette is at points (N, 2) of its normal form."""


@dataclass(frozen=True)
class Figures:
    """Two silhouettes that are to share a tiling, with a mean area of 1, at three levels of points."""

    rings: tuple[bytes, bytes]  # (M, 2) each, float64, counter-clockwise, of area 1
    ratio: float = 1.0  # the area of the second one over that of the first
    mirrored: bool = False  # whether the second one is mirrored
    count: int = 64  # of points of both on the first level, in proportion to their lengths
    phase: float = 0.0  # by how many of the finest points' distances these are shifted
    # the width of necks, in square roots of the mean area, below which scores fall
    min_neck: float = 0.01
    background: bool = False  # whether the second one may have any shape
    # how much stiffer the silhouettes are at points (N, 2) of their normal forms
    stiff: tuple[Stiff | None, Stiff | None] = field(default=(None, None), compare=False)

    @classmethod
    def of(cls, one: Array, two: Array, **others: Any) -> Figures:
        """Return those of two rings (M, 2), with other fields by name."""
        rings = np.ascontiguousarray(one, np.float64), np.ascontiguousarray(two, np.float64)
        return cls((rings[0].tobytes(), rings[1].tobytes()), **others)

    @property
    def plain(self) -> bool:
        """Whether no part of a silhouette is stiffer than others."""
        return self.stiff == (None, None)

    @property
    def sizes(self) -> tuple[float, float]:
        """How large both are, in lengths of their normal forms."""
        first = math.sqrt(2 / (1 + self.ratio))
        return first, first * math.sqrt(self.ratio)

    def parts(self, level: int) -> tuple[Elastic, Elastic]:
        """Return the bodies of both, with the points of a level."""
        return _parts(self, level)


@lru_cache(maxsize=64)
def _parts(figures: Figures, level: int) -> tuple[Elastic, Elastic]:
    rings = [np.frombuffer(ring).reshape(-1, 2) for ring in figures.rings]
    lengths = [ring_length(ring) * size for ring, size in zip(rings, figures.sizes, strict=True)]
    first = round(figures.count * lengths[0] / sum(lengths))
    multiple, step = MULTIPLES[-1], MULTIPLES[-1] // MULTIPLES[level]

    def body(k: int, count: int, mirrored: bool) -> Elastic:
        corners = important_vertices(rings[k], CORNER_DEPTH)
        fine = with_corners(rings[k], corners, multiple * count, figures.phase)
        flip = (1.0, -1.0) if mirrored else (1.0, 1.0)
        fine = (reverse(fine) if mirrored else fine) * flip
        mesh, factor = triangulate(fine[::step] * figures.sizes[k]), figures.stiff[k]
        if k == 1 and figures.background:
            weak = np.full(len(mesh.points), BACKGROUND_STIFFNESS)
            return Elastic(mesh.points[: mesh.size], BACKGROUND, stiff=weak, mesh=mesh)
        own = None if factor is None else factor(mesh.points / figures.sizes[k] * flip)
        return Elastic(mesh.points[: mesh.size], BODIES["firm"], stiff=own, mesh=mesh)

    return body(0, first, False), body(1, figures.count - first, figures.mirrored)


@lru_cache(maxsize=256)
def glued_body(figures: Figures, level: int, glue: Glue) -> PairBody:
    """Return both figures, glued, with the points of a level."""
    return PairBody(figures.parts(level), glue)


@dataclass(frozen=True, eq=False)
class BentPair:
    """Two figures that are bent so that their union is, nearly, a tile."""

    figures: Figures
    level: int
    glue: Glue
    kind: IsohedralClass
    placement: Placements  # one, of the union
    points: Complex  # (N,) of the body

    @property
    def body(self) -> PairBody:
        """Both figures, glued."""
        return glued_body(self.figures, self.level, self.glue)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a process tells another, with costs and marks, which it would work out again."""
        known = {"_costs": self._costs, "marks": self.marks}
        return {**vars(self), **known, "kind": self.kind.name}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, kind=isohedral_class(state["kind"]))

    @cached_property
    def _costs(self) -> tuple[Array, bool]:
        costs, sound = costs_of(self.body, self.points[:, None])
        return costs[:, 0], bool(sound[0])

    @property
    def sound(self) -> bool:
        """Whether nothing crosses or overlaps."""
        return self._costs[1]

    @property
    def cost(self) -> float:
        """What bending costs, by which pairs are compared before they are carved."""
        return float(together(self._costs[0])) + CROSSING_COST * (not self.sound)

    @cached_property
    def mixed(self) -> float:
        """The share of all boundaries, by length, that lie between both figures."""
        n, own = self.body.size, self.placement
        ring = self.points[:n]
        steps = abs(np.roll(ring, -1) - ring)
        # which figure each step is of; those of the first one come first
        first = np.arange(n) < self.body.figures[0].size - self.glue.length
        lengths = own.lengths[0]
        corners = np.cumsum(lengths) - lengths + own.starts[0]

        def along(edge: int) -> Integers:
            return np.arange(corners[edge], corners[edge] + lengths[edge], dtype=np.int64) % n

        between = 0.0
        for kind in self.kind.edge_classes:
            mine = along(kind.edge)
            for image in (*kind.images, *([kind.turn] if kind.turn else [])):
                mate = along(image.edge)[:: -1 if image.reversed else 1]
                sides = 1 if image.edge == kind.edge else 2
                between += sides * float(steps[mine][first[mine] != first[mate]].sum())
        path = self.body.path(*self.outlines)[0]
        within = 2 * float(abs(np.diff(path)).sum())
        return (between + within) / (float(steps.sum()) + within)

    @property
    def promise(self) -> float:
        """The mark of the worse figure, less if something crosses: it predicts what carving gives."""
        return min(self.marks) - CROSSING_MARKS * (not self.sound)

    @property
    def outlines(self) -> list[Complex]:
        """Where the points (n_k,) of both figures' outlines are."""
        return self.body.rings(self.points)

    @cached_property
    def marks(self) -> tuple[float, float]:
        """The marks that people would give to both figures."""
        one, two = (
            kept_of(part.measures, ring, 0.0).mark
            for part, ring in zip(self.body.figures, self.outlines, strict=True)
        )
        return one, one if self.figures.background else two

    @property
    def space(self) -> TileSpace:
        """The tiles of the placement."""
        return TileSpace(self.kind, self.placement)

    def is_twin(self, other: BentPair) -> bool:
        """Whether both figures are as in another pair of the same figures."""
        rings = zip(self.body.rings(self.points), other.body.rings(other.points), strict=True)
        return self.figures == other.figures and all(apart(a, b) < TWIN_DISTANCE for a, b in rings)


def together(costs: Array) -> Array:
    """Return what pairs (C,) cost whose figures cost (2, C)."""
    return costs.sum(axis=0) + costs.max(axis=0)


def _as_placements(found: Sequence[Placement]) -> Placements:
    return Placements(
        np.array([own.lengths for own in found]),
        np.array([own.start for own in found]),
        np.array([own.turn for own in found], dtype=float),
        np.array([-own.residual for own in found], dtype=float),
    )


def bent(figures: Figures, placements: Sequence[Placement], count: int) -> list[BentPair]:
    """Bend coarse pairs by springs for each placement; the best of these are held among tiles."""
    groups: defaultdict[tuple[Glue, IsohedralClass], list[Placement]] = defaultdict(list)
    for own in placements:
        groups[own.glue, own.kind].append(own)
    rough: list[tuple[float, BentPair]] = []
    for (glue, kind), found in groups.items():
        own, body = _as_placements(found), glued_body(figures, 0, glue)
        z, space = drawn_to_tiles(body, kind, own)
        costs, _ = costs_of(body, z)
        own = own._replace(turns=space.turns)
        rough += [
            (cost, BentPair(figures, 0, glue, kind, own.take(np.array([k])), z[:, k]))
            for k, cost in enumerate(together(costs).tolist())
        ]
    rough.sort(key=lambda own: own[0])
    return [held(pair, HELD_ROUNDS) for _, pair in rough[:count]]


def held(pair: BentPair, rounds: int) -> BentPair:
    """Return the shape of least energy among the tiles of a pair's placement, in so many rounds."""
    tiles = held_on_tiles(pair.body, pair.space, pair.points[:, None], rounds)
    return replace(pair, placement=tiles.placements, points=tiles.points[:, 0])


def finer(pair: BentPair, level: int, *, rounds: int = HELD_ROUNDS) -> BentPair:
    """Return the same with the points of a finer level, in so many steps of the minimisation."""
    multiple = MULTIPLES[level] // MULTIPLES[pair.level]
    glue, own = pair.glue.times(multiple), pair.placement
    body = glued_body(pair.figures, level, glue)
    shapes = (pair.points[places] for places in pair.body.places)
    one, two = (
        followed(old, part, z[:, None], _turned(part, old, z))
        for part, old, z in zip(body.figures, pair.body.figures, shapes, strict=True)
    )
    own = own._replace(lengths=own.lengths * multiple, starts=own.starts * multiple)
    space = TileSpace(pair.kind, own)
    z = sprung(body, space, body.joined((one, two)), 2)
    if not rounds:
        z[: body.size] = nearest_tiles(space, z)
    own = own._replace(turns=space.turns)
    found = BentPair(pair.figures, level, glue, pair.kind, own, z[:, 0])
    return held(found, rounds) if rounds else found


def _turned(body: Elastic, old: Elastic, z: Complex) -> Complex:
    """Return a body (N, 1) in the pose of a coarser one's shape (N,)."""
    turn = np.exp(1j * np.angle(best_similarity(old.rest, z)))
    return (body.rest * turn + z[: old.size].mean())[:, None]


# How the ends of the path move along the first outline, along the second, and how much longer it is
PATH_MOVES = (
    *((0, 0, 0), (-1, 0, 1), (1, 0, -1), (0, -1, 1), (0, 1, -1)),
    *((1, -1, 0), (-1, 1, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)),
)


@lru_cache(maxsize=256)
def _changes(kind: IsohedralClass, total: int) -> Integers:
    """Return changes (M, K) of edges' lengths with a sum, by few steps."""
    edges = [own.edges for own in kind.edge_classes]
    found: list[Integers] = []
    for steps in product(range(-2, 3), repeat=len(edges)):
        if sum(map(abs, steps)) <= MOST_CHANGED:
            change = np.zeros(len(kind.template()), dtype=np.int64)
            for own, step in zip(edges, steps, strict=True):
                change[own] = step
            if change.sum() == total:
                found.append(change)
    return np.array(found, dtype=np.int64).reshape(-1, len(kind.template()))


@dataclass(frozen=True, eq=False)
class _Sprung:
    """Shapes drawn to tiles by springs, for comparison."""

    body: PairBody
    placements: Placements
    points: Complex  # (N, C)
    costs: Array  # (C,)

    @classmethod
    def of(
        cls, body: PairBody, kind: IsohedralClass, placements: Placements, z: Complex
    ) -> _Sprung:
        space = TileSpace(kind, placements)
        z = sprung(body, space, z, SPRUNG_ROUNDS)
        costs, sound = costs_of(body, z)
        away = (abs(z[: body.size] - nearest_tiles(space, z)) ** 2).mean(axis=0)
        whole = together(costs) + COMPARISON_STRENGTH * away + CROSSING_COST * ~sound
        return cls(body, placements._replace(turns=space.turns), z, whole)

    @property
    def best(self) -> _Sprung:
        k = np.array([self.costs.argmin()])
        return replace(
            self, placements=self.placements.take(k), points=self.points[:, k], costs=self.costs[k]
        )


def moved(pair: BentPair, step: int = 1, *, most: int = 6, tried: int = 12) -> BentPair:
    """Move corners and the path's ends by so many points until no neighbour costs less."""
    parts = pair.body.figures
    here = _Sprung.of(pair.body, pair.kind, pair.placement, pair.points[:, None])
    for _ in range(most):
        options: list[tuple[float, Glue, Placements, Complex]] = []
        for first, second, longer in PATH_MOVES:
            glue = here.body.glue
            glue = Glue(
                (glue.first + step * first) % parts[0].size,
                (glue.second + step * second) % parts[1].size,
                glue.length + step * longer,
            )
            if 3 <= glue.length < min(part.size for part in parts) - 3:
                body = glued_body(pair.figures, pair.level, glue)
                options += _neighbours(pair.kind, here, body, (first, second, longer), step)
        options.sort(key=lambda own: own[0])
        better = here
        for glue in {own[1]: None for own in options[:tried]}:
            mine = [own for own in options[:tried] if own[1] == glue]
            joined = Placements(
                *(np.concatenate(part) for part in zip(*(own[2] for own in mine), strict=True))
            )
            z = np.repeat(mine[0][3], len(mine), axis=1)
            body = glued_body(pair.figures, pair.level, glue)
            found = _Sprung.of(body, pair.kind, joined, z).best
            better = min(better, found, key=lambda own: float(own.costs[0]))
        if better.costs[0] > MAX_COST_RATIO * here.costs[0]:
            break
        here = better
    own = here.placements, here.points[:, 0]
    return held(BentPair(pair.figures, pair.level, here.body.glue, pair.kind, *own), HELD_ROUNDS)


def _neighbours(
    kind: IsohedralClass, here: _Sprung, body: PairBody, move: tuple[int, int, int], step: int
) -> list[tuple[float, Glue, Placements, Complex]]:
    """Return placements of a glue near those of the present one, with how far their tiles are."""
    first, second, longer = move
    one, two = (here.points[places] for places in here.body.places)
    z = body.joined((one, two))
    change = _changes(kind, -2 * longer) * step
    if not len(change):
        return []
    ends = np.concatenate([np.zeros((len(change), 1), np.int64), np.cumsum(change, axis=1)], axis=1)
    zero, rows = np.zeros(len(change), dtype=np.int64), list[Integers]()
    # the first corner keeps its place on the first or on the second figure, or another corner does
    for shift in {-(first + longer) * step, -(second + 2 * longer) * step}:
        for start in (zero, -ends.min(axis=1), -ends.max(axis=1), zero + step, zero - step):
            starts = (here.placements.starts[0] + shift + start) % body.size
            rows.append(np.column_stack([here.placements.lengths[0] + change, starts]))
    own = np.unique(np.concatenate(rows), axis=0)
    own = own[(own[:, :-1] >= 2).all(axis=1)]
    if move == (0, 0, 0):
        present = np.append(here.placements.lengths[0], here.placements.starts[0])
        own = own[(own != present).any(axis=1)]
    if not len(own):
        return []
    turns, gains = (np.full(len(own), part[0]) for part in here.placements[2:])
    found = Placements(own[:, :-1], own[:, -1], turns, gains)
    away = TileSpace(kind, found).distances(np.repeat(z[: body.size].T, len(own), axis=0))
    # the path may not have been one
    torn = sum(
        float((abs(shape - z[places]) ** 2).sum())
        for shape, places in zip((one, two), body.places, strict=True)
    )
    near = np.argsort(away, kind="stable")[:BEST_OF_GLUE].tolist()
    return [(float(away[k]) + torn, body.glue, found.take(np.array([k])), z) for k in near]
