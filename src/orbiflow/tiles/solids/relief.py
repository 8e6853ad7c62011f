"""What is raised of a drawing: where it is dark, in lines that a printer can draw."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from orbiflow.drawing import rgb
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.scene import INK, Motif, Part
from orbiflow.tiles.silhouette import fill

FLATNESS = 0.01  # how far in mm straight sides may be from curves: no printer shows it


def raised(motif: Motif, nozzle: float) -> BaseGeometry:
    """Return where a drawing in mm is dark; shapes that are thinner than the nozzle are widened.

    Light colours wipe out what is dark below them, as in an eye; faint ones count as nothing.
    """
    dark: BaseGeometry = shapely.Polygon()
    for part in motif.parts:
        for colour, region in _painted(part, nozzle) if part.opacity >= 0.5 else ():
            light = colour != INK and np.mean(rgb(colour)) > 127
            dark = dark.difference(region) if light else dark.union(region)
    return shapely.union_all([_widened(polygon, nozzle) for polygon in polygons_in(dark)])


def _painted(part: Part, nozzle: float) -> Iterator[tuple[str, BaseGeometry]]:
    """Yield the colours of a part, and where they are."""
    lines = [curve.flattened(FLATNESS) for curve in part.curves]
    if part.style.fill is not None:
        yield part.style.fill, fill([line for line in lines if len(line) > 2])
    if part.style.stroke is not None:
        both = zip(lines, part.curves, strict=True)
        paths = [shapely.LinearRing(a) if c.closed else shapely.LineString(a) for a, c in both]
        wide = shapely.buffer(paths, max(part.style.width, nozzle) / 2)
        yield part.style.stroke, shapely.union_all(wide)


def _widened(polygon: shapely.Polygon, width: float) -> BaseGeometry:
    """Return a polygon that is nowhere so wide widened until it is so on the mean."""
    if not polygon.buffer(-width / 2).is_empty:
        return polygon
    return polygon.buffer(max(width / 2 - polygon.area / polygon.length, 0.0))
