"""The search for likeness in one class: placements, co-deformation, finalists, start tiles."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.errors import CertificationError
from orbiflow.runtime import NEVER, Cancel
from orbiflow.tiles.geometry import apart, best_similarity, plane_points, signed_area
from orbiflow.tiles.likeness import (
    Elastic,
    Fidelity,
    Overlap,
    best_overlay,
    kept_of,
    least_neck,
    neck_factor,
    neck_up_to,
)
from orbiflow.tiles.search.candidates import ClassFinalists, OnProgress, Prototiles, StillTiles
from orbiflow.tiles.search.carving import BehindError, Carved, Race, carved
from orbiflow.tiles.search.co_deformation import (
    BODIES,
    Orientation,
    costs_of,
    drawn_to_tiles,
    following,
    held_on_tiles,
    shifted,
)
from orbiflow.tiles.search.tile_orbits import template_symmetries
from orbiflow.tiles.search.tile_space import NearestTiles, Placements, TileSpace, best_placements
from orbiflow.tiles.tilings import IsohedralClass

if TYPE_CHECKING:
    from orbiflow.tiles.search.likeness_search import LikenessSearch
    from orbiflow.tiles.search.search_method import Goal

TWIN_DISTANCE = 2e-4  # mean squared distance of two bent outlines below which they are twins
FIRST_ROUNDS = 6  # steps of the minimisation for all that are held
FOLLOWING_STRENGTH = 60.0  # strength of the springs by which a finer body follows a coarser one
RELAXED_STRENGTH = 1500.0  # strength of the springs that keep a relaxed outline near its tile
# The most tiles of a class that cross themselves and are carved apart; twice as many if all do
MAX_REPAIRED = 1
MAX_MARK_BEHIND = 0.25  # below the best mark of tiles that are not carved yet: what is carved, too
CROSSING_MARKS = 0.5  # less for a shape that crosses itself, while it is one of many
# The share of the best coarse shapes that cross themselves above which a rounder silhouette is searched
MAX_CROSSED_SHARE = 0.6
MIN_CARVED_GAP = 0.012  # the gaps that carving apart leaves at least, in square roots of the area

Item = TypeVar("Item")


class Bent(NamedTuple):
    """A bent silhouette that is a tile."""

    orientation: Orientation  # what was bent
    body: Elastic  # as which body
    tile: Carved  # the tile, up to a similarity
    points: Complex  # (N,) of the fine body; its outline lies on the tile
    placement: Placements  # one, of the fine outline
    fidelity: Fidelity  # what is left of the outline; without the cost
    factor: float  # of its score: 1, less where a neck is too thin, 0 if it crosses itself

    @property
    def score(self) -> float:
        """What finalists are ordered by."""
        return self.fidelity.score * self.factor

    @property
    def cost(self) -> float:
        """What bending costs."""
        return float(self.orientation.fine.cost(self.points[:, None])[0])

    @property
    def relaxed(self) -> Complex:
        """The outline (n,) let go a little: bent as it would like to be near this tile."""
        points, n = self.points[:, None], self.body.size
        return self.body.pulled(points, points[:n], RELAXED_STRENGTH, 3)[:n, 0]


def bent_tiles(
    both: Sequence[Orientation],
    kind: IsohedralClass,
    settings: LikenessSearch,
    tell: Callable[[float], None] = lambda _: None,
    cancel: Cancel = NEVER,
    *,
    wanted: int = 1,
    may_give_up: bool = False,
) -> tuple[list[Bent], int]:
    """Return finalists, best first and without twins, and how many crossed themselves.

    There are none if it `may_give_up` where hardly any coarse shape is without crossings.
    """
    used = both[:1] if template_symmetries(kind)[1] else both
    usual = settings.of_class(wanted, symmetric=len(kind.stabiliser) > 1)
    most_crossed = MAX_CROSSED_SHARE if may_give_up else 1.0
    finalists = _finalists(used, kind, usual, tell, cancel, most_crossed)
    simple = _best_first([bent for bent in finalists if bent.factor])
    crossed = [bent for bent in finalists if not bent.factor]
    if usual.carved and both[0].plain:
        simple = _all_carved(kind, simple, crossed, usual, cancel)
    return simple, len(crossed)


def _all_carved(
    kind: IsohedralClass,
    simple: list[Bent],
    crossed: list[Bent],
    settings: LikenessSearch,
    cancel: Cancel,
) -> list[Bent]:
    """Carve the first simple tiles, and those that cross themselves, that may become the best."""
    least = max((bent.fidelity.mark for bent in simple), default=-math.inf) - MAX_MARK_BEHIND
    first = [bent for bent in simple[: settings.carved] if bent.fidelity.mark >= least]
    worth = [bent for bent in crossed if bent.fidelity.mark > least]
    worth.sort(key=lambda bent: -bent.fidelity.mark)
    chosen = first + unlike(worth, MAX_REPAIRED * (1 if simple else 2), _twins)
    done: list[Bent] = []
    race = Race()
    for bent in chosen:
        cancel.check()
        done.append(_carved(kind, bent, settings.min_neck, race))
    return _best_first([bent for bent in done if bent.factor] + simple[len(first) :])


def _best_first(shapes: list[Bent]) -> list[Bent]:
    """Return the tiles without twins, by their scores."""
    return unlike(sorted(shapes, key=lambda bent: -bent.score), len(shapes), _twins)


def _twins(a: Bent, b: Bent) -> bool:
    return a.orientation is b.orientation and apart(a.tile.ring, b.tile.ring) <= TWIN_DISTANCE


class _Lot(NamedTuple):
    """Shapes of one orientation and stiffness that are nearly tiles."""

    side: Orientation
    bodies: tuple[Elastic, Elastic, Elastic]  # with few points, more and all
    level: int  # which of them is bent
    placements: Placements  # C of them
    points: Complex  # (N, C)

    @property
    def body(self) -> Elastic:
        return self.bodies[self.level]

    @property
    def crossed(self) -> NDArray[np.bool_]:
        """Which shapes (C,) cross themselves."""
        rings = plane_points(self.points[: self.body.size].T)
        return ~np.asarray(shapely.is_valid(shapely.polygons(rings)))

    @property
    def marks(self) -> list[float]:
        """The marks (C,) that people would give, less where a shape crosses itself."""
        rings = self.points[: self.body.size].T
        marks = np.array([kept_of(self.body.measures, ring, 0.0).mark for ring in rings])
        return (marks - CROSSING_MARKS * self.crossed).tolist()

    def take(self, index: Integers) -> _Lot:
        """Return those at `index`."""
        return self._replace(placements=self.placements.take(index), points=self.points[:, index])

    def finer(self, level: int) -> _Lot:
        """Return the same with the points of a level."""
        body, finer = self.body, self.bodies[level]
        if finer is body:
            return self._replace(level=level)
        placements, points = _finer(body, finer, self.placements, self.points)
        return _Lot(self.side, self.bodies, level, placements, points)


def _finalists(
    used: Sequence[Orientation],
    kind: IsohedralClass,
    settings: LikenessSearch,
    tell: Callable[[float], None],
    cancel: Cancel,
    most_crossed: float,
) -> list[Bent]:
    """Work out the best of some orientations, with all stiffnesses; some cross themselves.

    All begin with few points; the best marks among them all go on to more points, and corners move.
    There are none if more than a share `most_crossed` of the first of these cross themselves.
    """
    lots: list[_Lot] = []
    for body in settings.bodies:
        for side in used:
            cancel.check()
            bodies = side.bodies(BODIES[body])
            placements, points = _best_coarse(bodies[0], kind, settings)
            lots.append(_Lot(side, bodies, 0, placements, points))
    tell(0.3)
    step = lots[0].bodies[1].size // lots[0].body.size  # from one of the few points to the next
    few, fewer = 2 * settings.finalists, settings.finalists
    steps = [(1, step, settings.starts), (1, max(1, step // 2), few), (2, 1, fewer)]
    for k, (level, step, keep) in enumerate(steps):
        going_on = _best_marked(lots, keep)
        if k == 0 and np.concatenate([lot.crossed for lot in going_on]).mean() > most_crossed:
            return []
        lots = [_shifted(kind, lot, level, step, settings, cancel) for lot in going_on]
        tell(0.3 + 0.2 * (k + 1))
    finalists: list[Bent] = []
    for lot in _best_marked(lots, settings.finalists):
        for k in range(len(lot.placements.starts)):
            cancel.check()
            bent = _detailed(lot.take(np.array([k])), kind, settings)
            finalists += [] if bent is None else [bent]
    return finalists


def _shifted(
    kind: IsohedralClass, lot: _Lot, level: int, step: int, settings: LikenessSearch, cancel: Cancel
) -> _Lot:
    """Give a lot the points of a level, and move its corners by so many of them."""
    lot = lot.finer(level)
    shapes = lot.body, kind, lot.placements, lot.points
    drawn = shifted(*shapes, step, share=settings.share, cancel=cancel)
    return lot._replace(placements=drawn.placements, points=drawn.points)


def _best_marked(lots: Sequence[_Lot], count: int) -> list[_Lot]:
    """Return so many of the best marks, of all lots together."""
    every = [
        (mark, lot, k) for lot, shapes in enumerate(lots) for k, mark in enumerate(shapes.marks)
    ]
    every.sort(key=lambda entry: -entry[0])
    kept: dict[int, list[int]] = {}
    for _, lot, k in every[:count]:
        kept.setdefault(lot, []).append(k)
    return [lots[lot].take(np.array(chosen)) for lot, chosen in sorted(kept.items())]


def _best_coarse(
    body: Elastic, kind: IsohedralClass, settings: LikenessSearch
) -> tuple[Placements, Complex]:
    """Return placements whose tiles cost least, with these: few points, all placements side by side."""
    outline = body.rest[: body.size]
    placements = best_placements(kind, outline, settings.placements)
    z, space = drawn_to_tiles(body, kind, placements)
    rough, _ = costs_of(body, z)
    chosen = np.argsort(rough[0], kind="stable")[: settings.held]
    picked = placements._replace(turns=space.turns).take(chosen)
    tiles = held_on_tiles(body, TileSpace(kind, picked), z[:, chosen], FIRST_ROUNDS)
    costs, simple = costs_of(body, tiles.points)
    order = np.lexsort((costs[0], ~simple))
    fresh = _unlike_outlines(tiles.points[: body.size].T, order.tolist(), settings.starts)
    return tiles.placements.take(fresh), tiles.points[:, fresh]


def _finer(
    body: Elastic, finer: Elastic, placements: Placements, points: Complex
) -> tuple[Placements, Complex]:
    """Return the same placements, and shapes (N, C) like those given, of a body with more points."""
    multiple = finer.size // body.size
    rest = np.repeat(finer.rest[:, None], points.shape[1], axis=1)
    more = placements._replace(
        lengths=placements.lengths * multiple, starts=placements.starts * multiple
    )
    return more, followed(body, finer, points, rest)


def followed(body: Elastic, finer: Elastic, points: Complex, start: Complex) -> Complex:
    """Return shapes (N, C) of a body with more points that follow coarse ones, from a start (N, C)."""
    n, multiple = body.size, finer.size // body.size
    closed = np.vstack([points[:n], points[:1]])
    below, part = np.divmod(np.arange(finer.size), multiple)
    share = (part / multiple)[:, None]
    outline = (1 - share) * closed[below] + share * closed[below + 1]
    return finer.pulled(start, outline, FOLLOWING_STRENGTH, 6)


def _detailed(lot: _Lot, kind: IsohedralClass, settings: LikenessSearch) -> Bent | None:
    """Work out the one shape of a lot, with all points; None if nothing is left of it."""
    body, space = lot.body, TileSpace(kind, lot.placements)
    tiles = held_on_tiles(body, space, lot.points, settings.rounds)
    ring, laid = tiles.points[: body.size, 0], tiles.placements
    corners = (np.cumsum(laid.lengths[0]) - laid.lengths[0] + laid.starts[0]) % body.size
    as_bent = Carved(ring, np.arange(body.size), corners, tiles.linear[0], tiles.offset[0])
    return _bent(lot.side, body, as_bent, tiles.points, laid, settings.min_neck)


def _carved(kind: IsohedralClass, bent: Bent, min_neck: float, race: Race) -> Bent:
    """Carve a tile, with room between its parts if it needs that; return it as it is if no better."""
    body, space = bent.orientation.fine, TileSpace(kind, bent.placement)
    placement = bent.placement._replace(turns=space.turns)
    tried = [bent]
    for room in (0.0,) * (bent.factor > 0) + (max(MIN_CARVED_GAP, 1.2 * min_neck),):
        try:  # what lacks room costs more, and is in no race
            (tile,) = carved(body, space, [bent.tile], room=room, race=None if room else race)
        except BehindError:
            break
        points = following(body, tile.outline, bent.points)[:, None]
        better = _bent(bent.orientation, body, tile, points, placement, min_neck)
        tried += [] if better is None else [better]
        if better is not None and better.factor == 1:
            break
    return max(tried, key=lambda tile: tile.score)


def _bent(
    side: Orientation,
    body: Elastic,
    tile: Carved,
    points: Complex,
    placement: Placements,
    min_neck: float,
) -> Bent | None:
    """Return a tile and the shape (N, 1) of the body in it; None without area, lattice or order."""
    polygon, outline = plane_points(tile.ring), points[: body.size]
    whole = float(signed_area(polygon)) > 0.1 and np.linalg.det(tile.linear) > 1e-6
    if not whole or not tile.in_order:
        return None
    simple = all(
        shapely.is_valid(shapely.Polygon(ring)) for ring in (polygon, plane_points(outline[:, 0]))
    )
    return Bent(
        side,
        body,
        tile,
        points[:, 0],
        placement,
        kept_of(body.measures, outline[:, 0], 0.0),
        neck_factor(neck_up_to(polygon, min_neck), min_neck) if simple else 0.0,
    )


def _unlike_outlines(outlines: Complex, order: Iterable[int], count: int) -> Integers:
    """Return which outlines (C, n) come first in an order, at most `count`, without twins."""

    def twins(a: int, b: int) -> bool:
        return apart(outlines[a], outlines[b]) <= TWIN_DISTANCE

    return np.array(unlike(order, count, twins), dtype=np.int64)


def unlike(items: Iterable[Item], count: int, twins: Callable[[Item, Item], bool]) -> list[Item]:
    """Return the first `count` items at most, without twins of earlier ones."""
    kept: list[Item] = []
    for item in items:
        if len(kept) == count:
            break
        if not any(twins(item, other) for other in kept):
            kept.append(item)
    return kept


class PlacedBent(NamedTuple):
    """A bent silhouette that is a tile, laid over the target by a similarity."""

    bent: Bent  # the silhouette, in a frame of its own, mirrored if its orientation is
    factor: complex  # z -> factor z + shift, after which a mirrored one is reflected in the x axis
    shift: complex

    def place(self, z: Complex) -> Array:
        """Return points (...) x + iy of the bent silhouette as points (..., 2) of the normal form."""
        placed = self.factor * z + self.shift
        return plane_points(np.conj(placed) if self.bent.orientation.mirrored else placed)

    @property
    def outlines(self) -> tuple[Array, Array, Array]:
        """The outline at rest, bent, and on the tile, in the normal form.

        Each is (n, 2) and counter-clockwise.
        """
        side, bent = self.bent.orientation, self.bent
        rest = side.samples.fine * ((1.0, -1.0) if side.mirrored else (1.0, 1.0))
        oriented = rest, self.place(bent.relaxed), self.place(bent.points[: len(rest)])
        first, second, third = (ring[::-1] if side.mirrored else ring for ring in oriented)
        return first, second, third


def fit_bending(
    goal: Goal,
    kind: IsohedralClass,
    settings: LikenessSearch,
    phases: Iterable[Sequence[Orientation]],
    count: int,
    per_class: int,
    progress: OnProgress,
    cancel: Cancel,
) -> ClassFinalists:
    """Fit tiles of one class to a silhouette by letting the silhouette bend (design point 15).

    Each of so many phases is the silhouette and its mirror image.
    """
    enough = 1 if per_class == 1 else 3 * per_class
    outline, gives_up = goal.target.normal, goal.has_rounder
    settings = replace(settings, min_neck=least_neck(outline, settings.min_neck))
    finalists: list[Bent] = []
    dropped = 0
    for phase, both in enumerate(phases):

        def tell(share: float, phase: int = phase) -> None:
            progress(0.9 * (phase + share) / count, math.nan)

        tiles, crossed = bent_tiles(
            both, kind, settings, tell, cancel, wanted=enough, may_give_up=gives_up
        )
        finalists, dropped = finalists + tiles, dropped + crossed
    if not finalists:
        raise CertificationError("all tiles near the silhouette cross themselves")
    # one to spare, if one is not certified
    candidates = PlacedTiles(kind, outline, _best_first(finalists)[: enough + 1])
    return ClassFinalists(candidates, settings.placements, dropped, enough)


class PlacedTiles(StillTiles):
    """Bent tiles over their silhouette (N, 2), each laid there when it is first asked for."""

    def __init__(self, kind: IsohedralClass, silhouette: Array, tiles: Sequence[Bent]) -> None:
        self.kind, self.tiles = kind, tiles

        @cache
        def overlap(mirrored: bool) -> Overlap:
            return Overlap(silhouette * (1.0, -1.0 if mirrored else 1.0))

        self._overlap = overlap
        self._placed: dict[int, PlacedBent] = {}

    @property
    def prototiles(self) -> Prototiles:
        """All of them."""
        return Prototiles.joined([self.prototile(k) for k in range(self.size)])

    @property
    def size(self) -> int:
        """The number of tiles."""
        return len(self.tiles)

    def prototile(self, index: int) -> Prototiles:
        """Return the start tile of one."""
        return prototile(self.kind, self.bent(index))

    def bent(self, index: int) -> PlacedBent:
        """Return the bent silhouette of one."""
        if index not in self._placed:
            tile = self.tiles[index]
            self._placed[index] = placed_best(tile, self._overlap(tile.orientation.mirrored))
        return self._placed[index]


def placed_best(bent: Bent, overlap: Overlap) -> PlacedBent:
    """Lay a bent tile over its silhouette by the similarity of largest IoU, found by L-BFGS."""
    rest, points = bent.orientation.fine.rest, bent.points
    center = points.mean()
    ring = bent.tile.ring - center
    factor, middle, _ = best_overlay(
        ring, overlap, complex(best_similarity(points, rest)), rest.mean()
    )
    return PlacedBent(bent, factor, complex(middle - factor * center))


def prototile(kind: IsohedralClass, placed: PlacedBent) -> Prototiles:
    """Return a placed bent tile as a start tile of a flow."""
    bent, factor, shift = placed
    n = bent.orientation.fine.size
    order = (np.arange(n) + bent.placement.starts[0]) % n
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    tiles = NearestTiles(
        (factor * bent.tile.ring + shift)[order][None],
        (turn @ bent.tile.linear)[None],
        (turn @ bent.tile.offset + [shift.real, shift.imag])[None],
        np.cumsum(bent.placement.lengths, axis=1) - bent.placement.lengths,
        np.zeros(1),
    )
    return Prototiles.of(kind, tiles, n, mirrored=bent.orientation.mirrored)
