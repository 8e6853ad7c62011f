"""Tiles that come apart: each copy leaves a stack by a straight move.

Along a direction d the copies of a tile have an order, that of their centres. A tile comes apart
along d if on each line of direction d the copies follow each other in this order: then nothing lies
ahead of a copy but copies that have left before it. The exact tile of a function becomes such a tile
if the labels of the places on each line are sorted: of all sequences of labels in this order, the one
on which the function is largest in total. Elements that keep d up to its sign take sequences in order
to such sequences, so that the copies of the sorted tile still fill space once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.ndimage

from orbiflow.arrays import Array, Integers
from orbiflow.errors import GroupError
from orbiflow.solids.assembly import Pieces, axes_along, keeps_directions, sphere
from orbiflow.solids.closing import Function, ball_of_cells, box_around
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.smoothing import PointOrbits, patch_vectors
from orbiflow.solids.surfaces import Patches, tile_surface
from orbiflow.symmetry import CrystallographicGroup

SEPARABLE_GROUPS = ("P 1", "P -1")
"""Groups that keep each direction up to its sign, so that any may be the one."""

DIRECTIONS, ROUGH, FINE = 40, 0.1, 0.03  # tried, all around; distances of lines and places on them
BLUR = 1.2  # of the sorted tile, in steps
FAITH, DEEPEST = 0.1, 0.1  # of the function beside it, and its most
DRAFT = np.sin(np.deg2rad(2.0))  # slope that walls get, so that they do not rub
DRAFT_ROUNDS, SMOOTHED, DRAFTS, OVERSHOOT = 120, 4, 3, 1.3
GAP = 0.004  # between copies that come apart, in longest sides: a quarter of a millimetre of 60
STILL = 0.15  # how much less a face that may stay counts at a point than one that turns


def check_separable(group: CrystallographicGroup) -> None:
    """Raise `GroupError` for groups in which tiles that come apart are not looked for."""
    if not keeps_directions(group):
        raise GroupError(
            f"solids that come apart are looked for in {' and '.join(SEPARABLE_GROUPS)}, "
            f"not in {group.name}"
        )


def pieces_with_gap(group: CrystallographicGroup, tile: Mesh) -> Pieces:
    """Return a tile and its neighbours with the gap that copies which come apart may have."""
    return Pieces(group, tile, GAP * float(np.ptp(tile.points, axis=0).max()))


def separable_tile(
    detail: int, depth: Function, body: Mesh, group: CrystallographicGroup
) -> Mesh | None:
    """Return a tile, much like the exact tile of a function, that leaves a stack by a straight move.

    The direction is that in which sorting changes least. Walls that would be undercut are then
    turned, and the direction once more chosen, until nothing is in the way of copies that keep a gap of
    `GAP`, as prints do.

    Args:
        detail: The number of cells it is made of.
        depth: How deep points are inside of the body.
        body: The body in its place.
        group: P 1 or P -1.

    Returns None if the cells do not close, or something stays in the way.
    """
    bounds = box_around(body)
    lines = _Lines.of(depth, bounds, group)
    half = [d for d in sphere(DIRECTIONS) if d @ (0.3, 0.5, 1) > 0]
    direction = max(half, key=lambda d: lines.kept(d, ROUGH))
    ball = ball_of_cells(lines.sorted_function(direction, FINE), bounds, group, detail)
    if ball is None:
        return None
    for _ in range(DRAFTS):
        tile = tile_surface(ball, move=partial(_drafted, group, direction)).mesh
        leaving = pieces_with_gap(group, tile).leaving_stack(group.linear_parts)
        if leaving.is_free:
            return tile
        direction = leaving.direction
    return None


@dataclass(frozen=True, eq=False)
class _Lines:
    """Lines through a box, on whose places copies of a body meet.

    - `depth`: The function.
    - `values`: Its values on a cubic grid from the box's lower corner, `FINE` apart.
    - `bounds`: The box.
    - `turns`, `shifts`: The elements (n, 3, 3), (n, 3) whose copies come near, the identity first.
    - `offsets`: Where the copies' centres are from the first's (n, 3).
    """

    depth: Function
    values: Array
    bounds: tuple[Array, Array]
    turns: Array
    shifts: Array
    offsets: Array

    @classmethod
    def of(
        cls, depth: Function, bounds: tuple[Array, Array], group: CrystallographicGroup
    ) -> _Lines:
        low, high = bounds
        counts = np.ceil((high - low) / FINE).astype(int) + 1
        places = low + FINE * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1)
        values = depth(places.reshape(-1, 3)).reshape(counts)
        inside = places[values > 0]
        center = inside.mean(axis=0)
        radius = float(np.linalg.norm(inside - center, axis=1).max())
        near = group.elements_near(center, 2 * radius, source=center)
        turns = np.array([element.linear for element in near])
        shifts = np.array([element.translation for element in near])
        return cls(depth, values, bounds, turns, shifts, turns @ center + shifts - center)

    def kept(self, direction: Array, step: float) -> float:
        """Return the volume that the exact tile and the sorted one share."""
        values, itself, _, _ = self._values(direction, step)
        return float(
            ((values.argmax(axis=0) == itself) & (sorted_labels(values) == itself)).sum() * step**3
        )

    def sorted_function(self, direction: Array, step: float) -> Function:
        """Return a function that is above 0 in the sorted tile, and a little deeper as `depth` is."""
        values, itself, axes, start = self._values(direction, step)
        inside = np.where(sorted_labels(values) == itself, 0.5, -0.5)
        soft = scipy.ndimage.gaussian_filter(inside, BLUR)

        def wanted(points: Array) -> Array:
            at = (points @ axes - start) / step
            blurred = scipy.ndimage.map_coordinates(soft, at.T, order=1, mode="nearest")
            return blurred + FAITH * np.clip(self.depth(points), -DEEPEST, DEEPEST)

        return wanted

    def _values(self, direction: Array, step: float) -> tuple[Array, int, Array, Array]:
        """Return the depths of copies, in their order, at places on lines (K, U, V, places).

        Returns as well which copy is the first, and the axes (3, 3) and the start (3,) of the places.
        """
        axes = axes_along(direction)
        corners = np.stack(np.meshgrid(*zip(*self.bounds, strict=True)), -1).reshape(-1, 3) @ axes
        start = corners.min(axis=0)
        counts = np.ceil((corners.max(axis=0) - start) / step).astype(int) + 1
        places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1)
        points = (start + step * places) @ axes.T
        order = np.argsort(self.offsets @ direction, kind="stable")
        depths = np.empty((len(order), *counts), np.float32)
        for place, k in enumerate(order):
            depths[place] = self._depths((points - self.shifts[k]) @ self.turns[k])
        return depths, int(np.flatnonzero(order == 0)[0]), axes, start

    def _depths(self, points: Array) -> Array:
        """Return depths between the grid's values; off the grid they fall with the distance."""
        low = self.bounds[0]
        inside = np.clip(points, low, low + FINE * (np.array(self.values.shape) - 1))
        at = np.moveaxis((inside - low) / FINE, -1, 0)
        depths = scipy.ndimage.map_coordinates(self.values, at, order=1)
        return depths - np.linalg.norm(points - inside, axis=-1)


def sorted_labels(values: Array) -> Array:
    """Return labels (U, V, n), never less along a line, whose values (K, U, V, n) have the largest sum.

    >>> sorted_labels(np.array([[[[0.0, 2.0, 1.0]]], [[[1.0, 0.0, 2.0]]]])).tolist()
    [[[0, 0, 1]]]
    """
    number = np.arange(len(values))[:, None, None]
    came_from = np.zeros(values.shape, np.int16)
    total = values[..., 0]
    for place in range(1, values.shape[-1]):
        best = np.maximum.accumulate(total, axis=0)
        at = np.where(total >= best, number, 0)
        came_from[..., place] = np.maximum.accumulate(at, axis=0)
        total = best + values[..., place]
    labels = np.empty(values.shape[1:], np.int64)
    labels[..., -1] = total.argmax(axis=0)
    for place in range(values.shape[-1] - 1, 0, -1):
        last = labels[None, ..., place]
        labels[..., place - 1] = np.take_along_axis(came_from[..., place], last, axis=0)[0]
    return labels


def _drafted(
    group: CrystallographicGroup,
    direction: Array,
    orbits: PointOrbits,
    places: Array,
    patches: Patches,
) -> Array:
    """Return the orbits' places (n, 3) where few faces stay that would be undercut along a direction.

    A face towards a copy that is higher must look up, and one towards a lower copy down. Points go to
    the means of where their faces, turned about their centres, would have them.
    """
    center = orbits.places(places).mean(axis=0)
    behind = group.linear_parts[patches.cosets] @ center + group.translations[patches.cosets]
    behind = behind + patches.shifts @ group.lattice.T
    side = np.sign((behind - center) @ direction)
    for turn in range(DRAFT_ROUNDS):
        if turn % SMOOTHED == 0 and turn < DRAFT_ROUNDS / 2:  # else walls keep the steps of cells
            places = orbits.near(places + 0.5 * orbits.pull(places), orbits.start)
        moves = _moves_of_draft(orbits.places(places), patches.corners, side, direction)
        places = orbits.near(places + OVERSHOOT * orbits.mean_moves(moves), orbits.start)
    return places


def _moves_of_draft(points: Array, corners: Integers, side: Array, direction: Array) -> Array:
    """Return the moves (N, 3) of points that turn undercut patches (F, 4) about their centres.

    `side` (F,) is 1 for patches that must look along the direction, -1 for those that must look back.
    """
    real = np.ones(corners.shape, bool)
    real[:, 3] = corners[:, 2] != corners[:, 3]
    p = points[corners]
    flat = patch_vectors(p, ~real[:, 3])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    up = side * (flat @ direction)
    bad = up < DRAFT
    turned = flat + np.where(bad, side * (2 * DRAFT - up), 0.0)[:, None] * direction
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    middle = (p * real[..., None]).sum(axis=1) / real.sum(axis=1, keepdims=True)
    off = np.einsum("fkj,fj->fk", p - middle[:, None], turned) * bad[:, None]
    moves, weight = np.zeros_like(points), np.zeros(len(points))
    np.add.at(moves, corners[real], (-off[..., None] * turned[:, None])[real])
    np.add.at(weight, corners[real], np.where(bad, 1.0, STILL)[:, None].repeat(4, 1)[real])
    return moves / np.maximum(weight, 1e-300)[:, None]
