"""A tile to draw on, with the map that carries pictures of its silhouette onto it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles.exporting import (
    ExportTile,
    TileSource,
    folder_names,
    read_document,
    read_result,
)
from orbiflow.tiles.search import (
    CarriedTile,
    SavedModel,
    TileResult,
    load_saved,
    matched,
)
from orbiflow.tiles.silhouette import Frame, Target

MODEL = "model.safetensors"
SAME = 1e-6
"""How far the map's outline may be from the tile's, in square roots of its area."""


class Covered(NamedTuple):
    """The rectangle in the silhouette's coordinates that a picture of it covers, and its name."""

    low: Array
    high: Array
    name: str
    y_down: bool = True

    def shares(self, points: Array) -> Array:
        """Points (..., 2) as shares of the picture's width and height, from its upper left corner."""
        found = (points - self.low) / (self.high - self.low)
        if not self.y_down:
            found[..., 1] = 1 - found[..., 1]
        return found


@dataclass(frozen=True, eq=False)
class ArtTile:
    """What artwork starts from.

    - `given`: the tile and its name.
    - `carried`: the same tile with its map; without one where none could be made.
    - `notes`: what the user should know.
    """

    given: ExportTile
    carried: CarriedTile
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, tile: ArtTile | TileSource, target: Target | None = None) -> ArtTile:
        """From whatever has a tile, with its map if there is one; of a run's folder, the best tile.

        Args:
            tile: in memory, or a run's folder, or its result.json.
            target: of the search, from whose outline the map is made where the search left none, as
                one for overlap does.

        Raises:
            OrbiflowError: for what holds no tile.
            InputFileError: as `read_art_tile`.
        """
        if isinstance(tile, ArtTile):
            return tile
        if isinstance(tile, str | Path):
            return read_art_tile(tile)
        if isinstance(tile, ExportTile) and tile.model is not None and tile.rank is not None:
            return read_art_tile(tile.model.parent.parent, tile.rank)
        given = ExportTile.of(tile)
        saved = tile.model if isinstance(tile, TileResult) else None
        if saved is not None and saved.frame is not None and saved.bending is not None:
            return cls(given, CarriedTile(given.tile, saved.frame, saved.bending))
        if target is not None:
            return _with_outlines(given, target)
        frame = (saved.frame if saved else None) or Frame(_unit(given), np.zeros(2))
        reason = "there is no map of the silhouette; give the search's target as well"
        return cls(given, CarriedTile(given.tile, frame, None, (reason,)))

    def require_map(self) -> None:
        """Nothing, if there is a map from the silhouette.

        Raises:
            OrbiflowError: if there is none, with the reason.
        """
        if self.carried.bending is None:
            reason = "; ".join(self.carried.notes) or "its run left no map"
            raise OrbiflowError(
                f"{self.given.name}: no picture of the silhouette can be carried onto this tile: "
                f"{reason}"
            )

    @property
    def outline(self) -> Array:
        """(N, 2) of the silhouette in its own coordinates; the tile's own where there is no map."""
        bending = self.carried.bending
        if bending is None:
            return self.carried.tile.polygon
        return self.carried.frame.to_input(_border(bending.rest, bending.triangles))

    @property
    def covered(self) -> Covered:
        """What a picture covers: the input picture, the drawing's page, or the outline's box."""
        frame = self.carried.frame
        if frame.size is None:
            ring = self.outline
            name = "the silhouette's bounding box"
            return Covered(ring.min(axis=0), ring.max(axis=0), name, frame.y_down)
        low = np.array(frame.corner)
        name = "the drawing's page" if frame.kind == "svg" else "the silhouette's picture"
        return Covered(low, low + frame.size, name, frame.y_down)


def read_art_tile(path: str | Path, which: str | int = 1) -> ArtTile:
    """A tile of a run, with its map.

    The map is the one that the search saved. Where there is none, as after a search for overlap, the
    outlines of the silhouette and of the tile over it are matched.

    Args:
        path, which: as for `read_result`.

    Raises:
        InputFileError: as `read_result`, and for a model that is another tile's.
    """
    file, document = read_document(path)
    given = read_result(path, which)
    names = folder_names(str(entry["class"]) for entry in document["tiles"])
    model = file.parent / names[(given.rank or 1) - 1] / MODEL
    # the folder is named after the class: a name that is none leads nowhere
    known = given.tile.isohedral_class != "" and model.is_file()
    saved = load_saved(model) if known else None
    if saved is not None and saved.frame is not None and saved.bending is not None:
        carried = CarriedTile(given.tile, saved.frame, saved.bending)
        _check_same(carried, model)
        return ArtTile(given, carried)
    return _matched(given, document, saved)


def _matched(given: ExportTile, document: dict[str, Any], saved: SavedModel | None) -> ArtTile:
    """With a map made from the outlines, if the silhouette is still there."""
    try:
        target = _silhouette(document)
    except OrbiflowError as error:
        frame = (saved.frame if saved else None) or Frame(_unit(given), np.zeros(2))
        return ArtTile(given, CarriedTile(given.tile, frame, None, (str(error),)))
    return _with_outlines(given, target)


def _with_outlines(given: ExportTile, target: Target) -> ArtTile:
    """With a map between the outlines of silhouette and tile."""
    frame = target.frame
    try:
        bending = matched(target.normal, frame.to_normal(given.tile.polygon))
    except OrbiflowError as error:
        return ArtTile(given, CarriedTile(given.tile, frame, None, (str(error),)))
    note = "the search left no map of the silhouette; its outline was matched with the tile's"
    return ArtTile(given, CarriedTile(given.tile, frame, bending), (note,))


def _silhouette(document: dict[str, Any]) -> Target:
    """The silhouette of a run, read again.

    Raises:
        OrbiflowError: if it is not there, or another one.
    """
    own = document["input"]
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


def _unit(given: ExportTile) -> Array:
    return np.sqrt(abs(given.tile.signed_area)) * np.diag([1.0, -1.0 if given.y_down else 1.0])


def _check_same(carried: CarriedTile, model: Path) -> None:
    assert carried.bending is not None
    images = carried.frame.to_input(carried.bending.images)
    polygon = carried.tile.polygon
    far, _ = KDTree(images).query(polygon)
    if np.max(far) > SAME * np.sqrt(abs(carried.tile.signed_area)):
        raise InputFileError(
            f"{model}: belongs to another tile than the one in result.json; search again"
        )


def _border(points: Array, triangles: np.ndarray) -> Array:
    """(N, 2) the border of triangles without holes, in order."""
    sides = {(int(t[k - 1]), int(t[k])) for t in triangles for k in range(3)}
    after = {a: b for a, b in sides if (b, a) not in sides}
    first = next(iter(after))
    ring = [first]
    while (following := after[ring[-1]]) != first:
        ring.append(following)
    return points[ring]
