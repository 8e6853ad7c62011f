"""What was drawn on a tile in the browser, as exports take it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.drawing import draw_line, png_bytes, rgb
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import is_list, is_object, write_atomic
from orbiflow.settings import as_array, as_number
from orbiflow.tiles import EscherTile, TileMap, open_image

MAX_STROKES, MAX_POINTS, MAX_EYES = 2000, 100_000, 60
MAX_RINGS = 200  # around one part that is filled
SUPERSAMPLING = 2  # pixels, across, of which one pixel of a picture with lines is the mean
COLOUR = re.compile(r"#[0-9a-fA-F]{6}")


class Stroke(NamedTuple):
    """A line with its width and points (N, 2), in the silhouette's coordinates, or a filled part.

    A part has the `rings` (N, 2) around it, of which some are holes.
    """

    colour: str
    width: float
    points: Array
    rings: tuple[Array, ...] = ()


def with_any_map(tile: EscherTile) -> EscherTile:
    """Return a tile that can be drawn on: one figure without a map is its own silhouette."""
    if len(tile.figures) > 1 or (tile.bending is not None and tile.frame is not None):
        return tile
    still = TileMap.still(tile.tile.polygon, y_down=tile.y_down)
    return tile.changed(map_source=still, no_map="")


def drawing_settings(
    drawing: Any, tile: EscherTile, folder: Path, picture: Path | None = None, name: str = "drawing"
) -> dict[str, Any]:
    """Write the lines of a drawing into a folder as exports take them; return `picture` and `eyes`.

    Args:
        drawing: `strokes`, each with `colour`, `width` and `points`, and `eyes` (x, y, radius), in the
            coordinates of the silhouette, or of a tile that has none.
        tile: The tile, as `with_any_map` returns it, or one of its figures.
        folder: The folder for the file, which is written only if there are lines.
        picture: The artwork that is carried as well, so that the lines are drawn over it.
        name: The name of the file, without its ending.

    Raises `OrbiflowError` for a drawing that is none, or too large.
    """
    strokes, eyes = read_drawing(drawing)
    ring = shapely.Polygon(tile.silhouette_outline)
    if strokes:
        file = folder / f"{name}.{'svg' if picture is None else 'png'}"
        made = drawing_svg(strokes, tile) if picture is None else _png(strokes, tile, picture)
        picture = write_atomic(file, made)
    # none but by rounding is outside
    return {
        "picture": picture,
        "eyes": tuple(e for e in eyes if ring.contains(shapely.Point(e[:2]))),
    }


def read_drawing(drawing: Any) -> tuple[list[Stroke], tuple[tuple[float, ...], ...]]:
    """Return the lines and eyes of a drawing from a browser, checked."""
    parts = drawing if is_object(drawing) else {}
    strokes, eyes = parts.get("strokes", []), parts.get("eyes", [])
    if not is_list(strokes) or not is_list(eyes):
        raise OrbiflowError("a drawing has a list of strokes and a list of eyes")
    lines = [_stroke(stroke) for stroke in strokes[: MAX_STROKES + 1]]
    count = sum(len(stroke.points) + sum(map(len, stroke.rings)) for stroke in lines)
    if len(lines) > MAX_STROKES or count > MAX_POINTS or len(eyes) > MAX_EYES:
        raise OrbiflowError(
            f"the drawing is too large: it may have {MAX_STROKES} lines with {MAX_POINTS} points in "
            f"all, and {MAX_EYES} eyes; rub some out"
        )
    return lines, tuple(tuple(as_array(eye, "an eye", (3,)).tolist()) for eye in eyes)


def _stroke(entry: Any) -> Stroke:
    stroke = entry if is_object(entry) else {}
    colour, points = str(stroke.get("colour")), stroke.get("points")
    if not COLOUR.fullmatch(colour):
        raise OrbiflowError(f"the colour of a line must be like #2a9d8f, got {colour!a:.40}")
    width = as_number(stroke.get("width"), "the width of a line", 0)
    rings = stroke.get("rings") or []
    if not is_list(rings) or len(rings) > MAX_RINGS:
        raise OrbiflowError(f"a part that is filled has a list of at most {MAX_RINGS} rings")
    around = tuple(as_array(ring, "a ring of what is filled", ("N", 2)) for ring in rings)
    return Stroke(colour, width, as_array(points, "the points of a line", ("N", 2)), around)


def drawing_svg(strokes: list[Stroke], tile: EscherTile) -> str:
    """Return the lines as an SVG that covers what the silhouette's picture covers."""
    covered = tile.covered
    wide, tall = size = covered.high - covered.low
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.9g} {tall:.9g}">']
    for stroke in strokes:
        if stroke.rings:
            path = "".join(f"M{_path(covered.shares(ring) * size)}Z" for ring in stroke.rings)
            parts.append(f'<path d="{path}" fill="{stroke.colour}" fill-rule="evenodd"/>')
            continue
        points = covered.shares(stroke.points) * size
        ends = points if len(points) > 1 else np.stack([points[0], points[0] + 1e-3])
        parts.append(
            f'<path d="M{_path(ends)}" fill="none" stroke="{stroke.colour}" '
            f'stroke-width="{stroke.width:.6g}" stroke-linecap="round" stroke-linejoin="round" '
            'vector-effect="non-scaling-stroke"/>'
        )
    return "\n".join([*parts, "</svg>\n"])


def _path(points: Array) -> str:
    return "L".join(f"{x:.6g} {y:.6g}" for x, y in points.tolist())


def _png(strokes: list[Stroke], tile: EscherTile, picture: Path) -> bytes:
    """Return a picture with the lines drawn over it."""
    from PIL import Image, ImageChops, ImageDraw

    image = open_image(picture)[0].convert("RGBA")
    layer = Image.new("RGBA", (SUPERSAMPLING * image.width, SUPERSAMPLING * image.height))
    covered, pen = tile.covered, ImageDraw.Draw(layer)
    scale = layer.width / float(covered.high[0] - covered.low[0])
    for stroke in strokes:
        if stroke.rings:
            inside = Image.new("1", layer.size)
            for ring in stroke.rings:
                places = (covered.shares(ring) * layer.size).ravel().tolist()
                area = Image.new("1", layer.size)
                ImageDraw.Draw(area).polygon(places, fill=1)
                inside = ImageChops.logical_xor(inside, area)
            layer.paste((*rgb(stroke.colour), 255), mask=inside)
            continue
        points = covered.shares(stroke.points) * layer.size
        draw_line(pen, points, scale * stroke.width, (*rgb(stroke.colour), 255))
    image.alpha_composite(layer.resize(image.size))
    return png_bytes(image)
