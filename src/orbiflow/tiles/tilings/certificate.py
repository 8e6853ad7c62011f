"""Certificates that a tile tiles the plane (design point 9)."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import math
import re
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypeAlias, cast

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.settings import as_number
from orbiflow.tiles.tilings.prototile import Prototile
from orbiflow.tiles.tilings.surroundings import (
    SegmentMatch,
    Surroundings,
    boundaries_cancel,
    curve_distance,
    match_segments,
    surroundings,
    touching,
)
from orbiflow.tiles.tilings.tiling import Tiles, Tiling, as_tiling

EdgeMatching: TypeAlias = Literal["segments", "curves", "none"]

# On edges that agree but for rounding, GEOS without a grid is plainly wrong in about 3 % of turned
# hexagons (an overlap of 0.93 for neighbours that only touch); snapping to a grid is safe.
_GRID = 1e-12
_LEAST_WIDTH = 100  # the least width of one of several prototiles, in tolerances
_MARGIN = 0.05  # width of the ring around the tile that must be covered; any positive width will do


@dataclass(frozen=True)
class Certificate:
    """The result of `certify`.

    Lengths are in square roots of the expected area, areas relative to it. Figures that could not
    be computed are NaN. With several prototiles each figure is the worst one, and areas are means
    over the tiles.

    Args:
        simple: Whether the polygon does not cross or touch itself.
        signed_area: The polygon's area in its own units, negative if it is clockwise.
        expected_area: |det B| over the number of tiles in a lattice cell, in the same units; for a tile
            without symmetry of its own, over the order of the group.
        area_error: | |signed_area| - expected_area | / expected_area.
        edge_mismatch: The largest distance of a boundary segment from the reversed segment of an
            image, or of a vertex from the images' boundaries unless `edge_matching` is "segments"; or
            of a symmetric tile from its image, if that is larger.
        edge_matching: "segments" if they match one to one, "curves" if the same curves have other
            vertices, "none" if neither holds within tolerance.
        overlap: The largest area in common with one image.
        total_overlap: The sum of the areas in common with all images.
        uncovered: The area around the tile that no image covers.
        neighbours: The number of images that share a piece of the boundary, the largest of all
            prototiles.
        tolerance: The bound on area_error, edge_mismatch, total_overlap and uncovered. A prototile
            whose boundary is shorter than one overlaps others by at most as much times its length,
            and each of several prototiles is at least 100 tolerances wide.
        reasons: What failed, in words; empty if and only if the tile is valid.
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
        """Return the figures as JSON can hold them: NaN and infinity as None, with "valid" added."""
        values: dict[str, Any] = {"valid": self.valid}
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, float) and not math.isfinite(value):
                value = None
            values[item.name] = value
        return {**values, "reasons": list(self.reasons)}

    def require(self) -> None:
        """Raise `CertificationError` with the reasons unless the tile is valid."""
        if not self.valid:
            raise CertificationError(
                f"this tile does not tile the plane: {'; '.join(self.reasons)}"
            )


def certify(tile: Tiles, *, tolerance: float = 1e-9) -> Certificate:
    """Check that the tiles of a tiling cover the plane once (design points 9 and 16).

    Proof. The tiles are the images g(T_k), one for each coset of the stabiliser S_k. Orient all of
    them alike and let n(x) be the number of tiles that contain x; n is invariant under the group
    and constant off the boundaries. Suppose that each boundary segment is the reverse of an image
    of its partner, and that partners are evenly distributed (`boundaries_cancel`). As an invariant
    chain, the sum of all boundaries then equals minus itself, so it vanishes: n does not jump
    across any segment and is constant. Its mean over a lattice cell is sum_k area(T_k) |G| / |S_k|
    over |det B|. If that is one, n = 1: with the T_k simple, the tiles cover the plane once. This
    uses no class table, only polygons and group.

    When partner edges are the same curves with different vertices (bricks laid in half bond, say),
    no such pairing exists. Then boundaries must lie within tolerance of the other tiles' boundaries
    as curves, and the proof rests on the areas alone: no tile overlaps a prototile, and a ring
    around each prototile is covered, so the covered set is open and closed. Both areas are also
    computed, as an independent check, when the segments match.

    Args:
        tile: A tile or a tiling, of any scale and position; double precision cannot hold the default
            tolerance for coordinates a factor 1e6 larger than the tile.
        tolerance: The relative tolerance, see `Certificate`.

    Returns:
        A certificate, also for an invalid tile: it says what is wrong.

    Raises:
        OrbiflowError: for `tile` of another type, and for a tolerance that is not a positive number.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> eighth = Tiling(wallpaper_group("p4m"), [[[0, 0], [0.5, 0], [0.5, 0.5]]])
    >>> certify(eighth).valid, certify(eighth).neighbours
    (True, 3)
    """
    tiling = as_tiling(tile)
    tolerance = as_number(tolerance, "tolerance", above=0)
    shares = np.bincount(tiling.aspects.prototiles, minlength=len(tiling.prototiles))
    area = float(shares @ [p.signed_area for p in tiling.prototiles] / shares.sum())
    size, nan = tiling.tile_area, math.nan
    off = abs(abs(area) - size) / size
    proof = Certificate(False, area, size, off, nan, "none", nan, nan, nan, 0, tolerance, ())
    numbers = range(len(tiling.prototiles))
    try:
        around = [surroundings(tiling, k, _MARGIN) for k in numbers]
    except OrbiflowError as error:
        return replace(proof, reasons=(str(error),))
    mismatch, matching = _edge_mismatch(tiling, around, tolerance)
    proof = replace(proof, edge_mismatch=mismatch, edge_matching=matching)
    for k in numbers:
        crossing = _self_crossing(tiling, k, around[k].ring)
        if crossing:
            return replace(proof, reasons=(crossing,))
    areas = np.array([_areas(a) for a in around])
    overlap, total, bare = (float(x) for x in areas[:, :3].max(axis=0))
    count = max(int(touching(a, max(1e-7, tolerance))[1].sum()) for a in around)
    proof = replace(proof, simple=True, overlap=overlap, total_overlap=total, uncovered=bare)
    return replace(proof, neighbours=count, reasons=_reasons(proof, areas, tiling))


def _reasons(proof: Certificate, areas: Array, tiling: Tiling) -> tuple[str, ...]:
    """Return what fails, given what `_areas` gives for each prototile, (K, 5)."""
    several, bound = len(tiling.prototiles) > 1, proof.tolerance
    _, overlaps, bare, lengths, widths = areas.T
    reasons: list[str] = []
    if several and widths.min() < _LEAST_WIDTH * bound:
        reasons.append(
            f"prototile {widths.argmin()} is only {widths.min():.1e} of a tile's size wide: within "
            f"the tolerance of {bound:.0e} it is hardly more than a line, leave it out"
        )
    if not proof.area_error <= bound:
        symmetry = max(s.order for s in tiling.stabilisers)
        of_order = f" for a tile with a symmetry of order {symmetry}" if symmetry > 1 else ""
        reasons.append(
            f"{'the mean area of its tiles' if several else 'its area'} "
            f"{abs(proof.signed_area):.9g} is not the group's {proof.expected_area:.9g}"
            f"{'' if several else of_order} (relative error {proof.area_error:.1e})"
        )
    if not proof.edge_mismatch <= bound:
        reasons.append(f"its edges miss their partners by {proof.edge_mismatch:.1e} of its size")
    if np.isnan(overlaps).any():
        needles = "a tile has needles or gaps thinner than 1e-12 of its size: smooth its outline"
        return (*reasons, f"overlaps cannot be computed, as {needles}")
    # edges that miss by the tolerance overlap by at most as much times their length
    excess = overlaps / np.minimum(lengths, 1.0)
    if not excess.max() <= bound:
        who = f"prototile {excess.argmax()}" if several else "it"
        whose = "a tile's" if several else "its"
        much = overlaps[excess.argmax()]
        reasons.append(f"{who} overlaps its neighbours by {much:.1e} of {whose} area")
    if not proof.uncovered <= bound:
        who = f"prototile {bare.argmax()}" if several else "it"
        reasons.append(f"its images leave {proof.uncovered:.1e} of its area uncovered around {who}")
    return tuple(reasons)


def _self_crossing(tiling: Tiling, prototile: int, ring: Array) -> str:
    """Return why a ring is not a simple polygon, and where in the tile; "" if it is simple."""
    polygon = shapely.Polygon(ring)
    if shapely.is_valid(polygon) and polygon.area > 0:
        return ""
    what = f"prototile {prototile}" if len(tiling.prototiles) > 1 else "the polygon"
    reason = str(shapely.is_valid_reason(polygon))
    match = re.fullmatch(r"(.*)\[(\S+) (\S+)\]", reason)
    if not match:
        return f"{what} is not simple: {reason}"
    figure: Prototile = tiling.prototiles[prototile]
    x, y = (
        np.array([float(match[2]), float(match[3])]) * math.sqrt(tiling.tile_area) + figure.center
    )
    return f"{what} is not simple: {match[1].lower()} near ({x:.6g}, {y:.6g})"


def _edge_mismatch(
    tiling: Tiling, around: list[Surroundings], tolerance: float
) -> tuple[float, EdgeMatching]:
    asymmetry = max(s.error for s in tiling.stabilisers) / math.sqrt(tiling.tile_area)
    matches: list[SegmentMatch] = [match_segments(a, tolerance) for a in around]
    mismatch = max(float(match.distance.max()) for match in matches)
    if mismatch <= tolerance and boundaries_cancel(tiling, around, matches):
        matching: EdgeMatching = "segments"
    else:
        mismatch = max(curve_distance(a) for a in around)
        matching = "curves" if mismatch <= tolerance else "none"
    return max(mismatch, asymmetry), matching if asymmetry <= tolerance else "none"


def _areas(around: Surroundings) -> tuple[float, float, float, float, float]:
    """Return the largest and total overlap with other tiles, and the uncovered area around.

    After them the length of the prototile's boundary, and its width if it were a strip.
    """
    polygon = shapely.Polygon(around.ring)
    images = cast(NDArray[np.object_], shapely.polygons(around.rings))
    region = shapely.buffer(polygon, _MARGIN, quad_segs=2)
    shapely.prepare(region)
    images = images[shapely.intersects(region, images)]
    length = float(polygon.length)
    width = 2 * float(polygon.area) / length
    try:
        common = shapely.area(shapely.intersection(polygon, images, grid_size=_GRID))
        covered = shapely.union_all([polygon, *images], grid_size=_GRID)
        uncovered = shapely.area(shapely.difference(region, covered, grid_size=_GRID))
    except shapely.GEOSException:  # needles vanish in the grid
        return math.nan, math.nan, math.nan, length, width
    return float(common.max(initial=0.0)), float(common.sum()), float(uncovered), length, width
