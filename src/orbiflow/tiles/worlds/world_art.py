"""Artwork of a tile in another world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.drawing import Palette, palette
from orbiflow.runtime import NEVER, Cancel
from orbiflow.tiles.make import ArtSettings, Made
from orbiflow.tiles.motifs import Over, motifs_on, require_figures, with_map
from orbiflow.tiles.page import Raster, Scene, glass, tinted_picture
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.worlds.choosing import flip_of, in_world
from orbiflow.tiles.worlds.curved import facing, turned, undone
from orbiflow.tiles.worlds.metamorphosis import Metamorphosis, metamorphosis
from orbiflow.tiles.worlds.sheet import LEAST_COPY, CopyMotifs, World, world_scene
from orbiflow.tiles.worlds.spiral import cylinder, spiral
from orbiflow.tiles.worlds.turning import turning_page
from orbiflow.tiles.worlds.unfolding import Unfolding
from orbiflow.tiles.worlds.views import WorldView
from orbiflow.tiles.worlds.world_copies import colours, copies
from orbiflow.tiles.write import texture

MOST_COPIES = 20_000
TEXELS_PER_PIXEL = 1.5
"""Pixels of a picture on a tile along one of the page, where the tile is largest."""


def world_artwork(
    source: TileSource,
    settings: ArtSettings,
    *overs: Over | None,
    begin: EscherTile | None = None,
    cancel: Cancel = NEVER,
) -> Made:
    """Return a picture of a tile in the world that settings name; arguments as of `artwork`.

    A metamorphosis begins with the tile `begin` instead of polygons; the last of `overs` lies on it.

    Raises:
        OrbiflowError: As `artwork`, and if the tile's group has no pattern in that world.
    """
    tile = with_map(source)
    world, notes = world_of(tile, settings, begin)
    count, chosen = len(tile.figures) * world.count, palette(settings.palette)
    if len(tile.figures) > 1:  # each figure has a colour of its own, and its shades
        chosen = chosen.shaded((world.count,) * len(tile.figures))
    own_overs = overs if begin is None else overs[:1]
    require_figures(tile, settings, len(own_overs))
    skins = [_worn(tile, world, settings, chosen, own_overs, notes)]
    if isinstance(world, Metamorphosis) and world.before and begin:
        skins.append(_worn(with_map(begin), world.before, settings, chosen, overs[1:], notes))
    notes += chosen.shortage(count)
    more = {
        "title": tile.name,
        "notes": (
            f"Artwork of {tile.isohedral_class or 'a tile'}, made with orbiflow {__version__}.",
        ),
    }
    if settings.format == "html":
        page = partial(turning_page, world, chosen, skins[0].motifs, tile.name)
        scene = Scene(*settings.page, (), web_page=page, **more)
    else:
        scene = world_scene(world, chosen, skins, line=settings.outline, cancel=cancel, **more)
    return Made(
        tile=tile,
        settings=settings,
        scenes=(scene,),
        counted="copies",
        tiles=len(world.motions),
        world=settings.world or "metamorphosis",
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
    density = float(world.sizes.max()) / world.size * settings.pixels * TEXELS_PER_PIXEL
    on = motifs_on(tile, settings, chosen, overs, tint=settings.tint, density=density)
    motifs = [motif.moved(*part.place) for motif, part in zip(on.motifs, tile.figures, strict=True)]
    notes += on.notes
    drawn = [replace(motif, rasters=()) for motif in motifs]
    if not on.has_pictures:
        return CopyMotifs(world, drawn)
    if settings.format == "html":
        notes.append("a page to turn has drawings in SVG, but no pictures of pixels")
        return CopyMotifs(world, drawn)
    pictures = list[list[Raster]]()
    for kind, (motif, prototile) in enumerate(zip(motifs, world.tiling.prototiles, strict=True)):
        plain = texture(replace(motif, parts=()), prototile.polygon, density)
        fills = [chosen.fill(kind * world.count + colour) for colour in range(world.count)]
        seen = (tinted_picture(plain, glass(fill, on.tint)) for fill in fills)
        pictures.append([*seen] if on.tint else [plain] * world.count)
    return CopyMotifs(world, drawn, pictures)


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
    unfolding, seen = in_world(tile, settings.order, sign)
    view = WorldView(settings.world or "disc", settings.page, _facing(unfolding, settings))
    ring = unfolding.vectors(unfolding.ring[:: max(1, len(unfolding.ring) // 30)])

    def shown(motions: Array) -> Any:
        if sign > 0:
            return np.ones(len(motions), dtype=bool)
        places = view.places(np.einsum("mij,nj->mni", motions, ring))
        large = np.ptp(places, axis=1).max(axis=1) > LEAST_COPY
        return view.meets(places) & large & np.isfinite(places.max(axis=1)).all(axis=1)

    motions = copies(unfolding, shown, MOST_COPIES)
    numbers, _ = colours(unfolding, motions)
    if settings.colour == "one":
        numbers = 0 * numbers
    world = World(
        tile.tiling,
        lambda points: unfolding.vectors(points @ flip),
        motions,
        numbers,
        view,
        unfolding,
        flip,
    )
    notes = [f"{len(motions)} copies; {unfolding.words}", *seen]
    if len(motions) == MOST_COPIES:
        notes.append("more copies than these are not drawn: choose a smaller {area}")
    return world, notes


def _facing(unfolding: Unfolding, settings: ArtSettings) -> Array:
    """Return the motion that brings what is to be in the middle there, turned as asked."""
    turn = turned(np.radians(settings.rotate))
    if unfolding.sign > 0:
        return turn @ facing(unfolding.middle)
    middle = int(np.argmax(unfolding.development.orders))
    return turn @ undone(unfolding.development.frame(middle), unfolding.sign)
