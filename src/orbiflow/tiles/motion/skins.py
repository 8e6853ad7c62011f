"""What lies on the tiles of an animation: painted once, and bent with the body of each frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy
from PIL import Image

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import Palette
from orbiflow.tiles.geometry import Place
from orbiflow.tiles.motifs import (
    MARGIN,
    TEXELS_PER_PIXEL,
    Grid,
    Over,
    bilinear,
    carried_places,
    figure_paint,
    read_overs,
    require_figures,
    with_map,
    worn,
)
from orbiflow.tiles.motion.settings import AnimationSettings
from orbiflow.tiles.silhouette import triangulate
from orbiflow.tiles.tile import EscherTile

STILL = 1e-9  # pixels by which a body moves that has not moved


class BendingFigure(NamedTuple):
    """What of a figure bends: points (V, 2) of the tile, in its figure's units, and triangles."""

    points: Array
    triangles: Integers

    @classmethod
    def of(cls, figure: EscherTile) -> BendingFigure:
        """Return the body of a silhouette that bends, or else of the tile as it is."""
        if figure.bending is not None and figure.frame is not None:
            return cls(figure.frame.to_input(figure.bending.images), figure.bending.triangles)
        mesh = triangulate(figure.tile.polygon)
        return cls(mesh.points, mesh.triangles)


class Skin:
    """What lies on a figure, in each colour that its copies have."""

    def __init__(self, body: BendingFigure, grid: Grid, colours: Array) -> None:
        self._triangles, self._colours = body.triangles, colours
        self._places = grid.texels(body.points)
        self._at, self._bent = np.zeros((0, 2)), list[Image.Image]()
        self._grid = grid

    def bent(self, body: Array) -> tuple[list[Image.Image], Grid]:
        """Return the skin where its body's points are (V, 2), in pixels: a picture of each colour."""
        if self._at.shape != body.shape or abs(self._at - body).max() > STILL:
            self._at, self._grid = body, Grid.over(body, TEXELS_PER_PIXEL, len(self._colours))
            self._bent = self._drawn(body)
        return self._bent, self._grid

    def _drawn(self, body: Array) -> list[Image.Image]:
        grid = self._grid
        places, inside = carried_places(grid, body, self._places, self._triangles)
        if not inside.any():
            return [Image.new("RGBA", (grid.width, grid.height))] * len(self._colours)
        # colours go on a little beyond the outline, so that none is mixed with nothing there
        near = np.asarray(
            scipy.ndimage.binary_dilation(inside, np.ones((3, 3), dtype=int), MARGIN - 1)
        )
        rows, columns = np.asarray(
            scipy.ndimage.distance_transform_edt(
                ~inside, return_distances=False, return_indices=True
            )
        )[:, near]
        at = places[rows, columns].astype(np.float32)
        drawn = list[Image.Image]()
        for own in self._colours:
            pixels = np.zeros((grid.height, grid.width, 4), dtype=np.uint8)
            pixels[near, :3] = (bilinear(own, at) * 255 + 0.5).clip(0, 255)
            pixels[..., 3] = 255 * inside
            drawn.append(Image.fromarray(pixels, "RGBA"))
        return drawn


@dataclass(frozen=True, eq=False)
class Dress:
    """Skins of a tile's figures; `bodies` are in their units."""

    bodies: tuple[BendingFigure, ...]
    skins: tuple[Skin, ...]

    @classmethod
    def of(
        cls,
        tile: EscherTile,
        settings: AnimationSettings,
        overs: Sequence[Over],
        places: Sequence[Place],
        shaded: Palette,
        count: int,
    ) -> Dress:
        """Paint all that lies on a tile's figures, whose units lie at `places`, in so many colours."""
        on = worn(tile, settings, shaded, overs, settings.tint)
        bodies, skins = list[BendingFigure](), list[Skin]()
        own = zip(on.pictures, on.motifs, tile.figures, places, strict=True)
        for picture, motif, part, place in own:
            density, body = TEXELS_PER_PIXEL * place.scale, BendingFigure.of(part.figure)
            paint = figure_paint(picture, motif, part.figure, density, count)
            bodies.append(body)
            skins.append(Skin(body, paint.grid, paint.coloured(shaded, count, on.tint)))
        return cls(tuple(bodies), tuple(skins))


def dressed(
    tile: EscherTile, settings: AnimationSettings, pictures: Sequence[Path | None]
) -> tuple[EscherTile, list[Over]]:
    """Return a tile with the map that carries what lies on it, and what lies on each of its figures.

    Raises:
        OrbiflowError: If a picture cannot be read or carried, or is for a figure that is not there.
    """
    if not (settings.draws or any(pictures)):
        return tile, []
    tile = with_map(tile)
    require_figures(tile, settings, 1 + any(pictures[1:]))
    return tile, read_overs(pictures, tile)


def lay_skin(
    frame: Image.Image, picture: Image.Image, grid: Grid, linear: Array, offset: Array
) -> None:
    """Lay a skin on a frame, its points p at `linear` p + `offset` in pixels."""
    width, height = grid.width / grid.density, grid.height / grid.density
    corners = grid.corner + np.array([[0, 0], [width, 0], [width, height], [0, height]])
    box = corners @ linear.T + offset
    low = np.floor(box.min(axis=0)).astype(int).clip(0, frame.size)
    high = np.ceil(box.max(axis=0)).astype(int).clip(0, frame.size)
    if (high <= low).any():
        return
    inverse = grid.density * np.linalg.inv(linear)
    start = inverse @ (low - offset) - grid.density * grid.corner
    (a, b), (c, d) = inverse.tolist()
    own = picture.transform(
        (int(high[0] - low[0]), int(high[1] - low[1])),
        Image.Transform.AFFINE,
        (a, b, float(start[0]), c, d, float(start[1])),
        resample=Image.Resampling.BILINEAR,
    )
    frame.paste(own, (int(low[0]), int(low[1])), own)
