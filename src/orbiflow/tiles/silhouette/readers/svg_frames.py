"""What lies around and behind a drawing and is no part of it: axes and frames of lines, grids."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import filled, outer_outline
from orbiflow.tiles.silhouette.readers.frames import AXES_NOTE, LEAST_DRAWN, MARKS, WIDEST
from orbiflow.tiles.silhouette.readers.svg_overlays import NOTEWORTHY, alike
from orbiflow.tiles.silhouette.readers.svg_regions import Layer

THINNEST = 0.01  # of all that is painted: a line that is no wider may belong to a grid
ACROSS = 0.98  # of the shape's width or height: what a line of a grid spans
SQUARE = 0.97  # of its box: what a frame encloses, marks that point inwards apart


def without_grid(layers: list[Layer], paper: str) -> tuple[list[Layer], list[str]]:
    """Return layers without level or upright thin lines of another colour that run past the shape."""
    bounds = shapely.total_bounds([layer.region for layer in layers])
    thin = THINNEST * max(bounds[2] - bounds[0], bounds[3] - bounds[1])
    dark = [k for k, layer in enumerate(layers) if not alike(layer.brush.colour, paper)]
    lines = [k for k in dark if _is_of_lines(layers[k].region, thin)]
    rest = [layers[k] for k in dark if k not in {*lines}]
    if not lines or not rest:
        return layers, []
    own = max(rest, key=lambda layer: layer.region.area).brush.colour
    whole = outer_outline(shapely.union_all([layer.region for layer in rest]))[0]
    across = [k for k in lines if _is_across(layers[k].region, whole)]
    meeting = [k for k in across if layers[k].region.intersects(whole)]
    colours = [layers[k].brush.colour for k in meeting if not alike(layers[k].brush.colour, own)]
    left = {k for k in across if any(alike(layers[k].brush.colour, colour) for colour in colours)}
    beyond = sum(layers[k].region.difference(whole).area for k in left.intersection(meeting))
    lines_left = f"{len(left)} thin line{'s' * (len(left) > 1)}"
    note = (
        f"left out {lines_left} of another colour that run{'s' * (len(left) == 1)} across the shape"
    )
    kept = [layer for k, layer in enumerate(layers) if k not in left]
    return kept, [note] * (beyond > NOTEWORTHY * whole.area)


def _is_of_lines(region: BaseGeometry, thin: float) -> bool:
    """Whether all parts of a region are thin and level or upright."""
    bounds = shapely.bounds(polygons_in(region))
    return bool((np.minimum(*(bounds[:, 2:] - bounds[:, :2]).T) <= thin).all())


def _is_across(region: BaseGeometry, whole: Polygon) -> bool:
    """Whether every part of a region spans the width or the height of a shape."""
    low, high = np.array(whole.bounds).reshape(2, 2)
    bounds = shapely.bounds(polygons_in(region))
    common = np.minimum(bounds[:, 2:], high) - np.maximum(bounds[:, :2], low)
    return bool((common >= ACROSS * (high - low)).any(axis=1).all())


def without_axes(seen: BaseGeometry) -> tuple[BaseGeometry, list[str]]:
    """Return what lies in a thin rectangular frame, such as the axes of a chart, and a note.

    The frame goes, with what lies outside of it, if what is inside is no speck.
    """
    parts = polygons_in(seen)
    frame = max(parts, key=lambda part: filled(part).area, default=Polygon())
    if not frame.interiors or len(parts) == 1:
        return seen, []
    hole = max((Polygon(ring) for ring in frame.interiors), key=lambda own: own.area)
    xmin, ymin, xmax, ymax = hole.bounds
    width, height = xmax - xmin, ymax - ymin
    most, reach = WIDEST * min(width, height), MARKS * min(width, height)
    is_frame = (
        hole.area >= SQUARE * width * height
        and shapely.box(xmin - reach, ymin - reach, xmax + reach, ymax + reach).covers(frame)
        and frame.area <= most * hole.length
    )
    inside = [part for part in parts if part is not frame and hole.covers(part)]
    if not is_frame or not inside:
        return seen, []
    drawn = outer_outline(shapely.union_all(inside))[0].bounds
    if min((drawn[2] - drawn[0]) / width, (drawn[3] - drawn[1]) / height) <= LEAST_DRAWN:
        return seen, []
    return shapely.union_all(inside), [AXES_NOTE]
