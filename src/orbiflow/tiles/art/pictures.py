"""A picture of the silhouette: read within bounds, carried onto the tile's raster."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from scipy.ndimage import distance_transform_edt

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.art.raster import (
    Grid,
    polygon_sides,
    runs,
    triangle_sides,
)
from orbiflow.tiles.art.source import Covered, covered_area, silhouette_outline
from orbiflow.tiles.silhouette import (
    deep_channel,
    open_image,
    upright,
)
from orbiflow.tiles.tile import EscherTile

SAME_ASPECT = 0.01
"""Relative difference up to which two aspect ratios are one."""

FRINGE = 1.5
"""Pixels of the picture along the outline that its background may have mixed with."""

THIN = 4.0
"""Pixels of the silhouette farther than that from what the fringe leaves are kept: thin limbs."""


@dataclass(frozen=True, eq=False)
class Picture:
    """Colours over the silhouette.

    - `image`: RGBA, straight, 8 bits.
    - `covered`: the rectangle in the silhouette's coordinates.
    - `notes`: what was decided for the user.
    """

    image: Image.Image
    covered: Covered
    notes: tuple[str, ...] = ()

    @property
    def pixel(self) -> float:
        """Side of a pixel in the silhouette's units."""
        size = self.covered.high - self.covered.low
        return float(np.sqrt(size.prod() / (self.image.width * self.image.height)))

    def reduced(self, pixel: float) -> Picture:
        """With pixels no smaller than `pixel` in the silhouette's units, averaged."""
        share = self.pixel / pixel
        if share >= 0.9:
            return self
        size = [max(1, round(side * share)) for side in self.image.size]
        # averaged with their opacity: what is transparent has no colour
        premultiplied = self.image.convert("RGBa")
        small = premultiplied.resize((size[0], size[1]), Image.Resampling.BOX, reducing_gap=3.0)
        return Picture(small.convert("RGBA"), self.covered, self.notes)


def read_picture(path: Path, tile: EscherTile) -> Picture:
    """The picture in a file.

    Raises:
        InputFileError: for a file over 64 MB or 40 megapixels, one that is no image or is damaged, and
            a picture of another aspect than the silhouette's.
    """
    image, notes = open_image(path, _decode)
    covered = covered_area(tile)
    wide, high = covered.high - covered.low
    width, height = image.size
    if abs(width * high / (height * wide) - 1) > SAME_ASPECT:
        raise InputFileError(
            f"{path}: the picture is {width} x {height} pixels and {covered.name} is "
            f"{wide:.6g} x {high:.6g}; a picture covers all of that and must have its aspect within "
            "1 %, so paint over a copy of it"
        )
    if (width, height) != (round(wide), round(high)):
        notes = (
            *notes,
            f"laid the picture ({width} x {height} pixels) over {covered.name} "
            f"({wide:.6g} x {high:.6g})",
        )
    return Picture(image, covered, notes)


def _decode(path: Path, image: Image.Image) -> tuple[Image.Image, tuple[str, ...]]:
    turned, notes = upright(image)
    if turned.mode.startswith(("I", "F")):  # more than 8 bits
        levels = np.asarray(deep_channel(path, turned))
        turned = Image.fromarray((levels * 255 + 0.5).astype(np.uint8))
    return turned.convert("RGBA"), tuple(notes)


def carried_picture(picture: Picture, tile: EscherTile, grid: Grid) -> tuple[Array, Array]:
    """The picture on the tile's raster; its colours go on a little beyond the outline.

    Returns:
        Colours (height, width, 3) times their opacity, and the opacity (height, width).
    """
    small = picture.reduced(1 / grid.density)
    places = _places(tile, grid)
    at = torch.from_numpy((small.covered.shares(places) * 2 - 1).astype(np.float32))
    straight = np.asarray(small.image, dtype=np.float32) / 255
    straight[..., :3] *= straight[..., 3:]
    straight = _spread(straight, small.covered.shares(silhouette_outline(tile)) * small.image.size)
    values = torch.from_numpy(np.ascontiguousarray(straight.transpose(2, 0, 1)))[None]
    found = torch.nn.functional.grid_sample(
        values, at[None], mode="bilinear", padding_mode="border", align_corners=False
    )[0]
    result = found.permute(1, 2, 0).numpy()
    return result[..., :3], result[..., 3]


def _spread(colours: Array, outline: Array) -> Array:
    """Colours (height, width, 4) that from just inside an outline in pixels go on outside it.

    So neither the background of a cut-out nor what it mixed with along the outline shows.
    """
    height, width = colours.shape[:2]
    found = runs(polygon_sides(outline), 0, height, width)
    inside = found.spread(found.label >= 0).reshape(height, width)
    # beyond the picture is outside, too
    depth = np.asarray(distance_transform_edt(np.pad(inside, 1)))[1:-1, 1:-1]
    kept = depth > FRINGE
    if kept.any():
        kept |= (depth > 1) & (np.asarray(distance_transform_edt(~kept)) > THIN)
    else:
        kept = inside
    if not kept.any():
        return colours
    rows, columns = np.asarray(
        distance_transform_edt(~kept, return_distances=False, return_indices=True)
    )
    return colours[rows, columns]


def _places(tile: EscherTile, grid: Grid) -> Array:
    """(height, width, 2) where in the silhouette's coordinates each texel comes from.

    Texels outside the tile come from anywhere: they are painted from inside.
    """
    bending, frame = tile.require_map()
    images = grid.texels(frame.to_input(bending.images))
    rest = frame.to_input(bending.rest)
    triangles = bending.triangles
    found = runs(triangle_sides(images, triangles), 0, grid.height, grid.width)
    before, after = images[triangles], rest[triangles]
    sides = np.stack([before[:, 1] - before[:, 0], before[:, 2] - before[:, 0]], axis=2)
    goals = np.stack([after[:, 1] - after[:, 0], after[:, 2] - after[:, 0]], axis=2)
    linear = goals @ np.linalg.inv(sides)
    offset = after[:, 0] - np.einsum("tij,tj->ti", linear, before[:, 0])
    own = np.maximum(found.label, 0)
    columns = np.tile(np.arange(grid.width) + 0.5, grid.height)
    # along a run only x changes
    start = offset[own] + linear[own, :, 1] * (found.row + 0.5)[:, None]
    places = np.stack(
        [found.spread(start[:, k]) + found.spread(linear[own, k, 0]) * columns for k in (0, 1)],
        axis=-1,
    )
    return places.reshape(grid.height, grid.width, 2)
