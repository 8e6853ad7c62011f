"""Starts that find the good basin: tiles of a class that are near the target's outline already."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from orbiflow.arrays import Array, Complex
from orbiflow.runtime import NEVER, Cancel
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles.geometry import plane_points, resampled, reverse, subdivided
from orbiflow.tiles.likeness import boundary_iou, prepared_region
from orbiflow.tiles.search import (
    NearestTiles,
    Placements,
    Prototiles,
    TileSpace,
    best_placements,
    template_symmetries,
)
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class

if TYPE_CHECKING:
    from orbiflow.tiles.flowing.overlap_search import OverlapSearch


def initial_poses(isohedral_class: IsohedralClass, turns: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return angles (S,) in radians that give different templates, and mirror flags (S,)."""
    order, symmetric = template_symmetries(isohedral_class)
    angles = np.arange(turns, dtype=np.float64) * (2 * math.pi / order / turns)
    if symmetric:
        return angles, np.zeros(turns, dtype=np.bool_)
    return np.tile(angles, 2), np.arange(2 * turns) >= turns


# Starts differ by this share of the outline in where some corner sits, or they are twins
MIN_CORNER_SHIFT = 0.025
# Standard deviations, in points, of the smoothing of outlines whose nearest tile crosses itself
SMOOTHING_SIGMAS = (0.0, 1.0, 2.0)


@dataclass(frozen=True)
class Starts:
    """The best starts of a search."""

    prototiles: Prototiles  # best overlap first
    iou: Array  # (S,) of each before the descent


def outline_starts(
    target: Target, kind: IsohedralClass, settings: OverlapSearch, *, cancel: Cancel = NEVER
) -> Starts:
    """Return the best start tiles of one class for a target, no two of them twins.

    At each of the `resolutions`, points of the outline, so many placements are `projected` onto tiles
    and the nearest `measured`.
    """
    parts: list[Prototiles] = []
    scores: list[Array] = []
    places: list[Array] = []
    for mirrored in (False,) if template_symmetries(kind)[1] else (False, True):
        ring = reverse(target.normal * (1.0, -1.0)) if mirrored else target.normal
        goal = prepared_region(ring)
        for points in settings.resolutions:
            cancel.check()
            outline = resampled(ring, points, settings.phase) @ [1, 1j]
            best = best_placements(kind, outline, settings.projected)
            nearest = _simple_tiles(kind, goal, outline, best, settings.measured)
            for tiles, placements, score in nearest:
                parts.append(Prototiles.of(kind, tiles, settings.boundary, mirrored=mirrored))
                scores.append(score)
                places.append((placements.starts[:, None] + tiles.corners) / points)
    iou, all_tiles = np.concatenate(scores), Prototiles.joined(parts)
    chosen = _apart(iou, np.concatenate(places), all_tiles.mirrored, settings.candidates)
    return Starts(all_tiles.take(chosen), iou[chosen])


def template_starts(
    kind: IsohedralClass | str,
    *,
    turns: int,
    stretch: float,
    vertices: int = 240,
    phase: float = 0.0,
) -> Prototiles:
    """Return the template itself, turned and stretched: starts that know nothing of the target.

    There are so many `turns`, twice as many for classes without lattice freedom, moved by `phase`
    steps; and stretches of size `stretch` along each axis of that freedom, besides none.
    """
    kind = isohedral_class(kind)
    order, symmetric = template_symmetries(kind)
    stretches = [np.zeros(kind.stretch_dim)]
    for axis, sign in itertools.product(np.eye(kind.stretch_dim), (1.0, -1.0)):
        stretches.append(sign * stretch * axis)
    turns *= 1 if kind.stretch_dim else 2
    step = 2 * np.pi / order / turns
    sides = (False,) if symmetric else (False, True)
    poses = list(itertools.product(sides, (np.arange(turns) + phase) * step, stretches))
    corners = kind.template()
    pieces = vertices // len(corners)
    count = len(poses)
    area = kind.group().cell_volume / kind.group().order
    mirrored, angle, pull = (np.array(column) for column in zip(*poses, strict=True))
    scale = area**-0.5
    turned = np.array([rotation_matrix(a) for a in angle])
    turned[mirrored, :, 1] *= -1
    center = scale * turned @ kind.stretch(pull) @ corners.mean(axis=0)
    return Prototiles(
        np.tile(subdivided(corners[None], pieces), (count, 1, 1)),
        np.tile(np.arange(len(corners)) * pieces, (count, 1)),
        angle,
        np.full(count, np.log(scale)),
        -center,
        pull,
        mirrored,
    )


def _simple_tiles(
    kind: IsohedralClass,
    goal: shapely.Polygon,
    outline: Complex,
    placements: Placements,
    wanted: int,
) -> Iterator[tuple[NearestTiles, Placements, Array]]:
    """Return the `wanted` nearest tiles that do not cross themselves, their placements and IoU.

    Near an outline that was smoothed fewer cross: limbs are shorter, and the descent lets them grow.
    """
    for spread in SMOOTHING_SIGMAS:
        if not len(placements.starts) or wanted < 1:
            return
        smooth = outline
        if spread:
            parts = (outline.real, outline.imag)
            x, y = (np.asarray(gaussian_filter1d(z, spread, mode="wrap")) for z in parts)
            smooth = (x + 1j * y).astype(np.complex128)
        tiles = nearest_tiles(kind, smooth, placements)
        rings = plane_points(tiles.vertices)
        valid = np.asarray(shapely.is_valid(shapely.polygons(rings)))
        simple = valid & (np.linalg.det(tiles.linear) > 1e-6)
        nearest = np.argsort(tiles.distance, kind="stable")
        chosen = nearest[simple[nearest]][:wanted]
        yield tiles.take(chosen), placements.take(chosen), boundary_iou(goal, rings[chosen])
        wanted -= len(chosen)
        placements = placements.take(np.flatnonzero(~simple))


def _apart(scores: Array, places: Array, mirrored: NDArray[np.bool_], count: int) -> list[int]:
    """Choose the best scores, greedily, whose corners are not where those of a better one are."""
    chosen: list[int] = []
    for index in np.argsort(-scores, kind="stable"):
        gap = abs(places[chosen] - places[index]) % 1.0
        near = np.minimum(gap, 1 - gap).max(axis=1) < MIN_CORNER_SHIFT
        if (near & (mirrored[chosen] == mirrored[index])).any():
            continue
        chosen.append(int(index))
        if len(chosen) == count:
            break
    return chosen


CHUNK_PLACEMENTS = 4000  # placements worked on at a time: bounds the memory at some hundred MB


def nearest_tiles(kind: IsohedralClass, outline: Complex, placements: Placements) -> NearestTiles:
    """Project an outline (n,), counter-clockwise, onto the tiles of a class for every placement."""
    nearest: list[NearestTiles] = []
    pieces = max(1, -(-len(placements.starts) // CHUNK_PLACEMENTS))
    for index in np.array_split(np.arange(len(placements.starts)), pieces):
        space = TileSpace(kind, placements.take(index))
        nearest.append(space.nearest(np.broadcast_to(outline, (space.count, len(outline)))))
    return NearestTiles(*(np.concatenate(parts) for parts in zip(*nearest, strict=True)))
