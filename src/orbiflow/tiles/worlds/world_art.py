"""Artwork of a tile in another world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.drawing import Palette, palette
from orbiflow.runtime import Cancel, Outcome
from orbiflow.tiles.make import ArtSettings
from orbiflow.tiles.motifs import (
    TEXELS_PER_PIXEL,
    Over,
    picture_paint,
    require_figures,
    with_map,
    worn,
)
from orbiflow.tiles.page import Scene
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.worlds.choosing import flip_of, in_world
from orbiflow.tiles.worlds.curved import facing, turned, undone
from orbiflow.tiles.worlds.metamorphosis import Metamorphosis, metamorphosis
from orbiflow.tiles.worlds.sheet import (
    LEAST_COPY,
    CopyMotifs,
    PrototilePainting,
    World,
    world_scene,
)
from orbiflow.tiles.worlds.spiral import cylinder, spiral
from orbiflow.tiles.worlds.turning import turning_page
from orbiflow.tiles.worlds.unfolding import Unfolding
from orbiflow.tiles.worlds.views import WorldView
from orbiflow.tiles.worlds.world_copies import colours, copies
from orbiflow.tiles.write import write_pdf, write_png, write_svg

MOST_COPIES = 20_000
TEXTURE = 6_000_000  # texels of a painting at most


@dataclass(frozen=True, eq=False, kw_only=True)
class WorldArt(Outcome):
    """A picture of a tile's copies in another world.

    - `world`: The copies, and how they are seen.
    - `palette`: Its colours.
    - `worn`: What lies on its figures; in a metamorphosis also on those of the beginning.
    - `notes`: What the user should know.
    """

    tile: EscherTile
    settings: ArtSettings
    world: World
    palette: Palette
    worn: tuple[CopyMotifs, ...]
    notes: tuple[str, ...]

    def scene(self, cancel: Cancel | None = None) -> Scene:
        """Return the page."""
        name = self.tile.isohedral_class or "a tile"
        return world_scene(
            self.world,
            self.palette,
            self.worn,
            pixels=self.settings.pixels,
            line=self.settings.outline,
            title=self.tile.name,
            notes=(f"Artwork of {name}, made with orbiflow {__version__}.",),
            cancel=cancel,
        )

    @property
    def width(self) -> int:
        """The number of pixels in a row."""
        return round(self.settings.page[0] * self.settings.pixels)

    @property
    def height(self) -> int:
        """The number of rows."""
        return round(self.settings.page[1] * self.settings.pixels)

    @property
    def shown(self) -> float:
        """The number of copies."""
        return float(len(self.world.motions))

    def written(self, out: Path) -> WorldArt:
        """Return what came of writing it to a file, with its facts as JSON has them."""
        facts = {"file": str(out), "width": self.width, "height": self.height}
        facts |= {"tiles": self.shown, "world": self.called}
        return replace(self, summary={**facts, "class": self.tile.isohedral_class})

    @property
    def called(self) -> str:
        """What it is a picture of."""
        return self.settings.world or "metamorphosis"

    @property
    def words(self) -> str:
        """What was written, in a sentence."""
        name = self.tile.isohedral_class or "a tile"
        return f"written {self.summary['file']}: {self.shown:.0f} copies of {name}, {self.called}"

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
        return write_png(self.scene(), dpi=self.settings.dpi)


def world_artwork(
    source: TileSource, settings: ArtSettings, *overs: Over | None, begin: EscherTile | None = None
) -> WorldArt:
    """Return a picture of a tile in the world that settings name; arguments as of `artwork`.

    A metamorphosis begins with the tile `begin` instead of polygons; the last of `overs` lies on it.

    Raises:
        OrbiflowError: As `artwork`, and if the tile's group has no pattern in that world.
    """
    tile = with_map(source)
    world, notes = world_of(tile, settings, begin)
    count, chosen = len(tile.figures) * world.count, palette(settings.palette)
    if tile.parts:  # each figure has a colour of its own, and its shades
        chosen = chosen.shaded((world.count,) * len(tile.figures))
    own_overs = overs if begin is None else overs[:1]
    require_figures(tile, settings, len(own_overs))
    wearing = [_worn(tile, world, settings, chosen, own_overs, notes)]
    if isinstance(world, Metamorphosis) and world.before and begin:
        wearing.append(_worn(with_map(begin), world.before, settings, chosen, overs[1:], notes))
    notes += chosen.shortage(count)
    return WorldArt(
        tile=tile,
        settings=settings,
        world=world,
        palette=chosen,
        worn=tuple(wearing),
        notes=tuple(dict.fromkeys(notes)),
    )


def _worn(
    tile: EscherTile,
    world: World,
    settings: ArtSettings,
    chosen: Palette,
    overs: Sequence[Over | None],
    notes: list[str],
) -> CopyMotifs:
    """Return what lies on a tile's copies in a world, and add what the user should know of it."""
    on, paintings = worn(tile, settings, chosen, overs, settings.tint), list[PrototilePainting]()
    motifs = [own.moved(*part.place) for own, part in zip(on.motifs, tile.figures, strict=True)]
    notes += on.notes
    if any(on.pictures) and settings.format == "html":
        notes.append("a page to turn has drawings in SVG, but no pictures of pixels")
    elif any(on.pictures):
        count = len(tile.figures) * world.count
        scale = float(world.sizes.max()) / world.size * settings.pixels * TEXELS_PER_PIXEL
        scale = min(scale, float(np.sqrt(TEXTURE / count)) / world.size)
        for picture, part in zip(on.pictures, tile.figures, strict=True):
            paint = picture_paint(picture, part.figure, scale * part.place.scale, count)
            coloured = paint.coloured(chosen, count, on.tint)
            paintings.append(PrototilePainting(paint.grid, coloured, part.place))
    return CopyMotifs(world, motifs, paintings)


def world_file(art: WorldArt, format: str, *, cancel: Cancel | None = None) -> bytes | str:
    """Return the content of a file in a format, svg, pdf, png, or html for a page to turn it."""
    if format == "html":
        return turning_page(art.world, art.palette, art.worn[0].motifs, art.tile.name)
    scene = art.scene(cancel)
    if format == "png":
        return write_png(scene, dpi=art.settings.dpi)
    return write_pdf(scene) if format == "pdf" else write_svg(scene)


def world_of(
    tile: EscherTile, settings: ArtSettings, begin: EscherTile | None = None
) -> tuple[World, list[str]]:
    """Return the copies of a tile in the world that settings name, and what the user should know."""
    if settings.metamorphosis is not None:
        return metamorphosis(tile, settings, begin)
    flip = np.diag(flip_of(tile))
    if settings.world in ("spiral", "cylinder"):
        wound = spiral if settings.world == "spiral" else cylinder
        tiling = tile.tiling.transformed(flip, np.zeros(2))
        return wound(tile.tiling, tiling, flip, settings)
    sign = 1 if settings.world == "sphere" else -1
    found, seen = in_world(tile, settings.order, sign)
    view = WorldView(settings.world or "disc", settings.page, _facing(found, settings))
    ring = found.vectors(found.ring[:: max(1, len(found.ring) // 30)])

    def shown(motions: Array) -> Any:
        if sign > 0:
            return np.ones(len(motions), dtype=bool)
        places = view.places(np.einsum("mij,nj->mni", motions, ring))
        large = np.ptp(places, axis=1).max(axis=1) > LEAST_COPY
        return view.meets(places) & large & np.isfinite(places.max(axis=1)).all(axis=1)

    motions = copies(found, shown, MOST_COPIES)
    numbers, _ = colours(found, motions)
    if settings.colour == "one":
        numbers = 0 * numbers
    world = World(
        tile.tiling,
        lambda points: found.vectors(points @ flip),
        motions,
        numbers,
        view,
        found,
        flip,
    )
    notes = [f"{len(motions)} copies; {found.words}", *seen]
    if len(motions) == MOST_COPIES:
        notes.append("more copies than these are not drawn: choose a smaller {area}")
    return world, notes


def _facing(found: Unfolding, settings: ArtSettings) -> Array:
    """Return the motion that brings what is to be in the middle there, turned as asked."""
    turn = turned(np.radians(settings.rotate))
    if found.sign > 0:
        return turn @ facing(found.middle)
    middle = int(np.argmax(found.development.orders))
    return turn @ undone(found.development.frame(middle), found.sign)
