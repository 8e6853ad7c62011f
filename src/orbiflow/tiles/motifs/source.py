"""The sources of artwork: a tile with the map of its silhouette, and a picture that is carried."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles.geometry import triangle_sides
from orbiflow.tiles.motifs.raster import Grid, bilinear, polygon_sides, region_sides, runs
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.search import matched
from orbiflow.tiles.silhouette import Covered, Frame, Target, open_image
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tile_map import TileMap


def with_map(source: TileSource, target: Target | None = None) -> EscherTile:
    """Return a tile with a map from its silhouette, or with the reason why there is none.

    The map is the one that the search saved. Where there is none, as after a search for overlap,
    the outlines of the silhouette and of the tile over it are matched: that of the search's
    `target`, for a tile in memory, or the silhouette that a tile out of a file names, read again.

    Raises:
        OrbiflowError: If `source` holds no tile.
        InputFileError: As `read_result`, and if a model belongs to another tile.
    """
    tile = as_tile(source)
    if tile.no_map or (tile.bending is not None and tile.frame is not None):
        return tile
    frame, bending, known = tile.frame, None, tile.map or TileMap()
    said: dict[str, Any] = {}
    try:
        if tile.rank is not None and tile.silhouette is not None:  # out of a file
            target = _silhouette(tile.silhouette)
        if target is None:
            raise OrbiflowError(
                "there is no map of the silhouette; give the search's target as well"
            )
        frame = target.frame
        bending = matched(target.normal, frame.to_normal(tile.tile.polygon))
        note = "the search left no map of the silhouette; its outline was matched with the tile's"
        said["notes"] = (*tile.notes, note)
    except OrbiflowError as error:
        said["no_map"] = str(error)
    if frame is None:
        size = np.sqrt(abs(tile.tile.signed_area))
        frame = Frame(size * np.diag([1.0, -1.0 if tile.y_down else 1.0]), np.zeros(2))
    return tile.changed(map_source=TileMap(known.settings, known.arrays, frame, bending), **said)


def _silhouette(own: dict[str, Any]) -> Target:
    """Return the silhouette of a run, read again, unless it is missing or has changed."""
    source = Path(str(own["source"]))
    if not source.is_file():
        raise InputFileError(
            f"the run saved no map, and its silhouette {source} is not there; run from the folder "
            "that the search ran in, or search again"
        )
    target = Target.read(source)
    # it may have been read with another threshold, or edited since
    area = own.get("area")
    same = isinstance(area, int | float) and np.isclose(target.area, area)
    if not same or len(target.outline) != own.get("vertices"):
        raise InputFileError(
            f"the run saved no map, and {source} is not the silhouette that it was; search again"
        )
    return target


# Width in pixels of the strip inside the outline that its background may have mixed with
FRINGE = 1.5
# Distance in pixels from what the fringe leaves beyond which pixels are kept: thin limbs
THIN = 4.0


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of the silhouette."""

    image: Image.Image  # the image: RGBA, straight, 8 bits
    covered: Covered  # the rectangle that it covers in the silhouette's coordinates
    notes: tuple[str, ...] = ()  # what was decided for the user

    def reduced(self, pixel: float) -> Picture:
        """Return the picture averaged to pixels no smaller than `pixel` in the silhouette's units."""
        area = (self.covered.high - self.covered.low).prod()
        share = float(np.sqrt(area / (self.image.width * self.image.height))) / pixel
        if share >= 0.9:
            return self
        size = [max(1, round(side * share)) for side in self.image.size]
        # averaged with their opacity, for transparent pixels have no colour
        premultiplied = self.image.convert("RGBa")
        small = premultiplied.resize((size[0], size[1]), Image.Resampling.BOX, reducing_gap=3.0)
        return Picture(small.convert("RGBA"), self.covered, self.notes)


def read_picture(path: Path, tile: EscherTile) -> Picture:
    """Read a picture of a tile's silhouette from a file; it must have the silhouette's aspect."""
    image, notes = open_image(path)
    image, covered = image.convert("RGBA"), tile.covered
    covered.require_aspect(path, "picture", image.size)
    wide, high = covered.high - covered.low
    width, height = image.size
    if (width, height) != (round(wide), round(high)):
        notes.append(
            f"laid the picture ({width} x {height} pixels) over {covered.name} "
            f"({wide:.6g} x {high:.6g})"
        )
    return Picture(image, covered, tuple(notes))


def carried_picture(picture: Picture, tile: EscherTile, grid: Grid) -> tuple[Array, Array]:
    """Carry a picture onto a tile's raster; its colours extend a little beyond the outline.

    Returns colours (height, width, 3) times their opacity, and the opacity (height, width).
    """
    small = picture.reduced(1 / grid.density)
    places = _places(tile, grid)
    straight = np.asarray(small.image, dtype=np.float32) / 255
    straight[..., :3] *= straight[..., 3:]
    straight = _spread(straight, small.covered.shares(tile.silhouette_outline) * small.image.size)
    at = (small.covered.shares(places) * small.image.size).astype(np.float32)
    result = bilinear(straight, at.reshape(-1, 2)).reshape(*places.shape[:2], 4)
    return result[..., :3], result[..., 3]


def _spread(colours: Array, outline: Array) -> Array:
    """Extend the colours (height, width, 4) just inside an outline, in pixels, to all outside it.

    So neither the background of a cut-out shows nor the outline's pixels that it mixed with.
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
    """Return the point (height, width, 2) that is carried to each texel; any, outside the tile."""
    bending, frame = tile.require_map()
    images = grid.texels(frame.to_input(bending.images))
    rest = frame.to_input(bending.rest)
    triangles = bending.triangles
    found = runs(region_sides(images, triangles), 0, grid.height, grid.width)
    linear = triangle_sides(rest, triangles) @ np.linalg.inv(triangle_sides(images, triangles))
    first = triangles[:, 0]
    offset = rest[first] - np.einsum("tij,tj->ti", linear, images[first])
    own = np.maximum(found.label, 0)
    columns = np.tile(np.arange(grid.width) + 0.5, grid.height)
    # along a run only x changes
    start = offset[own] + linear[own, :, 1] * (found.row + 0.5)[:, None]
    places = np.stack(
        [found.spread(start[:, k]) + found.spread(linear[own, k, 0]) * columns for k in (0, 1)],
        axis=-1,
    )
    return places.reshape(grid.height, grid.width, 2)
