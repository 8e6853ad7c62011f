"""A tiling around a spiral: every copy of a turn about a lattice vector is the same copy."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array, Integers
from orbiflow.tiles.make import ArtSettings
from orbiflow.tiles.tilings import Tiling, copies_meeting
from orbiflow.tiles.worlds.sheet import LEAST_COPY, World, motions_of
from orbiflow.tiles.worlds.views import View

AROUND = 9.0  # sizes of the tile that one turn of a spiral has
RIM = 0.35  # where a spiral's first tile is, as a share of its radius
TOUCHING = 1e-3  # of a tile's size: how far neighbours are made wider to see whether they touch


def spiral(
    given: Tiling, tiling: Tiling, flip: Array, settings: ArtSettings
) -> tuple[World, list[str]]:
    """Return the copies of a tiling around a spiral: z goes to exp(2 pi i z / w), w of the lattice."""
    middle, size = complex(*tiling.center), float(np.sqrt(tiling.tile_area))
    first, second = (complex(*tiling.group.lattice[:, k]) for k in (0, 1))
    arms = settings.arms or _usual_arms(first, second, AROUND * size)
    period = arms[0] * first + arms[1] * second
    # the first tile lies at a share of the radius; how far in and out, in periods
    start = middle - 1j * period * (-np.log(RIM) / (2 * np.pi))
    radius = float(np.linalg.norm(settings.page)) / 2
    inner = np.log(2 * np.pi * radius * size / abs(period) / (2 * LEAST_COPY)) / (2 * np.pi)
    corners = np.array(
        [start + (a + 1j * b) * period for a in (-1.2, 1.2) for b in (-0.6, inner + 0.2)]
    )
    x, y = np.real(corners), np.imag(corners)
    every = copies_meeting(tiling, (float(x.min()), float(y.min()), float(x.max()), float(y.max())))
    first_kind = np.flatnonzero(every.prototiles == 0)
    linear = every.group.linear_parts[every.cosets[first_kind]]
    shift = every.translations[first_kind]
    places = linear @ tiling.center + shift
    share = (places @ (1, 1j) - start) / period
    view = View("spiral", settings.page, np.eye(3), period)
    keep = (share.real > -0.5 + 1e-9) & (share.real <= 0.5 + 1e-9) & (share.imag < inner)
    begin = start - period * np.radians(settings.rotate) / (2 * np.pi)
    motions = motions_of(linear[keep], shift[keep] - (begin.real, begin.imag))

    def vectors(points: Array) -> Array:
        return np.column_stack([points @ flip, np.ones(len(points))])

    rings = [vectors(own.polygon) for own in given.prototiles]
    seen = view.places(np.einsum("mij,nj->mni", motions, np.concatenate(rings)))
    near = (seen.max(axis=1) > 0).all(axis=1) & (seen.min(axis=1) < view.size).all(axis=1)
    motions = motions[near]
    numbers = _around(motions, rings, period, size)
    if settings.colour == "one":
        numbers = 0 * numbers
    said = f"{len(motions)} copies, {arms[0]},{arms[1]} lattice vectors around"
    return World(given, vectors, motions, numbers, view), [said]


def _usual_arms(first: complex, second: complex, length: float) -> tuple[int, int]:
    """Return the steps along both lattice vectors, neither of them 0, of about this length together."""
    steps = [(m, n) for m in range(1, 9) for n in range(-8, 9) if n]
    return min(steps, key=lambda own: abs(abs(own[0] * first + own[1] * second) - length))


def _around(motions: Array, rings: list[Array], period: complex, size: float) -> Integers:
    """Return colours of copies in the plane that differ from their neighbours', also over a period."""
    step, count, small = np.array([period.real, period.imag]), len(motions), TOUCHING * size
    placed = [np.einsum("mij,nj->mni", motions, ring)[..., :2] for ring in rings]
    near: list[set[int]] = [set() for _ in range(count)]
    wide: list[Any] = [shapely.buffer(shapely.polygons(own), small) for own in placed]
    every: Any = np.concatenate(
        [
            shapely.buffer(shapely.polygons(own + turn * step), small)
            for own in placed
            for turn in (-1, 0, 1)
        ]
    )
    tree = shapely.STRtree(every)
    for own in wide:
        one, two = tree.query(own, predicate="intersects")
        shared = shapely.area(shapely.intersection(own[one], every[two]))
        for i, j in zip(one[shared > 50 * small**2], two[shared > 50 * small**2], strict=True):
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
