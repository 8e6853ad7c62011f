"""Does a tile tile the plane? A certificate in figures (design point 9)."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields
from typing import Any, Literal, TypeAlias

import numpy as np
import shapely

from orbiflow.arguments import instance, number
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.edge_matching import curve_distance, match_segments
from orbiflow.tilings.images import Surroundings, expected_area, surroundings
from orbiflow.tilings.neighbours import neighbours_among
from orbiflow.tilings.tile import Tile

EdgeMatching: TypeAlias = Literal["segments", "curves", "none"]

# On edges that agree but for rounding, GEOS without a grid is plainly wrong in about 3 % of turned
# hexagons (an overlap of 0.93 for neighbours that only touch); snapping to a grid is safe.
_GRID = 1e-12
_MARGIN = 0.05  # width of the ring around the tile that must be covered; any positive width will do


@dataclass(frozen=True)
class Certificate:
    """What `certify` found. Lengths are in square roots of the expected area, areas relative to it.

    Figures that could not be computed are NaN.

    Args:
        simple: whether the polygon does not cross or touch itself.
        signed_area: of the polygon, in its own units; negative if clockwise.
        expected_area: |det B| / order of the group, in the same units.
        area_error: | |signed_area| - expected_area | / expected_area.
        edge_mismatch: largest distance of a boundary segment from the reversed segment of an
            image, or unless `edge_matching` is "segments" of a vertex from the images' boundaries.
        edge_matching: "segments": one to one; "curves": the same curves with other vertices;
            "none": neither within tolerance.
        overlap: largest area in common with one image.
        total_overlap: sum of the areas in common with all images.
        uncovered: area around the tile that no image covers.
        neighbours: number of images that share a piece of the boundary.
        tolerance: bound on area_error, edge_mismatch, total_overlap and uncovered.
        reasons: what failed, in words; empty if and only if the tile is valid.
    """

    simple: bool
    signed_area: float
    expected_area: float
    area_error: float
    edge_mismatch: float
    edge_matching: EdgeMatching
    overlap: float
    total_overlap: float
    uncovered: float
    neighbours: int
    tolerance: float
    reasons: tuple[str, ...]

    @property
    def valid(self) -> bool:
        """Whether the images of the tile cover the plane without overlap, within tolerance."""
        return not self.reasons

    def as_dict(self) -> dict[str, Any]:
        """The figures as JSON can hold them: NaN and infinity as None, with "valid" added."""
        values: dict[str, Any] = {"valid": self.valid}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and not math.isfinite(value):
                value = None
            values[item.name] = list(value) if isinstance(value, tuple) else value
        return values

    def require(self) -> None:
        """Do nothing if the tile is valid.

        Raises:
            CertificationError: with the reasons, if it is not.
        """
        if not self.valid:
            raise CertificationError(
                f"this tile does not tile the plane: {'; '.join(self.reasons)}"
            )


def certify(tile: Tile, *, tolerance: float = 1e-9) -> Certificate:
    """Check that the images of `tile` under its group tile the plane.

    Proof. Orient all images counter-clockwise and let n(x) be the number of images that contain x;
    n is invariant under the group and constant off the boundaries. Suppose that segment i of T is
    the reverse of segment s(i) of an image g_i(T), and that s is a permutation. As an invariant
    chain, the sum of all boundaries then equals minus itself (replace every g(e_i) by
    -g g_i(e_s(i))), so it vanishes: n does not jump across any segment and is constant. Its mean
    over a lattice cell is order * area / |det B|. If that is one, n = 1: with T simple, its images
    cover the plane once. This uses no class table, only the polygon and the group.

    When partner edges are the same curves with different vertices (bricks laid in half bond, say),
    no such permutation exists. Then the boundary must lie within tolerance of the images'
    boundaries as a curve, and the proof rests on the areas alone: no image overlaps T, and a ring
    around T is covered, so the covered set is open and closed. Both areas are also computed, as an
    independent check, when the segments match.

    Args:
        tile: any scale and position; coordinates a factor 1e6 larger than the tile leave no room
            for the default tolerance in double precision.
        tolerance: relative, see `Certificate`.

    Raises nothing for a bad tile: the certificate says what is wrong. `OrbiflowError` for what is no
    `Tile`, and for a tolerance that is not a positive number.
    """
    instance(tile, Tile, "the tile", "Tile(polygon, group) makes one")
    tolerance = number(tolerance, "tolerance", 0, above=True)
    size = expected_area(tile)
    area = tile.signed_area
    figures = _Figures(area, size, tolerance)
    try:
        around = surroundings(tile, _MARGIN)
    except OrbiflowError as error:
        return figures.refuse(str(error))
    crossing = _self_crossing(tile, around.ring)
    if crossing:
        return figures.refuse(crossing, *_edge_mismatch(around, tolerance))
    overlap, total, uncovered = _areas(around)
    mismatch, matching = _edge_mismatch(around, tolerance)
    count = len(neighbours_among(around, max(1e-7, tolerance)).edge)
    return figures.certificate(mismatch, matching, overlap, total, uncovered, count)


@dataclass(frozen=True)
class _Figures:
    """The figures that are there whatever the tile, and how a certificate is made of them."""

    area: float
    size: float
    tolerance: float

    @property
    def area_error(self) -> float:
        return abs(abs(self.area) - self.size) / self.size

    def refuse(
        self, reason: str, mismatch: float = math.nan, matching: EdgeMatching = "none"
    ) -> Certificate:
        nan = math.nan
        return Certificate(
            False, self.area, self.size, self.area_error, mismatch, matching,
            nan, nan, nan, 0, self.tolerance, (reason,),
        )  # fmt: skip

    def certificate(
        self,
        mismatch: float,
        matching: EdgeMatching,
        overlap: float,
        total: float,
        uncovered: float,
        count: int,
    ) -> Certificate:
        reasons = []
        if not self.area_error <= self.tolerance:
            reasons.append(
                f"its area {abs(self.area):.9g} is not the group's {self.size:.9g} "
                f"(relative error {self.area_error:.1e})"
            )
        if not mismatch <= self.tolerance:
            reasons.append(f"its edges miss their partners by {mismatch:.1e} of its size")
        if not total <= self.tolerance:
            reasons.append(f"it overlaps its neighbours by {total:.1e} of its area")
        if not uncovered <= self.tolerance:
            reasons.append(f"its images leave {uncovered:.1e} of its area uncovered around it")
        return Certificate(
            True, self.area, self.size, self.area_error, mismatch, matching,
            overlap, total, uncovered, count, self.tolerance, tuple(reasons),
        )  # fmt: skip


def _self_crossing(tile: Tile, ring: Array) -> str:
    """Why the ring is not a simple polygon, and where in the tile's coordinates; "" if it is."""
    polygon = shapely.Polygon(ring)
    if shapely.is_valid(polygon) and polygon.area > 0:
        return ""
    reason = str(shapely.is_valid_reason(polygon))
    found = re.fullmatch(r"(.*)\[(\S+) (\S+)\]", reason)
    if not found:
        return f"the polygon is not simple: {reason}"
    x, y = (
        np.array([float(found[2]), float(found[3])]) * math.sqrt(expected_area(tile)) + tile.center
    )
    return f"the polygon is not simple: {found[1].lower()} near ({x:.6g}, {y:.6g})"


def _edge_mismatch(around: Surroundings, tolerance: float) -> tuple[float, EdgeMatching]:
    match = match_segments(around, tolerance)
    mismatch = float(match.distance.max())
    if mismatch <= tolerance and match.one_to_one:
        return mismatch, "segments"
    curves = curve_distance(around)
    return curves, "curves" if curves <= tolerance else "none"


def _areas(around: Surroundings) -> tuple[float, float, float]:
    """Largest and total overlap with the images, and uncovered area in a ring around the tile."""
    polygon = shapely.Polygon(around.ring)
    images = np.asarray(shapely.polygons(around.images))
    region = shapely.buffer(polygon, _MARGIN, quad_segs=2)
    shapely.prepare(region)
    images = images[shapely.intersects(region, images)]
    common = shapely.area(shapely.intersection(polygon, images, grid_size=_GRID))
    covered = shapely.union_all([polygon, *images], grid_size=_GRID)
    uncovered = shapely.area(shapely.difference(region, covered, grid_size=_GRID))
    return float(common.max(initial=0.0)), float(common.sum()), float(uncovered)
