"""The order in which a machine follows lines: what is inside first, and little travel between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely
from scipy.spatial import KDTree

from orbiflow.arrays import Array
from orbiflow.tiles.page import Curve, Item, Layer, PathPart, Scene

MOST_STARTS = 24  # the places at which a closed line may begin: more shorten the way no further
FINE = 0.01  # distance in mm at which a line is taken for a polygon, to see what lies in it


def in_cutting_order(scene: Scene) -> Scene:
    """Return a scene whose lines are followed layer by layer, in each those inside a line before it.

    A piece that has dropped out moves, so what lies in it comes first. Otherwise the way leads to the
    nearest line that is left. An open line may be followed either way, and a closed one from any of
    its corners. What is no line, such as words, stays before them.
    """
    place, layers = np.zeros(2), list[Layer]()
    for layer in scene.layers:
        items = [piece for item in layer.items for piece in _single(item, layer)]
        lines = [item for item in items if isinstance(item, Curve | PathPart)]
        others = [item for item in items if not isinstance(item, Curve | PathPart)]
        ordered, place = ordered_lines(lines, place)
        layers.append(replace(layer, items=(*others, *ordered)))
    return replace(scene, layers=tuple(layers))


def _single(item: Item, layer: Layer) -> Iterator[Item]:
    """Yield the lines of an item one by one; what is filled stays whole, as its holes are its own."""
    if (
        not isinstance(item, PathPart)
        or item.style.fill
        or not item.style.stroke
        or item.opacity < 1
    ):
        yield item
        return
    (_, stroke, width), usual = item.style, layer.style
    as_the_layer = stroke == usual.stroke and usual.fill is None
    as_the_layer &= bool(np.isclose(width, usual.width))
    yield from item.curves if as_the_layer else (item._replace(curves=(c,)) for c in item.curves)


def ordered_lines(
    lines: Sequence[Curve | PathPart], place: Array
) -> tuple[list[Curve | PathPart], Array]:
    """Return lines in their order from a place (2,) on, and where the way ends."""
    starts = [_starts(_curve(line)) for line in lines]
    owners = np.repeat(np.arange(len(lines)), [len(line_starts) for line_starts in starts])
    first = np.cumsum([0, *(len(line_starts) for line_starts in starts)])
    points = np.concatenate([np.zeros((0, 2)), *starts])
    within = _containing(lines)
    waiting = np.bincount([k for around in within for k in around], minlength=len(lines))
    left, ordered = np.ones(len(lines), dtype=bool), list[Curve | PathPart]()
    tree, numbers, taken = None, np.zeros(0, dtype=np.int64), 0
    for _ in lines:
        if tree is None or 2 * taken > len(numbers):  # most that the tree knows is taken: a new one
            numbers, taken = np.flatnonzero(left[owners]), 0
            tree = KDTree(points[numbers])
        start, count = -1, min(8, len(numbers))
        while start < 0:
            for hit in np.atleast_1d(tree.query(place, k=count)[1]).tolist():
                line = owners[numbers[hit]]
                if left[line] and not waiting[line]:
                    start = int(numbers[hit])
                    break
            count = min(4 * count, len(numbers))
        line = int(owners[start])
        left[line], taken = False, taken + len(starts[line])
        for around in within[line]:
            waiting[around] -= 1
        ordered.append(_begun(lines[line], start - int(first[line])))
        place = _curve(ordered[-1]).end
    return ordered, place


def _curve(line: Curve | PathPart) -> Curve:
    return line if isinstance(line, Curve) else line.curves[0]


def _starts(curve: Curve) -> Array:
    """Return the places (n, 2) at which a line may begin."""
    if not curve.closed:
        return np.stack([curve.start, curve.end])
    return curve.pieces[:: _step(curve), 0]


def _step(curve: Curve) -> int:
    return -(-len(curve.pieces) // MOST_STARTS)


def _begun(line: Curve | PathPart, start: int) -> Curve | PathPart:
    """Return a line that begins at one of its starts."""
    if isinstance(line, Curve):
        return _turned(line, start)
    first, *others = line.curves
    return line._replace(curves=(_turned(first, start), *others))


def _turned(curve: Curve, start: int) -> Curve:
    if start == 0:
        return curve
    if not curve.closed:
        return curve.reversed()
    shift = -start * _step(curve)
    return Curve(np.roll(curve.pieces, shift, 0), np.roll(curve.straight, shift), closed=True)


def _containing(lines: Sequence[Curve | PathPart]) -> list[list[int]]:
    """Return for each line the closed lines in which it lies."""
    around: list[list[int]] = [[] for _ in lines]
    closed = [k for k, line in enumerate(lines) if isinstance(line, Curve) and line.closed]
    rings = [_curve(lines[k]).flattened(FINE) for k in closed]
    polygons = np.array([shapely.Polygon(ring) if len(ring) > 2 else None for ring in rings])
    if not len(polygons):
        return around
    areas = np.full(len(lines), 0.0)
    areas[closed] = shapely.area(polygons)
    points = shapely.points([_curve(line).start for line in lines])
    inner, outer = shapely.STRtree(polygons).query(points, predicate="within")
    for number, other in zip(inner.tolist(), (closed[k] for k in outer.tolist()), strict=True):
        # of two that cross, each may begin in the other
        if number != other and areas[number] < areas[other]:
            around[number].append(other)
    return around
