"""What is raised of a drawing: where it is dark, in lines that a printer can draw."""

from __future__ import annotations

from collections.abc import Iterator

import shapely
from shapely.geometry.base import BaseGeometry

from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.scene import Motif, Part, lines_of, region_of
from orbiflow.tiles.silhouette import lightness


def raised(motif: Motif, nozzle: float) -> BaseGeometry:
    """Return where a drawing in mm is dark; shapes that are thinner than the nozzle are widened.

    Light colours wipe out what is dark below them, as in an eye; faint ones count as nothing.
    """
    dark: BaseGeometry = shapely.Polygon()
    for part in motif.parts:
        for colour, region in _painted(part, nozzle) if part.opacity >= 0.5 else ():
            light = lightness(colour) >= 0.5
            dark = dark.difference(region) if light else dark.union(region)
    return shapely.union_all([_widened(polygon, nozzle) for polygon in polygons_in(dark)])


def _painted(part: Part, nozzle: float) -> Iterator[tuple[str, BaseGeometry]]:
    """Yield the colours of a part, and where they are."""
    fill, stroke, width = part.style
    if fill is not None:
        yield fill, region_of(part)
    if stroke is not None:
        yield stroke, lines_of(part).buffer(max(width, nozzle) / 2)


def _widened(polygon: shapely.Polygon, width: float) -> BaseGeometry:
    """Return a polygon that is nowhere so wide widened until it is so on the mean."""
    if not polygon.buffer(-0.49 * width).is_empty:
        return polygon
    return polygon.buffer(max(width / 2 - polygon.area / polygon.length, 0.0))
