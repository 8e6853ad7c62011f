"""Pixels of a page: every sample is looked up in a raster of the tile, which is painted once."""

from __future__ import annotations

import numpy as np

from orbiflow.arrays import Array
from orbiflow.runtime import Cancel
from orbiflow.tiles.art.page import HIDDEN, ArtPage
from orbiflow.tiles.motifs import NOWHERE, Grid, Runs, bilinear, rgb_of, ring_sides, runs

BAND = 2_000_000  # number of samples that are computed at a time


def render_page(
    page: ArtPage,
    grid: Grid,
    coloured: Array,
    paper: str,
    *,
    samples: int,
    cancel: Cancel | None = None,
) -> np.ndarray:
    """Return the picture of a page (height, width, 3) in 8 bits.

    Every sample belongs to exactly one copy of the tile, and has its colour in the raster (colours,
    height, width, 3) that `Paint.coloured` returns; a pixel is the mean of `samples` x `samples`.
    """
    cancel = cancel or Cancel()
    look = _Lookup(page, grid, coloured, paper, samples)
    rings = page.rings() * samples
    low, high = rings[..., 1].min(axis=1), rings[..., 1].max(axis=1)
    result = np.empty((page.height, page.width, 3), dtype=np.uint8)
    step = max(1, BAND // (page.width * samples * samples))
    for top in range(0, page.height, step):
        cancel.check()
        rows = min(step, page.height - top)
        first = top * samples
        near = np.flatnonzero((high > first) & (low < first + rows * samples))
        found = runs(ring_sides(rings[near]), first, rows * samples, page.width * samples)
        unpainted = (found.label < 0) | (page.colours[near[found.label]] == HIDDEN)
        named = found._replace(label=np.where(unpainted, NOWHERE, near[found.label]))
        colours = look(named, first).reshape(rows * samples, page.width * samples, 3)
        mean = _pooled(colours, samples) * 255 + 0.5
        result[top : top + rows] = mean.clip(0, 255).astype(np.uint8)
    return result


def _pooled(colours: Array, samples: int) -> Array:
    """Return the mean of `samples` x `samples` colours for each pixel."""
    parts = [colours[i::samples, j::samples] for i in range(samples) for j in range(samples)]
    return sum(parts[1:], parts[0]) / len(parts)


class _Lookup:
    """The colours of samples, each in one copy of the tile, from the tile's raster."""

    def __init__(
        self, page: ArtPage, grid: Grid, coloured: Array, paper: str, samples: int
    ) -> None:
        copies = page.copies
        count, height, width = coloured.shape[:3]
        # all colours in one tall raster, and a strip of paper under them
        strip = np.broadcast_to(rgb_of(paper).astype(np.float32), (8, width, 3))
        tall = np.concatenate([coloured.reshape(count * height, width, 3), strip])
        self.raster = np.ascontiguousarray(tall, dtype=np.float32)
        # from samples to texels: linear @ sample + offset, one a copy
        to_page = copies.group.linear_parts[copies.cosets]
        forward = page.linear @ to_page * samples
        shift = (copies.translations @ page.linear.T + page.offset) * samples
        inverse = np.linalg.inv(forward)
        self.linear = inverse * grid.density
        start = -np.einsum("mij,mj->mi", inverse, shift) - grid.corner
        self.offset = start * grid.density
        self.offset[:, 1] += page.colours * height
        # nowhere, the last: the middle of the strip
        self.linear = np.concatenate([self.linear, np.zeros((1, 2, 2))])
        self.offset = np.concatenate([self.offset, [[width / 2, count * height + 4.0]]])

    def __call__(self, found: Runs, top: int) -> Array:
        """Return the samples' colours (samples, 3), row by row."""
        kept = found.length > 0
        own = Runs(*(part[kept] for part in found))
        linear, offset = self.linear[own.label], self.offset[own.label]
        y = own.row + top + 0.5
        # texel = start + step * column
        start = offset + linear[:, :, 1] * y[:, None] + linear[:, :, 0] * (own.start + 0.5)[:, None]
        at = np.concatenate([start, linear[:, :, 0]], axis=1).astype(np.float32)
        first = np.cumsum(own.length) - own.length
        along = np.arange(own.length.sum()) - own.spread(first)
        spread = own.spread(at)
        return bilinear(
            self.raster, spread[:, :2] + along[:, None].astype(np.float32) * spread[:, 2:]
        )
