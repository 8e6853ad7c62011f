"""SVG drawings: the outline of the largest closed shape, in the drawing's own user units."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import numpy as np
import shapely
from shapely.errors import GEOSException
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.outlines import (
    MAX_COORDINATE,
    MAX_VERTICES,
    clean_ring,
    outer_outline,
    outer_ring,
    simplified,
)
from orbiflow.tiles.silhouette.readers.reading import Reading, Source, read_bytes
from orbiflow.tiles.silhouette.readers.svg_paths import (
    MAX_POINTS,
    SubPath,
    TooManyPoints,
    TooTangled,
    fill,
)
from orbiflow.tiles.silhouette.readers.svg_shapes import Drawing, parse_xml

MAX_BYTES = 16 * 2**20
# Flattening error, of the size of each shape, and its floor, of the size of the drawing.
FLATNESS = 1 / 2000
FLATNESS_FLOOR = 1 / 20_000
CLOSING_GAP = 1e-6  # of the size of the drawing: ends nearer than this are one point
OVERLAY_GRID = 1e-9  # of the size of the drawing: the grid that the united outline is snapped to
OVERLAY_GRID_FLOOR = 1e-12  # of the largest coordinate
# of the size of the drawing: vertices nearer their chord than this are dropped
COLLINEAR_TOLERANCE = 1e-6


def read_svg(path: Source) -> Reading:
    """Read the outline of the silhouette in an SVG drawing, in user units of the viewBox, with y down.

    All closed sub-paths of paths, rectangles, circles, ellipses, polygons and polylines count,
    painted or not, filled by the `fill-rule` of their element. The elements are united, the largest
    component is kept and its holes are filled. Strokes, clips and masks are passed over.
    """
    drawing = Drawing(path, parse_xml(path, read_bytes(path, MAX_BYTES)))
    drawing.collect()
    size = _drawing_size(drawing)
    regions, n_open = _regions(drawing, size)
    if not regions:
        raise InputFileError(f"{path}: {_why_empty(drawing, n_open)}")
    notes = [f"left out {n_open} open path{'s' * (n_open > 1)}"] * (n_open > 0)
    regions, dropped = _drop_backgrounds(regions, drawing.box)
    shape, kept = outer_outline(_overlay(path, regions))
    outline, cleaned = clean_ring(_thinned(shape, size), str(path), InputFileError)
    box = drawing.box
    notes = (*notes, *dropped, *kept, *cleaned)
    if box is None:
        return Reading(outline, True, "svg", None, notes)
    return Reading(outline, True, "svg", (box[2] - box[0], box[3] - box[1]), notes, box[:2])


def _drawing_size(drawing: Drawing) -> float:
    reach = [path.reach() for shape in drawing.shapes for path in shape.paths]
    if not reach:
        return 0.0
    points = np.concatenate(reach)
    if not np.isfinite(points).all() or np.abs(points).max() > MAX_COORDINATE:
        reach = f"a path reaches beyond {MAX_COORDINATE:g} user units"
        raise InputFileError(f"{drawing.path}: {reach}; rescale the drawing")
    return float(np.ptp(points, axis=0).max())


def _regions(drawing: Drawing, size: float) -> tuple[list[BaseGeometry], int]:
    """Return the regions filled by closed sub-paths, and the number of open sub-paths."""
    regions: list[BaseGeometry] = []
    n_open, n_points = 0, 0
    for shape in drawing.shapes:
        closed = [p for p in shape.paths if p.closed or p.gap() <= CLOSING_GAP * size]
        n_open += len(shape.paths) - len(closed)
        try:
            rings = _flatten(closed, size)
            n_points += sum(map(len, rings))
            if n_points > MAX_POINTS:
                raise TooManyPoints
            region = fill(rings, shape.fill_rule)
        except TooManyPoints as exc:
            raise InputFileError(
                f"{drawing.path}: the paths come to more than {MAX_POINTS} points; simplify them"
            ) from exc
        except (TooTangled, GEOSException) as exc:
            raise InputFileError(
                f"{drawing.path}: a path crosses itself too often to be filled; simplify it"
            ) from exc
        if region.area > 0:
            regions.append(region)
    return regions, n_open


def _flatten(paths: list[SubPath], size: float) -> list[Array]:
    reach = [path.reach() for path in paths]
    own = float(np.ptp(np.concatenate(reach), axis=0).max()) if reach else 0.0
    if own == 0:
        return []
    tolerance = max(own * FLATNESS, size * FLATNESS_FLOOR)
    return [path.flatten(tolerance) for path in paths]


def _drop_backgrounds(
    regions: list[BaseGeometry], box: Window | None
) -> tuple[list[BaseGeometry], list[str]]:
    """Return `regions` without rectangles that cover the page, as long as something else is there."""
    xmin, ymin, xmax, ymax = shapely.total_bounds(regions) if box is None else box
    page = shapely.box(xmin, ymin, xmax, ymax)

    def covers(region: BaseGeometry) -> bool:  # but for 0.1% of the page
        is_box = region.area >= 0.999 * region.envelope.area
        return is_box and region.envelope.intersection(page).area >= 0.999 * page.area

    rest = [region for region in regions if not covers(region)]
    n = len(regions) - len(rest)
    if not rest or n == 0:
        return regions, []
    noun = "a background rectangle" if n == 1 else f"{n} background rectangles"
    return rest, [f"left out {noun} that cover{'s' * (n == 1)} the whole drawing"]


def _overlay(path: Source, regions: list[BaseGeometry]) -> BaseGeometry:
    # Snapped to a grid: neighbours that all but share an edge would leave cracks between them.
    bounds = shapely.total_bounds(regions)
    size = max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    grid = max(OVERLAY_GRID * size, OVERLAY_GRID_FLOOR * float(np.abs(bounds).max()))
    try:
        union = shapely.union_all(regions, grid_size=grid)
    except GEOSException as exc:
        raise InputFileError(
            f"{path}: the shapes cannot be united ({exc}); unite them in the drawing program"
        ) from exc
    if not union.area > 0:
        raise InputFileError(f"{path}: the drawing encloses no area that shows at its size")
    return union


def _thinned(shape: shapely.Polygon, size: float) -> Array:
    tolerance = COLLINEAR_TOLERANCE * size
    thin = simplified(shape, tolerance)
    while len(thin.exterior.coords) > MAX_VERTICES:
        tolerance *= 2
        thin = simplified(shape, tolerance)
    return outer_ring(thin if thin.is_valid else shape)


def _why_empty(drawing: Drawing, n_open: int) -> str:
    if n_open:
        return (
            f"no closed path: {'its only path is' if n_open == 1 else f'all {n_open} paths are'} "
            "open; close the outline in the drawing program"
        )
    images, texts = drawing.others.get("image", 0), drawing.others.get("text", 0)
    if images or texts:
        parts = [f"{images} embedded image(s)"] * bool(images) + [f"{texts} text(s)"] * bool(texts)
        advice = "trace the image or give it as PNG" if images else "convert the text to paths"
        return f"no closed path: it holds only {' and '.join(parts)}; {advice}"
    return "no closed path: the drawing has no shape that encloses an area"
