"""The regions of the plane that a drawing paints, cut by its clips and masks, and their colours."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import groupby
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError
from orbiflow.tiles.geometry import complex_points
from orbiflow.tiles.silhouette.outlines import MAX_COORDINATE
from orbiflow.tiles.silhouette.readers.svg_drawing import Drawing
from orbiflow.tiles.silhouette.readers.svg_gradients import gradient_of, references
from orbiflow.tiles.silhouette.readers.svg_paths import (
    Polyline,
    SubPath,
    TooManyPoints,
    fill,
    stroked,
)
from orbiflow.tiles.silhouette.readers.svg_shapes import Clip, DrawnShape, PaintGroup
from orbiflow.tiles.silhouette.readers.svg_values import (
    CURRENT,
    REFERENCE,
    Brush,
    as_number,
    colour_of,
    lightness,
    mean_colour,
)

STROKE_REFINEMENT = 8  # strokes are flattened as much finer: a wide pen magnifies errors
EDGE_SHARE = 1e-3  # of the page's longer side: shapes that reach less beyond are whole
MIN_VISIBLE_OPACITY = 0.5  # opacity: less is not seen
NEGLIGIBLE_SHARE = 1e-3  # share of a region: it is kept whole where no more of it is faint
PATTERN_BRUSH = Brush("#808080", 1.0)
_SAMPLES = np.linspace(0, 1, 257)


def paints(drawing: Drawing, shape: DrawnShape) -> dict[str, Brush]:
    """Return what paints the "fill" and "stroke" of a shape, without what does not show, in order."""
    if shape.paint.get("visibility", "visible") != "visible":
        return {}
    found: dict[str, Brush] = {}
    order = [word for word in shape.paint.get("paint-order", "fill").split() if word != "markers"]
    for kind in ("stroke", "fill") if order[:1] == ["stroke"] else ("fill", "stroke"):
        text = shape.paint.get(kind, "#000000" if kind == "fill" else "none")
        paint = _paint(text, drawing, shape)
        if paint and (kind == "fill" or shape.width > 0):
            own = min(max(as_number(shape.paint.get(f"{kind}-opacity"), 1.0), 0.0), 1.0)
            paint = _tinted(paint, shape.tint) if shape.tint else paint
            found[kind] = paint._replace(opacity=shape.place.opacity * paint.opacity * own)
    return {kind: paint for kind, paint in found.items() if paint.opacity > 0}


def _paint(text: str, drawing: Drawing, shape: DrawnShape) -> Brush | None:
    if text.lower() == "none" or not text:
        return None
    server = REFERENCE.match(text)
    if server:
        found = _served(drawing.referred(text, "a fill or stroke"), drawing, shape)
        return found or _paint(text[server.end() :].strip(), drawing, shape)
    brush = colour_of(text)
    if brush and brush.colour == CURRENT:
        # without a colour it is the one that shows on what lies below
        brush = colour_of(shape.paint.get("color", CURRENT)) or brush
    return brush if brush and brush.opacity > 0 else None


def _tinted(paint: Brush, tint: str) -> Brush:
    """Return a paint in one colour, as opaque as before."""
    if paint.gradient is None:
        return paint._replace(colour=tint)
    brushes = [Brush(tint, brush.opacity) for brush in paint.gradient.brushes]
    return Brush(tint, paint.opacity, replace(paint.gradient, brushes=brushes))


def _served(element: Element | None, drawing: Drawing, shape: DrawnShape) -> Brush | None:
    """Return the paint that a gradient gives; a pattern is an even gray."""
    if element is None:
        return None
    if element.tag == "pattern":
        if not any(len(one) for one in references(drawing, element)):
            return None
        drawing.notes.add("took a pattern for an even gray")
        return PATTERN_BRUSH
    if element.tag not in ("linearGradient", "radialGradient"):
        drawing.notes.add(f"paint by a <{element.tag[:40]}> is left out")
        return None
    gradient = gradient_of(drawing, element, shape)
    if gradient is None or isinstance(gradient, Brush):
        return gradient
    return Brush(mean_colour(gradient.brushes).colour, 1.0, gradient)


class PaintedLayer(NamedTuple):
    """A region that is painted, and with what."""

    region: BaseGeometry
    brush: Brush
    groups: tuple[PaintGroup, ...] = ()  # whose opacities are in that of the brush


class Regions:
    """The regions that a drawing's shapes cover.

    Paths are flattened to within `tolerance`, a function of points that span them, and come to `most`
    points at most. What lies beyond a `page` is not shown, unless it is as near as `EDGE_SHARE`.
    """

    def __init__(
        self,
        drawing: Drawing,
        tolerance: Callable[[Array], float],
        most: int,
        page: Window | None = None,
    ) -> None:
        self.drawing, self.tolerance, self.most = drawing, tolerance, most
        self._clips: dict[Clip, BaseGeometry] = {}
        self._page = None if page is None else shapely.box(*page)
        self._count = 0
        self.beyond = 0.0  # the area that is painted beyond the page, where it is not seen

    def lines(self, shape: DrawnShape, finer: float = 1.0) -> list[tuple[Array, SubPath]]:
        """Return each sub-path of a shape with its polyline (N, 2)."""
        if not shape.paths:
            return []
        reach = np.concatenate([path.reach() for path in shape.paths])
        if not (np.abs(reach) <= MAX_COORDINATE).all():  # NaN, too
            reason = f"a path reaches beyond {MAX_COORDINATE:g} user units; rescale the drawing"
            raise InputFileError(f"{self.drawing.path}: {reason}")
        tolerance = self.tolerance(reach) / finer
        if not tolerance > 0:
            return []
        lines = [(path.flatten(tolerance), path) for path in shape.paths]
        self._count += sum(len(points) for points, _ in lines)
        if self._count > self.most:
            raise TooManyPoints
        return lines

    def fill(self, shape: DrawnShape, rule: str = "fill-rule") -> BaseGeometry:
        """Return what the fill of a shape covers, before clips."""
        rings = [points for points, _ in self.lines(shape)]
        return fill(rings, shape.paint.get(rule, "nonzero"))

    def stroke(self, shape: DrawnShape) -> BaseGeometry:
        """Return what the stroke of a shape covers, before clips."""
        linear, offset = shape.matrix[:2, :2], shape.matrix[:2, 2]
        back = np.linalg.inv(linear).T
        lines: list[Polyline] = []
        for points, path in self.lines(shape, STROKE_REFINEMENT):
            corners = np.isin(complex_points(points), complex_points(path.ends))
            lines.append(Polyline((points - offset) @ back, corners, path.closed))
        region = stroked(lines, shape)
        return shapely.transform(region, lambda points: points @ linear.T + offset)

    def clipped(self, shape: DrawnShape, region: BaseGeometry) -> BaseGeometry:
        """Return the part of a region that the clips and masks of a shape leave."""
        for clip in shape.clips:
            if clip not in self._clips:
                self._clips[clip] = self._clip(clip)
            if not self._clips[clip].covers(region):
                region = shapely.intersection(region, self._clips[clip])
        return region

    def shown(self, shape: DrawnShape, region: BaseGeometry) -> BaseGeometry:
        """Return the part of a region that clips and masks leave, and that lies on the page."""
        region = self.clipped(shape, region)
        if self._page is None or region.is_empty:
            return region
        if _is_within(np.array(region.bounds), self._page):
            return region
        found = shapely.intersection(region, self._page)
        self.beyond += region.area - found.area
        return found

    def has_plain_stroke(self, shape: DrawnShape) -> bool:
        """Return whether a shape's stroke is one whole line, everywhere as wide as the pen."""
        most, least = np.linalg.svd(shape.matrix[:2, :2])[1]
        if shape.dashes or most - least >= 1e-3 * most:
            return False
        whole = self.stroke(shape)
        return self.shown(shape, whole) is whole

    def layer(self, shape: DrawnShape, kind: str, paint: Brush) -> PaintedLayer:
        """Return what the "fill" or "stroke" of a shape covers, and its colour.

        Of a gradient that fades it is the part that is at least half visible, if there is one.
        """
        whole = self.fill(shape) if kind == "fill" else self.stroke(shape)
        region = self.shown(shape, whole)
        if paint.gradient is None:
            return PaintedLayer(region, paint)
        values = paint.opacity * np.array([brush.opacity for brush in paint.gradient.brushes])
        along = np.interp(_SAMPLES, paint.gradient.offsets, values)
        part = paint.gradient.part(values, MIN_VISIBLE_OPACITY, region)
        counts = along >= MIN_VISIBLE_OPACITY if part.area > 0 else along < MIN_VISIBLE_OPACITY
        beyond = values.max() if part.area > 0 else values.min()  # where it shows beyond its ends
        opacity = along[counts].mean() if counts.any() else beyond
        brush = Brush(paint.colour, float(opacity))
        if not 0 < part.area < (1 - NEGLIGIBLE_SHARE) * region.area:
            return PaintedLayer(region, brush)
        self.drawing.notes.add("left out what of a gradient is less than half visible")
        return PaintedLayer(part, brush)

    def layers(self, shape: DrawnShape) -> list[PaintedLayer]:
        """Return what a shape paints, from bottom to top."""
        found = [
            self.layer(shape, kind, paint) for kind, paint in paints(self.drawing, shape).items()
        ]
        groups = shape.place.groups
        return [layer._replace(groups=groups) for layer in found if layer.region.area > 0]

    def _clip(self, clip: Clip) -> BaseGeometry:
        if clip.kind == "clip":
            shapes = (s for s in clip.shapes if s.paint.get("visibility", "visible") == "visible")
            return shapely.union_all(
                [self.clipped(shape, self.fill(shape, "clip-rule")) for shape in shapes]
            )
        found = [part for shape in clip.shapes for part in self._masking(shape, clip.kind)]
        return painted([layer for layer, _ in found], [sign for _, sign in found])

    def _masking(self, shape: DrawnShape, kind: str) -> Iterator[tuple[PaintedLayer, int]]:
        """Yield where a shape on a mask hides what is masked (-1) and where it shows it (1)."""
        for key, paint in paints(self.drawing, shape).items():
            region = self.clipped(shape, self.fill(shape) if key == "fill" else self.stroke(shape))
            gradient = paint.gradient
            brushes = gradient.brushes if gradient else [Brush(paint.colour, 1.0)]
            opaque = paint.opacity * np.array([brush.opacity for brush in brushes])
            light = np.array([lightness(brush.colour) for brush in brushes])
            shown = opaque * (1.0 if kind == "alpha" else light)
            for values, sign in ((opaque, -1), (shown, 1)):
                part = gradient.part(values, MIN_VISIBLE_OPACITY, region) if gradient else region
                if gradient or values[0] >= MIN_VISIBLE_OPACITY:
                    yield PaintedLayer(part, paint), sign


def _is_within(bounds: Array, page: BaseGeometry) -> bool:
    xmin, ymin, xmax, ymax = page.bounds
    edge = EDGE_SHARE * max(xmax - xmin, ymax - ymin)
    bounds = bounds + edge * np.array([1, 1, -1, -1])
    return bool((bounds[:2] >= [xmin, ymin]).all() and (bounds[2:] <= [xmax, ymax]).all())


def painted(
    layers: list[PaintedLayer], signs: list[int], grid: float | None = None
) -> BaseGeometry:
    """Paint layers in turn, which add their region (sign 1), take it away (-1) or do nothing (0)."""
    found: BaseGeometry = Polygon()
    acting = [(sign, layer) for sign, layer in zip(signs, layers, strict=True) if sign]
    for sign, run in groupby(acting, key=lambda pair: pair[0]):
        regions = [layer.region for _, layer in run]
        if sign > 0:
            regions += [found] * (not found.is_empty)
            found = shapely.union_all(regions, grid_size=grid)
        elif not found.is_empty:
            away = shapely.union_all(regions, grid_size=grid)
            found = shapely.difference(found, away, grid_size=grid)
    return found
