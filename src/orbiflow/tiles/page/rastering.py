"""Pictures of pixels on meshes: which samples lie in which region, and what is seen at each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from orbiflow.arrays import Array, Integers
from orbiflow.tiles.geometry import doubled_areas, triangle_sides

Pixels = NDArray[np.uint8]
"""A picture (height, width, 4): red, green, blue and opacity, 0 to 255; colours are straight."""

NOWHERE = -1  # the label of samples that lie in no region

# Distance, in samples, by which rows of samples are moved down: rounding would otherwise decide about
# vertices that a symmetric placement puts exactly on a row
NUDGE = 3.1415926e-7


BLOCK = 2**15
"""Pixels that are looked up at a time: what is computed for them stays in the processor's cache."""


class Runs(NamedTuple):
    """R runs of samples, each in one region, row by row and from left to right."""

    label: Integers  # the region (R,), or `NOWHERE`
    row: Integers  # the row (R,), counted from 0
    start: Integers  # the first column (R,)
    length: Integers  # the number (R,) of samples; those of a row add up to its width

    def spread(self, values: NDArray) -> NDArray:
        """Return one value for each sample (rows x width,) from one for each run."""
        return np.repeat(values, self.length, axis=0)


class Sides(NamedTuple):
    """Sides of regions, each with the region to its right, at larger x."""

    start: Array  # with `end`: (S, 2) in samples, y down: sample (i, j) lies at (j + 1/2, i + 1/2)
    end: Array
    label: Integers  # the region (S,)


def sampled(pixels: Pixels, places: Array) -> Pixels:
    """Return the colours (N, 4) of a picture at places (N, 2), linear between the middles of pixels.

    Pixel (i, j) has its middle at (j + 1/2, i + 1/2). Beyond the outermost ones colours go on as they
    are there. What is transparent has no share in a colour.
    """
    height, width = pixels.shape[:2]
    packed = np.ascontiguousarray(pixels).view(np.uint32).reshape(-1)
    right, below = int(width > 1), width * int(height > 1)
    shown = np.empty((len(places), 4), dtype=np.uint8)
    for begin in range(0, len(places), BLOCK):
        x, y = (places[begin : begin + BLOCK].astype(np.float32) - np.float32(0.5)).T
        x, y = x.clip(0, width - 1), y.clip(0, height - 1)
        left = np.minimum(x.astype(np.int64), max(width - 2, 0))
        top = np.minimum(y.astype(np.int64), max(height - 2, 0))
        x, y, at = (x - left)[:, None], (y - top)[:, None], top * width + left
        weights = (1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y
        # clipped, which nothing needs, is faster than checked
        steps = (0, right, below, right + below)
        four = [packed.take(at + step, mode="clip").view(np.uint8).reshape(-1, 4) for step in steps]
        if all(colours[:, 3].min(initial=255) == 255 for colours in four):
            mixed = sum(weight * colours for weight, colours in zip(weights, four, strict=True))
        else:
            opacity = [
                weight * colours[:, 3:] for weight, colours in zip(weights, four, strict=True)
            ]
            whole = np.asarray(sum(opacity))
            mixed = sum(share * colours for share, colours in zip(opacity, four, strict=True))
            mixed = np.asarray(mixed) / np.maximum(whole, 1e-3)
            mixed[:, 3:] = whole
        shown[begin : begin + BLOCK] = np.clip(mixed + np.float32(0.5), 0, 255)
    return shown


def ring_sides(rings: Array) -> Sides:
    """Return the sides of rings (M, N, 2) that have the inside to their right; ring m has label m."""
    ahead, entering = _entering(rings)
    return Sides(rings[entering], ahead[entering], np.nonzero(entering)[0])


def _entering(rings: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the ends of the sides of rings (..., N, 2), and which have the inside to their right."""
    ahead = np.roll(rings, -1, axis=-2)
    area = (rings[..., 0] * ahead[..., 1] - rings[..., 1] * ahead[..., 0]).sum(axis=-1)
    return ahead, (ahead[..., 1] - rings[..., 1]) * np.sign(area)[..., None] < 0


def polygon_sides(ring: Array) -> Sides:
    """Return the sides of one ring (N, 2): 0 where they enter it, `NOWHERE` where they leave it."""
    ahead, entering = _entering(ring)
    return Sides(ring, ahead, np.where(entering, 0, NOWHERE))


def region_sides(points: Array, triangles: Integers) -> Sides:
    """Return the sides of triangles (M, 3) that do not overlap, and of what lies around them."""
    inner = ring_sides(points[triangles])
    # a side of a single triangle is the border, and beyond it is nowhere
    pairs = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    keys = np.sort(pairs, axis=1) @ np.array([len(points), 1])
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    border = pairs[first[count == 1]]
    owner = np.tile(np.arange(len(triangles)), 3)[first[count == 1]]
    start, end = points[border[:, 0]], points[border[:, 1]]
    sense = np.sign(doubled_areas(points, triangles))
    leaving = (end - start)[:, 1] * sense[owner] > 0
    return Sides(
        np.concatenate([inner.start, start[leaving]]),
        np.concatenate([inner.end, end[leaving]]),
        np.concatenate([inner.label, np.full(int(leaving.sum()), NOWHERE)]),
    )


def runs(sides: Sides, top: int, rows: int, width: int) -> Runs:
    """Return the runs of `rows` rows of `width` samples from row `top`, with rows counted from there.

    A sample belongs to the region entered at the last crossing to its left with a side. A side that
    two regions share enters one of them, so every sample of a partition is in exactly one region.

    >>> square = np.array([[[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]]])
    >>> found = runs(ring_sides(np.concatenate([square - (2.0, 0.0), square])), 0, 2, 3)
    >>> found.label[found.length > 0].tolist(), found.length[found.length > 0].tolist()
    ([0, 1, 0, 1], [1, 2, 1, 2])
    """
    low = np.minimum(sides.start[:, 1], sides.end[:, 1])
    high = np.maximum(sides.start[:, 1], sides.end[:, 1])
    middle = 0.5 + NUDGE
    first = np.clip(np.ceil(low - middle).astype(np.int64), top, top + rows)
    last = np.clip(np.ceil(high - middle).astype(np.int64), top, top + rows)
    count = last - first
    side = np.repeat(np.arange(len(count)), count)
    row = np.arange(len(side)) - np.repeat(np.cumsum(count) - count, count) + first[side]
    start, end = sides.start[side], sides.end[side]
    share = (row + middle - start[:, 1]) / (end[:, 1] - start[:, 1])
    x = start[:, 0] + share * (end[:, 0] - start[:, 0])
    row -= top
    # every row begins nowhere
    row = np.concatenate([np.arange(rows), row])
    x = np.concatenate([np.full(rows, -np.inf), x])
    label = np.concatenate([np.full(rows, NOWHERE), sides.label[side]])
    order = np.lexsort((x, row))
    row, x, label = row[order], x[order], label[order]
    begin = np.ceil(np.clip(x, 0, width + 1) - 0.5).clip(0, width).astype(np.int64)
    stop = np.append(begin[1:], width)
    stop[np.append(row[1:] != row[:-1], True)] = width
    return Runs(label, row, begin, stop - begin)


def inside_ring(ring: Array, rows: int, width: int) -> NDArray[np.bool_]:
    """Return which samples (rows, width) lie in a ring (N, 2), in samples."""
    ring_runs = runs(polygon_sides(ring), 0, rows, width)
    return ring_runs.spread(ring_runs.label >= 0).reshape(rows, width)


MARGIN = 3  # width in texels of the margin around what a grid is over
MOST_TEXELS = 12_000_000  # greatest number of texels of a grid
# The neighbours of a texel, those that share a side first, for the first one counts
_AROUND = ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1))


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of texels: texel (i, j) lies at corner + (j + 1/2, i + 1/2) / density."""

    corner: Array  # the corner (2,) in the units of what it is over
    density: float  # texels per unit
    width: int  # with `height`: the size in texels
    height: int

    @classmethod
    def over(cls, points: Array, density: float) -> Grid:
        """Return a grid over points (N, 2), no denser than `MOST_TEXELS` allow."""
        size = np.ptp(points, axis=0).clip(1e-300)
        density = min(density, float(np.sqrt(MOST_TEXELS / size.prod())))
        width, height = np.ceil(size * density).astype(int) + 2 * MARGIN
        return cls(points.min(axis=0) - MARGIN / density, density, int(width), int(height))

    def texels(self, points: Array) -> Array:
        """Return points (..., 2) in texels."""
        return (points - self.corner) * self.density

    def inside(self, ring: Array) -> NDArray[np.bool_]:
        """Return which texels (height, width) have their middle in the ring."""
        return inside_ring(self.texels(ring), self.height, self.width)


def bleed(pixels: Pixels, inside: NDArray[np.bool_], area: NDArray[np.bool_]) -> None:
    """Copy colours from inside to what else of an area has none: its edge, and thinner parts.

    What is outside the area becomes transparent.
    """
    has_colour, left = np.pad(inside & area, 1), np.argwhere(area & ~inside)
    pixels[~(area | inside)] = 0
    while len(left):
        rows, columns = left.T
        filled = np.zeros(len(left), dtype=bool)
        for down, right in _AROUND:
            near = has_colour[rows + 1 + down, columns + 1 + right] & ~filled
            pixels[rows[near], columns[near]] = pixels[rows[near] + down, columns[near] + right]
            filled |= near
        if not filled.any():
            return
        has_colour[rows[filled] + 1, columns[filled] + 1] = True
        left = left[~filled]


def covered(ring: Array, size: tuple[int, int], reach: int) -> NDArray[np.bool_]:
    """Return which pixels of a picture of a size a ring (N, 2) meets, and those so many steps away."""
    mask = Image.new("1", size)
    ImageDraw.Draw(mask).polygon(np.floor(ring).ravel().tolist(), fill=1)
    near = np.array(mask)
    for _ in range(reach):
        for low, high in _NEXT:
            before = near.copy()
            near[high] |= before[low]
            near[low] |= before[high]
    return near


_NEXT = (np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])
"""Rows and columns of samples and those that follow them, along the memory, which is much faster."""


FLATTEST = 1e-3  # twice the area in pixels of triangles that are seen


def carried(
    pixels: Pixels, texels: Array, places: Array, triangles: Integers, size: tuple[int, int]
) -> tuple[Pixels, NDArray[np.bool_]]:
    """Return a picture that is carried to another one, and which pixels (height, width) have some.

    Args:
        pixels: The picture.
        texels: Where points (V, 2) of a mesh lie in it, in its pixels.
        places: Where they lie in the other one (V, 2), in its own.
        triangles: The mesh's triangles (T, 3). Those that are turned over, unlike most, are not seen.
        size: The width and height of the other picture.
    """
    width, height = size
    shown = np.zeros((height, width, 4), dtype=np.uint8)
    areas = doubled_areas(places, triangles)
    triangles = triangles[areas * np.sign(np.median(areas)) > FLATTEST]
    if not len(triangles):
        return shown, np.zeros((height, width), dtype=bool)
    mesh_runs = runs(region_sides(places, triangles), 0, height, width)
    linear = triangle_sides(texels, triangles) @ np.linalg.inv(triangle_sides(places, triangles))
    first = triangles[:, 0]
    offset = texels[first] - np.einsum("tij,tj->ti", linear, places[first])
    held = mesh_runs.label >= 0
    label, row, start = mesh_runs.label[held], mesh_runs.row[held], mesh_runs.start[held]
    length = mesh_runs.length[held]
    # along a run only x changes
    here = offset[label] + linear[label, :, 1] * (row + 0.5)[:, None]
    here += linear[label, :, 0] * (start + 0.5)[:, None]
    step = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
    ahead = np.repeat(linear[label, :, 0], length, axis=0) * step[:, None]
    columns, rows = np.repeat(start, length) + step, np.repeat(row, length)
    shown[rows, columns] = sampled(pixels, np.repeat(here, length, axis=0) + ahead)
    inside = np.zeros((height, width), dtype=bool)
    inside[rows, columns] = True
    return shown, inside
