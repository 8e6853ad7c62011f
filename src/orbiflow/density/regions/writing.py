"""Regions as GeoJSON, as a table of vertices, and as a JSON document."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from orbiflow.batch import csv_bytes
from orbiflow.density.regions.boundaries import Outline
from orbiflow.density.regions.levels import DensityRegion
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError

DIGITS = 7
"""Digits after the point of degrees in GeoJSON: a centimetre on the ground."""


def to_geojson(outlines: Sequence[Outline]) -> dict[str, Any]:
    """Return a FeatureCollection with a MultiPolygon for each region, for `json.dumps`.

    Coordinates are longitude and latitude in degrees, outer rings counter-clockwise (RFC 7946, 3.1.6);
    polygons are cut at the antimeridian (3.1.9), and one that holds a pole runs along the edge of the
    map there. Sides are straight in longitude and latitude (3.1.1). Axes are drawn at their northern
    ends.

    The properties of each are `mass` (asked for, or null), `held` and `held_error` (from samples of
    the density), `log_prob` (the threshold, nats per steradian) and its interval of 95 %, `area` in
    steradians, `fraction` of the space, `polygons_mass` and `polygons_mass_error` (from new samples
    inside the polygons).

    Raises:
        OrbiflowError: If the space is not round.
    """
    features: list[dict[str, Any]] = []
    for outline in outlines:
        region = outline.region
        if not outline.window.on_globe:
            raise OrbiflowError(
                "GeoJSON is for places on a globe, not for the angles of a "
                f"{region.density.space.name}: write .json or .csv"
            )
        found = region.to_json()
        names = ("mass", "held", "log_prob", "log_prob_low", "log_prob_high")
        properties = {
            **{name: found[name] for name in names},
            "held_error": region.error,
            "area": outline.size,
            "fraction": outline.fraction,
            "polygons_mass": outline.mass,
            "polygons_mass_error": outline.error,
        }
        rings = [[np.round(ring, DIGITS).tolist() for ring in rings] for rings in outline.rings()]
        geometry = {"type": "MultiPolygon", "coordinates": rings}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return {"type": "FeatureCollection", "features": features}


def outlines_csv(outlines: Sequence[Outline]) -> bytes:
    """Return CSV text with a row for each vertex of the outlines of one density's regions."""
    heads = ["region", "mass", "log_prob", "polygon", "ring", *outlines[0].window.names]
    return csv_bytes(heads, _vertices(outlines))


def _vertices(outlines: Sequence[Outline]) -> Iterator[list[Any]]:
    for number, outline in enumerate(outlines, 1):
        mass = "" if outline.region.mass is None else f"{outline.region.mass:g}"
        level = f"{outline.region.log_prob:.10g}"
        for polygon, rings in enumerate(outline.rings(), 1):
            for ring, points in enumerate(rings):
                for x, y in points:
                    yield [number, mass, level, polygon, ring, f"{x:.10g}", f"{y:.10g}"]


def regions_document(
    regions: Sequence[DensityRegion], outlines: Sequence[Outline], *, samples: int, seed: int
) -> dict[str, Any]:
    """Return one density's regions, with their outlines if there are any, for `json.dumps`."""
    space = regions[0].density.space
    document: dict[str, Any] = {
        "kind": "regions",
        "space": {"name": space.name, **space.settings()},
        "size_unit": size_unit(space),
        "samples": samples,
        "seed": seed,
    }
    if outlines:
        window = outlines[0].window
        document["axes"] = list(window.names)
        document["window"] = [window.low.tolist(), window.high.tolist()]
        document["edges"] = window.edges
    document["regions"] = [one.to_json() for one in outlines or regions]
    return document


def size_unit(space: Space) -> str:
    """Return the unit of sizes in a space's natural measure.

    >>> from orbiflow.density import Torus
    >>> size_unit(Torus(2, unit="degrees"))
    'degrees^2'
    """
    if space.is_round:
        return "steradians"
    return str(space.unit) if space.dim == 1 else f"{space.unit}^{space.dim}"
