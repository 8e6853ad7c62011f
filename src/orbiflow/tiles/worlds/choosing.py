"""Which tile goes to another world, and which of its centres gets which order: by how images look."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from orbiflow.arrays import Array, Complex
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import complex_points, resampled, signed_area
from orbiflow.tiles.likeness import Measures, Rating, kept_of
from orbiflow.tiles.make import CURVED
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.worlds.curved import disc_of, facing
from orbiflow.tiles.worlds.unfolding import (
    Unfolding,
    check_world,
    distortion,
    order_count,
    unfolded,
    usual_orders,
)

POINTS = 240  # of a silhouette's outline
BETTER = 0.5  # marks, of 10, that an image has beyond its tile's in the plane at most


class WorldLikeness:
    """How a tile's image in another world looks beside its silhouette.

    Args:
        tile: A tile with a map from its silhouette.
    """

    def __init__(self, tile: EscherTile) -> None:
        ring = resampled(tile.silhouette_outline, POINTS)
        if signed_area(ring * flip_of(tile)) < 0:
            ring = ring[::-1]
        self._bent = tile.forward(ring) * flip_of(tile)
        self._measures = Measures(complex_points(ring * flip_of(tile)))

    @property
    def plane(self) -> float:
        """The mark in the plane, from 0 to 10."""
        return self._mark(complex_points(self._bent))

    def mark(self, unfolding: Unfolding) -> float:
        """Return the mark of the image, in the stereographic picture about its middle."""
        vectors = unfolding.vectors(self._bent)
        if unfolding.sign > 0:
            return self._mark(disc_of(vectors @ facing(unfolding.middle).T))
        z, middle = disc_of(vectors), complex(disc_of(unfolding.middle))
        return self._mark((z - middle) / (1 - np.conj(middle) * z))

    def _mark(self, outline: Complex) -> float:
        return kept_of(self._measures, outline, 0.0).mark


def flip_of(tile: EscherTile) -> Array:
    """Return what makes a tile's coordinates (..., 2) those of a world, whose y points upwards."""
    return np.array([1.0, -1.0 if tile.y_down else 1.0])


def why_not_in(tile: EscherTile, world: str) -> str:
    """Return why a tile has no pattern in a world of `art`, found without drawing it; "" if it has."""
    try:
        if world in CURVED:
            check_world(tile.tiling, CURVED[world])
    except OrbiflowError as error:
        return str(error)
    return ""


def in_world(
    tile: EscherTile, orders: Sequence[int] | None, sign: int
) -> tuple[Unfolding, tuple[str, ...]]:
    """Return a tile in a world of some orders, which its centres get as it looks best, and notes.

    Without a map from a silhouette, they get them as the tile is distorted least.

    Raises:
        OrbiflowError: As `unfolded` and `usual_orders`.
    """
    if len(tile.figures) > 1 or tile.bending is None:
        return _unfolded(tile, orders, sign, distortion), ()
    seen = WorldLikeness(tile)
    world = _unfolded(tile, orders, sign, lambda unfolding: -seen.mark(unfolding))
    here, there = (Rating.of_mark(mark) for mark in (seen.plane, seen.mark(world)))
    return world, (f"likeness {there} there, {here} in the plane",)


def _unfolded(
    tile: EscherTile, orders: Sequence[int] | None, sign: int, cost: Callable[[Unfolding], float]
) -> Unfolding:
    tiling = tile.tiling.transformed(np.diag(flip_of(tile)), np.zeros(2))
    return unfolded(tiling, orders or usual_orders(tiling.group, sign), sign, cost)


def best_in_world(
    tiles: Iterable[EscherTile], orders: Sequence[int] | None, sign: int
) -> EscherTile | None:
    """Return the tile, of some with the best in the plane first, whose image looks best.

    If none goes there, the first that takes so many orders is returned, so that what is wrong with them
    is told of it; else None.
    """
    best, highest, spare = None, -np.inf, None
    for tile in tiles:
        if len(tile.figures) > 1 or tile.bending is None:
            continue
        seen = WorldLikeness(tile)
        if seen.plane + BETTER < highest:
            break
        try:
            world = _unfolded(tile, orders, sign, lambda opened, seen=seen: -seen.mark(opened))
        except OrbiflowError:  # it stays in the plane
            if spare is None and orders and order_count(tile.tiling.group) == len(orders):
                spare = tile
            continue
        if (mark := seen.mark(world)) > highest:
            best, highest = tile, mark
    return best or spare
