"""The solids of one figure: a tile, a cutter, a stamp, a mould. On a page y is down."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import shapely
from manifold3d import Manifold
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make import Layout, cut_ring
from orbiflow.tiles.solids.sections import CrossSection, stacked
from orbiflow.tiles.solids.settings import SolidSettings

FLATNESS = 0.01  # how far in mm straight sides may be from the tile's curves: no printer shows it


class ClosedBody(NamedTuple):
    """A closed body, and what fills the drawing that is sunk in it, in another colour."""

    solid: Manifold
    inlay: Manifold | None = None

    def changed(self, change: Callable[[Manifold], Manifold]) -> ClosedBody:
        """Return both after a change of their places."""
        return ClosedBody(change(self.solid), self.inlay and change(self.inlay))


class Plan(NamedTuple):
    """What solids are made from: the tile in its place, and what is drawn on it, in mm."""

    settings: SolidSettings
    layout: Layout
    drawing: BaseGeometry
    number: int = 0  # which of the tile's figures it is made of

    @property
    def ring(self) -> Array:
        """The figure's outline (N, 2)."""
        curve = self.layout.outline.closed[self.number]
        rings = [curve.flattened(flatness) for flatness in (FLATNESS, FLATNESS / 16)]
        # hair-thin parts cross where a line is taken for their curves
        return next((ring for ring in rings if shapely.Polygon(ring).is_valid), rings[0])

    @property
    def piece(self) -> shapely.Polygon:
        """The tile, smaller by half of the clearance all around."""
        return shapely.Polygon(cut_ring(self.ring, 0.0, self.settings.clearance))


def _grown(region: BaseGeometry, distance: float) -> BaseGeometry:
    """Return a region grown by a distance, or shrunk, unless nothing is left."""
    grown = region.buffer(distance, quad_segs=12) if distance else region
    if grown.is_empty:
        raise OrbiflowError(
            f"nothing is left of the tile {-distance:.3g} mm inside its edge; choose a larger tile size"
        )
    return grown


def tile_body(plan: Plan) -> ClosedBody:
    """Return a tile with a bevelled upper edge, in which what is drawn is sunk."""
    settings, piece = plan.settings, plan.piece
    face, top = _grown(piece, -settings.chamfer), settings.height
    body = stacked(
        CrossSection(0.0, piece),
        CrossSection(top - settings.chamfer, piece),
        CrossSection(top, face),
    )
    drawing = plan.drawing.intersection(face.buffer(-settings.nozzle))
    if drawing.is_empty or not drawing.area:
        return ClosedBody(body)
    inlay = stacked(CrossSection(top - settings.relief, drawing), CrossSection(top, drawing))
    return ClosedBody(body - inlay, inlay)


def _cutter(plan: Plan) -> ClosedBody:
    """Return a cutter that stands on its rim, blade up; its walls stand outside of the tile."""
    settings, tile = plan.settings, shapely.Polygon(plan.ring)
    widths = (settings.foot, settings.wall, settings.blade)
    foot, wall, blade = (_grown(tile, width).difference(tile) for width in widths)
    rim, top = settings.floor, settings.floor + settings.height
    thins = CrossSection(top - settings.height / 3, wall)
    return ClosedBody(
        stacked(
            CrossSection(0.0, foot),
            CrossSection(rim, foot),
            CrossSection(rim, wall),
            thins,
            CrossSection(top, blade),
        )
    )


def _stamp(plan: Plan) -> ClosedBody:
    """Return a stamp, face up: the tile's border and the drawing inside it are raised."""
    settings, tile = plan.settings, shapely.Polygon(plan.ring)
    low = tile.buffer(-settings.wall).difference(plan.drawing)
    raised = tile.difference(low)
    base, top = settings.height, settings.height + settings.relief
    return ClosedBody(
        stacked(
            CrossSection(0.0, tile),
            CrossSection(base, tile),
            CrossSection(base, raised),
            CrossSection(top, raised),
        )
    )


def _mould(plan: Plan) -> ClosedBody:
    """Return a block with a cavity that is the tile at its mouth, with the drawing on its floor."""
    settings, mouth = plan.settings, plan.piece
    block = shapely.box(*mouth.bounds).buffer(settings.wall)
    bottom = _grown(mouth, -settings.slope * settings.height)
    middle = _grown(mouth, -settings.slope * (settings.height - settings.relief))
    drawing = plan.drawing.intersection(bottom.buffer(-settings.nozzle))
    floor, relief = settings.floor, settings.floor + settings.relief
    levels = (
        CrossSection(0.0, block),
        CrossSection(floor, block),
        CrossSection(floor, block.difference(bottom).union(drawing)),
        CrossSection(relief, block.difference(middle).union(drawing)),
        CrossSection(relief, block.difference(middle)),
        CrossSection(floor + settings.height, block.difference(mouth)),
    )
    return ClosedBody(stacked(*levels))


SHAPES: Mapping[str, Callable[[Plan], ClosedBody]] = {
    "tile": tile_body,
    "cutter": _cutter,
    "stamp": _stamp,
    "mould": _mould,
}
"""How each kind is made of one figure."""
