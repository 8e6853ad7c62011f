"""Artwork of a tiling in the plane: what lies on the tiles of a page, in colours."""

from __future__ import annotations

import numpy as np

from orbiflow import __version__
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make.art_settings import ArtSettings
from orbiflow.tiles.make.made import Made
from orbiflow.tiles.make.repeats import repeating_page
from orbiflow.tiles.motifs import Over, motifs_on, notes_on_dark_pictures, require_figures, with_map
from orbiflow.tiles.page import Page, Style, edge_margin, tiling_size
from orbiflow.tiles.tile import EscherTile, TileSource

TILE_PER_OUTLINE = 120  # the tile's size over the outline's usual width
USUAL_TILES = 25  # number of tiles on a page if no size of a tile is given
SEAM = 0.3  # width in pixels of hairlines between filled tiles


def artwork(tile: TileSource, settings: ArtSettings | None = None, *overs: Over | None) -> Made:
    """Return a picture of a tiling with something on its tiles, before it is written.

    Args:
        tile: A tile in memory, or a run's folder; see `with_map`.
        settings: How it is drawn.
        overs: What lies over the silhouette of each of the tile's figures, as `read_over` returns it.

    Raises:
        OrbiflowError: If a picture or an eye is given but there is no map of the silhouette, an eye
            lies outside it, there are too many tiles, or no rectangle repeats.
    """
    settings, tile = settings or ArtSettings(), with_map(tile)
    require_figures(tile, settings, len(overs))
    (page, note), chosen = _art_page(tile, settings), palette(settings.palette)
    density = settings.pixels * page.place.scale
    on = motifs_on(tile, settings, chosen, overs, tint=settings.tint, density=density)
    outline = settings.outline
    if outline is None:
        outline = max(1 / settings.pixels, page.tile_size / TILE_PER_OUTLINE)
    placed = zip(on.motifs, tile.figures, strict=True)
    name, (width, height) = tile.isohedral_class or "a tile", page.size
    scene = page.scene(
        chosen,
        Style(None, chosen.outline, outline),
        clipped=True,
        seam=SEAM / settings.pixels,
        motifs=[motif.moved(*page.place.after(part.place)) for motif, part in placed],
        tint=on.tint,
        title=tile.name,
        notes=(f"Artwork of {name}, made with orbiflow {__version__}.",),
        facts={"tile_size": page.tile_size},
    )
    return Made(
        tile=tile,
        settings=settings,
        scenes=(scene,),
        counted="tiles",
        # where the page cuts some, what it has room for by area
        tiles=(
            len(page.copies) if page.whole is not None else width * height / page.tiling.tile_area
        ),
        notes=(
            *on.notes,
            *notes_on_dark_pictures(tile, overs, chosen),
            *filter(None, [note]),
            *page.palette(chosen).shortage(page.count),
        ),
    )


def _art_page(tile: EscherTile, settings: ArtSettings) -> tuple[Page, str]:
    """Return the page that is painted, and what the user should know of it."""
    (width, height), size = settings.page, tiling_size(tile.tiling)
    area = abs(tile.tile.signed_area) / len(tile.figures)
    scale = float(np.sqrt(width * height / USUAL_TILES / area))
    if settings.tile_size is not None:
        scale = settings.tile_size / size
    if settings.repeat is not None:
        return repeating_page(tile, settings, scale)
    whole = None if settings.clip else edge_margin(scale * size)
    page = Page.placed(
        tile.tiling, settings, scale, y_down=tile.y_down, whole=whole, centred=settings.clip
    )
    if not len(page.copies):
        raise OrbiflowError(
            f"no tile is whole on a page of {width * settings.pixels:.0f} x "
            f"{height * settings.pixels:.0f} pixels; choose a larger area or smaller tiles"
        )
    return page, ""
