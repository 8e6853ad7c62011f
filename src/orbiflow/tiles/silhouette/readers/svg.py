"""SVG drawings: the outline of the largest shape that is seen, in the drawing's own user units."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Iterable
from itertools import chain

import numpy as np
import shapely
from shapely.errors import GEOSException
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import Advice, InputFileError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import (
    clean_ring,
    filled,
    outer_outline,
    outer_ring,
    percent,
    thinned,
)
from orbiflow.tiles.silhouette.readers.reading import Reading, Source
from orbiflow.tiles.silhouette.readers.svg_drawing import Drawing
from orbiflow.tiles.silhouette.readers.svg_overlays import (
    BLACK,
    MIN_NOTED_SHARE,
    PAPER_COLOUR,
    alike,
    overlay,
    solid,
    without_grid,
)
from orbiflow.tiles.silhouette.readers.svg_paths import MAX_POINTS, TooManyPoints, TooTangled
from orbiflow.tiles.silhouette.readers.svg_regions import MIN_VISIBLE_OPACITY, PaintedLayer, Regions

# Flattening error, of the size of each shape, and its floor, of the size of the drawing.
FLATNESS = 1 / 2000
FLATNESS_FLOOR = 1 / 20_000
# of the size of the drawing: vertices nearer their chord than this are dropped
COLLINEAR_TOLERANCE = 1e-6
WHOLE_SHARE, PAVED_SHARE = (
    0.999,
    0.95,
)  # shares of the page that a background covers: one shape, several
DISC_AREA_TOLERANCE = 0.01  # of its box: how nearly a disc has the area of one
MIN_DRAWN_SHARE = 0.25  # of a disc's sides: what is drawn on it
MIN_BADGE_SHARE = 0.5  # of a disc's width or height: more than an eye or a spot on it has
MIN_HOLE_SHARE = 0.1  # of what fills the page: what is cut out of it is larger
MAX_STRIPS = 500  # rectangles that a background is made of, as strips or a chequerboard


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
    outline, cleaned = clean_ring(
        outer_ring(thinned(shape, COLLINEAR_TOLERANCE * size)[0]), str(path), InputFileError
    )
    left, top, right, bottom = drawing.box or (0.0, 0.0, 0.0, 0.0)
    size = (right - left, bottom - top) if drawing.box else None
    notes = (*notes, *drawing.left_out(), *kept, *cleaned)
    return Reading(outline, True, "svg", size, notes, (left, top), seen)


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
            page = " ".join(f"{value:g}" for value in drawing.box or ())
            raise InputFileError(
                f"{drawing.path}: nothing lies on the page {page} (the viewBox, or width and "
                "height); fit the page to the drawing"
            )
        fills = [regions.shown(shape, regions.fill(shape)) for shape in drawing.shapes]
        layers = [[PaintedLayer(region, BLACK)] for region in fills if region.area > 0]
        notes = ["nothing is painted: took the closed paths as filled"]
    layers = [own for own in layers if own]
    paper, grounds = _background(layers, drawing)
    n = len(grounds)
    shown = [layer for k, own in enumerate(layers) if k not in grounds for layer in own]
    if not shown:
        raise InputFileError(f"{drawing.path}: {_why_empty(drawing)}")
    noun = "a background rectangle" if n == 1 else f"{n} background rectangles"
    notes += [f"left out {noun} that cover{'s' * (n == 1)} the whole drawing"] * (n > 0)
    shown, ruled = without_grid(shown, paper or PAPER_COLOUR)
    seen, decided = overlay(shown, paper)
    decided = [*ruled, *decided]
    colours = {layer.brush.colour for layer in shown if layer.brush.opacity >= MIN_VISIBLE_OPACITY}
    whole = solid(seen)
    if whole >= PAVED_SHARE * _page(layers, drawing).area:
        all_but = "the silhouette is all but the whole page"
        if len(colours) > 1:
            notes.append(f"{all_but}; if that is a background, delete it")
        elif seen.area < (1 - MIN_HOLE_SHARE) * whole:
            notes.append(Advice(f"{all_but}; if the hole in it is the shape, change {{invert}}"))
    elif _is_badge(seen, shown):
        notes.append(
            "the silhouette is a disc with a drawing on it; if it is a background, delete it"
        )
    cut = regions.beyond / (regions.beyond + sum(layer.region.area for layer in shown))
    if cut > MIN_NOTED_SHARE:
        notes.append(f"left out what lies beyond the page: {percent(cut)} of what is painted")
    return seen, notes + decided


def _page(layers: list[list[PaintedLayer]], drawing: Drawing) -> shapely.Polygon:
    """Return the page, or without one the box of what is painted."""
    every = [layer.region for own in layers for layer in own]
    xmin, ymin, xmax, ymax = drawing.box or shapely.total_bounds(every)
    return shapely.box(xmin, ymin, xmax, ymax)


def _background(layers: list[list[PaintedLayer]], drawing: Drawing) -> tuple[str | None, set[int]]:
    """Return the background's colour, if it is painted, and which shapes are no more than it."""
    if not layers:
        return drawing.ground, set()
    first, page = [own[0] for own in layers], _page(layers, drawing)
    whole = {k for k, layer in enumerate(first) if _covers(layer.region, page)}
    paving = set(range(_paving(layers, page)))
    if whole == set(range(len(layers))) and not drawing.others.keys() & {"image", "text"}:
        return drawing.ground, set()
    # frames have no colour that others lie on
    solid = [k for k in sorted(whole) if first[k].region.area >= WHOLE_SHARE * page.area]
    under = solid[-1:] or sorted(paving, key=lambda k: first[k].region.area)[-1:]
    return first[under[0]].brush.colour if under else drawing.ground, whole | paving


def _covers(region: BaseGeometry, page: shapely.Polygon) -> bool:
    if region.envelope.intersection(page).area < WHOLE_SHARE * page.area:
        return False
    return _without_holes(region).area >= WHOLE_SHARE * region.envelope.area


def _paving(layers: list[list[PaintedLayer]], page: shapely.Polygon) -> int:
    """Return how many of the lowest shapes are rectangles that pave the page for others on them.

    Corners may be rounded. Once the page is paved, what lies beside the rest or reaches from edge to
    edge still belongs to it.
    """
    xmin, ymin, xmax, ymax = page.buffer(-(1 - WHOLE_SHARE) * page.length / 4).bounds
    ground: BaseGeometry = shapely.Polygon()
    count, paved = 0, False
    for own in layers[:MAX_STRIPS]:
        parts = polygons_in(own[0].region)
        if any(filled(part).area < PAVED_SHARE * part.envelope.area for part in parts):
            break
        region = _without_holes(own[0].region)
        left, low, right, high = region.bounds
        spans = (left <= xmin and right >= xmax) or (low <= ymin and high >= ymax)
        beside = region.intersection(ground).area <= MIN_NOTED_SHARE * region.area
        if paved and not spans and not beside:
            break
        ground, count = ground.union(region), count + 1
        paved = ground.intersection(page).area >= PAVED_SHARE * page.area
    widest = max(
        (own[0] for own in layers[:count]), key=lambda layer: layer.region.area, default=None
    )
    has_others = widest and _shown_on(widest.brush.colour, chain(*layers[count:]))
    return count if paved and has_others else 0


def _shown_on(colour: str, layers: Iterable[PaintedLayer]) -> list[PaintedLayer]:
    """Return the layers that are no fainter than what is seen, and of another colour."""
    visible = (layer for layer in layers if layer.brush.opacity >= MIN_VISIBLE_OPACITY)
    return [layer for layer in visible if not alike(layer.brush.colour, colour)]


def _is_badge(seen: BaseGeometry, layers: list[PaintedLayer]) -> bool:
    """Return whether what is seen is a disc in one colour with a drawing of another on it."""
    whole = outer_outline(seen)[0]
    gap = DISC_AREA_TOLERANCE * whole.envelope.area
    if abs(whole.area - np.pi / 4 * whole.envelope.area) > gap:
        return False
    disc = max(layers, key=lambda layer: layer.region.area)
    on_it = [layer.region for layer in _shown_on(disc.brush.colour, layers)]
    is_round = whole.convex_hull.area - whole.area < gap and disc.region.area > whole.area - gap
    if not on_it or not is_round:
        return False
    shares = _sides(outer_outline(shapely.union_all(on_it))[0]) / _sides(whole)
    return bool(shares.min() > MIN_DRAWN_SHARE and shares.max() > MIN_BADGE_SHARE)


def _sides(region: BaseGeometry) -> Array:
    bounds = np.array(region.bounds)
    return bounds[2:] - bounds[:2]


def _without_holes(region: BaseGeometry) -> BaseGeometry:
    return shapely.union_all([filled(part) for part in polygons_in(region)])


def _why_empty(drawing: Drawing) -> str:
    images, texts = drawing.others.get("image", 0), drawing.others.get("text", 0)
    if images or texts:
        parts = [f"{images} embedded image(s)"] * bool(images) + [f"{texts} text(s)"] * bool(texts)
        advice = "trace the image or give it as PNG" if images else "convert the text to paths"
        return f"no closed path: it holds only {' and '.join(parts)}; {advice}"
    left = "".join(f"; {note}" for note in drawing.left_out())
    return f"no closed path: the drawing has no shape that encloses an area{left}"
