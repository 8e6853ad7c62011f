"""The maps behind one tile, in memory and in `model.safetensors`."""

from __future__ import annotations

import contextlib
from collections.abc import Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import array_bytes, read_arrays
from orbiflow.settings import as_path
from orbiflow.tiles.geometry import orient
from orbiflow.tiles.silhouette import Bending, Frame, triangulate
from orbiflow.tiles.tilings import Tile

FORMAT = "orbiflow-tile/1"
MAX_BYTES = 64 * 2**20
# Arrays of the map from the silhouette, which files may lack.
BENDING = ("bending.rest", "bending.images", "bending.triangles")
# Entry of the settings in a file, which files may lack.
FRAME = "frame"
SAME = 1e-6  # largest distance of the map's outline from the tile's, in square roots of its area


@dataclass(frozen=True, eq=False)
class TileMap:
    """The maps behind one tile, as plain arrays that processes send and files keep.

    - `settings`: The flow's class, max_frequency, segments, smoothness, steps, method and mirrored;
      empty without a flow, as after a search for likeness.
    - `arrays`: The flow's float64 parameters by name, and its start tile if that is not the template.
    - `frame`: Where the silhouette's normal form, in which both maps act, lies in the input.
    - `bending`: The map from the silhouette onto the tile, in normal form.
    """

    settings: dict[str, Any] = field(default_factory=dict[str, Any])
    arrays: dict[str, Array] = field(default_factory=dict[str, Array])
    frame: Frame | None = None
    bending: Bending | None = None

    @classmethod
    def still(cls, polygon: Array, *, y_down: bool) -> TileMap:
        """Return the map of a polygon (N, 2) that is its own silhouette: nothing moves."""
        frame = Frame.upright(y_down=y_down)
        mesh = triangulate(orient(frame.to_normal(polygon), counter_clockwise=True))
        return cls(frame=frame, bending=Bending(mesh.points, mesh.points, mesh.triangles))

    @property
    def has_flow(self) -> bool:
        """Whether a flow made the tile."""
        return bool(self.settings or self.arrays)

    def to_bytes(self) -> bytes:
        """Return the contents of a `model.safetensors` file."""
        frame = {} if self.frame is None else {FRAME: self.frame.as_dict()}
        header = dict(sorted({**self.settings, **frame}.items()))
        bending = self.bending
        parts = () if bending is None else (bending.rest, bending.images, bending.triangles)
        stored = {**self.arrays, **dict(zip(BENDING, parts, strict=False))}
        arrays = {name: np.array(a, order="C") for name, a in stored.items()}  # keeps 0-d
        return array_bytes(header, arrays, "a tile model", key=FORMAT)

    @classmethod
    def read(cls, path: str | Path) -> TileMap:
        """Read a `model.safetensors` that `orbiflow escherize` wrote.

        It may lack the frame and the bending. The flow's parameters are checked when a model is made of
        them, by `load_model`.

        Raises:
            InputFileError: if the file is missing, too large, damaged or of another kind.
        """
        path = as_path(path, "the model's file")
        settings, arrays = read_arrays(path, "a tile model", key=FORMAT, max_bytes=MAX_BYTES)
        with naming_file(path):
            stored = settings.pop(FRAME, None)
            frame = None if stored is None else Frame.from_dict(stored)
            return cls(settings, arrays, frame, _bending_in(arrays))

    def ends_on(self, tile: Tile) -> bool:
        """Whether the bent silhouette is this tile, which lies in the input's coordinates."""
        from scipy.spatial import KDTree

        if self.bending is None or self.frame is None:
            return True  # nothing contradicts it
        far, _ = KDTree(self.frame.to_input(self.bending.images)).query(tile.polygon)
        return bool(np.max(far) <= SAME * np.sqrt(abs(tile.signed_area)))


def _bending_in(arrays: dict[str, Array]) -> Bending | None:
    """Take the map from the silhouette out of a file's arrays."""
    parts = {name: arrays.pop(name) for name in BENDING if name in arrays}
    if not parts:
        return None
    missing = [name for name in BENDING if name not in parts]
    if missing:
        raise OrbiflowError(f"the model's {', '.join(missing)} is missing")
    return Bending(*(parts[name] for name in BENDING))


@contextlib.contextmanager
def naming_file(path: str | Path) -> Generator[None]:
    """Raise what is wrong inside as an `InputFileError` that names the file."""
    try:
        yield
    except (ValueError, KeyError, TypeError) as error:
        raise InputFileError(f"{path}: not an orbiflow tile model: {error}") from error
