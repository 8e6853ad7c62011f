"""What artwork starts from: a tile with the map that carries pictures of its silhouette onto it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles.search import matched
from orbiflow.tiles.silhouette import Bending, Frame, Target
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tile_map import TileMap


def with_map(source: TileSource, target: Target | None = None) -> EscherTile:
    """Return a tile with a map from its silhouette, or with the reason why there is none.

    The map is the one that the search saved. Where there is none, as after a search for overlap, the
    outlines of the silhouette and of the tile over it are matched.

    Args:
        source: A tile in memory, or a run's folder, or its result.json, whose best tile is meant.
        target: The search's target, for a tile in memory without a map. The silhouette of a tile out
            of a file is read again.

    Raises:
        OrbiflowError: for what holds no tile.
        InputFileError: as `EscherTile.load`, and for a model that is another tile's.
    """
    tile = EscherTile.of(source)
    if tile.no_map or (tile.bending is not None and tile.frame is not None):
        return tile
    if tile.rank is not None and tile.silhouette is not None:  # out of a file
        try:
            target = _silhouette(tile.silhouette)
        except OrbiflowError as error:
            return _without_map(tile, tile.frame, str(error))
    if target is None:
        reason = "there is no map of the silhouette; give the search's target as well"
        return _without_map(tile, tile.frame, reason)
    frame = target.frame
    try:
        bending = matched(target.normal, frame.to_normal(tile.tile.polygon))
    except OrbiflowError as error:
        return _without_map(tile, frame, str(error))
    note = "the search left no map of the silhouette; its outline was matched with the tile's"
    return _mapped(tile, frame, bending).changed(notes=(*tile.notes, note))


def _without_map(tile: EscherTile, frame: Frame | None, reason: str) -> EscherTile:
    size = np.sqrt(abs(tile.tile.signed_area))
    frame = frame or Frame(size * np.diag([1.0, -1.0 if tile.y_down else 1.0]), np.zeros(2))
    return _mapped(tile, frame, None).changed(no_map=reason)


def _mapped(tile: EscherTile, frame: Frame, bending: Bending | None) -> EscherTile:
    known = tile.map or TileMap()
    return tile.changed(map_source=TileMap(known.settings, known.arrays, frame, bending))


def silhouette_outline(tile: EscherTile) -> Array:
    """Return the outline (N, 2) of the silhouette; the tile's own where there is no map."""
    bending, frame = tile.bending, tile.frame
    if bending is None or frame is None:
        return tile.tile.polygon
    return frame.to_input(_border(bending.rest, bending.triangles))


class Covered(NamedTuple):
    """The rectangle in the silhouette's coordinates that a picture of it covers, and its name."""

    low: Array
    high: Array
    name: str
    y_down: bool = True

    def shares(self, points: Array) -> Array:
        """Return points (..., 2) in widths and heights of the picture, from its upper left corner."""
        found = (points - self.low) / (self.high - self.low)
        if not self.y_down:
            found[..., 1] = 1 - found[..., 1]
        return found


def covered_area(tile: EscherTile) -> Covered:
    """Return what a picture covers: the input picture, the drawing's page, or the outline's box."""
    frame = tile.frame
    if frame is None or frame.size is None:
        ring = silhouette_outline(tile)
        y_down = tile.y_down if frame is None else frame.y_down
        return Covered(ring.min(axis=0), ring.max(axis=0), "the silhouette's bounding box", y_down)
    low = np.array(frame.corner)
    name = "the drawing's page" if frame.kind == "svg" else "the silhouette's picture"
    return Covered(low, low + frame.size, name, frame.y_down)


def _silhouette(own: dict[str, Any]) -> Target:
    """Return the silhouette of a run, read again.

    Raises:
        OrbiflowError: if it is not there, or another one.
    """
    source = Path(str(own["source"]))
    if not source.is_file():
        raise InputFileError(
            f"the run saved no map, and its silhouette {source} is not there; run from the folder "
            "that the search ran in, or search again"
        )
    target = Target.read(source)
    # one that was read with a threshold of its own, or painted over since
    area = own.get("area")
    same = isinstance(area, int | float) and np.isclose(target.area, area)
    if not same or len(target.outline) != own.get("vertices"):
        raise InputFileError(
            f"the run saved no map, and {source} is not the silhouette that it was; search again"
        )
    return target


def _border(points: Array, triangles: np.ndarray) -> Array:
    """Return the border (N, 2) of triangles without holes, in order."""
    sides = {(int(t[k - 1]), int(t[k])) for t in triangles for k in range(3)}
    after = {a: b for a, b in sides if (b, a) not in sides}
    first = next(iter(after))
    ring = [first]
    while (following := after[ring[-1]]) != first:
        ring.append(following)
    return points[ring]
