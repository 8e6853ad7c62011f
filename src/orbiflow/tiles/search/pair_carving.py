"""Pairs of figures that are carved, and how good they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.geometry import plane_points
from orbiflow.tiles.likeness import mixing_factor, neck_factor, neck_up_to, score_of
from orbiflow.tiles.search.carving import Carved, carved
from orbiflow.tiles.search.co_deformation import following
from orbiflow.tiles.search.pair_bending import BentPair
from orbiflow.tiles.tilings import Tiling

ROOM = 0.012  # the gaps that carving apart leaves, in square roots of the mean area
NO_CORNERS: Integers = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class CarvedPair(BentPair):
    """A pair that was carved: its outlines are those of two tiles."""

    tiles: Sequence[Carved]  # both figures

    @property
    def tiling(self) -> Tiling:
        """The tiling of both figures' polygons."""
        group = self.kind.group().conjugate(self.tiles[0].linear, self.tiles[0].offset)
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
    def outlines(self) -> list[Complex]:
        return [tile.outline for tile in self.tiles]


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
    group = space.group(0, parameters)
    tiles = [
        Carved(ring, np.arange(len(ring)), NO_CORNERS, *group) for ring in pair.body.rings(points)
    ]
    return CarvedPair(pair.figures, pair.level, pair.glue, pair.kind, pair.placement, points, tiles)


def _carved(pair: BentPair, steps: int, room: float) -> CarvedPair:
    """Return a pair carved by so many steps, with so much room."""
    body = pair.body
    uncarved = pair if isinstance(pair, CarvedPair) else _uncarved(pair)
    shapeless = (1,) if pair.figures.background else ()
    steps_twice = steps, steps
    tiles = carved(
        body, pair.space, uncarved.tiles, room=room, most_steps=steps_twice, shapeless=shapeless
    )
    outline = body.on_outlines(tile.ring for tile in tiles)
    points = following(body, outline, np.concatenate([outline, pair.points[body.outer :]]))
    return CarvedPair(pair.figures, pair.level, pair.glue, pair.kind, pair.placement, points, tiles)


def finer_slides(pair: CarvedPair, finer: BentPair) -> CarvedPair:
    """Return a finer one of a carved pair with its slides."""
    multiple = finer.body.figures[0].size // pair.body.figures[0].size

    def more(places: Array) -> Array:
        slide = places - np.arange(len(places))
        numbers = np.arange(multiple * len(slide))
        closed = np.append(slide, slide[0])
        return numbers + multiple * np.interp(numbers / multiple, np.arange(len(closed)), closed)

    rings = finer.body.rings(finer.points)
    tiles = [
        tile._replace(ring=ring, places=more(tile.places))
        for tile, ring in zip(pair.tiles, rings, strict=True)
    ]
    return CarvedPair(
        finer.figures, finer.level, finer.glue, finer.kind, finer.placement, finer.points, tiles
    )
