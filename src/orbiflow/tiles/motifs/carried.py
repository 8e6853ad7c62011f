"""What every copy of a tile carries: a picture of pixels, or a drawing in curves from an SVG file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy
import shapely
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.drawing import Palette
from orbiflow.errors import InputFileError, OrbiflowError, SettingError
from orbiflow.settings import as_path
from orbiflow.tiles import search
from orbiflow.tiles.motifs.artwork import TooManyPoints, read_parts, whole_picture
from orbiflow.tiles.motifs.engraving import engraved, eye
from orbiflow.tiles.motifs.settings import MotifSettings
from orbiflow.tiles.page import Motif, Pixels, Warped, inside_ring
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.silhouette import (
    Covered,
    Drawing,
    FileContent,
    Frame,
    Target,
    content_of,
    open_image,
)
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tile_map import TileMap


def with_map(source: TileSource, target: Target | None = None) -> EscherTile:
    """Return a tile with a map from its silhouette, or with the reason why there is none.

    The map is the one that the search saved. Where there is none, as after a search for overlap,
    the outlines of the silhouette and of the tile over it are matched: that of the search's
    `target`, for a tile in memory, or the silhouette that a tile out of a file names, read again.

    Raises:
        OrbiflowError: If `source` holds no tile.
        InputFileError: As `read_result`, and if a model belongs to another tile.
    """
    tile = as_tile(source)
    if len(tile.figures) > 1:
        return tile.with_figures(with_map)
    if tile.no_map or (tile.bending is not None and tile.frame is not None):
        return tile
    frame, bending, stored = tile.frame, None, tile.map or TileMap()
    said: dict[str, Any] = {}
    try:
        if tile.rank is not None and tile.silhouette is not None:  # out of a file
            target = _silhouette(tile.silhouette)
        if target is None:
            raise OrbiflowError(
                "there is no map of the silhouette; give the search's target as well"
            )
        frame = target.frame
        bending = search.matched(target.normal, frame.to_normal(tile.tile.polygon))
        note = "the search left no map of the silhouette; its outline was matched with the tile's"
        said["notes"] = (*tile.notes, note)
    except OrbiflowError as error:
        said["no_map"] = str(error)
    if frame is None:
        size = np.sqrt(abs(tile.tile.signed_area))
        frame = Frame.upright(size, y_down=tile.y_down)
    return tile.changed(map_source=TileMap(stored.settings, stored.arrays, frame, bending), **said)


def _silhouette(stored: dict[str, Any]) -> Target:
    """Return the silhouette of a run, read again, unless it is missing or has changed."""
    source = Path(str(stored["source"]))
    if not source.is_file():
        raise InputFileError(
            f"the run saved no map, and its silhouette {source} is not there; run from the folder "
            "that the search ran in, or search again"
        )
    target = Target.read(source)
    # it may have been read with another threshold, or edited since
    area = stored.get("area")
    same = isinstance(area, int | float) and np.isclose(target.area, area)
    if not same or len(target.outline) != stored.get("vertices"):
        raise InputFileError(
            f"the run saved no map, and {source} is not the silhouette that it was; search again"
        )
    return target


# Width in pixels of the strip inside the outline that its background may have mixed with
FRINGE = 1.5
# Distance in pixels from what the fringe leaves beyond which pixels are kept: thin limbs
THIN = 4.0


@dataclass(frozen=True, eq=False)
class CarriedPicture:
    """A picture of the silhouette."""

    image: Image.Image  # the image: RGBA, straight, 8 bits
    covered: Covered  # the rectangle that it covers in the silhouette's coordinates
    notes: tuple[str, ...] = ()  # what was decided for the user

    def reduced(self, pixel: float) -> CarriedPicture:
        """Return the picture averaged to pixels no smaller than `pixel` in the silhouette's units."""
        area = (self.covered.high - self.covered.low).prod()
        share = float(np.sqrt(area / (self.image.width * self.image.height))) / pixel
        if share >= 0.9:
            return self
        size = [max(1, round(side * share)) for side in self.image.size]
        # averaged with their opacity, for transparent pixels have no colour
        premultiplied = self.image.convert("RGBa")
        small = premultiplied.resize((size[0], size[1]), Image.Resampling.BOX, reducing_gap=3.0)
        return CarriedPicture(small.convert("RGBA"), self.covered, self.notes)


def read_picture(path: FileContent, tile: EscherTile) -> CarriedPicture:
    """Read a picture of a tile's silhouette from a file; it must have the silhouette's aspect."""
    image, notes = open_image(path)
    image, covered = image.convert("RGBA"), tile.covered
    covered.require_aspect(path, "picture", image.size)
    wide, high = covered.high - covered.low
    width, height = image.size
    if (width, height) != (round(wide), round(high)):
        notes.append(
            f"laid the picture ({width} x {height} pixels) over {covered.name} "
            f"({wide:.6g} x {high:.6g})"
        )
    return CarriedPicture(image, covered, tuple(notes))


def carried_picture(picture: CarriedPicture, tile: EscherTile, density: float) -> Warped:
    """Return a picture on a tile, in its units, of about `density` pixels along one.

    Its colours extend a little beyond the outline.
    """
    small = picture.reduced(1 / density)
    bending, frame = tile.require_map()
    images, rest = frame.to_input(bending.images), frame.to_input(bending.rest)
    outline, size = small.covered.shares(tile.silhouette_outline), small.image.size
    pixels = _spread(np.asarray(small.image), outline * size)
    return Warped(pixels, small.covered.shares(rest) * size, images, bending.triangles)


def _spread(colours: Pixels, outline: Array) -> Pixels:
    """Extend the colours just inside an outline, in pixels, to all outside it.

    So neither the background of a cut-out shows nor the outline's pixels that it mixed with.
    """
    inside = inside_ring(outline, *colours.shape[:2])
    # beyond the picture is outside, too
    depth = np.asarray(scipy.ndimage.distance_transform_edt(np.pad(inside, 1)))[1:-1, 1:-1]
    kept = depth > FRINGE
    if kept.any():
        kept |= (depth > 1) & (np.asarray(scipy.ndimage.distance_transform_edt(~kept)) > THIN)
    else:
        kept = inside
    if not kept.any():
        return colours
    rows, columns = np.asarray(
        scipy.ndimage.distance_transform_edt(~kept, return_distances=False, return_indices=True)
    )
    return colours[rows, columns]


# Greatest distance of flattened curves from the drawing's, in sizes of the silhouette
FLATNESS = 1 / 4000
# Longest straight piece that is carried, in sizes of the silhouette: lines bend with the tile
LONGEST = 1 / 150
# Widest strokes that stay lines, in sizes of the silhouette: a wider one is an area, which bends with
# the tile and fills it as the drawing did. A machine is to follow a line where a picture has an area
WIDEST_LINE, WIDEST_FOLLOWED = 1 / 150, 1 / 40
MOST_CARRIED = 400_000  # greatest number of points that are carried in all


class _Carry:
    """The map from a drawing to the tile, point by point."""

    def __init__(self, drawing: Drawing, tile: EscherTile, widest: float) -> None:
        self.tile, self.box, self.count = tile, drawing.box, 0
        self.size, self.scale = float(np.sqrt(abs(tile.tile.signed_area))), 1.0
        if self.box is not None:
            covered, extent = tile.covered, np.subtract(self.box[2:], self.box[:2])
            covered.require_aspect(drawing.path, "drawing", extent.tolist())
            self.scale = float(np.sqrt(np.prod((covered.high - covered.low) / extent)))
        self.tolerance = FLATNESS * self.size / self.scale
        self.widest = widest * self.size / self.scale

    def __call__(self, points: Array, *, closed: bool) -> Array:
        here = points
        if self.box is not None:
            low, high = self.box[:2], self.box[2:]
            here = self.tile.covered.at((points - low) / np.subtract(high, low))
        line = shapely.LinearRing(here) if closed else shapely.LineString(here)
        # before any point is made
        if line.length / (LONGEST * self.size) > MOST_CARRIED:
            raise TooManyPoints
        fine = shapely.get_coordinates(shapely.segmentize(line, LONGEST * self.size))
        self.count += len(fine)
        if self.count > MOST_CARRIED:
            raise TooManyPoints
        return self.tile.forward(fine[:-1] if closed else fine)


class Over(NamedTuple):
    """What lies over the silhouette, a picture or a drawing; and what was decided for the user."""

    picture: CarriedPicture | None = None
    drawing: Motif | None = None
    notes: tuple[str, ...] = ()


def read_over(path: str | Path, tile: EscherTile, *, followed: bool = False) -> Over:
    """Read the picture or drawing in a file, whichever its content is, over a tile with a map.

    In a drawing whose lines are to be `followed` by a machine, more strokes stay lines.
    """
    tile.require_map()
    content = content_of(as_path(path, "the picture's file"))
    head = content.data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if head.startswith(b"<") or (content.suffix.lower() == ".svg" and b"\0" not in head[:64]):
        return _read_drawing(content, tile, WIDEST_FOLLOWED if followed else WIDEST_LINE)
    picture = read_picture(content, tile)
    return Over(picture, None, picture.notes)


def _read_drawing(path: FileContent, tile: EscherTile, widest: float) -> Over:
    """Read an SVG file over a tile: its fills and strokes as curves, or else its page as pixels.

    Strokes wider than `widest`, in sizes of the silhouette, are carried as areas.
    """
    drawing = Drawing(path)
    carry = _Carry(drawing, tile, widest)
    parts, notes = read_parts(drawing, carry), drawing.notes()
    if parts:
        return Over(None, Motif(tuple(parts)), tuple(notes))
    bounds = drawing.box or (0.0, 0.0, 100.0, 100.0)
    if not drawing.pixels(bounds, (300, 300))[..., 3].any():
        raise InputFileError(f"{path}: draws nothing that is filled or stroked")
    if drawing.box is None:
        raise InputFileError(
            f"{path}: a drawing of more than fills and strokes needs a page, a viewBox as the "
            "silhouette has it"
        )
    picture = whole_picture(drawing)
    notes.append(
        f"carried the drawing as a picture of {picture.width} x {picture.height} pixels: it is more "
        "than fills and strokes"
    )
    return Over(CarriedPicture(picture, tile.covered, tuple(notes)), None, tuple(notes))


def require_figures(tile: EscherTile, settings: MotifSettings, pictures: int) -> None:
    """Check that a tile has figures for all that is to be drawn on them.

    Raises:
        SettingError: If something is for a second figure, and there is none.
    """
    extra = {"second_picture": pictures > 1, "second_eyes": bool(settings.second_eyes)}
    for name in (name for name, present in extra.items() if present and len(tile.figures) == 1):
        raise SettingError(f"{{{name}}} applies only to a tile of two figures; leave it out")


def read_overs(
    paths: Sequence[str | Path | None], tile: EscherTile, *, followed: bool = False
) -> list[Over]:
    """Read what lies over the silhouette of each of a tile's figures, from no file for some."""
    figures = zip_longest(paths[: len(tile.figures)], tile.figures)
    return [
        Over() if path is None else read_over(path, part.figure, followed=followed)
        for path, part in figures
    ]


def drawn_motif(
    tile: EscherTile,
    settings: MotifSettings,
    palette: Palette,
    drawing: Motif | None = None,
    *,
    hairlines: bool = False,
) -> Motif:
    """Return what is drawn on a tile, in its units: a drawing, engraved lines, then eyes.

    Engraved lines are regions that swell and taper, or `hairlines` along their middle.
    """
    if drawing is not None or settings.eyes:
        tile.require_map()
    parts = () if drawing is None else drawing.parts
    around = [eye(tile, spot, palette) for spot in settings.eyes]
    if settings.strokes is not None:
        parts += engraved(tile, settings.strokes, around, hairlines=hairlines)
    return Motif(parts + tuple(part for motif in around for part in motif.parts))
