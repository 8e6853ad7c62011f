"""What a search method gives: candidates of one class, not certified yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from orbiflow.arrays import Array
from orbiflow.tiles.search.polygons import simplest_tile
from orbiflow.tiles.search.prototiles import Prototiles
from orbiflow.tiles.tile_map import TileMap
from orbiflow.tiles.tilings import IsohedralClass, Tile

if TYPE_CHECKING:
    from orbiflow.tiles.search.bending_fit import PlacedBent
    from orbiflow.tiles.search.model import TileModel

Progress = Callable[[float, float], None]
"""Called with the share of the work done and the best loss so far."""

VERTICES, CORNERS = "prototile.outline", "prototile.corners"
"""Names under which the arrays of a map hold the start tile, if it is not the template."""


def silent(_share: float, _loss: float) -> None:
    """Report no progress."""


class Candidates(Protocol):
    """Tiles of one class, best first, in the target's normal form."""

    @property
    def size(self) -> int:
        """The number of candidates."""
        ...

    def finished(self, index: int, *, force: bool = False) -> tuple[Tile, TileMap]:
        """Return the polygon of a candidate with its group, and the flow that made it.

        Raises:
            CertificationError: if it has no simple polygon and `force` is not set.
        """
        ...

    def as_model(self) -> TileModel:
        """Return the candidates as a torch module, to be trained further."""
        ...


class Fit(NamedTuple):
    """Finalists of one class, not certified yet.

    - `candidates`: The finalists, best first.
    - `starts`: The number of candidates that the method began with.
    - `crossed`: The number of those that were dropped because their boundary crossed itself.
    - `enough`: Certified finalists after which the others need not be looked at.
    - `bent`: After a search for likeness, the bent silhouette of each finalist.
    """

    candidates: Candidates
    starts: int
    crossed: int
    enough: int
    bent: tuple[PlacedBent, ...] = ()

    @property
    def model(self) -> TileModel:
        """The candidates as a torch module, to be trained further."""
        return self.candidates.as_model()


WAVES = {
    "IH1": 18,
    "IH2": 9,
    "IH3": 9,
    "IH4": 8,
    "IH5": 4,
    "IH6": 4,
    "IH7": 8,
    "IH21": 4,
    "IH28": 4,
}
"""By class, the number of parameters of a symmetric field of frequency 1."""

STEPS = 8
"""Integration steps with which a flow's polygon is first computed."""


@dataclass(frozen=True, eq=False)
class StillTiles:
    """Start tiles as candidates: no flow moves them, and torch is not needed."""

    kind: IsohedralClass
    prototiles: Prototiles

    @property
    def size(self) -> int:
        """The number of candidates."""
        return len(self.prototiles)

    def finished(self, index: int, *, force: bool = False) -> tuple[Tile, TileMap]:
        """Return the polygon of a candidate with its group, and a flow that stays where it is."""
        own, steps = self.prototiles.take([index]), STEPS
        vertices, corners, offset = own.vertices[0], own.corners[0], own.offset[0]

        def moved(points: Array) -> Array:
            nonlocal steps  # what a flow's convergence costs, for the record
            steps *= 2
            return points

        linear = self._linear(own)
        tile = simplest_tile(
            self.kind, vertices, corners.tolist(), linear, offset, moved=moved, force=force
        )
        settings = {
            "class": self.kind.name,
            "max_frequency": 1,
            "segments": 1,
            "smoothness": 0.0,
            "steps": steps,
            "method": "rk4",
            "mirrored": bool(own.mirrored[0]),
        }
        arrays = {
            "angle": own.angle[0],
            "log_scale": own.log_scale[0],
            "offset": offset,
            "shape": np.zeros(self.kind.shape_dim),
            "stretch": own.stretch[0],
            "flow.segments.0.parameters_": np.zeros(WAVES[self.kind.name]),
            VERTICES: vertices,
            CORNERS: corners,
        }
        return tile, TileMap(settings, {name: np.array(a) for name, a in arrays.items()})

    def _linear(self, own: Prototiles) -> Array:
        """Return the linear part (2, 2) of the placement of a single candidate."""
        c, s = np.cos(own.angle[0]), np.sin(own.angle[0])
        sign = -1.0 if own.mirrored[0] else 1.0
        turn = np.array([[c, -s * sign], [s, c * sign]])
        stretch = self.kind.stretch(own.stretch[0])
        # einsum rounds each product, as torch does for a flow's tile; matmul does not
        return np.einsum("ij,jk->ik", np.exp(own.log_scale[0]) * turn, stretch)

    def as_model(self) -> TileModel:
        """Return the candidates as a torch module, with a field of frequency 1 that is zero."""
        from orbiflow.tiles.search.model import TileModel

        return TileModel(
            self.kind,
            max_frequency=1,
            segments=1,
            smoothness=0.0,
            steps=1,
            prototiles=self.prototiles,
        )
