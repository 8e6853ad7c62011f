"""Regions of a density as an answer: in words, as JSON, GeoJSON and CSV."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.polygon import orient

from orbiflow.density.regions.boundaries import RegionOutline, parts_of, rings_of
from orbiflow.density.regions.levels import DensityRegion
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Answer, csv_bytes, to_json

DIGITS = 7
"""Digits after the point of degrees in GeoJSON: a centimetre on the ground."""


@dataclass(frozen=True)
class DensityRegions(Answer):
    """Regions of one density.

    - `space`: The name and the settings of its space. `size_unit`: The unit of sizes.
    - `samples`, `seed`: Those from which the masses were told.
    - `regions`: The regions, with their outlines if there are any.
    - `axes`, `window`, `edges`: Of outlines, the names of x and y, two corners of the rectangle that
      they are drawn in, and which of its edges are one.
    """

    kind = "regions"

    space: dict[str, Any]
    size_unit: str
    samples: int
    seed: int
    regions: Sequence[DensityRegion]
    axes: tuple[str, str] | None = None
    window: tuple[list[float], list[float]] | None = None
    edges: str | None = None

    @classmethod
    def of(cls, regions: Sequence[DensityRegion], samples: int, seed: int) -> DensityRegions:
        """Return regions of one density, one or more, as an answer."""
        space, first = regions[0].density.space, regions[0]
        named = {"name": space.name, **space.settings()}
        frame: tuple[Any, ...] = ()
        if isinstance(first, RegionOutline):
            window = first.window
            frame = window.names, (window.low.tolist(), window.high.tolist()), window.edges
        return cls(named, size_unit(space), samples, seed, regions, *frame)

    def outlined(self) -> list[RegionOutline]:
        """The regions that have outlines."""
        return [region for region in self.regions if isinstance(region, RegionOutline)]

    def vertices(self) -> list[list[Any]]:
        """Return the lines of a table of the outlines: the names of columns, then a line a vertex."""
        heads = ["region", "mass", "log_prob", "polygon", "ring", *(self.axes or ())]
        lines: list[list[Any]] = [heads]
        for number, outline in enumerate(self.outlined(), 1):
            mass = "" if outline.mass is None else f"{outline.mass:g}"
            level = f"{outline.log_prob:.10g}"
            for polygon, rings in enumerate(outline.polygons, 1):
                for ring, points in enumerate(rings):
                    for x, y in points:
                        lines.append([number, mass, level, polygon, ring, f"{x:.10g}", f"{y:.10g}"])
        return lines

    def words(self) -> list[str]:
        """Return what the user should know of regions, whose outlines may not have been drawn."""
        lines: list[str] = []
        for region in self.regions:
            lines += [_described(region), *getattr(region, "notes", ())]
        if self.outlined():
            return lines
        space = self.regions[0].density.space
        return [
            f"outlines are drawn in two dimensions, this {space.name} has {space.dimensions}: there "
            "are thresholds and sizes alone; `orbiflow density score --region` says of each row how "
            "far inside it is",
            *lines,
        ]

    def content(self, ending: str) -> bytes:
        """Return the content of a .json, .csv or .geojson; JSON of outlines is long, and compact."""
        if ending == ".geojson":
            return json.dumps(to_geojson(self.outlined()), allow_nan=False).encode()
        if ending == ".json":
            return json.dumps(to_json(self), allow_nan=False).encode()
        heads, *lines = self.vertices()
        return csv_bytes(heads, lines)


def _described(region: DensityRegion) -> str:
    size, fraction, polygons = region.size, region.fraction, ""
    if isinstance(region, RegionOutline):
        size, fraction = region.polygons_size, region.polygons_fraction
        count = len(region.shape.geoms)
        polygons = f"; {count} polygon{'s' * (count != 1)}, which hold{'s' * (count == 1)} "
        polygons += _with_error(region.polygons_mass, region.polygons_mass_error)
    share = "" if fraction is None else f", {_percentage(fraction)} of the space"
    of = "log density" if region.smooth is None else "smoothed log density"
    return (
        f"mass {_with_error(region.held, region.error)}: {of} of at least "
        f"{region.log_prob:.4f} ({region.log_prob_low:.4f} to {region.log_prob_high:.4f}), "
        f"{size:.6g} {size_unit(region.density.space)}{share}{polygons}"
    )


def _with_error(value: float, error: float) -> str:
    """Return a number and its standard error, in two digits of the error, at least four decimals.

    >>> _with_error(0.5, 0.00354), _with_error(0.9999, 0.00001)
    ('0.5000 ± 0.0035', '0.999900 ± 0.000010')
    """
    decimals = 4 if error <= 0 else max(4, 1 - math.floor(math.log10(error)))
    return f"{value:.{decimals}f} ± {error:.{decimals}f}"


def _percentage(share: float) -> str:
    """Return a share in percent, in two decimals or, where these would say nothing, two digits.

    >>> _percentage(0.0218), _percentage(0.0000123), _percentage(0.0)
    ('2.18%', '0.0012%', '0.00%')
    """
    percents = 100 * share
    decimals = 1 - math.floor(math.log10(percents)) if 0 < percents < 0.1 else 2
    return f"{percents:.{decimals}f}%"


def _about_greenwich(outline: RegionOutline) -> shapely.MultiPolygon:
    """Return polygons of longitudes from -180 to 180, cut at the antimeridian and nowhere else."""
    if outline.window.low[0] < 0:
        return outline.shape
    halves = [
        affinity.translate(part, -2 * west)
        for west in (0.0, 180.0)
        for part in parts_of(
            shapely.intersection(list(outline.shape.geoms), shapely.box(west, -90, west + 180, 90))
        )
    ]
    whole = shapely.union_all(halves, grid_size=10.0**-DIGITS)
    return shapely.MultiPolygon([orient(part) for part in parts_of(whole)])


def to_geojson(outlines: Sequence[RegionOutline]) -> dict[str, Any]:
    """Return a FeatureCollection with a MultiPolygon for each region, for `json.dumps`.

    Coordinates are longitude and latitude in degrees, outer rings counter-clockwise (RFC 7946, 3.1.6);
    polygons are cut at the antimeridian (3.1.9), and one that holds a pole runs along the edge of the
    map there. Sides are straight in longitude and latitude (3.1.1). Axes are drawn at their northern
    ends.

    The properties of each are `mass` (asked for, or null), `smooth` (degrees of arc, or null), `held`
    and `held_error` (from samples of the density), `log_prob` (the threshold, nats per steradian) and
    its interval of 95 %, `area` in steradians, `fraction` of the space,
    `polygons_mass` and `polygons_mass_error` (from new samples inside the polygons).
    """
    features: list[dict[str, Any]] = []
    for outline in outlines:
        if not outline.window.on_globe:
            raise OrbiflowError(
                "GeoJSON is for places on a globe, not for points of the "
                f"{outline.density.space.name}: write .json or .csv"
            )
        names = ("mass", "smooth", "held", "log_prob", "log_prob_low", "log_prob_high")
        properties = {
            **{name: getattr(outline, name) for name in names},
            "held_error": outline.error,
            "area": outline.polygons_size,
            "fraction": outline.polygons_fraction,
            "polygons_mass": outline.polygons_mass,
            "polygons_mass_error": outline.polygons_mass_error,
        }
        parts = rings_of(_about_greenwich(outline))
        rings = [[np.round(ring, DIGITS).tolist() for ring in part] for part in parts]
        geometry = {"type": "MultiPolygon", "coordinates": rings}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return {"type": "FeatureCollection", "features": features}


def size_unit(space: Space) -> str:
    """Return the unit of sizes in a space's natural measure.

    >>> from orbiflow.density import Torus
    >>> size_unit(Torus(2, unit="degrees"))
    'degrees^2'
    """
    if space.is_round:
        return "steradians" if space.dim == 2 else f"radians^{space.dim} of the unit sphere"
    if space.axes and not space.is_of_angles:
        return "units of each column" if space.dim > 1 else "units"
    if space.parts:
        return f"{size_unit(space.parts[0])} times {size_unit(space.parts[1])}"
    return str(space.unit) if space.dim == 1 else f"{space.unit}^{space.dim}"
