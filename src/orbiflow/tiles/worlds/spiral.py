"""A tiling around a spiral or a cylinder: what lies a lattice vector apart is the same copy."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.make import ArtSettings
from orbiflow.tiles.page import tiling_size
from orbiflow.tiles.tilings import Tiling, copies_meeting
from orbiflow.tiles.worlds.sheet import LEAST_COPY, World, motions_of
from orbiflow.tiles.worlds.views import WorldView

AROUND = 9.0  # sizes of the tile that one turn of a spiral has
MOST_STEPS = 8  # along a lattice vector that a turn has by default
RIM = 0.35  # where a spiral's first tile is, as a share of its radius
TOUCHING = 1e-3  # of a tile's size: how far neighbours are made wider to see whether they touch


def spiral(
    original: Tiling, tiling: Tiling, flip: Array, settings: ArtSettings
) -> tuple[World, list[str]]:
    """Return the copies of a tiling around a spiral: z goes to exp(2 pi i z / w), w of the lattice."""
    middle, size = complex(*tiling.center), float(np.sqrt(tiling.tile_area))
    arms, period = _turn(tiling, settings, AROUND * size, wound=True)
    # the first tile lies at a share of the radius; how far in and out, in periods
    start = middle - 1j * period * (-np.log(RIM) / (2 * np.pi))
    radius = float(np.linalg.norm(settings.page)) / 2
    inner = np.log(2 * np.pi * radius * size / abs(period) / LEAST_COPY) / (2 * np.pi)
    corners = np.array(
        [start + (a + 1j * b) * period for a in (-1.2, 1.2) for b in (-0.6, inner + 0.2)]
    )
    x, y = np.real(corners), np.imag(corners)
    window = float(x.min()), float(y.min()), float(x.max()), float(y.max())
    linear, shift, share = _first_copies(tiling, window, start, period)
    view = WorldView("spiral", settings.page, np.eye(3), period)
    keep = (share.real > -0.5 + 1e-9) & (share.real <= 0.5 + 1e-9) & (share.imag < inner)
    begin = start - period * np.radians(settings.rotate) / (2 * np.pi)
    motions = motions_of(linear[keep], shift[keep] - (begin.real, begin.imag))

    def vectors(points: Array) -> Array:
        return np.column_stack([points @ flip, np.ones(len(points))])

    rings = [vectors(prototile.polygon) for prototile in original.prototiles]
    near = view.meets(view.places(np.einsum("mij,nj->mni", motions, np.concatenate(rings))))
    motions = motions[near]
    numbers = _around(motions, rings, period, size)
    if settings.colour == "one":
        numbers = 0 * numbers
    said = f"{len(motions)} copies, {arms[0]},{arms[1]} lattice vectors around"
    return World(original, vectors, motions, numbers, view), [said]


def cylinder(
    original: Tiling, tiling: Tiling, flip: Array, settings: ArtSettings
) -> tuple[World, list[str]]:
    """Return the copies of a tiling on a page whose left and right edges meet around a cylinder."""
    (width, height), middle = settings.page, complex(*tiling.center)
    size = float(np.sqrt(tiling.tile_area))
    across = AROUND if settings.tile_size is None else width / settings.tile_size
    around = across * (size if settings.tile_size is None else tiling_size(tiling))
    arms, period = _turn(tiling, settings, around, wound=False)
    far = 0.5 * height / width + 2 * tiling.radius / abs(period)
    corners = [middle + complex(a, b) * period for a in (-1.5, 1.5) for b in (-far, far)]
    x, y = np.real(corners), np.imag(corners)
    window = float(x.min()), float(y.min()), float(x.max()), float(y.max())
    linear, shift, share = _first_copies(tiling, window, middle, period)
    keep = (share.real > -0.5 + 1e-9) & (share.real <= 0.5 + 1e-9) & (abs(share.imag) < far)
    once = motions_of(linear[keep], shift[keep] - (middle.real, middle.imag))

    def vectors(points: Array) -> Array:
        return np.column_stack([points @ flip, np.ones(len(points))])

    rings = [vectors(prototile.polygon) for prototile in original.prototiles]
    numbers = _around(once, rings, period, size)
    steps = np.array([period.real, period.imag]) * np.array([[-1.0], [0.0], [1.0]])
    motions = np.concatenate([motions_of(once[:, :2, :2], once[:, :2, 2] + step) for step in steps])
    view = WorldView("cylinder", settings.page, np.eye(3), period)
    near = view.meets(view.places(np.einsum("mij,nj->mni", motions, np.concatenate(rings))))
    colours = np.tile(numbers, 3)[near] * (settings.colour != "one")
    said = f"the left and the right edge meet, {arms[0]},{arms[1]} lattice vectors around"
    return World(original, vectors, motions[near], colours, view), [said]


def _first_copies(
    tiling: Tiling, window: tuple[float, float, float, float], start: complex, period: complex
) -> tuple[Array, Array, Complex]:
    """Return maps (M, 2, 2), (M, 2) to the first prototile's copies, and where (M,) their middles are,
    in periods from `start`."""
    every = copies_meeting(tiling, window)
    first = np.flatnonzero(every.prototiles == 0)
    linear, shift = every.group.linear_parts[every.cosets[first]], every.translations[first]
    return linear, shift, ((linear @ tiling.center + shift) @ (1, 1j) - start) / period


def _turn(
    tiling: Tiling, settings: ArtSettings, length: float, wound: bool
) -> tuple[tuple[int, int], complex]:
    """Return the steps along both lattice vectors that make one turn of about a length, and their sum.

    Unless the turn is `wound`, with steps along both, it is the one that turns the tiling least.
    """
    first, second = (complex(*tiling.group.lattice[:, k]) for k in (0, 1))

    def cost(arms: tuple[int, int]) -> float:
        turn = arms[0] * first + arms[1] * second
        off = abs(turn) / length - 1 if wound else np.log(abs(turn) / length)
        return abs(off) + (0.0 if wound else abs(float(np.angle(turn))))

    steps = range(-MOST_STEPS, MOST_STEPS + 1)
    every = [(m, n) for m in steps for n in steps if (n and m > 0 if wound else n or m)]
    chosen = settings.arms or min(every, key=cost)
    return chosen, chosen[0] * first + chosen[1] * second


def _around(motions: Array, rings: list[Array], period: complex, size: float) -> Integers:
    """Return colours of copies in the plane that differ from their neighbours', also over a period."""
    step, count, small = np.array([period.real, period.imag]), len(motions), TOUCHING * size
    placed = [np.einsum("mij,nj->mni", motions, ring)[..., :2] for ring in rings]
    near: list[set[int]] = [set() for _ in range(count)]
    wide: list[Any] = [shapely.buffer(shapely.polygons(polygons), small) for polygons in placed]
    every: Any = np.concatenate(
        [
            shapely.buffer(shapely.polygons(polygons + turn * step), small)
            for polygons in placed
            for turn in (-1, 0, 1)
        ]
    )
    tree = shapely.STRtree(every)
    for grown in wide:
        index, nearby = tree.query(grown, predicate="intersects")
        shared = shapely.area(shapely.intersection(grown[index], every[nearby]))
        for i, j in zip(index[shared > 50 * small**2], nearby[shared > 50 * small**2], strict=True):
            if j % count != i:
                near[i].add(int(j % count))
                near[j % count].add(int(i))
    numbers, left = np.full(count, -1), set(range(count))
    while left:  # the one whose neighbours have most colours first
        taken = {i: {int(numbers[j]) for j in near[i]} - {-1} for i in left}
        i = max(sorted(left), key=lambda k: (len(taken[k]), len(near[k])))
        numbers[i] = next(c for c in range(len(taken[i]) + 1) if c not in taken[i])
        left.remove(i)
    return numbers
