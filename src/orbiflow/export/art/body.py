"""A tile's inside as an engraver sees it: how deep, which way, how thick, where the light falls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates

from orbiflow.export.art.paint import Grid
from orbiflow.geometry import resampled, signed_area
from orbiflow.symmetry.isometry import Array

FINE = 420.0
"""Cells of the raster along the square root of the area."""

LIGHT = np.array([-0.6, -0.8])
"""Where it comes from, in units with y down: above, from the left."""


class Along:
    """Places along the outline: `points`, inward `normals` and half-thickness `half`; (n, ...)."""

    def __init__(self, body: Body, count: int) -> None:
        ring = body.ring
        self.points = resampled(ring, count)
        step = np.roll(self.points, -1, axis=0) - np.roll(self.points, 1, axis=0)
        inward = np.stack([-step[:, 1], step[:, 0]], axis=1) * np.sign(signed_area(ring))
        inward = gaussian_filter(inward, (2, 0), mode="wrap")
        self.normals = inward / np.maximum(np.linalg.norm(inward, axis=1), 1e-12)[:, None]
        self.half = body.half_thickness(self.points, self.normals)


@dataclass(frozen=True, eq=False)
class Body:
    """A tile at area 1, y down.

    - `ring`: (N, 2).
    """

    ring: Array

    @cached_property
    def _grid(self) -> Grid:
        return Grid.over(self.ring, FINE, 1)

    @cached_property
    def _depth(self) -> Array:
        grid = self._grid
        return np.asarray(distance_transform_edt(grid.inside(self.ring))) / grid.density

    @cached_property
    def _slope(self) -> tuple[Array, Array]:
        # along x, along y
        smooth = gaussian_filter(self._depth, 6.0)
        return np.gradient(smooth, axis=1), np.gradient(smooth, axis=0)

    def depth(self, points: Array) -> Array:
        """(...) how far inside points (..., 2) lie; 0 outside."""
        return self._at(self._depth, points)

    def inward(self, points: Array) -> Array:
        """(..., 2) unit vectors away from the nearest part of the outline."""
        vector = np.stack([self._at(part, points) for part in self._slope], axis=-1)
        return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-12)

    def half_thickness(self, points: Array, normals: Array) -> Array:
        """(n,) how far one can go inwards from the outline before it comes nearer again."""
        steps = np.linspace(0, float(self._depth.max()) * 1.05, 90)
        depth = self.depth(points[:, None] + steps[None, :, None] * normals[:, None])
        ahead = depth >= 0.85 * steps[None] - 0.004
        return steps[np.argmin(np.column_stack([ahead, np.zeros(len(points), bool)]), axis=1) - 1]

    @cached_property
    def axis(self) -> Array:
        """(2,) its longest direction, to the right or down."""
        points = resampled(self.ring, 400)
        _, _, ways = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        way = ways[0]
        return way * np.sign(way @ (1.0, 0.5))

    @cached_property
    def thickest(self) -> float:
        """Greatest depth."""
        return float(self._depth.max())

    def _at(self, values: Array, points: Array) -> Array:
        place = self._grid.texels(points) - 0.5
        flat = place.reshape(-1, 2)
        found = map_coordinates(values, [flat[:, 1], flat[:, 0]], order=1, mode="nearest")
        return found.reshape(points.shape[:-1])


def shade(normals: Array) -> Array:
    """(n,) how dark it is where the outline has these inward normals: 0 in the light, 1 away."""
    toward = normals @ (LIGHT / np.linalg.norm(LIGHT))
    return np.clip(0.5 + 0.5 * toward, 0, 1)


def stroke(points: Array, widths: Array) -> Array:
    """(2 n, 2) the outline of a line through points (n, 2) as wide as `widths` (n,) at each."""
    step = np.gradient(points, axis=0)
    across = np.stack([-step[:, 1], step[:, 0]], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]
    side = across * widths[:, None] / 2
    return np.concatenate([points + side, (points - side)[::-1]])
