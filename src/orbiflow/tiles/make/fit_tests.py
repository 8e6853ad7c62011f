"""A test of fits: the same two neighbours at five clearances, each with its number in dots."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.make.layout import BLUE, Layout, line_style
from orbiflow.tiles.make.offsets import LEAST_GAP, closed_fit, cut_ring
from orbiflow.tiles.page import Curve, Layer, Scene, boundary
from orbiflow.tiles.tilings import Copies, Tiling, copies_meeting

STEPS = (0.5, 0.75, 1.0, 1.5, 2.0)  # the clearances that are tried, in the one that is asked for
USUAL_CLEARANCE = 0.1  # in mm, if none is asked for
DOT = 1.0  # the largest radius of a dot in mm
TOUCHING = 1e-6  # the distance of sides that are shared, in the tiling's radius

# the faces of dice, in half the side of a square
_FACES = {
    1: [(0, 0)],
    2: [(-1, -1), (1, 1)],
    3: [(-1, -1), (0, 0), (1, 1)],
    4: [(-1, -1), (1, -1), (-1, 1), (1, 1)],
    5: [(-1, -1), (1, -1), (0, 0), (-1, 1), (1, 1)],
}


def fit_clearances(clearance: float) -> list[float]:
    """Return the clearances in mm of the pairs.

    >>> fit_clearances(0.2)
    [0.1, 0.15, 0.2, 0.3, 0.4]
    """
    return [round(step * (clearance or USUAL_CLEARANCE), 4) for step in STEPS]


def fit_words(clearance: float) -> str:
    """Return what the dots mean, in a sentence."""
    *others, last = (f"{gap:g}" for gap in fit_clearances(clearance))
    return f"pieces with one to five dots have clearances of {', '.join(others)} and {last} mm"


def dice(region: BaseGeometry, number: int) -> BaseGeometry:
    """Return as many dots as a face of dice has, where a region is widest."""
    part = max(polygons_in(region), key=lambda polygon: polygon.area, default=None)
    if part is None:
        raise OrbiflowError("the piece has no room for its dots; choose a larger tile size")
    line = shapely.maximum_inscribed_circle(part)
    middle, reach = shapely.get_coordinates(line)[0], line.length
    radius = min(DOT, 0.22 * reach)
    half = min(2.6 * radius, 0.7 * reach - radius)
    places = middle + half * np.array(_FACES[number], dtype=np.float64)
    return shapely.union_all(shapely.buffer(shapely.points(places), radius, quad_segs=8))


def two_neighbours(tiling: Tiling) -> Copies:
    """Return the prototile and the neighbour with which it shares most of its outline."""
    low, high = tiling.center - tiling.radius, tiling.center + tiling.radius
    copies = copies_meeting(tiling, (*low.tolist(), *high.tolist()))
    first = int(np.linalg.norm(copies.centers() - tiling.center, axis=1).argmin())
    rings: Any = shapely.linearrings(copies.rings())
    around = rings[first].buffer(TOUCHING * tiling.radius)
    shared = shapely.length(shapely.intersection(rings, around))
    shared[first] = 0.0
    return copies.select(np.array([first, int(shared.argmax())]))


def fit_test_scene(layout: Layout) -> Scene:
    """Return a scene with the pairs in rows to cut, and their dots to score."""
    settings, box = layout.settings, layout.page.box
    pair, gap = two_neighbours(layout.page.tiling), max(settings.spacing, LEAST_GAP)
    cuts, scores = list[Curve](), list[Curve]()
    right, row, bottom = box.left, box.top, box.top
    for number, clearance in enumerate(fit_clearances(settings.clearance), 1):
        for kind, coset in zip(pair.prototiles.tolist(), pair.cosets.tolist(), strict=True):
            ring = cut_ring(layout.pieces[kind][0], settings.kerf, clearance)
            ring = ring @ pair.group.linear_parts[coset].T
            width, height = np.ptp(ring, axis=0) + gap
            if right + width > box.right:
                right, row = box.left, bottom
            if row + height > box.bottom or right + width > box.right:
                raise OrbiflowError(
                    f"the page of {box.width:g} x {box.height:g} mm does not hold the ten pieces of a "
                    "test of fits; choose a larger area or bed, or a smaller tile size"
                )
            ring += np.array([right, row]) + gap / 2 - ring.min(axis=0)
            cuts.append(closed_fit(ring, layout.fine))
            dots = boundary(dice(shapely.Polygon(ring).buffer(-DOT), number))
            scores += dots
            right, bottom = right + width, max(bottom, row + height)
    style = line_style(layout)
    layers = (
        Layer("score", "mark", style._replace(stroke=BLUE), tuple(scores)),
        Layer("cut", "cut", style, tuple(cuts)),
    )
    notes = (fit_words(settings.clearance),)
    return layout.scene(layers, (), facts={"pieces": len(cuts)}, remarks=notes)
