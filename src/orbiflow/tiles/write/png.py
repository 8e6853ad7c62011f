"""A scene as pixels: drawn several times finer by Pillow, then averaged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo

from orbiflow.arrays import Array
from orbiflow.drawing import font, limited, png_bytes, rgb
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.page import (
    INK,
    MARGIN,
    Box,
    Grid,
    Layer,
    Motif,
    PathPart,
    Raster,
    Scene,
    Style,
    Uses,
    Warped,
    Words,
    bleed,
    covered,
    inside_ring,
)
from orbiflow.tiles.write.painting import (
    FLATNESS,
    INCH,
    OutlineStamps,
    PictureStamps,
    PixelShape,
    PixelSheet,
    Stamps,
    laid,
    painted,
    shape_of,
    shape_reach,
    with_page_pictures,
)

MOST_PIXELS = 100_000_000
"""Pixels of a page, at most."""

LONGEST_SIDE = 2**16 - 1
"""Pixels of a side, at most."""

GROUND = "#ffffff"
"""What a page's paper looks like where nothing is drawn."""

TEXELS_PER_PIXEL = 2.0
"""Pixels of what is painted once along a pixel of the page that it is copied to."""

PICTURE_COMPRESSION = 4
"""Level of compression of pictures of many colours: 7 % larger than at 6, in half the time."""

MOST_COLOURS = 32
"""Colours of a picture that is drawn with a palette, which is faster, at most."""


def write_png(scene: Scene, *, dpi: float = 300.0, small: bool = False) -> bytes:
    """Return the scene as a PNG that gives its resolution, so that it prints in real size.

    Lines are at least a pixel wide. If it is to be `small` and has few colours, it has a palette of
    them and steps between any two: a quarter of the size, and a few levels off where they meet.

    Raises:
        OrbiflowError: If the page would have too many pixels, or none.
    """
    width, height = (side * dpi / INCH for side in (scene.width, scene.height))
    if width * height > MOST_PIXELS or max(width, height) > LONGEST_SIDE:
        raise OrbiflowError(
            f"at {dpi:g} dots per inch the page has {width:.0f} x {height:.0f} pixels; "
            f"choose fewer dots or another format"
        )
    if min(width, height) < 1:
        raise OrbiflowError(f"at {dpi:g} dots per inch the page has no pixel; choose more dots")
    picture, colours = _drawn(scene, dpi / INCH)
    info = PngInfo()
    for key, text in (("Title", scene.title), ("Description", " ".join(scene.notes))):
        info.add_text(key, text)
    info.add_text("Software", "orbiflow")
    picture = limited(picture, colours) if small and colours else picture
    level = {} if colours else {"compress_level": PICTURE_COMPRESSION}
    return png_bytes(picture, dpi=(dpi, dpi), pnginfo=info, **level)


def scene_image(scene: Scene, pixels: float = 1.0) -> Image.Image:
    """Return the scene as a picture in RGB, with so many pixels in a mm."""
    return _drawn(scene, pixels)[0]


def _drawn(scene: Scene, pixels: float) -> tuple[Image.Image, list[str]]:
    """Return a scene as a picture, and its colours if they are few and all is opaque."""
    size = round(scene.width * pixels), round(scene.height * pixels)
    scene = with_page_pictures(scene, pixels)
    textures = Textures(scene, pixels)
    sheets = [_sheet(scene, layer, textures, size) for layer in scene.layers]
    colours = _few_colours(scene)
    items = [item for sheet in sheets for item in sheet.items]
    plain = all(isinstance(item, PixelShape | OutlineStamps) for item in items)
    picture = painted(sheets, size, ground=GROUND, colours=colours if plain else ())
    picture = picture.convert("RGB")
    pen = ImageDraw.Draw(picture)
    for words in (item for layer in scene.layers for item in layer.items):
        if isinstance(words, Words):
            at = pixels * words.place[0], pixels * words.place[1]
            anchor = "mm" if words.centred else "lm"
            pen.text(at, words.text, words.colour, font(pixels * words.size), anchor=anchor)
    return picture, colours


def _few_colours(scene: Scene) -> list[str]:
    """Return the colours of a scene without transparency and pictures, the ground's first; or none."""
    items = [item for layer in scene.layers for item in layer.items]
    parts = [item for item in items if isinstance(item, PathPart)]
    parts += [part for motif in scene.motifs.values() for part in motif.parts]
    pictures = [item for item in items if isinstance(item, Raster | Warped)]
    if pictures or any(motif.rasters for motif in scene.motifs.values()):
        return []
    if any(part.opacity < 1 for part in parts):
        return []
    styles = [drawn.style for drawn in (*scene.layers, *parts)]
    used = {colour: None for style in styles for colour in style[:2] if colour and colour != INK}
    inks = (layer.ink for layer in scene.layers if layer.ink)
    colours = list(dict.fromkeys([GROUND, *used, *inks]))
    return colours if len(colours) <= MOST_COLOURS else []


def _sheet(scene: Scene, layer: Layer, textures: Textures, size: tuple[int, int]) -> PixelSheet:
    """Return a layer of a scene in pixels."""
    window, scale = None, textures.scale
    if layer.clipped:
        left, top, right, bottom = (side * scale for side in scene.clip)
        if left > 0 or top > 0 or right < size[0] or bottom < size[1]:
            window = Box(left, top, right, bottom)
    return PixelSheet(tuple(_items(scene, layer, textures)), window)


def _items(
    scene: Scene, layer: Layer, textures: Textures
) -> Iterator[PixelShape | Raster | Stamps]:
    scale = textures.scale
    bigger = scale * np.eye(2), np.zeros(2)
    for item in layer.items:
        if isinstance(item, Words | Warped):
            continue  # words are written last, and pictures on meshes are one raster
        if isinstance(item, Raster):
            yield item.moved(*bigger)
        elif isinstance(item, PathPart):
            shape = shape_of(item.moved(*bigger), least_width=1.0)
            yield from _lines(shape) if not shape.rings and shape.opacity >= 1 else [shape]
        elif isinstance(item, Uses) and item.symbol in scene.motifs:
            yield textures.stamps(item, layer.ink)
        elif isinstance(item, Uses):
            ring = scene.symbols[item.symbol].flattened(FLATNESS / scale) * scale
            yield OutlineStamps(ring, _scaled(item, scale), _style(layer.style, scale))
        else:
            part = PathPart((item,), _style(layer.style, scale))
            yield shape_of(part.moved(*bigger)._replace(style=part.style))


def _scaled(uses: Uses, scale: float) -> Uses:
    return replace(uses, offsets=scale * uses.offsets)


def _style(style: Style, scale: float) -> Style:
    """Return the style of curves in pixels: lines are at least a pixel wide, seams need none."""
    width = style.width * scale
    if style.stroke is None or (style.fill == style.stroke and width < 1):
        return Style(style.fill)
    return style._replace(width=max(width, 1.0))


def _lines(shape: PixelShape) -> Iterator[PixelShape]:
    """Yield each line of a shape that is lines alone: most bands have few of many dashes."""
    for line in shape.lines:
        low, high = shape_reach([line], shape.style.width)
        yield shape._replace(lines=(line,), low=low, high=high)


class Textures:
    """What lies on the tiles of a scene, each painted once, at `scale` pixels a mm."""

    def __init__(self, scene: Scene, scale: float) -> None:
        self.scene, self.scale = scene, scale
        self._known: dict[tuple[Motif, str | None], Raster] = {}

    def stamps(self, uses: Uses, ink: str | None) -> PictureStamps:
        """Return the copies of a motif in pixels."""
        motif, scale, ring = self.scene.motifs[uses.symbol], self.scale, None
        if motif.within is not None:
            ring = self.scene.symbols[motif.within].flattened(FLATNESS / scale)
        colours = {colour for part in motif.parts for colour in part.style[:2] if colour}
        key = motif, ink if INK in colours else None
        if key not in self._known and colours == {INK} and not motif.rasters:
            other = next(
                (stamp for (drawn, _), stamp in self._known.items() if drawn is motif), None
            )
            if other is not None:  # the same in another ink
                pixels = other.pixels.copy()
                pixels[..., :3] = rgb(ink or "#000000")
                self._known[key] = other._replace(pixels=pixels)
        if key not in self._known:
            points = self._box(uses.symbol) if ring is None else ring
            how = {"ink": ink, "least_width": TEXELS_PER_PIXEL, "cut_off": ring is not None}
            drawn = texture(motif, points, TEXELS_PER_PIXEL * scale, **how)
            self._known[key] = drawn.moved(scale * np.eye(2), np.zeros(2))
        ring = None if ring is None else ring * scale
        return PictureStamps(self._known[key], _scaled(uses, scale), ring)

    def _box(self, symbol: str) -> Array:
        """Return two corners of the box around a motif, with the room that its lines need."""
        points = self.scene.points(symbol)
        widths = [part.style.width for part in self.scene.motifs[symbol].parts]
        room = max(widths, default=0.0) / 2 + 1 / self.scale
        return np.stack([points.min(axis=0) - room, points.max(axis=0) + room])


def texture(
    motif: Motif,
    points: Array,
    density: float,
    *,
    ink: str | None = None,
    least_width: float = 0.0,
    cut_off: bool = True,
) -> Raster:
    """Return what lies on a tile as one picture of pixels.

    Args:
        motif: What lies on it.
        points: Points (N, 2) around it.
        density: The picture's pixels along a unit.
        ink: The colour of what is drawn in ink. Default: black.
        least_width: The least width of lines in the picture's pixels.
        cut_off: Whether the points are an outline that cuts it off, beyond which its colours extend
            a little.
    """
    grid = Grid.over(points, density)
    size = grid.width, grid.height
    placed = motif.moved(grid.density * np.eye(2), -grid.density * grid.corner)
    picture = laid([raster for raster in placed.rasters if isinstance(raster, Warped)], size).pixels
    rasters = [raster for raster in placed.rasters if isinstance(raster, Raster)]
    if rasters or placed.parts:
        inked = [_inked(part, ink or "#000000") for part in placed.parts]
        shapes = [shape_of(part, least_width=least_width) for part in inked]
        image = Image.fromarray(picture, "RGBA")
        image.alpha_composite(painted([PixelSheet((*rasters, *shapes))], size))
        picture = np.array(image)
    if cut_off:
        ring = grid.texels(points)
        bleed(picture, inside_ring(ring, grid.height, grid.width), covered(ring, size, MARGIN - 1))
    return Raster(picture, np.eye(2) / grid.density, grid.corner)


def _inked(part: PathPart, ink: str) -> PathPart:
    fill, stroke = (ink if colour == INK else colour for colour in part.style[:2])
    return part._replace(style=part.style._replace(fill=fill, stroke=stroke))
