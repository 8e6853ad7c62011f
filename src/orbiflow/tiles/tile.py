"""A finished tile: all that is known of it, and what can be done with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, InputFileError, OrbiflowError, literal
from orbiflow.tiles.geometry import Place, border
from orbiflow.tiles.likeness import Likeness, Rating, mixing_factor
from orbiflow.tiles.silhouette import Bending, Covered, Frame
from orbiflow.tiles.tile_map import TileMap
from orbiflow.tiles.tilings import (
    Certificate,
    Prototile,
    Tile,
    Tiling,
    arrangement,
    certify,
    mixing,
)


@dataclass(frozen=True)
class SearchFacts:
    """How a tile was found.

    - `objective`: What the search was after, "likeness" or "overlap".
    - `starts`, `dropped`: The number of starts, and of those that gave no certified tile.
    - `seconds`: Computing time on one core.
    """

    objective: str = "overlap"
    starts: int = 0
    dropped: int = 0
    seconds: float = 0.0


UNMEASURED, UNSEARCHED = Likeness(), SearchFacts()
NO_MAP = "each of its figures has a map of its own"  # a reason, for tiles that figures divide


class Part(NamedTuple):
    """One of the figures that divide a tile.

    - `figure`: Its polygon, map and measures, in the coordinates of its own silhouette.
    - `place`: Where these lie in the coordinates of the whole.
    """

    figure: EscherTile
    place: Place

    @classmethod
    def background(cls, tile: Tile, *, y_down: bool) -> Part:
        """Return what is left between figures: it is its own silhouette, in the whole's coordinates."""
        still = TileMap.still(tile.polygon, y_down=y_down)
        figure = EscherTile(tile, name="background", y_down=y_down, map_source=still)
        return cls(figure, Place(np.eye(2), np.zeros(2)))

    @property
    def is_background(self) -> bool:
        """Whether it may have any shape: what is left between figures."""
        return self.figure.silhouette is None

    @property
    def prototile(self) -> Prototile:
        """Its polygon and corners in the coordinates of the whole."""
        tile = self.figure.tile
        return Prototile(self.place(tile.polygon), tile.corners)


@dataclass(frozen=True, eq=False)
class EscherTile:
    """A finished tile, from a search, a file or a polygon of one's own.

    - `tile`: The polygon with its group, in the input's coordinates.
    - `name`: What files and titles call it, such as "IH4" or "turtle-IH4". Default: its class.
    - `y_down`: Whether y points down in its coordinates, as in images.
    - `rank`: Its place in the list of its run, from 1; None outside a saved run.
    - `silhouette`: What was read as the silhouette, as result.json has it.
    - `map_source`: The maps behind it, or the file that holds them, which may be missing.
    - `no_map`: Why there is no map from the silhouette, if that is known.
    - `normal`: The tile in the normal form of the silhouette, as the search left it.
    - `notes`: What the user should know of it.

    - `likeness`: How it compares with the silhouette.
    - `rating`: Its stars among the tiles of its run.
    - `search`: How it was found.
    - `others`: More tiles of the class, if they were asked for.
    - `division`: The figures that divide it, if there are several: see `figures`.
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
    likeness: Likeness = UNMEASURED
    rating: Rating | None = None
    search: SearchFacts = UNSEARCHED
    others: tuple[EscherTile, ...] = ()
    division: tuple[Part, ...] = ()

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

    @property
    def figures(self) -> tuple[Part, ...]:
        """The figures that it shows, each like a silhouette of its own; one alone is the tile."""
        return self.division or (Part(self, Place(np.eye(2), np.zeros(2))),)

    @cached_property
    def tiling(self) -> Tiling:
        """The group with a prototile for each of the `figures`."""
        if not self.division:
            return self.tile.tiling
        return Tiling(self.tile.group, [part.prototile for part in self.division])

    @cached_property
    def arrangement(self) -> str:
        """How its copies lie, in plain words; "" if it does not tile."""
        return arrangement(self.tile) if self.certificate.valid else ""

    @cached_property
    def certificate(self) -> Certificate:
        """The proof that it tiles, or what is wrong: from the polygons and the group alone."""
        return certify(self.tiling)

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
        tile_map = TileMap.read(source)
        if not tile_map.ends_on(self.tile):
            raise InputFileError(
                f"{source}: belongs to another tile than the one in result.json; search again"
            )
        return tile_map

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
        frame = self.frame or Frame.upright(y_down=self.y_down)
        return frame.covered(self.silhouette_outline)

    @property
    def score(self) -> float:
        """What tiles are ranked by, from 0 to 1: that of `likeness`.

        Of several figures it is the worst one's, less where copies of one figure lie side by side, as
        the eye takes them for one.
        """
        if not self.division or self.likeness.known_score is not None:
            return self.likeness.score
        mixed = mixing(self.tiling) if self.certificate.valid else 0.0
        return self.worst.score * mixing_factor(mixed)

    @property
    def worst(self) -> EscherTile:
        """The one of the `figures` that is least like its silhouette."""
        return min(self.likenesses, key=lambda figure: figure.likeness.score)

    @property
    def likenesses(self) -> list[EscherTile]:
        """The figures that are to be like a silhouette: all but a background."""
        return [part.figure for part in self.division if not part.is_background] or [self]

    def changed(self, **changes: Any) -> EscherTile:
        """Return the tile with other values of some fields, and a certificate that is known kept."""
        other = replace(self, **changes)
        same = other.tile is self.tile and other.division is self.division
        if "certificate" in self.__dict__ and same:
            other.__dict__["certificate"] = self.certificate
        return other

    def with_figures(self, change: Callable[[EscherTile], EscherTile]) -> EscherTile:
        """Return the tile with each of its figures changed: itself, if it is one figure."""
        if not self.division:
            return change(self)
        figures = (part._replace(figure=change(part.figure)) for part in self.division)
        return self.changed(division=tuple(figures))

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
