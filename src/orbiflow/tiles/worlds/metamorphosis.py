"""A sheet on which a tiling changes: polygons on one side become the tile on the other.

The way from a class's template to the tile is one of tilings (`tiles/motion/morph.py`), whose lattice
may stay. So a point of an edge, which is a group's image of a point of the tile, may be anywhere on its
own way: each goes as far as its place on the sheet says. Both tiles at an edge agree, since they ask
for the same place: an edge is one curve.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make import ArtSettings
from orbiflow.tiles.motion import Morph, OwnFrame
from orbiflow.tiles.page import Box, Curve, Page, tiling_size
from orbiflow.tiles.silhouette import SilhouetteMesh, harmonic, triangulate
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.worlds.sheet import World, motions_of
from orbiflow.tiles.worlds.views import WorldView

STEPS = 40  # of the way, between which points go straight
STILL, BRIEF = 0.12, 0.05  # of the sheet at each end, where nothing changes; from another tile
SHOWN = 0.35, 0.9  # shares of the way between which drawings appear
SHOWN_LATE = 0.65, 0.95  # of the way from another tile, which is polygons in its middle
SLIDE = 0.45, 0.55  # shares of that way between which vertices slide along the polygon's edges
STARS_OF_STRETCH = 3.0  # that stretching both tiles by 1, to twice their length, costs
USUAL_TILES = 60  # on a sheet if no size of a tile is given
SMALLER = (0.75, 0.5)  # times that size, which are tried where edges cross: the change is slower


@dataclass(frozen=True, eq=False)
class Metamorphosis(World):
    """Copies of a tile that are on their way, each point as far as its place says.

    - `page`: Where all copies are in the end.
    - `way`: Points (V, 2) that fill the tile, in its place on the page, at `STEPS` + 1 shares.
    - `triangles`: (T, 3) of these; the first points are the tile's own vertices.
    - `last`: Where these points are in the end (V, 2), and ask how far they are.
    - `vertices`: How many of them are the tile's vertices.
    - `goes`: "right", "down" or "middle".
    - `stages`: How many changes there are, there and back.
    - `shown`: Shares of the way between which drawings appear.
    - `still`: The share of the sheet at each end where nothing changes; from another tile, which is a
      longer way, all the rest of it is used evenly.
    - `backwards`: Whether the way is the other tile's, which is there at the beginning.
    - `before`: The copies of the tile of the beginning, for what is drawn on it.
    """

    page: Page = field(kw_only=True)
    way: Array = field(kw_only=True)
    triangles: Integers = field(kw_only=True)
    last: Array = field(kw_only=True)
    vertices: int = field(kw_only=True)
    goes: str = field(kw_only=True)
    stages: int = field(kw_only=True)
    shown: tuple[float, float] = field(kw_only=True)
    backwards: bool = field(kw_only=True)
    still: float = field(kw_only=True)
    before: Metamorphosis | None = None

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
        share = np.clip((part - self.still) / (1 - 2 * self.still), 0, 1)
        if self.still == STILL:
            share = share * share * (3 - 2 * share)
        return 1 - share if self.backwards else share

    def moved(self, copies: Integers) -> Array:
        """Return the points (M, V, 2) of copies (M,) where they are on the sheet."""
        linear, shift = self.motions[copies, :2, :2], self.motions[copies, :2, 2]
        last = np.einsum("mij,vj->mvi", linear, self.last) + shift[:, None]
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
        for k in range(len(self.motions)):
            yield k, Curve.polyline(self.moved(np.array([k]))[0, : self.vertices], closed=True)

    @cached_property
    def fade(self) -> Array:
        """How much (M,) of its drawing a copy shows."""
        low, high = self.shown
        center = np.append(self.last.mean(axis=0), 1.0)
        return np.clip((self.shares((self.motions @ center)[:, :2]) - low) / (high - low), 0, 1)

    @cached_property
    def is_sound(self) -> bool:
        """Whether no outline crosses itself."""
        rings = self.moved(np.arange(len(self.motions)))[:, : self.vertices]
        return bool(shapely.is_valid(shapely.polygons(rings)).all())


def metamorphosis(
    tile: EscherTile, settings: ArtSettings, begin: EscherTile | None = None
) -> tuple[Metamorphosis, list[str]]:
    """Return the copies of a tile on a sheet on which its class's polygon becomes it.

    With `begin`, another tile of its class becomes it, by way of the polygon; `before` has its copies.

    Raises:
        OrbiflowError: For a tile of two figures, or one whose class is not known or another.
    """
    if len(tile.figures) > 1 or (begin and len(begin.figures) > 1):
        raise OrbiflowError("a metamorphosis is of one figure; choose another tile")
    notes, origin = list[str](), "polygons"
    if begin is None:
        mesh = triangulate(tile.tile.polygon)
        frame = OwnFrame.of(tile.tile)
        way, still = _way(frame, mesh.points), (np.eye(2), np.zeros(2))
        ends = [Changing(tile, tile, *still, mesh, way, mesh.points, SHOWN)]
    else:
        ends, stretch = _both(tile, begin)
        origin = begin.name
        notes.append(f"both tiles are stretched by {100 * stretch:.0f} % to lie on one lattice")
    (width, height), area = settings.page, abs(tile.tile.signed_area)
    scale = float(np.sqrt(width * height / USUAL_TILES / area))
    if settings.tile_size is not None:
        scale = settings.tile_size / tiling_size(tile.tiling)
    for smaller in (1.0, *SMALLER) if settings.tile_size is None else (1.0,):
        laid = _on_page(ends, settings, smaller * scale)
        if laid.is_sound:
            return laid, [f"{len(laid.motions)} tiles on their way from {origin}", *notes]
    crossed = "tiles change so fast on this sheet that edges cross; choose smaller ones"
    return laid, [*notes, crossed]


class Changing(NamedTuple):
    """A tile that others become.

    - `tile`: As it was found.
    - `placed`: On the sheet's lattice, with as many vertices as the other end has.
    - `linear`, `shift`: The map p -> linear p + shift from the one to the other.
    - `mesh`: The triangles that fill it, on that lattice.
    - `way`: Their points at even shares of the way (S, V, 2).
    - `last`: Where these points are at the sheet's end (V, 2): there they ask how far they are.
    - `shown`: Shares of the way between which its drawing appears.
    """

    tile: EscherTile
    placed: EscherTile
    linear: Array
    shift: Array
    mesh: SilhouetteMesh
    way: Array
    last: Array
    shown: tuple[float, float]


def _way(frame: OwnFrame, points: Array) -> Array:
    """Return points (V, 2) of a tile, its vertices first, on their way from the polygon (S, V, 2)."""
    morph = Morph(frame, [points])
    shares = np.linspace(0, 1, STEPS + 1).tolist()
    ways = [morph.rings(share)[0] @ frame.linear.T + frame.offset for share in shares]
    return np.stack([*ways[:-1], points])


def _both(tile: EscherTile, begin: EscherTile) -> tuple[list[Changing], float]:
    """Return a tile and the one that becomes it, on a lattice between theirs, and by how much both are
    stretched for it; vertices are at the same shares of their edges.
    """
    last, first = (OwnFrame.of(figure.tile) for figure in (tile, begin))
    if first.kind is not last.kind:
        raise OrbiflowError(
            f"{begin.name} is of {first.kind.name} and {tile.name} of {last.kind.name}: a tile can "
            "become another one of its own class"
        )
    shares, (half, stretch) = last.shares(first), _middle(last, first)
    frames = [replace(frame, linear=half) for frame in (last, first)]
    whole = zip((tile, begin), frames, strict=True)
    tiles = [figure.changed(tile=frame.at_shares(shares).tile()) for figure, frame in whole]
    meshes = [triangulate(figure.tile.polygon) for figure in tiles]
    # a tile's own vertices move; those of the other one lie between them
    ways = [_way(frame, mesh.points) for frame, mesh in zip(frames, meshes, strict=True)]
    changes = list[Changing]()
    for k, (figure, mine) in enumerate(zip((tile, begin), (last, first), strict=True)):
        there, back = ways[k], ways[1 - k] - frames[1 - k].offset + frames[k].offset
        count, way = len(tiles[k].tile.polygon), np.repeat(there[:1], STEPS + 1, axis=0)
        for n, share in enumerate(np.linspace(0, 1, STEPS + 1)):
            low, high = SLIDE
            if share <= low:
                way[n, :count] = _at(back, 1 - share / low)[:count]
            elif share < high:
                part = (share - low) / (high - low)
                way[n, :count] = (1 - part) * back[0, :count] + part * there[0, :count]
            else:
                way[n] = _at(there, (share - high) / (1 - high))
        linear = half @ np.linalg.inv(mine.linear)
        end = there[-1] if k == 0 else harmonic(meshes[1], back[-1, :count])
        shift = mine.offset - linear @ mine.offset
        changes.append(Changing(figure, tiles[k], linear, shift, meshes[k], way, end, SHOWN_LATE))
    return changes, stretch


def _middle(last: OwnFrame, first: OwnFrame) -> tuple[Array, float]:
    """Return the frame (2, 2) half of the way between two, as large as the last one, and by how much
    both are stretched to have it."""
    left, sizes, right = np.linalg.svd(last.linear @ np.linalg.inv(first.linear))
    half = left @ np.diag(np.sqrt(sizes)) @ right @ first.linear
    half *= np.sqrt(abs(np.linalg.det(last.linear) / np.linalg.det(half)))
    return half, float(np.sqrt(sizes[0] / sizes[1]) - 1)


def best_to_become(tiles: Sequence[EscherTile], begins: Sequence[EscherTile]) -> EscherTile | None:
    """Return the tile that a tile of its class becomes best: both are like their silhouettes, and
    hardly stretched to lie on one lattice; None if no class is in both."""

    def worth(pair: tuple[EscherTile, EscherTile]) -> float:
        stars = min(figure.rating.stars if figure.rating else 1.0 for figure in pair)
        return stars - STARS_OF_STRETCH * _middle(*(OwnFrame.of(figure.tile) for figure in pair))[1]

    pairs = [
        (tile, begin)
        for tile in tiles
        for begin in begins
        if tile.isohedral_class == begin.isohedral_class
        and len(tile.figures) == len(begin.figures) == 1
    ]
    return max(pairs, key=worth)[0] if pairs else None


def _at(way: Array, share: float) -> Array:
    """Return the points at a share of their way."""
    at = share * STEPS
    below = min(int(at), STEPS - 1)
    return (1 - at + below) * way[below] + (at - below) * way[below + 1]


def _on_page(ends: Sequence[Changing], settings: ArtSettings, scale: float) -> Metamorphosis:
    """Return the copies at a scale, with those around the page that may come onto it."""
    tile = ends[0].placed
    page = Page.placed(tile.tiling, settings, scale, y_down=tile.y_down)
    width, height = page.size
    room = 2 * page.tiling.radius
    wider = replace(page, box=Box(-room, -room, width + room, height + room))
    copies = wider.copies
    motions = motions_of(copies.group.linear_parts[copies.cosets], copies.translations)
    made = list[Metamorphosis]()
    for k, end in enumerate(ends):
        made.append(
            Metamorphosis(
                end.tile.tiling,
                _placer(page, end),
                motions,
                wider.colours,
                WorldView("sheet", page.size, np.eye(3)),
                page=wider,
                way=np.stack([page.place(way) for way in end.way]),
                last=page.place(end.last),
                triangles=end.mesh.triangles,
                vertices=len(end.placed.tile.polygon),
                goes=settings.metamorphosis or "right",
                stages=settings.stages,
                shown=end.shown,
                backwards=k > 0,
                still=STILL if len(ends) == 1 else BRIEF,
            )
        )
    rings = made[0].moved(np.arange(len(motions)))[:, : made[0].vertices]
    seen = made[0].view.meets(rings)
    near = [replace(part, motions=motions[seen], colours=part.colours[seen]) for part in made]
    return near[0] if len(near) == 1 else replace(near[0], before=near[1])


def _placer(page: Page, end: Changing) -> Callable[[Array], Array]:
    """Return what takes points of the tile as it was found to the sheet."""

    def vectors(points: Array) -> Array:
        return np.column_stack(
            [page.place(points @ end.linear.T + end.shift), np.ones(len(points))]
        )

    return vectors
