"""A tile in its place on the page that is exported, and the scene of its whole tiling."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import palette
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles.make.export_settings import ExportSettings
from orbiflow.tiles.make.offsets import offset_ring
from orbiflow.tiles.page import (
    USUAL_WIDTH,
    Box,
    Endless,
    Layer,
    Motif,
    Outline,
    Page,
    PlacedTile,
    Scene,
    Style,
    edge_margin,
    inset,
    outline,
    tiling_size,
)
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import Tiling

STRIP = 8.0  # height in mm of the strip at the page's foot that the calibration mark has for itself
LABELS = 9.0  # width in mm of the edge around a template that numbers have for themselves
SEAM = 0.025  # width in mm of hairlines between filled tiles
RED, BLACK, BLUE = "#ff0000", "#000000", "#0000ff"
"""The colours by which cutters tell lines to cut, areas to engrave and lines to mark."""


@dataclass(frozen=True, eq=False)
class Layout:
    """A tile's place on the page, from which every kind of export starts."""

    settings: ExportSettings
    tile: EscherTile
    page: Page
    outline: Outline  # the tile's curves, on the page
    motifs: tuple[Motif, ...] = ()  # what lies on each of its prototiles, on the page
    has_picture: bool = False  # whether a picture or drawing from a file is among them

    @property
    def fine(self) -> float:
        """The tolerance in mm of what is flattened or fitted again, a part of the whole."""
        return self.settings.fine

    def scene(self, layers: Iterable[Layer], tiles: tuple[PlacedTile, ...], **more: Any) -> Scene:
        """Return a scene of the page with these layers and tiles."""
        return self.page.empty(layers, prototiles=self.prototiles, tiles=tiles, **more)

    @property
    def prototiles(self) -> tuple[Array, ...]:
        """The polygon (N, 2) of each prototile, on the page."""
        return tuple(prototile.polygon for prototile in self.page.tiling.prototiles)

    @cached_property
    def pieces(self) -> list[tuple[Array, str]]:
        """The outline (M, 2) of each prototile's pieces with its offset, and what to know of it."""
        # flattening and fitting again share what the outline's fit left of the tolerance
        rings = (curve.flattened(self.fine / 2) for curve in self.outline.closed)
        return [offset_ring(ring, self.settings.offset, self.fine / 2) for ring in rings]

    @cached_property
    def placed_tiles(self) -> tuple[PlacedTile, ...]:
        """What a JSON file says of each copy on the page."""
        return self.page.listed(self.outline.edges)


def layout(tile: EscherTile, settings: ExportSettings) -> Layout:
    """Scale and turn the tile and put it on the page."""
    width, height = settings.page
    strip = STRIP if settings.calibrate else 0.0
    box, tiling = inset(Box(0.0, 0.0, width, height - strip), settings.margin), tile.tiling
    if settings.cut == "template" and "tile_size" not in settings.fields_given:
        settings = settings.replace(tile_size=_largest(tiling, settings.rotate, box))
    page = Page.placed(
        tiling,
        settings,
        settings.tile_size / tiling_size(tiling),
        y_down=tile.y_down,
        box=box,
        whole=None if settings.clip or settings.cut == "jigsaw" else bleed(settings),
        centred=settings.clip or settings.cut in ("pieces", "template"),
    )
    if settings.cut != "pieces":
        _require_fit(page, settings, strip)
    return Layout(settings, tile, page, outline(page.tiling, settings.deviation))


def _require_fit(page: Page, settings: ExportSettings, strip: float) -> None:
    """Check that the page holds a whole tile."""
    (width, height), box = page.size, page.box
    need = np.max([np.ptp(prototile.box, axis=0) for prototile in page.tiling.prototiles], axis=0)
    need += 2 * bleed(settings)
    if need[0] > box.width or need[1] > box.height:
        extra = f", {strip:g} mm of it for the calibration mark" if strip else ""
        edge = f" with a margin of {settings.margin:g} mm" if settings.margin else ""
        raise OrbiflowError(
            f"a tile of {settings.tile_size:g} mm does not fit on the page of {width:g} x "
            f"{height:g} mm{edge}: it needs {need[0]:.1f} x {need[1] + strip:.1f} mm{extra}; "
            "choose a larger area or a smaller tile size"
        )


def _largest(tiling: Tiling, rotate: float, box: Box) -> float:
    """Return the size of the largest tile, turned by an angle in degrees, with its numbers in a box."""
    points = np.concatenate([prototile.polygon for prototile in tiling.prototiles])
    width, height = np.ptp(points @ rotation_matrix(-np.radians(rotate)).T, axis=0)
    room = inset(box, LABELS)
    return max(0.0, min(room.width / width, room.height / height)) * tiling_size(tiling)


def bleed(settings: ExportSettings) -> float:
    """Return the room in mm for lines that reach beyond their tile's polygon."""
    reach = settings.deviation + (settings.outline or USUAL_WIDTH) / 2
    return max(reach, edge_margin(settings.tile_size))


def line_style(layout: Layout) -> Style:
    """Return the style of lines to cut."""
    settings = layout.settings
    return Style(None, settings.stroke or RED, settings.outline or 0.1)


def tiling_scene(layout: Layout) -> Scene:
    """Return a scene of all tiles, with their colours and what lies on them."""
    settings, page, motifs = layout.settings, layout.page, ()
    chosen, line = None, settings.stroke or BLACK
    if settings.filled:
        chosen, motifs = palette(settings.palette), layout.motifs
        line = settings.stroke or chosen.outline
    width = USUAL_WIDTH if settings.outline is None else settings.outline
    tint, whole = settings.tint * layout.has_picture, None
    if chosen is not None:
        whole = Endless.of_page(page, chosen, motifs, tint=tint, line=width)
    return page.scene(
        chosen,
        Style(None, line, width),
        outlines=layout.outline.closed,
        clipped=settings.clip,
        seam=SEAM if motifs else None,
        motifs=motifs,
        tint=tint,
        prototiles=layout.prototiles,
        tiles=layout.placed_tiles,
        endless=whole,
    )
