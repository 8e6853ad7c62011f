"""Artwork: what lies on the tile and the page, as pixels or as curves."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from orbiflow import __version__
from orbiflow.arrays import Array, Integers
from orbiflow.drawing import palette, png_bytes
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Outcome, SideBySide, Tell
from orbiflow.tiles.geometry import Place
from orbiflow.tiles.make.art_settings import ArtSettings
from orbiflow.tiles.make.repeats import repeating_page
from orbiflow.tiles.motifs import (
    NOWHERE,
    TEXELS_PER_PIXEL,
    CarriedPicture,
    Grid,
    Over,
    Paint,
    bilinear,
    carried_raster,
    figure_paint,
    notes_on_dark_pictures,
    paint_motif,
    require_figures,
    rgb_of,
    ring_sides,
    runs,
    with_map,
    worn,
)
from orbiflow.tiles.page import Curve, Motif, Page, PathPart, Scene, Style, edge_margin, tiling_size
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.write import write_pdf, write_svg

TILE_PER_OUTLINE = 120  # the tile's size over the outline's usual width
USUAL_TILES = 25  # number of tiles on a page if no size of a tile is given
SEAM = 0.3  # width in pixels of hairlines between filled tiles
BAND = 2_000_000  # number of samples that are computed at a time


@dataclass(frozen=True, eq=False, kw_only=True)
class Artwork(Outcome):
    """A picture of a tiling, and everything that it is made from.

    - `tile`: The tile with its map.
    - `settings`: The settings as they were given.
    - `page`: The copies of the tile and where they are.
    - `pictures`: The picture over the silhouette of each of the tile's figures, or None.
    - `motifs`: What is drawn over these, in each figure's units.
    - `tint`: How much each tile's colour tints all that.
    - `notes`: What the user should know.
    """

    tile: EscherTile
    settings: ArtSettings
    page: Page
    pictures: tuple[CarriedPicture | None, ...]
    motifs: tuple[Motif, ...]
    tint: float
    notes: tuple[str, ...]

    @property
    def width(self) -> int:
        """The number of pixels in a row."""
        return round(self.page.size[0] * self.settings.pixels)

    @property
    def height(self) -> int:
        """The number of rows."""
        return round(self.page.size[1] * self.settings.pixels)

    @property
    def tile_size(self) -> float:
        """The size of a tile in pixels."""
        return self.page.tile_size * self.settings.pixels

    @property
    def shown(self) -> float:
        """The number of tiles that the picture shows or, where it cuts some, has room for by area."""
        if self.page.whole is not None:
            return float(len(self.page.copies))
        width, height = self.page.size
        return width * height / self.page.tiling.tile_area

    @property
    def outline(self) -> float:
        """The outline's width in mm."""
        usual = max(1 / self.settings.pixels, self.page.tile_size / TILE_PER_OUTLINE)
        return usual if self.settings.outline is None else self.settings.outline

    def place(self, number: int) -> Place:
        """Return where the units of one of the tile's figures lie on the page."""
        return self.page.place.after(self.tile.figures[number].place)

    def density(self, number: int) -> float:
        """Return the texels of a figure's raster along its unit."""
        return TEXELS_PER_PIXEL * self.settings.pixels * self.place(number).scale

    def written(self, out: Path) -> Artwork:
        """Return what came of writing it to a file, with its facts as JSON has them."""
        facts = {"file": str(out), "width": self.width, "height": self.height, "tiles": self.shown}
        facts |= {"class": self.tile.isohedral_class, "tile_size": self.tile_size}
        return replace(self, summary=facts)

    @property
    def words(self) -> str:
        """What was written, in a sentence."""
        name = self.tile.isohedral_class or "a tile"
        return (
            f"written {self.summary['file']}: {self.width} x {self.height} pixels, "
            f"{self.shown:.0f} tiles of {name}, {self.tile_size:.0f} pixels each"
        )

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
        return png_of(render_artwork(self), self.settings.dpi)


def artwork(tile: TileSource, settings: ArtSettings | None = None, *overs: Over | None) -> Artwork:
    """Prepare a picture of a tiling with something on its tiles.

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
    (page, told), chosen = _art_page(tile, settings), palette(settings.palette)
    on = worn(tile, settings, chosen, overs, settings.tint)
    return Artwork(
        tile=tile,
        settings=settings,
        page=page,
        pictures=on.pictures,
        motifs=on.motifs,
        tint=on.tint,
        notes=(
            *on.notes,
            *notes_on_dark_pictures(tile, overs, chosen),
            *filter(None, [told]),
            *page.palette(chosen).shortage(page.count),
        ),
    )


def _art_page(given: EscherTile, settings: ArtSettings) -> tuple[Page, str]:
    """Return the page that is painted, and what the user should know of it."""
    (width, height), size = settings.page, tiling_size(given.tiling)
    area = abs(given.tile.signed_area) / len(given.figures)
    scale = float(np.sqrt(width * height / USUAL_TILES / area))
    if settings.tile_size is not None:
        scale = settings.tile_size / size
    if settings.repeat is not None:
        return repeating_page(given, settings, scale)
    whole = None if settings.clip else edge_margin(scale * size)
    page = Page.placed(
        given.tiling, settings, scale, y_down=given.y_down, whole=whole, centred=settings.clip
    )
    if not len(page.copies):
        raise OrbiflowError(
            f"no tile is whole on a page of {width * settings.pixels:.0f} x "
            f"{height * settings.pixels:.0f} pixels; choose a larger area or smaller tiles"
        )
    return page, ""


def render_artwork(art: Artwork, *, cancel: Cancel | None = None) -> np.ndarray:
    """Render the picture (height, width, 3) in 8 bits, antialiased."""
    chosen, samples = palette(art.settings.palette), art.settings.samples
    shaded = art.page.palette(chosen)
    painted = [
        PaintedPrototile(
            paint.grid, paint.coloured(shaded, art.page.count, art.tint), art.place(number)
        )
        for number, paint in enumerate(map(partial(paint_of, art), range(len(art.motifs))))
    ]
    return render_page(
        art.page, art.settings.pixels, painted, chosen.paper, samples=samples, cancel=cancel
    )


def paint_of(art: Artwork, number: int) -> Paint:
    """Paint the raster of one of the tile's figures with all that is on it."""
    figure, motif, density = (
        art.tile.figures[number].figure,
        art.motifs[number],
        art.density(number),
    )
    polygon = figure.tile.polygon
    paint = figure_paint(art.pictures[number], motif, figure, density, art.page.count)
    if art.outline > 0:
        # half of its width inside
        colour, width = palette(art.settings.palette).outline, art.outline / art.place(number).scale
        line = PathPart((Curve.polyline(polygon, closed=True),), Style(None, colour, width))
        paint_motif(paint, Motif((line,)))
    return paint


def art_scene(art: Artwork) -> Scene:
    """Return the page in millimetres, as `render_artwork` draws it, with pixels carried already."""
    page, chosen = art.page, palette(art.settings.palette)
    motifs: list[Motif] = []
    for number, (part, picture, own) in enumerate(
        zip(art.tile.figures, art.pictures, art.motifs, strict=True)
    ):
        rasters = ()
        if picture is not None:
            rasters = (carried_raster(picture, part.figure, art.density(number), page.count),)
        motifs.append(Motif(own.parts, rasters).moved(*art.place(number)))
    name = art.tile.isohedral_class or "a tile"
    return page.scene(
        chosen,
        Style(None, chosen.outline, art.outline),
        clipped=True,
        seam=SEAM / art.settings.pixels,
        motifs=motifs,
        tint=art.tint,
        title=art.tile.name,
        notes=(f"Artwork of {name}, made with orbiflow {__version__}.",),
    )


def art_file(art: Artwork, format: str, *, cancel: Cancel | None = None) -> bytes | str:
    """Return the content of a file in a format, svg, pdf, or png for pixels."""
    if format != "png":
        return (write_svg if format == "svg" else write_pdf)(art_scene(art))
    return png_of(render_artwork(art, cancel=cancel), art.settings.dpi)


def png_of(pixels: np.ndarray, dpi: float) -> bytes:
    """Return pixels (height, width, 3) as a PNG that gives their resolution."""
    return png_bytes(Image.fromarray(pixels), dpi=(dpi, dpi), compress_level=5)


class PaintedPrototile(NamedTuple):
    """The raster of one prototile in all colours."""

    grid: Grid
    colours: Array  # (colours, height, width, 3), as `Paint.coloured` returns it
    place: Place  # where its units lie on the page


def render_page(
    page: Page,
    pixels: float,
    painted: Sequence[PaintedPrototile],
    paper: str,
    *,
    samples: int,
    cancel: Cancel | None = None,
) -> np.ndarray:
    """Return the picture of a page (height, width, 3) in 8 bits, with so many `pixels` in a mm.

    Every sample belongs to exactly one copy of a prototile, and has its colour in what is `painted` of
    it. A pixel within a copy is one sample, and one that copies share is the mean of `samples` x
    `samples`.
    """
    cancel = cancel or Cancel()
    every, shown = _with_hidden(page)
    look = _lookup(every, pixels * samples, painted, paper)
    rings = _as_one(every.rings()) * (pixels * samples)
    page_width, page_height = (round(side * pixels) for side in page.size)
    low, high = rings[..., 1].min(axis=1), rings[..., 1].max(axis=1)
    step = max(1, BAND // (page_width * samples * samples))

    def band(top: int, _tell: Tell) -> np.ndarray:
        cancel.check()
        rows = min(step, page_height - top)
        first = top * samples
        near = np.flatnonzero((high > first) & (low < first + rows * samples))
        found = runs(ring_sides(rings[near]), first, rows * samples, page_width * samples)
        unpainted = (found.label < 0) | ~shown[near[found.label]]
        named = np.where(unpainted, NOWHERE, near[found.label]).astype(np.int32)
        labels = found.spread(named).reshape(rows, samples, page_width, samples)
        middle = labels[:, samples // 2, :, samples // 2]
        parts = itertools.product(range(samples), range(samples))
        differ = (labels[:, i, :, j] != middle for i, j in parts)
        shared = np.nonzero(functools.reduce(np.logical_or, differ))
        x, y = (samples * (np.arange(side) + 0.5) for side in (page_width, rows))
        colours = look(middle, x, y[:, None] + first)
        within = np.arange(samples) + 0.5
        x, y = (samples * own[:, None, None] for own in shared[::-1])
        finer = look(labels.swapaxes(1, 2)[shared], x + within, y + within[:, None] + first)
        colours[shared] = finer.mean(axis=(1, 2))
        return (colours * 255 + 0.5).clip(0, 255).astype(np.uint8)

    with SideBySide() as beside:
        bands = [beside.begin(functools.partial(band, top)) for top in range(0, page_height, step)]
        return np.concatenate([finished() for finished in bands])


def _with_hidden(page: Page) -> tuple[Page, NDArray[np.bool_]]:
    """Return the page with all copies that meet it, which leave no gap, and which of them it shows."""
    every = replace(page, whole=None)
    shown, keys = (
        list(zip(own.aspects.tolist(), *own.cells.T.tolist(), strict=True))
        for own in (page.copies, every.copies)
    )
    known = set(shown)
    return every, np.array([key in known for key in keys])


def _as_one(rings: Sequence[Array]) -> Array:
    """Return rings (N, 2) as one array (M, N, 2): the last vertex of shorter ones is repeated."""
    most = max(map(len, rings))
    return np.stack([np.pad(ring, ((0, most - len(ring)), (0, 0)), mode="edge") for ring in rings])


def _lookup(
    page: Page, samples: float, painted: Sequence[PaintedPrototile], paper: str
) -> Callable[[Integers, Array, Array], Array]:
    """Return a function for colours (..., 3) in copies of the tile, by their number, at x and y."""
    copies, width = page.copies, max(own.colours.shape[2] for own in painted)
    # all colours of all prototiles in one tall raster, and a strip of paper under them
    strip = np.broadcast_to(rgb_of(paper).astype(np.float32), (8, width, 3))
    tall = list[Array]()
    # from samples to texels: linear @ sample + offset, one a copy
    to_page = page.stretch @ copies.group.linear_parts[copies.cosets] * samples
    linears, offsets, top = np.zeros((len(copies) + 1, 2, 2)), np.zeros((len(copies) + 1, 2)), 0
    for number, (grid, colours, place) in enumerate(painted):
        count, height, wide = colours.shape[:3]
        mine = np.flatnonzero(copies.prototiles == number)
        inverse = np.linalg.inv(to_page[mine] @ place.linear)
        shift = to_page[mine] @ place.offset
        shift += samples * copies.translations[mine] @ page.stretch.T
        start = -np.einsum("mij,mj->mi", inverse, shift) - grid.corner
        start *= grid.density
        start[:, 1] += page.colours[mine] * height + top
        linears[mine], offsets[mine] = inverse * grid.density, start
        own = colours.reshape(count * height, wide, 3)
        tall.append(np.pad(own, ((0, 0), (0, width - wide), (0, 0))))
        top += count * height
    offsets[-1] = width / 2, top + 4.0  # nowhere, the last: the middle of the strip
    raster = np.ascontiguousarray(np.concatenate([*tall, strip]), dtype=np.float32)
    maps = np.concatenate([linears.reshape(-1, 4), offsets], axis=1).astype(np.float32).T.copy()

    def look(labels: Integers, x: Array, y: Array) -> Array:
        a, b, c, d, right, below = (part.take(labels) for part in maps)
        x, y = x.astype(np.float32), y.astype(np.float32)
        places = np.stack([a * x + b * y + right, c * x + d * y + below], axis=-1)
        return bilinear(raster, places.reshape(-1, 2)).reshape(*labels.shape, 3)

    return look
