"""How two figures bend, as rigidly as they can, until their union is a tile (design point 21).

All is as for one silhouette (`co_deformation`, `carving`), with a body of two figures. A pair costs
what both figures do and, once more, what the worse one does: nobody looks at a pair of which one is
spoilt.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.geometry import apart, best_similarity, plane_points
from orbiflow.tiles.likeness import (
    Elastic,
    kept_of,
    mixing_factor,
    neck_factor,
    neck_up_to,
    score_of,
)
from orbiflow.tiles.search.bending import followed
from orbiflow.tiles.search.carving import BehindError, Carved, carved
from orbiflow.tiles.search.co_deformation import (
    COMPARISON_STRENGTH,
    CROSSING_COST,
    MAX_COST_RATIO,
    costs_of,
    drawn_to_tiles,
    following,
    held_on_tiles,
    nearest_tiles,
    sprung,
)
from orbiflow.tiles.search.glued_body import MULTIPLES, Couple, Glue, GluedBody, glued_body
from orbiflow.tiles.search.gluing import Placement
from orbiflow.tiles.search.tile_space import Placements, TileSpace
from orbiflow.tiles.tilings import IsohedralClass, Tiling, certify, mixing

HELD_ROUNDS = 5  # steps of the minimisation among tiles
SPRUNG_ROUNDS = 3  # steps of springs that compare neighbours
ROOM = 0.012  # the gaps that carving apart leaves, in square roots of the mean area
CROSSING_MARKS = 1.0  # less for a pair in which something crosses, before it is carved
TWIN_DISTANCE = 4e-4  # mean squared distance of both outlines below which pairs are twins
MOST_CHANGED = 3  # steps by which lengths of edges change at a time, in all
BEST_OF_GLUE = 5  # neighbours of each neighbouring glue that are worked out
NO_CORNERS: Integers = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class BentPair:
    """Two figures that are bent so that their union is a tile, or nearly."""

    couple: Couple
    level: int
    glue: Glue
    kind: IsohedralClass
    placement: Placements  # one, of the union
    points: Complex  # (N,) of the body
    tiles: Sequence[Carved] = ()  # both figures, once the union is a tile

    @property
    def body(self) -> GluedBody:
        """Both figures, glued."""
        return glued_body(self.couple, self.level, self.glue)

    @property
    def space(self) -> TileSpace:
        """The tiles of the placement."""
        return TileSpace(self.kind, self.placement)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a process tells another, with what it would work out again."""
        results = {"_costs": self._costs, "marks": self.marks}
        return {**vars(self), **results, **({"scores": self.scores} if self.tiles else {})}

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

    @property
    def outlines(self) -> list[Complex]:
        """Where the points (n_k,) of both silhouettes' outlines are."""
        return [tile.outline for tile in self.tiles] or self.body.rings(self.points)

    @cached_property
    def marks(self) -> tuple[float, float]:
        """The marks that people would give to both figures."""
        first, second = (
            kept_of(figure.measures, ring, 0.0).mark
            for figure, ring in zip(self.body.figures, self.outlines, strict=True)
        )
        return first, first if self.couple.background else second

    @property
    def promise(self) -> float:
        """The mark of the worse figure, less if something crosses: it predicts what carving gives."""
        return min(self.marks) - CROSSING_MARKS * (not self.sound)

    @property
    def polygons(self) -> list[Array]:
        """The vertices (n_k, 2) of both figures."""
        return [plane_points(ring) for ring in self.body.rings(self.points)]

    @property
    def tiling(self) -> Tiling:
        """The tiling of both figures' polygons, once the union is a tile."""
        figure = self.tiles[0]
        return Tiling(self.kind.group().conjugate(figure.linear, figure.offset), self.polygons)

    @property
    def is_whole(self) -> bool:
        """Whether no figure crosses itself, though they may overlap each other's copies."""
        rings = [*self.polygons, *map(plane_points, self.outlines)]
        return all(shapely.is_valid(shapely.Polygon(ring)) for ring in rings)

    @cached_property
    def certified(self) -> bool:
        """Whether the tiling is one."""
        return self.sound and certify(self.tiling).valid

    @cached_property
    def factor(self) -> float:
        """What is left of its score: 1, less where a neck is too thin, 0 if something crosses."""
        if not self.sound:
            return 0.0
        width = self.couple.min_neck
        return min(neck_factor(neck_up_to(ring, width), width) for ring in self.polygons)

    @cached_property
    def scores(self) -> tuple[float, float]:
        """What pairs are ordered by: how probably people like the worse figure, and the better.

        They are less where copies of one figure lie side by side.
        """
        low, high = sorted(score_of(mark) for mark in self.marks)
        factor = self.factor * mixing_factor(mixing(self.tiling) if self.certified else 0.0)
        return low * factor, high * factor

    def is_twin(self, other: BentPair) -> bool:
        """Whether both figures are as in another pair of the same silhouettes."""
        rings = zip(self.body.rings(self.points), other.body.rings(other.points), strict=True)
        return self.couple == other.couple and all(apart(a, b) < TWIN_DISTANCE for a, b in rings)


def together(costs: Array) -> Array:
    """Return what pairs (C,) cost whose figures cost (2, C)."""
    return costs.sum(axis=0) + costs.max(axis=0)


def bent(couple: Couple, placements: Sequence[Placement], count: int) -> list[BentPair]:
    """Bend coarse pairs by springs for each placement; the best of these are held among tiles."""
    groups: defaultdict[tuple[Glue, IsohedralClass], list[Placements]] = defaultdict(list)
    for placed in placements:
        groups[placed.glue, placed.kind].append(placed.corners)
    rough: list[tuple[float, BentPair]] = []
    for (glue, kind), corners in groups.items():
        body = glued_body(couple, 0, glue)
        z, space = drawn_to_tiles(body, kind, Placements.joined(corners))
        costs, _ = costs_of(body, z)
        turned = space.placements._replace(turns=space.turns)
        rough += [
            (cost, BentPair(couple, 0, glue, kind, turned.take(np.array([k])), z[:, k]))
            for k, cost in enumerate(together(costs).tolist())
        ]
    rough.sort(key=lambda scored: scored[0])
    return [held(pair, HELD_ROUNDS) for _, pair in rough[:count]]


def held(pair: BentPair, rounds: int) -> BentPair:
    """Return the shape of least energy among the tiles of a pair's placement, in so many rounds."""
    tiles = held_on_tiles(pair.body, pair.space, pair.points[:, None], rounds)
    points, group = tiles.points[:, 0], (tiles.linear[0], tiles.offset[0])
    return _on_tile(pair, tiles.placements, points, *group)


def _on_tile(
    pair: BentPair, placement: Placements, points: Complex, linear: Array, offset: Array
) -> BentPair:
    """Return a pair whose union is a tile at these points; the map is from the group's own frame."""
    rings = pair.body.rings(points)
    tiles = [Carved(ring, np.arange(len(ring)), NO_CORNERS, linear, offset) for ring in rings]
    return replace(pair, placement=placement, points=points, tiles=tiles)


def finer(pair: BentPair, level: int, *, rounds: int = HELD_ROUNDS) -> BentPair:
    """Return the same with the points of a finer level, in so many steps of the minimisation.

    Points that slide do so by as much.
    """
    multiple = MULTIPLES[level] // MULTIPLES[pair.level]
    glue, coarse = pair.glue.times(multiple), pair.placement
    body = glued_body(pair.couple, level, glue)
    shapes = (pair.points[places] for places in pair.body.places)
    followers = [
        followed(old, figure, z[:, None], _turned(figure, old, z))
        for figure, old, z in zip(body.figures, pair.body.figures, shapes, strict=True)
    ]
    corners = coarse._replace(lengths=coarse.lengths * multiple, starts=coarse.starts * multiple)
    space = TileSpace(pair.kind, corners)
    z = sprung(body, space, body.joined(followers), 2)
    corners = corners._replace(turns=space.turns)
    more = BentPair(pair.couple, level, glue, pair.kind, corners, z[:, 0])
    if rounds:
        return held(more, rounds)
    nearest = space.nearest(z[: body.size].T)
    z[: body.size] = space.in_order(nearest.vertices).T
    more = _on_tile(more, corners, z[:, 0], nearest.linear[0], nearest.offset[0])
    slid = [
        tile._replace(places=_finer_places(old.places, multiple))
        for tile, old in zip(more.tiles, pair.tiles, strict=True)
    ]
    return replace(more, tiles=slid)


def _finer_places(places: Array, multiple: int) -> Array:
    """Return where a multiple of points lie that slide as those at `places` do."""
    slide = places - np.arange(len(places))
    numbers, closed = np.arange(multiple * len(slide)), np.append(slide, slide[0])
    return numbers + multiple * np.interp(numbers / multiple, np.arange(len(closed)), closed)


def _turned(body: Elastic, old: Elastic, z: Complex) -> Complex:
    """Return a body (N, 1) in the pose of a coarser one's shape (N,)."""
    turn = np.exp(1j * np.angle(best_similarity(old.rest, z)))
    return (body.rest * turn + z[: old.size].mean())[:, None]


def carved_pair(pair: BentPair, steps: int) -> BentPair:
    """Carve a pair, by so many steps while points slide and after it.

    If something crosses, or a neck is thin, it is carved apart. Where users say which parts matter, the
    pair stays as it is bent.
    """
    if not pair.couple.plain:
        return pair
    along = _carved(pair, steps, 0.0)
    if along.factor == 1:
        return along
    try:
        return max(along, _carved(pair, steps, ROOM), key=lambda pair: pair.scores)
    except BehindError:
        return along


def _carved(pair: BentPair, steps: int, room: float) -> BentPair:
    body, most = pair.body, (steps, steps)
    shapeless = (1,) if pair.couple.background else ()
    tiles = carved(body, pair.space, pair.tiles, room=room, most_steps=most, shapeless=shapeless)
    outline = body.on_outlines(tile.ring for tile in tiles)
    points = following(body, outline, np.concatenate([outline, pair.points[body.outer :]]))
    return replace(pair, points=points, tiles=tiles)


# How the ends of the path move along the first outline, along the second, and how much longer it is
PATH_MOVES = (
    *((0, 0, 0), (-1, 0, 1), (1, 0, -1), (0, -1, 1), (0, 1, -1)),
    *((1, -1, 0), (-1, 1, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)),
)


@lru_cache(maxsize=256)
def _changes(kind: IsohedralClass, total: int) -> Integers:
    """Return changes (M, K) of edges' lengths with a sum, by few steps."""
    classes = [edge_class.edges for edge_class in kind.edge_classes]
    changes: list[Integers] = []
    for steps in product(range(-2, 3), repeat=len(classes)):
        if sum(map(abs, steps)) <= MOST_CHANGED:
            change = np.zeros(len(kind.template()), dtype=np.int64)
            for edges, step in zip(classes, steps, strict=True):
                change[edges] = step
            if change.sum() == total:
                changes.append(change)
    return np.array(changes, dtype=np.int64).reshape(-1, len(kind.template()))


def moved(pair: BentPair, step: int = 1, *, most: int = 6, tried: int = 12) -> BentPair:
    """Move corners and the path's ends by so many points until no neighbour costs less."""
    ((cost, here),) = _compared([pair])
    for _ in range(most):
        options = [near for move in PATH_MOVES for near in _neighbours(here, move, step)]
        options.sort(key=lambda option: option[0])
        glues: defaultdict[Glue, list[BentPair]] = defaultdict(list)
        for _, near in options[:tried]:
            glues[near.glue].append(near)
        compared = [pair for near in glues.values() for pair in _compared(near)]
        least, best = min(compared, key=lambda pair: pair[0], default=(cost, here))
        if least > MAX_COST_RATIO * cost:
            break
        cost, here = least, best
    return held(here, HELD_ROUNDS)


def _compared(pairs: Sequence[BentPair]) -> list[tuple[float, BentPair]]:
    """Return pairs of one glue drawn to their tiles by springs, after what they cost then."""
    body, kind = pairs[0].body, pairs[0].kind
    space = TileSpace(kind, Placements.joined([pair.placement for pair in pairs]))
    z = sprung(body, space, np.stack([pair.points for pair in pairs], axis=1), SPRUNG_ROUNDS)
    costs, sound = costs_of(body, z)
    away = (abs(z[: body.size] - nearest_tiles(space, z)) ** 2).mean(axis=0)
    whole = together(costs) + COMPARISON_STRENGTH * away + CROSSING_COST * ~sound
    turned = space.placements._replace(turns=space.turns)
    return [
        (cost, replace(pair, placement=turned.take(np.array([k])), points=z[:, k], tiles=()))
        for k, (cost, pair) in enumerate(zip(whole.tolist(), pairs, strict=True))
    ]


def _neighbours(
    here: BentPair, move: tuple[int, int, int], step: int
) -> list[tuple[float, BentPair]]:
    """Return the nearest neighbours whose path's ends have moved, after how far their tiles are."""
    first, second, longer = (step * by for by in move)
    figures, corners = here.body.figures, here.placement
    glue = Glue(
        (here.glue.first + first) % figures[0].size,
        (here.glue.second + second) % figures[1].size,
        here.glue.length + longer,
    )
    change = _changes(here.kind, -2 * move[2]) * step
    if not (3 <= glue.length < min(figure.size for figure in figures) - 3 and len(change)):
        return []
    body = glued_body(here.couple, here.level, glue)
    shapes = [here.points[places][:, None] for places in here.body.places]
    z = body.joined(shapes)
    ends = np.concatenate([np.zeros((len(change), 1), np.int64), np.cumsum(change, axis=1)], axis=1)
    zero, rows = np.zeros(len(change), dtype=np.int64), list[Integers]()
    # the first corner keeps its place on the first or on the second figure, or another corner does
    for shift in {-(first + longer), -(second + 2 * longer)}:
        for start in (zero, -ends.min(axis=1), -ends.max(axis=1), zero + step, zero - step):
            starts = (corners.starts[0] + shift + start) % body.size
            rows.append(np.column_stack([corners.lengths[0] + change, starts]))
    options = np.unique(np.concatenate(rows), axis=0)
    options = options[(options[:, :-1] >= 2).all(axis=1)]
    if move == (0, 0, 0):
        present = np.append(corners.lengths[0], corners.starts[0])
        options = options[(options != present).any(axis=1)]
    if not len(options):
        return []
    turns = np.full(len(options), corners.turns[0])
    near = Placements(options[:, :-1], options[:, -1], turns)
    away = TileSpace(here.kind, near).distances(np.repeat(z[: body.size].T, len(options), axis=0))
    # the path may not have been one
    torn = sum(
        float((abs(shape - z[places]) ** 2).sum())
        for shape, places in zip(shapes, body.places, strict=True)
    )
    return [
        (
            float(away[k]) + torn,
            replace(here, glue=glue, placement=near.take(np.array([k])), points=z[:, 0], tiles=()),
        )
        for k in np.argsort(away, kind="stable")[:BEST_OF_GLUE].tolist()
    ]
