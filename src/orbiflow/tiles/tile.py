"""A finished tile: all that is known of it, what can be done with it, and the maps that made it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Generator
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from orbiflow.arguments import as_path
from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, InputFileError, OrbiflowError, literal
from orbiflow.runtime import array_bytes, read_arrays
from orbiflow.tiles.geometry import border
from orbiflow.tiles.likeness import (
    Fidelity,
    Rating,
    Recognisability,
    ShapeMetrics,
    Thinnest,
    neck_factor,
    rank_score,
)
from orbiflow.tiles.silhouette import Bending, Covered, Frame
from orbiflow.tiles.tilings import Certificate, Tile, arrangement, certify

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

    @property
    def has_flow(self) -> bool:
        """Whether a flow made the tile."""
        return bool(self.settings or self.arrays)

    def to_bytes(self) -> bytes:
        """Return the contents of a `model.safetensors` file."""
        frame = {} if self.frame is None else {FRAME: self.frame.as_dict()}
        header = dict(sorted({**self.settings, **frame}.items()))
        own = self.bending
        parts = () if own is None else (own.rest, own.images, own.triangles)
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
    found = {name: arrays.pop(name) for name in BENDING if name in arrays}
    if not found:
        return None
    missing = [name for name in BENDING if name not in found]
    if missing:
        raise OrbiflowError(f"the model's {', '.join(missing)} is missing")
    return Bending(*(found[name] for name in BENDING))


@contextlib.contextmanager
def naming_file(path: str | Path) -> Generator[None]:
    """Raise what is wrong inside as an `InputFileError` that names the file."""
    try:
        yield
    except (ValueError, KeyError, TypeError) as error:
        raise InputFileError(f"{path}: not an orbiflow tile model: {error}") from error


NAN = float("nan")
NOT_COMPARED = ShapeMetrics(NAN, NAN, NAN, (NAN, NAN, NAN, NAN), NAN)
NOT_RECOGNISED = Recognisability(NAN, NAN, NAN, NAN)


@dataclass(frozen=True, eq=False)
class EscherTile:
    """A finished tile, from a search, a file or a polygon of one's own.

    The tile itself:

    - `tile`: The polygon with its group, in the input's coordinates.
    - `name`: What files and titles call it, such as "IH4" or "turtle-IH4". Default: its class.
    - `y_down`: Whether y points down in its coordinates, as in images.
    - `rank`: Its place in the list of its run, from 1; None outside a saved run.
    - `silhouette`: What was read as the silhouette, as result.json has it.
    - `map_source`: The maps behind it, or the file that holds them, which may be missing.
    - `no_map`: Why there is no map from the silhouette, if that is known.
    - `normal`: The tile in the normal form of the silhouette, as the search left it.
    - `notes`: What the user should know of it.

    How it compares with the silhouette; NaN or None where that was not measured:

    - `metrics`, `recognisability`: Measures of the certified polygon against the silhouette.
    - `thinnest`: The narrowest neck of the polygon.
    - `min_neck`: Width in square roots of the area below which necks lower the score.
    - `deformation`, `fidelity`: What bending the silhouette costs, and what is left of its outline
      (docs/likeness.md).
    - `bent`, `rest`: The bent silhouette near which the tile was found, and the silhouette as it is:
      outlines (n, 2) in the input's coordinates, point by point.
    - `bent_iou`: The IoU of the tile with the bent silhouette.
    - `pinned`: How far the worst pinned part is from similar to what it was; None without pins.
    - `smoothed`: The share of the silhouette's length below which parts were rounded off, because its
      class has no tile of the silhouette as it is; 0 otherwise. The measures of likeness, `rest` and
      `bent` are of the silhouette without these parts.
    - `known_score`: The score that a file states.
    - `rating`: Its stars among the tiles of its run.

    How it was found:

    - `objective`: What the search was after, "likeness" or "overlap".
    - `starts`, `dropped`: The number of starts, and of those that gave no certified tile.
    - `seconds`: Computing time on one core.
    - `others`: More tiles of the class, if they were asked for.
    """

    tile: Tile
    _: KW_ONLY
    name: str = ""
    y_down: bool = False
    rank: int | None = None
    silhouette: dict[str, Any] | None = None
    map_source: TileMap | Path | None = None
    no_map: str = ""
    normal: Tile | None = None
    notes: tuple[str, ...] = ()
    metrics: ShapeMetrics = NOT_COMPARED
    recognisability: Recognisability = NOT_RECOGNISED
    thinnest: Thinnest | None = None
    min_neck: float = 0.0
    deformation: float | None = None
    fidelity: Fidelity | None = None
    bent: Array | None = None
    rest: Array | None = None
    bent_iou: float | None = None
    pinned: float | None = None
    smoothed: float = 0.0
    known_score: float | None = None
    rating: Rating | None = None
    objective: str = "overlap"
    starts: int = 0
    dropped: int = 0
    seconds: float = 0.0
    others: tuple[EscherTile, ...] = ()

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.tile.isohedral_class or "tile")

    @property
    def isohedral_class(self) -> str:
        """The class, such as "IH4"; "" if it is not known."""
        return self.tile.isohedral_class

    @property
    def group_name(self) -> str:
        """The name of the wallpaper group, such as "p2"."""
        return self.tile.group.name

    @cached_property
    def arrangement(self) -> str:
        """How its copies lie, in plain words; "" if it does not tile."""
        return arrangement(self.tile) if self.certificate.valid else ""

    @cached_property
    def certificate(self) -> Certificate:
        """The proof that it tiles, or what is wrong: from the polygon and the group alone."""
        return certify(self.tile)

    @cached_property
    def normal_tile(self) -> Tile:
        """The tile in the normal form of the silhouette: y up, the silhouette's area 1."""
        if self.normal is not None:
            return self.normal
        if self.frame is None:
            raise OrbiflowError(f"{self.name}: where its silhouette lies is not known")
        inverse = self.frame.inverse
        return self.tile.transformed(inverse, -inverse @ self.frame.offset)

    @cached_property
    def map(self) -> TileMap | None:
        """The maps behind the tile, read from their file when first asked for; None if it is gone.

        Raises:
            InputFileError: for a file that is damaged or belongs to another tile.
        """
        source = self.map_source
        if not isinstance(source, Path):
            return source
        if not source.is_file():
            return None
        found = TileMap.read(source)
        if not found.ends_on(self.tile):
            raise InputFileError(
                f"{source}: belongs to another tile than the one in result.json; search again"
            )
        return found

    @property
    def bending(self) -> Bending | None:
        """The map from the silhouette, in normal form; None for a tile that no silhouette bent to."""
        return None if self.map is None else self.map.bending

    @property
    def frame(self) -> Frame | None:
        """Where the silhouette's normal form lies in the input."""
        return None if self.map is None else self.map.frame

    @property
    def silhouette_outline(self) -> Array:
        """The outline (N, 2) of the silhouette; the tile's own where there is no map."""
        if self.bending is None or self.frame is None:
            return self.tile.polygon
        return self.frame.to_input(self.bending.rest[border(self.bending.triangles)])

    @property
    def covered(self) -> Covered:
        """What a picture of the silhouette covers."""
        frame = self.frame or Frame(np.diag([1.0, -1.0 if self.y_down else 1.0]), np.zeros(2))
        return frame.covered(self.silhouette_outline)

    @property
    def score(self) -> float:
        """What tiles are ranked by, from 0 to 1.

        After a search for likeness the score of its `fidelity`, otherwise `rank_score` of IoU and
        recognisability; less in proportion where a neck is too thin.
        """
        if self.known_score is not None:
            return self.known_score
        if self.fidelity is not None:
            score = self.fidelity.score
        elif math.isnan(self.metrics.iou):
            return NAN
        else:
            score = rank_score(self.metrics.iou, self.recognisability.score)
        if self.thinnest is None:
            return score
        return score * neck_factor(self.thinnest.share, self.min_neck)

    def changed(self, **changes: Any) -> EscherTile:
        """Return the tile with other values of some fields, and a certificate that is known kept."""
        other = replace(self, **changes)
        if "certificate" in self.__dict__ and other.tile is self.tile:
            other.__dict__["certificate"] = self.certificate
        return other

    def family(self) -> tuple[EscherTile, ...]:
        """Return this tile and the others of its class."""
        return (self, *self.others)

    def forward(self, points: Any) -> Any:
        """Return where points (..., 2) of the silhouette go, in the input's coordinates.

        Arrays and lists give an array, tensors a tensor.

        Raises:
            OrbiflowError: if there is no map.
        """
        bending, frame = self.require_map()
        return frame.to_input(bending.forward(frame.to_normal(points)))

    def inverse(self, points: Any) -> Any:
        """Return where points (..., 2) of the tile come from; as `forward`."""
        bending, frame = self.require_map()
        return frame.to_input(bending.inverse(frame.to_normal(points)))

    def require_map(self) -> tuple[Bending, Frame]:
        """Return the map from the silhouette, and where its coordinates lie in the input.

        Raises:
            OrbiflowError: if there is none, with the reason.
        """
        if self.bending is None or self.frame is None:
            raise OrbiflowError(
                f"{self.name}: no picture of the silhouette can be carried onto this tile: "
                f"{self.no_map or 'its run left no map'}"
            )
        return self.bending, self.frame

    def require_certified(self, *, force: bool = False, otherwise: str) -> Certificate:
        """Return the certificate; raise `CertificationError` if it is not valid and `force` is not set.

        `otherwise` says what does not happen to such a tile, and what to do, with names of arguments in
        braces.
        """
        if not self.certificate.valid and not force:
            what = f"{self.name} is not certified ({'; '.join(self.certificate.reasons)})"
            raise CertificationError(f"{literal(what)}, {otherwise}")
        return self.certificate


TileSource: TypeAlias = EscherTile | Tile | str | Path
"""What functions take for a tile. A text or path is a tile's own folder in a run; or the run's folder
or result.json, whose best tile is meant; `read_result` gives the others."""
