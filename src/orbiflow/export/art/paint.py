"""The tile's own raster: what is painted on it, whatever colour it will have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from orbiflow.export.art.runs import polygon_sides, runs
from orbiflow.figures.palette import Palette
from orbiflow.symmetry.isometry import Array

MARGIN = 3
"""Texels around the tile."""

MOST_TEXELS = 20_000_000
"""Of the rasters of all colours together."""


_AROUND = ((-1, -1), (-1, 1), (1, -1), (1, 1), (-1, 0), (1, 0), (0, -1), (0, 1))
"""The neighbours of a texel, those that share a side last: theirs is what counts."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Texels over a tile: texel (i, j) lies at corner + (j + 1/2, i + 1/2) / density.

    - `corner`: (2,) in the tile's units. `density`: texels a unit.
    - `width`, `height`: in texels.
    """

    corner: Array
    density: float
    width: int
    height: int

    @classmethod
    def over(cls, ring: Array, density: float, colours: int) -> Grid:
        """Over a ring (N, 2), at most as dense as `MOST_TEXELS` allow for so many colours."""
        size = np.ptp(ring, axis=0)
        most = float(np.sqrt(MOST_TEXELS / colours / size.prod()))
        density = min(density, most)
        width, height = np.ceil(size * density).astype(int) + 2 * MARGIN
        return cls(ring.min(axis=0) - MARGIN / density, density, int(width), int(height))

    def texels(self, points: Array) -> Array:
        """Where points (..., 2) of the tile's units lie."""
        return (points - self.corner) * self.density

    def inside(self, ring: Array) -> NDArray[np.bool_]:
        """(height, width) which texels have their middle in the ring."""
        found = runs(polygon_sides(self.texels(ring)), 0, self.height, self.width)
        return found.spread(found.label >= 0).reshape(self.height, self.width)


class Paint:
    """Five channels (height, width, 5) of a tile: how each texel's colour is mixed.

    Red, green and blue, 0 to 1, already times their share; then the share of the tile's own colour
    and of its ink: colour = rgb + own * tile + ink * ink's.
    """

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        self.values = np.zeros((grid.height, grid.width, 5), dtype=np.float32)
        self.values[..., 3] = 1.0

    def lay(self, rgb: Array, alpha: Array) -> None:
        """Colours over all: rgb (height, width, 3) times alpha already, alpha (height, width)."""
        self.values *= (1 - alpha)[..., None]
        self.values[..., :3] += rgb

    def ink(self, alpha: Array) -> None:
        """Ink over all, (height, width)."""
        self.values *= (1 - alpha)[..., None]
        self.values[..., 4] += alpha

    def line(self, colour: str, alpha: Array) -> None:
        """One colour over all, (height, width)."""
        self.lay(alpha[..., None] * rgb_of(colour).astype(np.float32), alpha)

    def bleed(self, inside: NDArray[np.bool_]) -> None:
        """The texels around become what lies next to them inside: all that lookups blend in."""
        known = inside.copy()
        for _ in range(MARGIN - 1):
            wider = np.asarray(binary_dilation(known, np.ones((3, 3), dtype=int)), dtype=bool)
            rows, columns = np.nonzero(wider & ~known)
            for down, right in _AROUND:
                there = rows + down, columns + right
                near = known[there]
                own = rows[near], columns[near]
                self.values[own] = self.values[there[0][near], there[1][near]]
            known[rows, columns] = True

    def coloured(self, palette: Palette, colours: int) -> Array:
        """(colours, height, width, 3) the raster in each colour of the palette."""
        rgb, own, ink = self.values[..., :3], self.values[..., 3:4], self.values[..., 4:]
        return np.stack(
            [
                rgb
                + own * rgb_of(palette.fill(k)).astype(np.float32)
                + ink * rgb_of(palette.ink(k)).astype(np.float32)
                for k in range(colours)
            ]
        )


def rgb_of(colour: str) -> Array:
    """(3,) of #rrggbb, 0 to 1."""
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
