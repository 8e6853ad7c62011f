"""Which triangle is seen in each pixel: a depth buffer filled scanline by scanline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers

ROWS_AT_ONCE = 150_000
"""Rows of triangles that are filled at once, which bounds the memory."""


PIXELS_AT_ONCE = 100_000
"""Pixels whose values are interpolated at once: what a processor keeps close."""


NARROWEST = 1e-9
"""Twice the area in pixels below which a triangle is seen from its edge, and not drawn."""


class SeenTriangles(NamedTuple):
    """What is seen in the pixels of a picture, row by row from its upper left corner.

    - `triangle`: (height, width) the triangle's number, -1 where there is none.
    - `depth`: (height, width) its z, minus infinity where there is none.
    - `planes`: (n, 3, 3) of all triangles: (x, y, 1) times one is the shares of its corners.
    """

    triangle: Integers
    depth: Array
    planes: Array

    @property
    def covered(self) -> Array:
        """(height, width) where something is seen."""
        return self.triangle >= 0

    def interpolated(self, values: Array) -> NDArray[np.float32]:
        """Return what covered pixels (m, c) have, row by row, of values (n, 3, c) at the corners."""
        row, column = np.nonzero(self.covered)
        owner = self.triangle[row, column]
        # affine in the picture, as the corners' shares are
        fields: Array = self.planes @ values
        seen = np.empty((len(owner), values.shape[2]), np.float32)
        for first in range(0, len(owner), PIXELS_AT_ONCE):
            part = slice(first, first + PIXELS_AT_ONCE)
            field = fields[owner[part]]
            sums = field[:, 0] * (column[part, None] + 0.5)
            sums += field[:, 1] * (row[part, None] + 0.5)
            seen[part] = sums + field[:, 2]
        return seen


def nearest_triangles(corners: Array, width: int, height: int) -> SeenTriangles:
    """Return which of triangles (n, 3, 3) is seen in each pixel of a picture.

    Corners are in pixels, x to the right, y down, z towards the viewer. A triangle is seen from both
    sides; leave out those that are turned away. Pixels are asked at their middles.
    """
    depth = np.full(width * height, -np.inf)
    triangle = np.full(width * height, -1, np.int64)
    # the shares of the corners in a point: affine in x and y
    across, along = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    wide = np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0]) > NARROWEST
    ones = np.concatenate([corners[wide, :, :2], np.ones((int(wide.sum()), 3, 1))], axis=2)
    planes = np.zeros((len(corners), 3, 3))
    planes[wide] = np.linalg.inv(ones.transpose(0, 2, 1)).transpose(0, 2, 1)
    heights = np.einsum("nij,nj->ni", planes, corners[..., 2])
    top = np.clip(np.ceil(corners[..., 1].min(axis=1) - 0.5), 0, height).astype(int)
    last = np.clip(np.floor(corners[..., 1].max(axis=1) - 0.5), -1, height - 1).astype(int)
    rows = np.where(wide, np.maximum(last - top + 1, 0), 0)
    chunks: Array = np.cumsum(rows) // ROWS_AT_ONCE
    cuts = np.flatnonzero(np.diff(chunks)) + 1
    for chunk in np.split(np.arange(len(corners)), cuts):
        which, row = each(rows[chunk])
        which, row = chunk[which], row + top[chunk][which]
        slope = planes[which, 0]
        rest = planes[which, 1] * (row[:, None] + 0.5) + planes[which, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = -rest / slope
        left = np.where(slope > 0, zero, 0.0).max(axis=1)
        right = np.where(slope < 0, zero, float(width)).min(axis=1)
        first = np.ceil(left - 0.5 - 1e-6).astype(int)
        count = np.floor(right - 0.5 + 1e-6).astype(int) - first + 1
        line, column = each(np.clip(count, 0, width))
        column += first[line]
        owner = which[line]
        z = heights[owner, 0] * (column + 0.5)
        z += heights[owner, 1] * (row[line] + 0.5)
        z += heights[owner, 2]
        place = row[line] * width + column
        ahead = z > depth[place]
        place, z, owner = place[ahead], z[ahead], owner[ahead]
        np.maximum.at(depth, place, z)
        on_top = z == depth[place]
        triangle[place[on_top]] = owner[on_top]
    shape = height, width
    return SeenTriangles(triangle.reshape(shape), depth.reshape(shape), planes)


def each(counts: Integers) -> tuple[Integers, Integers]:
    """Return, for as many things as are counted, whose each is and its place among them.

    >>> [part.tolist() for part in each(np.array([2, 0, 1]))]
    [[0, 0, 2], [0, 1, 0]]
    """
    whose = np.repeat(np.arange(len(counts)), counts)
    return whose, np.arange(len(whose)) - (np.cumsum(counts) - counts)[whose]
