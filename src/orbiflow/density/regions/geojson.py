"""Outlines on the sphere as GeoJSON (RFC 7946)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from orbiflow.density.regions.outlines import Outline
from orbiflow.errors import OrbiflowError

DIGITS = 7
"""After the point, of degrees: a centimetre on the ground."""


def to_geojson(outlines: Sequence[Outline]) -> dict[str, Any]:
    """A FeatureCollection, a MultiPolygon a region, for `json.dumps`.

    Coordinates are longitude and latitude in degrees, outer rings counter-clockwise (section 3.1.6);
    polygons are cut at the antimeridian (3.1.9), and one that holds a pole runs along the edge of the
    map there. Sides are straight in longitude and latitude (3.1.1). Of axes northern ends are drawn.

    Properties of each: `mass` (asked for, or null), `held` and `held_error` (by samples of the
    density), `log_prob` (the threshold, nats per steradian) and its interval of 95 %, `area` in
    steradians, `fraction` of the space, `polygons_mass` and `polygons_mass_error` (of new samples
    inside the polygons).

    Raises:
        OrbiflowError: for a space that is not round.
    """
    for outline in outlines:
        if not outline.window.on_globe:
            space = outline.region.density.space
            raise OrbiflowError(
                f"GeoJSON is for places on a globe, not for the angles of a {space.name}: write "
                ".json or .csv"
            )
    return {"type": "FeatureCollection", "features": [_feature(outline) for outline in outlines]}


def _feature(outline: Outline) -> dict[str, Any]:
    region = outline.region
    return {
        "type": "Feature",
        "properties": {
            "mass": region.mass,
            "held": region.held,
            "held_error": region.error,
            "log_prob": region.log_prob,
            "log_prob_low": region.log_prob_low,
            "log_prob_high": region.log_prob_high,
            "area": outline.size,
            "fraction": outline.fraction,
            "polygons_mass": outline.mass,
            "polygons_mass_error": outline.error,
        },
        "geometry": {
            "type": "MultiPolygon",
            "coordinates": [
                [np.round(ring, DIGITS).tolist() for ring in rings] for rings in outline.rings()
            ],
        },
    }
