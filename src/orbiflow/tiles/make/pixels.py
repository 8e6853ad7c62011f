"""Pixels of a page: each sample is looked up in a raster of the tile, which is painted once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.runtime import Cancel
from orbiflow.tiles.motifs import NOWHERE, Grid, Runs, bilinear, rgb_of, ring_sides, runs
from orbiflow.tiles.page import Page

BAND = 2_000_000  # number of samples that are computed at a time


def render_page(
    page: Page,
    pixels: float,
    grid: Grid,
    coloured: Array,
    paper: str,
    *,
    samples: int,
    cancel: Cancel | None = None,
) -> np.ndarray:
    """Return the picture of a page (height, width, 3) in 8 bits, with so many `pixels` in a mm.

    Every sample belongs to exactly one copy of the tile, and has its colour in the raster (colours,
    height, width, 3) that `Paint.coloured` returns; a pixel is the mean of `samples` x `samples`.
    """
    cancel = cancel or Cancel()
    every, shown = _with_hidden(page)
    look = _Lookup(every, pixels * samples, grid, coloured, paper)
    rings = np.array(every.rings()) * (pixels * samples)
    page_width, page_height = (round(side * pixels) for side in page.size)
    low, high = rings[..., 1].min(axis=1), rings[..., 1].max(axis=1)
    result = np.empty((page_height, page_width, 3), dtype=np.uint8)
    step = max(1, BAND // (page_width * samples * samples))
    for top in range(0, page_height, step):
        cancel.check()
        rows = min(step, page_height - top)
        first = top * samples
        near = np.flatnonzero((high > first) & (low < first + rows * samples))
        found = runs(ring_sides(rings[near]), first, rows * samples, page_width * samples)
        unpainted = (found.label < 0) | ~shown[near[found.label]]
        named = found._replace(label=np.where(unpainted, NOWHERE, near[found.label]))
        colours = look(named, first).reshape(rows * samples, page_width * samples, 3)
        mean = _pooled(colours, samples) * 255 + 0.5
        result[top : top + rows] = mean.clip(0, 255).astype(np.uint8)
    return result


def _with_hidden(page: Page) -> tuple[Page, NDArray[np.bool_]]:
    """Return the page with all copies that meet it, which leave no gap, and which of them it shows."""
    every = replace(page, whole=None)
    shown, keys = (
        list(zip(own.aspects.tolist(), *own.cells.T.tolist(), strict=True))
        for own in (page.copies, every.copies)
    )
    known = set(shown)
    return every, np.array([key in known for key in keys])


def _pooled(colours: Array, samples: int) -> Array:
    """Return the mean of `samples` x `samples` colours for each pixel."""
    parts = [colours[i::samples, j::samples] for i in range(samples) for j in range(samples)]
    return sum(parts[1:], parts[0]) / len(parts)


class _Lookup:
    """The colours of samples, each in one copy of the tile, from the tile's raster."""

    def __init__(self, page: Page, samples: float, grid: Grid, coloured: Array, paper: str) -> None:
        copies = page.copies
        count, height, width = coloured.shape[:3]
        # all colours in one tall raster, and a strip of paper under them
        strip = np.broadcast_to(rgb_of(paper).astype(np.float32), (8, width, 3))
        tall = np.concatenate([coloured.reshape(count * height, width, 3), strip])
        self.raster = np.ascontiguousarray(tall, dtype=np.float32)
        # from samples to texels: linear @ sample + offset, one a copy
        to_page = page.stretch @ copies.group.linear_parts[copies.cosets] * samples
        forward = to_page @ page.place.linear
        shift = to_page @ page.place.offset
        shift += samples * copies.translations @ page.stretch.T
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
