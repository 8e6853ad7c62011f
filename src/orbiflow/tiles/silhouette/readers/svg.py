"""SVG drawings: the outline of the largest shape that is seen, in the drawing's own user units."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import numpy as np
import shapely
from shapely.errors import GEOSException
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Window
from orbiflow.drawing import rgb
from orbiflow.errors import InputFileError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import (
    MAX_VERTICES,
    clean_ring,
    filled,
    outer_outline,
    outer_ring,
    percent,
    simplified,
)
from orbiflow.tiles.silhouette.readers.reading import Reading, Source
from orbiflow.tiles.silhouette.readers.svg_colours import Brush
from orbiflow.tiles.silhouette.readers.svg_drawing import Drawing
from orbiflow.tiles.silhouette.readers.svg_paths import MAX_POINTS, TooManyPoints, TooTangled
from orbiflow.tiles.silhouette.readers.svg_regions import FAINT, Layer, Regions, painted

# Flattening error, of the size of each shape, and its floor, of the size of the drawing.
FLATNESS = 1 / 2000
FLATNESS_FLOOR = 1 / 20_000
OVERLAY_GRID = 1e-9  # of the size of the drawing: the grid that the united outline is snapped to
OVERLAY_GRID_FLOOR = 1e-12  # of the largest coordinate
# of the size of the drawing: vertices nearer their chord than this are dropped
COLLINEAR_TOLERANCE = 1e-6
PAPER = "#ffffff"  # what a drawing without a background lies on
SAME_COLOUR = 10  # of 255: colours whose channels differ by no more are one
COVERING = 0.9  # opacity: more hides what lies below
MOSTLY, NOTEWORTHY, OVER = 0.5, 0.001, 0.1  # shares of areas
PLAIN = Brush("#000000", 1.0)


def read_svg(path: Source) -> Reading:
    """Read the outline of the silhouette in an SVG drawing, in user units of the viewBox, with y down.

    What is seen counts: fills, strokes and markers, cut by clips and masks, one painted over the other.
    What has the background's colour hides what lies below. The largest component is kept and its holes
    are filled. Where nothing is painted, all paths count as filled.
    """
    drawing = Drawing(path)
    size = _size(drawing)
    try:
        seen, notes = _seen(drawing, size)
    except TooManyPoints as exc:
        raise InputFileError(
            f"{path}: the paths come to more than {MAX_POINTS} points; simplify them"
        ) from exc
    except TooTangled as exc:
        raise InputFileError(
            f"{path}: a path crosses itself too often to be filled or stroked; simplify it"
        ) from exc
    except GEOSException as exc:
        raise InputFileError(
            f"{path}: the shapes cannot be united ({exc}); unite them in the drawing program"
        ) from exc
    if not seen.area > 0:
        raise InputFileError(f"{path}: the drawing encloses no area that shows at its size")
    shape, kept = outer_outline(seen)
    outline, cleaned = clean_ring(_thinned(shape, size), str(path), InputFileError)
    box = drawing.box
    notes = (*notes, *drawing.left_out(), *kept, *cleaned)
    if box is None:
        return Reading(outline, True, "svg", None, notes, seen=seen)
    return Reading(outline, True, "svg", (box[2] - box[0], box[3] - box[1]), notes, box[:2], seen)


def _size(drawing: Drawing) -> float:
    """Return the longer side of what paths span on the page."""
    reach = [path.reach() for shape in drawing.shapes for path in shape.paths]
    if not reach:
        return 0.0
    points = np.concatenate(reach)
    if drawing.window is not None:
        points = points.clip(drawing.window[:2], drawing.window[2:])
    return float(np.ptp(points, axis=0).max())


def _seen(drawing: Drawing, size: float) -> tuple[BaseGeometry, list[str]]:
    """Return the region that is seen as shape, and notes of what was decided."""

    least = size * FLATNESS_FLOOR

    def tolerance(reach: Array) -> float:
        return max(float(np.ptp(reach, axis=0).max()) * FLATNESS, least)

    regions = Regions(drawing, tolerance, MAX_POINTS, drawing.window)
    layers = [regions.layers(shape) for shape in drawing.shapes]
    notes: list[str] = []
    if not any(layers):
        if regions.beyond > 0:
            raise InputFileError(
                f"{drawing.path}: nothing lies on the page {_numbers(drawing.box)} (the viewBox, or "
                "width and height); fit the page to the drawing"
            )
        fills = [regions.shown(shape, regions.fill(shape)) for shape in drawing.shapes]
        layers = [[Layer(region, PLAIN)] for region in fills if region.area > 0]
        notes = ["nothing is painted: took the closed paths as filled"]
    paper, grounds = _background(layers, drawing)
    shown = [layer for own in layers if own not in grounds for layer in own]
    if not shown:
        raise InputFileError(f"{drawing.path}: {_why_empty(drawing)}")
    n = len(grounds)
    noun = "a background rectangle" if n == 1 else f"{n} background rectangles"
    notes += [f"left out {noun} that cover{'s' * (n == 1)} the whole drawing"] * (n > 0)
    seen, decided = _overlay(shown, paper)
    cut = regions.beyond / (regions.beyond + sum(layer.region.area for layer in shown))
    if cut > NOTEWORTHY:
        notes.append(f"left out what lies beyond the page: {percent(cut)} of what is painted")
    return seen, notes + decided


def _numbers(box: Window | None) -> str:
    return " ".join(f"{value:g}" for value in box or ())


def _background(
    layers: list[list[Layer]], drawing: Drawing
) -> tuple[str | None, list[list[Layer]]]:
    """Return the background's colour, if it is painted, and the rectangles that are no more than it."""
    every = [layer.region for own in layers for layer in own]
    xmin, ymin, xmax, ymax = drawing.box or shapely.total_bounds(every)
    page = shapely.box(xmin, ymin, xmax, ymax)

    def covers(own: list[Layer]) -> bool:  # but for 0.1% of the page
        region = own[0].region
        if region.envelope.intersection(page).area < 0.999 * page.area:
            return False
        solid = sum(filled(part).area for part in polygons_in(region))
        return solid >= 0.999 * region.envelope.area

    shown = [own for own in layers if own]
    grounds = [own for own in shown if covers(own)]
    if len(grounds) == len(shown) and not drawing.others.keys() & {"image", "text"}:
        return drawing.ground, []
    full = [own[0] for own in grounds if own[0].region.area >= 0.999 * page.area]  # no frames
    return full[-1].brush.colour if full else drawing.ground, grounds


def _overlay(layers: list[Layer], ground: str | None) -> tuple[BaseGeometry, list[str]]:
    """Return the region that is seen of layers on a ground, and notes."""
    paper = ground or PAPER
    # Snapped to a grid: neighbours that all but share an edge would leave cracks between them.
    bounds = shapely.total_bounds([layer.region for layer in layers])
    size = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    grid = max(OVERLAY_GRID * size, OVERLAY_GRID_FLOOR * float(np.abs(bounds).max()))
    opaque = [layer for layer in layers if layer.brush.opacity >= FAINT]
    n = len(layers) - len(opaque)
    if not opaque:
        return painted(layers, [1] * n, grid), ["took faint shapes, as there are no others"]
    notes = [f"left out {n} faint shape{'s' * (n > 1)}"] * (n > 0)
    pale = [_alike(layer.brush.colour, paper) for layer in opaque]
    signs = [
        1 if not own else -1 if layer.brush.opacity >= COVERING else 0
        for layer, own in zip(opaque, pale, strict=True)
    ]
    seen = painted(opaque, signs, grid)
    if not any(pale):
        return seen, notes
    # what has the paper's colour and lies on the bare paper may be the shape itself
    every = painted(opaque, [_sign(opaque, k, pale) for k in range(len(opaque))], grid)
    hidden = 1 - _solid(seen) / (_solid(every) or 1.0)
    if not seen.area > 0 or (ground is None and hidden > MOSTLY):
        return every, [*notes, f"took shapes in {paper} too: they are most of the drawing"]
    dark = painted(opaque, [int(not own) for own in pale], grid)
    bitten = 1 - _solid(seen) / _solid(dark)
    if bitten > NOTEWORTHY:
        notes.append(
            f"took shapes in {paper} for background, which hide {percent(bitten)} of the others; "
            "give them another colour if they belong to the shape"
        )
    return seen, notes


def _sign(layers: list[Layer], k: int, pale: list[bool]) -> int:
    """Return -1 for a pale layer that lies over darker ones for a good part, else 1."""
    below = [layer.region for layer, own in zip(layers[:k], pale, strict=False) if not own]
    over = shapely.area(shapely.intersection(below, layers[k].region)).sum() if pale[k] else 0.0
    return -1 if over > OVER * layers[k].region.area else 1


def _alike(colour: str, other: str) -> bool:
    both = (rgb(c if c[0] == "#" else PLAIN.colour) for c in (colour, other))
    return max(abs(a - b) for a, b in zip(*both, strict=True)) <= SAME_COLOUR


def _solid(region: BaseGeometry) -> float:
    return outer_outline(region)[0].area if region.area > 0 else 0.0


def _thinned(shape: shapely.Polygon, size: float) -> Array:
    tolerance = COLLINEAR_TOLERANCE * size
    thin = simplified(shape, tolerance)
    while len(thin.exterior.coords) > MAX_VERTICES:
        tolerance *= 2
        thin = simplified(shape, tolerance)
    return outer_ring(thin if thin.is_valid else shape)


def _why_empty(drawing: Drawing) -> str:
    images, texts = drawing.others.get("image", 0), drawing.others.get("text", 0)
    if images or texts:
        parts = [f"{images} embedded image(s)"] * bool(images) + [f"{texts} text(s)"] * bool(texts)
        advice = "trace the image or give it as PNG" if images else "convert the text to paths"
        return f"no closed path: it holds only {' and '.join(parts)}; {advice}"
    return "no closed path: the drawing has no shape that encloses an area"
