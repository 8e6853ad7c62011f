"""Gradients: their colours, and where they are opaque or light enough to count."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np
import shapely
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.tiles.silhouette.readers.svg_shapes import (
    DrawnShape,
    bounds_of,
    mapped,
    unit_box_matrix,
)
from orbiflow.tiles.silhouette.readers.svg_values import (
    CURRENT,
    Brush,
    as_number,
    can_transform,
    colour_of,
    length,
    mean_colour,
    transform_matrix,
)
from orbiflow.tiles.silhouette.readers.svg_xml import reference

if TYPE_CHECKING:
    from orbiflow.tiles.silhouette.readers.svg_drawing import Drawing

MAX_REFERENCES = 10  # from gradient to gradient
MAX_STOPS = 500
MAX_PERIODS = 100  # of a gradient that repeats, to either side
_QUARTER_SEGMENTS = 64  # segments of a quarter of a circle
_MIN_EXTENT = 1e-9  # of a vector or radius: a gradient of less has its last colour everywhere
_LINEAR = {"x1": "0%", "y1": "0%", "x2": "100%", "y2": "0%"}
_RADIAL = {"cx": "50%", "cy": "50%", "r": "50%", "fr": "0%"}


@dataclass(frozen=True, eq=False)
class Gradient:
    """Colours along a line, or from circle to circle."""

    offsets: Array  # (N,), 0 to 1, in order
    brushes: list[Brush]  # (N)
    matrix: Array  # (3, 3), from its own units to the drawing's
    ends: Array  # (2, 3): x, y and radius where it begins and ends
    radial: bool
    spread: str  # "pad", "reflect" or "repeat"

    def part(self, values: Array, least: float, region: BaseGeometry) -> BaseGeometry:
        """Return the part of a region where values (N,), given at the offsets, are at least `least`."""
        if (values >= least).all():
            return region
        if (values < least).all() or region.is_empty:
            return Polygon()
        xmin, ymin, xmax, ymax = region.bounds
        corners = np.array([[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]])
        corners = mapped(np.linalg.inv(self.matrix), corners)
        if not np.isfinite(corners).all():
            return region
        low, high = self._reach(corners)
        spans = self._repeated(list(self._spans(values, least)), low, high)
        bands = [self._band(a, b, corners) for a, b in spans]
        there = shapely.transform(shapely.union_all(bands), lambda xy: mapped(self.matrix, xy))
        return shapely.intersection(region, there)

    def _spans(self, values: Array, least: float) -> Iterator[tuple[float, float]]:
        """Yield the intervals of offsets with enough of a value, beyond 0 to 1 where it pads."""
        pads = self.spread == "pad"
        first, last = float(self.offsets[0]), float(self.offsets[-1])
        if values[0] >= least and (first > 0 or pads):
            yield (-np.inf if pads else 0.0), first
        for (a, b), (u, v) in zip(pairwise(self.offsets), pairwise(values), strict=True):
            if max(u, v) >= least and b > a:
                crossing = a + (least - u) / (v - u) * (b - a) if (u < least) != (v < least) else a
                yield (crossing if u < least else a), (crossing if v < least else b)
        if values[-1] >= least and (last < 1 or pads):
            yield last, (np.inf if pads else 1.0)

    def _repeated(
        self, spans: list[tuple[float, float]], low: float, high: float
    ) -> list[tuple[float, float]]:
        """Return the intervals between `low` and `high`, repeated there as the gradient is."""
        if self.spread == "pad":
            every = spans
        else:
            low, high = max(low, -MAX_PERIODS), min(high, MAX_PERIODS)
            turns = range(int(np.floor(low)), int(high) + 1)
            back = self.spread == "reflect"
            every = [
                (k + 1 - b, k + 1 - a) if back and k % 2 else (k + a, k + b)
                for k in turns
                for a, b in spans
            ]
        cut = [(max(a, low), min(b, high)) for a, b in every]
        return [(a, b) for a, b in cut if b > a]

    def _reach(self, corners: Array) -> tuple[float, float]:
        """Return offsets between which all of a region with these corners lies."""
        (x, y, radius), step = self.ends[0], self.ends[1] - self.ends[0]
        if self.radial:
            growth = step[2] - float(np.hypot(*step[:2]))
            far = float(np.hypot(*(corners - [x, y]).T).max())
            return 0.0, 1 + max(far - radius, 0.0) / growth
        along = (corners - [x, y]) @ step[:2] / (step[:2] @ step[:2])
        return float(along.min()) - 1, float(along.max()) + 1

    def _band(self, a: float, b: float, corners: Array) -> BaseGeometry:
        """Return what has offsets from `a` to `b`, of all that lies around a region."""
        start, step = self.ends[0], self.ends[1] - self.ends[0]
        if self.radial:
            inner, outer = (
                Point(x, y).buffer(max(radius, 0.0), quad_segs=_QUARTER_SEGMENTS)
                for x, y, radius in (start + a * step, start + b * step)
            )
            return outer.difference(inner) if a > 0 else outer
        along, across = step[:2], np.array([-step[1], step[0]])
        sideways = (corners - start[:2]) @ across / (across @ across)
        wide = np.array([sideways.min() - 1, sideways.max() + 1])
        strip = np.outer([a, b, b, a], along) + np.outer(wide[[0, 0, 1, 1]], across)
        return Polygon(start[:2] + strip)


_Attribute = Callable[[str, str], str]  # the attribute of a gradient, or its usual value


def gradient_of(drawing: Drawing, element: Element, shape: DrawnShape) -> Gradient | Brush | None:
    """Return the gradient that paints a shape, or the one colour that it has, or None for nothing."""
    chain = list(references(drawing, element))
    own = ([child for child in one if child.tag == "stop"] for one in chain)
    stops = next(filter(None, own), list[Element]())

    def attribute(key: str, usual: str) -> str:
        same = (one.get(key) for one in chain if one.tag == element.tag or key not in _SHAPED)
        return next((text for text in same if text is not None), usual)

    placed = _placed(drawing, attribute, shape)
    if not stops or placed is None:
        return None
    matrix, size = placed
    brushes = [_stop(drawing, stop) for stop in stops]
    given = [min(max(as_number(stop.get("offset"), 0.0), 0.0), 1.0) for stop in stops]
    radial, ends = element.tag == "radialGradient", _ends(element.tag, attribute, size)
    flat = np.linalg.det(matrix) == 0 or not np.ptp(ends, axis=0).max() > _MIN_EXTENT
    if len(stops) == 1 or len(stops) > MAX_STOPS or flat:
        return brushes[-1]
    along = ends[1] - ends[0]
    if radial and float(np.hypot(*along[:2])) >= along[2]:
        drawing.notes.add("a gradient that begins outside its circle is taken for one colour")
        return mean_colour(brushes)
    offsets = np.maximum.accumulate(np.array(given))
    return Gradient(offsets, brushes, matrix, ends, radial, attribute("spreadMethod", "pad"))


def _placed(
    drawing: Drawing, attribute: _Attribute, shape: DrawnShape
) -> tuple[Array, tuple[float, float]] | None:
    """Return the map of a gradient's units to the drawing's, and what its percentages refer to.

    None is of a gradient in units of a box that has no area.
    """
    matrix, size = shape.place.matrix, shape.place.viewport
    if attribute("gradientUnits", "objectBoundingBox") != "userSpaceOnUse":
        box = bounds_of([shape], matrix)
        if box is None or not (box[2] > box[0] and box[3] > box[1]):
            return None
        matrix, size = matrix @ unit_box_matrix(box), (1.0, 1.0)
    text = attribute("gradientTransform", "")
    if not can_transform(text, css=False):
        drawing.notes.add("a gradientTransform is not understood and left out")
        return matrix, size
    return matrix @ transform_matrix(text, (1.0, 1.0)), size


_SERVERS = {"linearGradient", "radialGradient", "pattern"}
_SHAPED = {*_LINEAR, *_RADIAL, "fx", "fy"}


def references(drawing: Drawing, element: Element | None) -> Iterator[Element]:
    """Yield a gradient or pattern and those that it takes its stops, content or attributes from."""
    for _ in range(MAX_REFERENCES):
        if element is None or element.tag not in _SERVERS:
            return
        yield element
        element = drawing.named(reference(element), f"a {element.tag}")


def _stop(drawing: Drawing, stop: Element) -> Brush:
    style = drawing.styles.standing(stop)
    brush = colour_of(style.get("stop-color", "#000000")) or Brush("#000000", 1.0)
    if brush.colour == CURRENT:
        brush = colour_of(style.get("color", "#000000")) or brush
    opacity = min(max(as_number(style.get("stop-opacity"), 1.0), 0.0), 1.0)
    return Brush(brush.colour, brush.opacity * opacity)


def _ends(tag: str, attribute: _Attribute, size: tuple[float, float]) -> Array:
    """Return x, y and radius of where a gradient begins and ends."""
    across = float(np.hypot(*size)) / 2**0.5

    def number(key: str, usual: str) -> float:
        relative = size[0] if "x" in key else size[1] if "y" in key else across
        value = length(attribute(key, usual), relative)
        return length(usual, relative) or 0.0 if value is None else value

    if tag == "linearGradient":
        x1, y1, x2, y2 = (number(key, usual) for key, usual in _LINEAR.items())
        return np.array([[x1, y1, 0.0], [x2, y2, 0.0]])
    cx, cy, r, fr = (number(key, usual) for key, usual in _RADIAL.items())
    centre = np.array([cx, cy])
    focus = np.array([number("fx", repr(cx)), number("fy", repr(cy))])
    away, most = float(np.hypot(*(focus - centre))), max(r - fr, 0.0)
    if 0.99 * most < away < 1.01 * most:  # on the circle, but for rounding
        focus = centre + (focus - centre) * (0.99 * most / away)
    return np.array([[*focus, fr], [cx, cy, r]])
