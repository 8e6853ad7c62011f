"""What a body passes when it is lifted straight up: the room that a mould of it must leave open."""

from __future__ import annotations

import numpy as np
from manifold3d import CrossSection, FillRule, Manifold, Mesh64
from scipy.ndimage import distance_transform_edt, minimum_filter

from orbiflow.arrays import Array
from orbiflow.drawing import nearest_triangles
from orbiflow.solids.bodies import as_mesh

PITCH = 0.4
"""Distance in mm of the lines on which a body's lowest places are asked: a printer's line."""

MOST_LINES = 500
"""Lines across a body at most."""

STEEP = 3.0
"""Rise from one line to the next, as a multiple of their distance, beyond which it is a step."""


def lifted(body: Manifold, top: float) -> Manifold:
    """Return what a body in mm passes when it is lifted up to a height, and the body itself.

    That is what is above its lowest places, within its outline from above. The outline is exact, and
    so are the lowest places on a grid of lines; between them the floor is flat, and steps are taken
    on the far side, so that the body is never in the way.
    """
    corners = as_mesh(body).corners
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    pitch = max(PITCH, float((high - low)[:2].max()) / MOST_LINES)
    width, height = (int(n) + 3 for n in (high - low)[:2] / pitch)
    # half a pixel, so that lines are at whole numbers of pitches from the corner
    start = low - (pitch, pitch, 0)
    seen = nearest_triangles(
        ((corners - start) / pitch + (0.5, 0.5, 0)) * (1, 1, -1), width, height
    )
    covered = seen.covered
    floor = np.where(covered, low[2] - pitch * seen.depth, 0.0)
    nearest = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    floor = floor[tuple(np.asarray(nearest))]
    lowest = minimum_filter(floor, 3)
    floor = np.where(floor - lowest > STEEP * pitch, lowest, floor)
    above = _above(np.minimum(floor, top - pitch), start, pitch, top)
    outline = CrossSection(body.project().to_polygons(), FillRule.Positive)
    column = Manifold.extrude(outline, top - low[2] + 2 * pitch).translate((0, 0, low[2] - pitch))
    return (above ^ column) + body


def _above(floor: Array, start: Array, pitch: float, top: float) -> Manifold:
    """Return what is between a floor, given at the places (rows, columns) of a grid, and a height."""
    rows, columns = floor.shape
    y, x = np.meshgrid(*(pitch * np.arange(n) for n in floor.shape), indexing="ij")
    below = np.stack([x + start[0], y + start[1], floor], axis=2).reshape(-1, 3)
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    faces = np.concatenate([np.stack(f, axis=2).reshape(-1, 3) for f in ((a, c, b), (a, d, c))])
    # the rim, counter-clockwise from above, has its own points above; the lid is a fan
    rim = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    lid = np.column_stack([below[rim, :2], np.full(len(rim), top)])
    middle = [[*below[:, :2].mean(axis=0), top]]
    first = len(below) + np.arange(len(rim))
    after, following = np.roll(rim, -1), np.roll(first, -1)
    center = np.full(len(rim), len(below) + len(rim))
    sides = [(rim, after, following), (rim, following, first), (first, following, center)]
    faces = np.concatenate([faces, *(np.stack(side, axis=1) for side in sides)])
    points = np.concatenate([below, lid, middle])
    return Manifold(Mesh64(np.ascontiguousarray(points), np.ascontiguousarray(faces, np.uint64)))
