"""A sheet on which a tiling changes: polygons on one side become the tile on the other.

The way from a class's template to the tile is one of tilings (`tiles/motion/morph.py`), whose lattice
may stay. So a point of an edge, which is a group's image of a point of the tile, may be anywhere on its
own way: each goes as far as its place on the sheet says. Both tiles at an edge agree, since they ask
for the same place: an edge is one curve.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make import ArtSettings
from orbiflow.tiles.motion import Morph, OwnFrame
from orbiflow.tiles.page import Box, Curve, Page, tiling_size
from orbiflow.tiles.silhouette import triangulate
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.worlds.sheet import World, motions_of
from orbiflow.tiles.worlds.views import View

STEPS = 24  # of the way, between which points go straight
STILL = 0.12  # of the sheet at each end, where nothing changes
SHOWN = 0.35, 0.9  # shares of the way between which drawings appear
USUAL_TILES = 60  # on a sheet if no size of a tile is given
SMALLER = (0.75, 0.5)  # times that size, which are tried where edges cross: the change is slower


@dataclass(frozen=True, eq=False)
class Metamorphosis(World):
    """Copies of a tile that are on their way, each point as far as its place says.

    - `page`: Where all copies are in the end.
    - `way`: Points (V, 2) that fill the tile, in its place on the page, at `STEPS` + 1 shares.
    - `triangles`: (T, 3) of these; the first points are the tile's own vertices.
    - `goes`: "right", "down" or "middle".
    - `stages`: How many changes there are, there and back.
    """

    page: Page = field(kw_only=True)
    way: Array = field(kw_only=True)
    triangles: Integers = field(kw_only=True)
    goes: str = field(kw_only=True)
    stages: int = field(kw_only=True)

    def shares(self, places: Array) -> Array:
        """Return how far on their way points (..., 2) of the sheet are, 0 to 1."""
        width, height = self.view.size
        x, y = places[..., 0] / width, places[..., 1] / height
        if self.goes == "middle":
            far = np.hypot((places[..., 0] - width / 2), (places[..., 1] - height / 2))
            along = 1 - far / (np.hypot(width, height) / 2)
        else:
            along = x if self.goes == "right" else y
        stage, part = np.divmod(self.stages * np.clip(along, 0, 1 - 1e-12), 1.0)
        part = np.where(stage % 2, 1 - part, part)
        share = np.clip((part - STILL) / (1 - 2 * STILL), 0, 1)
        return share * share * (3 - 2 * share)

    def moved(self, copies: Integers) -> Array:
        """Return the points (M, V, 2) of copies (M,) where they are on the sheet."""
        linear, shift = self.motions[copies, :2, :2], self.motions[copies, :2, 2]
        last = np.einsum("mij,vj->mvi", linear, self.way[-1]) + shift[:, None]
        at = self.shares(last) * STEPS
        below = np.minimum(at.astype(np.int64), STEPS - 1)
        part, numbers = (at - below)[..., None], np.arange(self.way.shape[1])
        there = (1 - part) * self.way[below, numbers] + part * self.way[below + 1, numbers]
        return np.einsum("mij,mvj->mvi", linear, there) + shift[:, None]

    @cached_property
    def _tree(self) -> Any:
        return shapely.STRtree(np.asarray(shapely.polygons(self.way[-1][self.triangles])))

    def places(self, vectors: Array, copies: Integers) -> Array:
        """Return where vectors (N, 3) of the first tile are in copies (M,): places (M, N, 2) in mm."""
        points = vectors[:, :2]
        corners = self.triangles[self._tree.nearest(shapely.points(points))]
        first, second, third = self.way[-1][corners].swapaxes(0, 1)
        sides = np.stack([second - first, third - first], axis=-1)
        two = np.linalg.solve(sides, (points - first)[..., None])[..., 0]
        weights = np.column_stack([1 - two.sum(axis=1), two])
        return np.einsum("nk,mnkj->mnj", weights, self.moved(copies)[:, corners])

    def outlines(self, kind: int) -> Any:
        """Yield each copy and its outline: one polyline along each edge, whichever tile asks."""
        del kind
        count = len(self.tiling.prototiles[0].polygon)
        for k in range(len(self.motions)):
            yield k, Curve.polyline(self.moved(np.array([k]))[0, :count], closed=True)

    @cached_property
    def fade(self) -> Array:
        """How much (M,) of its drawing a copy shows."""
        low, high = SHOWN
        center = np.append(self.page.tiling.prototiles[0].center, 1.0)
        return np.clip((self.shares((self.motions @ center)[:, :2]) - low) / (high - low), 0, 1)

    @cached_property
    def is_sound(self) -> bool:
        """Whether no outline crosses itself."""
        rings = self.moved(np.arange(len(self.motions)))[
            :, : len(self.tiling.prototiles[0].polygon)
        ]
        return bool(shapely.is_valid(shapely.polygons(rings)).all())


def metamorphosis(tile: EscherTile, settings: ArtSettings) -> tuple[Metamorphosis, list[str]]:
    """Return the copies of a tile on a sheet on which its class's polygon becomes it.

    Raises:
        OrbiflowError: For a tile of two figures, or one whose class is not known.
    """
    if tile.parts:
        raise OrbiflowError("a metamorphosis is of one figure; choose another tile")
    frame = OwnFrame.of(tile.tile)
    mesh = triangulate(tile.tile.polygon)
    morph = Morph(frame, [mesh.points])
    end, shares = morph.end, np.linspace(0, 1, STEPS + 1).tolist()
    ways = [morph.rings(share)[0] @ end.linear.T + end.offset for share in shares]
    ways[-1] = mesh.points
    (width, height), area = settings.page, abs(tile.tile.signed_area)
    scale = float(np.sqrt(width * height / USUAL_TILES / area))
    if settings.tile_size is not None:
        scale = settings.tile_size / tiling_size(tile.tiling)
    for smaller in (1.0, *SMALLER) if settings.tile_size is None else (1.0,):
        found = _on_page(tile, settings, smaller * scale, np.stack(ways), mesh.triangles)
        if found.is_sound:
            return found, [f"{len(found.motions)} tiles on their way from polygons"]
    return found, ["tiles change so fast on this sheet that edges cross; choose smaller ones"]


def _on_page(
    tile: EscherTile, settings: ArtSettings, scale: float, ways: Array, triangles: Integers
) -> Metamorphosis:
    """Return the copies at a scale, with those around the page that may come onto it."""
    page = Page.placed(tile.tiling, settings, scale, y_down=tile.y_down)
    width, height = page.size
    room = 2 * page.tiling.radius
    wider = replace(page, box=Box(-room, -room, width + room, height + room))
    copies = wider.copies
    motions = motions_of(copies.group.linear_parts[copies.cosets], copies.translations)

    def vectors(points: Array) -> Array:
        return np.column_stack([page.place(points), np.ones(len(points))])

    made = Metamorphosis(
        tile.tiling,
        vectors,
        motions,
        wider.colours,
        View("sheet", page.size, np.eye(3)),
        page=wider,
        way=np.stack([page.place(way) for way in ways]),
        triangles=triangles,
        goes=settings.metamorphosis or "right",
        stages=settings.stages,
    )
    rings = made.moved(np.arange(len(motions)))[:, : len(tile.tile.polygon)]
    seen = (rings.max(axis=1) > 0).all(axis=1) & (rings.min(axis=1) < page.size).all(axis=1)
    return replace(made, motions=motions[seen], colours=made.colours[seen])
