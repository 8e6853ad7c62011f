"""Outlines to bend, measure and triangulate: simple shapes, animals, and what is hard about them."""

from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.runtime import NEVER, Cancel, Sink, ignore
from orbiflow.tiles import (
    CLASSES,
    ClassFailure,
    Emphasis,
    EscherizeSettings,
    EscherTile,
    LikenessSearch,
    Overlap,
    Pins,
    SearchMethod,
    Target,
    Tile,
    TileModel,
    escherize,
    plane_points,
    signed_area,
)
from orbiflow.tiles.flowing.tile_model import extract_tile
from orbiflow.tiles.search import Goal
from orbiflow.tiles.search.bending import Bent, PlacedBent, bent_tiles, placed_best, prototile
from orbiflow.tiles.search.co_deformation import Orientation

FOLDER = Path(__file__).parent.parent / "examples" / "silhouettes"
ANIMALS = ("squirrel.dat", "nagata/spider_120.dat", "nagata/octpus_94.dat", "nagata/camel_60.dat")


def searched(
    target: Target,
    classes: list[str],
    method: SearchMethod,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
    **settings: Any,
) -> tuple[list[EscherTile], list[ClassFailure]]:
    """The tiles and failures of a search by a method."""
    own = EscherizeSettings(classes=tuple(classes), **settings)
    goal: dict[str, Any] = {"emphasis": emphasis, "pins": pins}
    found = escherize(target, own, method=method, **goal, on_event=on_event, cancel=cancel)
    return list(found.tiles), list(found.failures)


def disc(count: int) -> Array:
    """A regular polygon (count, 2) of area 1, counter-clockwise, about the origin."""
    turns = 2 * np.pi * np.arange(count) / count
    return unit(np.stack([np.cos(turns), np.sin(turns)], axis=-1))


def star(points: int, inner: float) -> Array:
    """A star of area 1 whose notches lie at a share `inner` of its tips' radius."""
    turns = np.pi * np.arange(2 * points) / points
    radii = np.where(np.arange(2 * points) % 2, inner, 1.0)
    return unit(radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1))


def bar(length: float, width: float) -> Array:
    """A rectangle (4, 2) from the origin."""
    return np.array([[0, 0], [length, 0], [length, width], [0, width]], dtype=np.float64)


def comb(teeth: int, width: float, gap: float, length: float, back: float = 0.3) -> Array:
    """Teeth upwards from a back; counter-clockwise."""
    total = teeth * width + (teeth - 1) * gap
    points = [[0.0, 0.0], [total, 0.0]]
    for k in reversed(range(teeth)):
        left = k * (width + gap)
        points += [[left + width, back + length], [left, back + length]]
        if k:
            points += [[left, back], [left - gap, back]]
    return np.array(points)


def dumbbell(neck: float, length: float, block: float = 1.0) -> Array:
    """Two square blocks joined by a neck in the middle of their sides."""
    low, high = (block - neck) / 2, (block + neck) / 2
    end = block + length
    return np.array(
        [
            [0, 0], [block, 0], [block, low], [end, low], [end, 0], [end + block, 0],
            [end + block, block], [end, block], [end, high], [block, high], [block, block],
            [0, block],
        ]
    )  # fmt: skip


def slit_square(width: float, depth: float) -> Array:
    """A square of side 1 with a slit from the middle of its upper side."""
    low, high = (1 - width) / 2, (1 + width) / 2
    return np.array(
        [[0, 0], [1, 0], [1, 1], [high, 1], [high, 1 - depth], [low, 1 - depth], [low, 1], [0, 1]]
    )


def crescent(count: int = 60) -> Array:
    """Two arcs that meet in sharp tips; counter-clockwise, of area 1."""
    turns = np.linspace(-1.45, 1.45, count)
    outer = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    inner = outer * (0.4, 1.0) + (0.6 * np.cos(1.45), 0.0)
    return unit(np.concatenate([outer, inner[-2:0:-1]]))


def unit(ring: Array) -> Array:
    """The ring (n, 2) at area 1, about its vertices' mean."""
    return (ring - ring.mean(axis=0)) / np.sqrt(abs(signed_area(ring)))


SHAPES: dict[str, Array] = {
    **{"triangle": disc(3), "square": disc(4), "disc": disc(64), "star": star(5, 0.4)},
    **{"sharp star": star(9, 0.25), "bar": unit(bar(12.0, 1.0))},
    **{"comb": unit(comb(5, 0.2, 0.15, 2.0)), "dumbbell": unit(dumbbell(0.05, 1.0))},
    **{"slit": slit_square(0.004, 0.8), "crescent": crescent()},
    "vertices on sides": unit(np.insert(bar(3.0, 1.0), 1, [[0.5, 0.0], [0.7, 0.0]], axis=0)),
}
"""Simple outlines of area about 1, counter-clockwise."""


def animal(name: str) -> Target:
    """A bundled silhouette."""
    return Target.read(FOLDER / name)


SMALL = LikenessSearch(
    phases=1, placements=60, held=6, starts=2, finalists=1, rounds=8, carved=1, multiples=(4,)
)
"""A search of a fraction of a second a class."""


@lru_cache(maxsize=1)
def squirrel_orientations() -> tuple[Orientation, Orientation]:
    """The bundled squirrel and its mirror image, ready to be bent."""
    return SMALL.orientations(Goal(animal("squirrel.dat")))


class BentTile(NamedTuple):
    """A bent squirrel, its place on the target, and the polygon that comes of it."""

    bent: Bent
    factor: complex
    shift: complex
    tile: Tile

    @property
    def images(self) -> Array:
        """(N, 2) where the body's points are placed, in the target's normal form."""
        points = plane_points(self.factor * self.bent.points + self.shift)
        return points * (1.0, -1.0) if self.bent.orientation.mirrored else points


@lru_cache(maxsize=32)
def bent_squirrel(name: str, mirrored: bool = False) -> BentTile:
    """A small search's best tile of a class, from one hand of the squirrel."""
    kind = CLASSES[name]
    side = squirrel_orientations()[mirrored]
    bent = bent_tiles([side], kind, SMALL)[0][0]
    _, factor, shift = placed_best(bent, Overlap(np.asarray(side.samples.fine)))
    tile, _ = extract_tile(flowless(name, bent, factor, shift))
    return BentTile(bent, factor, shift, tile)


def flowless(name: str, bent: Bent, factor: complex, shift: complex) -> TileModel:
    """The model of a bent tile, with a field of no effect."""
    kind = CLASSES[name]
    return TileModel(
        kind, max_frequency=0, prototiles=prototile(kind, PlacedBent(bent, factor, shift))
    )


def limb(tilt: float = 0.0, length: float = 1.2) -> np.ndarray:
    """A disc with a limb 0.3 wide."""
    body = np.exp(1j * np.linspace(0.15, 2 * np.pi - 0.15, 180))
    reach = np.linspace(0, length, 30)[1:]
    sides = [np.cos(0.15) + reach + 0.15j * side for side in (-1, 1)]
    tip = sides[0][-1] + 0.3j * np.linspace(0, 1, 8)[1:-1]
    own = np.concatenate([sides[0], tip, sides[1][::-1]])
    root = np.cos(0.15)
    return np.concatenate([body, root + (own - root) * np.exp(1j * tilt)])
