"""Files of lines on the globe: GeoJSON, or tables of latitude and longitude."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.arguments import described
from orbiflow.arrays import Array
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import Space
from orbiflow.density.tables import read_table
from orbiflow.errors import InputFileError, SettingError, system_errors

MAX_BYTES = 32_000_000
MAX_POINTS = 1_000_000
"""Limits of a file: Natural Earth's finest coastline has 18 MB and 400,000 points."""

_MAX_DEPTH = 20
"""Depth of collections within collections."""

_SHAPES = {"LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}
"""Depth of the lists of positions in each kind of geometry that has lines."""

_POINTS = ("Point", "MultiPoint")
_COLLECTIONS = {"FeatureCollection": "features", "GeometryCollection": "geometries"}
_EDGE = 1e-4
"""Degrees from a pole or longitude 180 within which a polygon's edge is where the globe was cut."""

_ROUNDING = 1e-3
"""Degrees beyond a pole that are taken for rounding."""


def coastlines_for(space: Space, settings: PlotSettings) -> list[Array]:
    """Return the lines that settings ask for, which only the sphere can have."""
    if settings.coastlines is None:
        return earth() if settings.earth and _is_earth(space, settings) else []
    if space.name != "sphere":
        raise SettingError(f"{{coastlines}} apply to the sphere, not to the {space.name}")
    return read_coastlines(settings.coastlines)


def _is_earth(space: Space, settings: PlotSettings) -> bool:
    """Return whether columns are latitude and longitude, by their names or without names."""
    name = (settings.names or space.columns)[0].casefold()
    on_earth = space.name == "sphere" and space.columns[0] == "lat"
    return on_earth and bool(re.match(r"lat|column\d", name))


@cache
def earth() -> list[Array]:
    """Return the Earth's coastlines (M, 2), of Natural Earth at 1:110 million."""
    with files("orbiflow.density.pictures").joinpath("coastlines.npy").open("rb") as file:
        return _parted(np.load(file, allow_pickle=False) / 100)


def read_coastlines(path: Path) -> list[Array]:
    """Read lines (M, 2) of latitude and longitude in degrees from GeoJSON (RFC 7946) or a table.

    Polygons become rings, without edges along longitude 180 or at a pole, where files cut what is
    whole on the globe. In a table, a row whose latitude is beyond 90 ends a line.
    """
    with system_errors(InputFileError, f"cannot read {path}"):
        if path.exists() and not path.is_file():
            raise InputFileError(f"cannot read {path}: it is not a file")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise InputFileError(
                f"{path} has {size / 1e6:.0f} MB, more than {MAX_BYTES / 1e6:.0f}: take coarser lines"
            )
        with path.open("rb") as file:
            start = file.read(4096)
    known = {b"\x00\x00\x27\x0a": "a shapefile", b"PK\x03\x04": "a zip archive"}
    for magic, what in known.items():
        if start.startswith(magic):
            raise InputFileError(
                f"{path} is {what}: make GeoJSON of it, with ogr2ogr -f GeoJSON lines.geojson FILE.shp"
            )
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    lines = _geojson(path) if text.startswith((b"{", b"[")) else _table(path)
    if not lines:
        raise InputFileError(f"{path} holds no lines: coastlines need two points or more each")
    if sum(map(len, lines)) > MAX_POINTS:
        raise InputFileError(f"{path} has more than {MAX_POINTS} points: take coarser lines")
    return lines


def _table(path: Path) -> list[Array]:
    return [
        _checked(path, line) for line in _parted(read_table(path, columns=None, width=2).values)
    ]


def _parted(values: Array) -> list[Array]:
    """Return the lines in values (N, 2), of which a latitude beyond 90 ends one."""
    parts = np.split(values, np.flatnonzero(abs(values[:, 0]) > 90))
    lines = [part[abs(part[:, 0]) <= 90] for part in parts]
    return [line for line in lines if len(line) > 1]


def _geojson(path: Path) -> list[Array]:
    try:
        content = json.loads(path.read_bytes())
        return list(_lines(path, content, 0))
    except (ValueError, RecursionError) as error:  # ValueError: neither JSON nor UTF-8
        raise InputFileError(f"{path} is not GeoJSON: {error}"[:300]) from error


def _lines(path: Path, item: Any, depth: int) -> Iterator[Array]:
    """Yield the lines (M, 2), M > 1, of a feature, a geometry or a collection of them."""
    kind = item.get("type") if isinstance(item, dict) else None
    kind = kind if isinstance(kind, str) else None
    if kind == "Topology":
        raise InputFileError(
            f"{path} is TopoJSON: make GeoJSON of it, with ogr2ogr -f GeoJSON lines.geojson {path.name}"
        )
    if depth > _MAX_DEPTH:
        raise InputFileError(f"{path} has collections more than {_MAX_DEPTH} deep")
    if kind in _COLLECTIONS:
        inner = item.get(_COLLECTIONS[kind])
        if not isinstance(inner, list):
            raise InputFileError(f"{path}: a {kind} without a list of them is not GeoJSON")
        for part in inner:
            yield from _lines(path, part, depth + 1)
    elif kind == "Feature":
        if item.get("geometry") is not None:
            yield from _lines(path, item["geometry"], depth + 1)
    elif kind in _SHAPES:
        for line in _positions(path, kind, item.get("coordinates"), _SHAPES[kind]):
            parts = without_cuts(line) if kind.endswith("Polygon") else [line]
            yield from (part for part in parts if len(part) > 1)
    elif kind not in _POINTS:
        raise InputFileError(
            f"{path} is not GeoJSON: expected a feature or a geometry, got {described(kind)}"
        )


def _positions(path: Path, kind: str, items: Any, depth: int) -> list[Array]:
    """Return latitudes and longitudes (M, 2) of positions in lists `depth` deep, without heights."""
    if not isinstance(items, list):
        raise InputFileError(f"{path}: the coordinates of a {kind} must be lists {depth} deep")
    if depth > 1:
        return [line for item in items for line in _positions(path, kind, item, depth - 1)]
    try:
        # a position is longitude, latitude
        line = np.array([(p[1], p[0]) for p in items], dtype=float).reshape(-1, 2)
    except (TypeError, ValueError, IndexError, KeyError, OverflowError) as error:
        raise InputFileError(
            f"{path}: a {kind} has a position that is not longitude, latitude"
        ) from error
    line = _checked(path, line)
    line[:, 0] = np.clip(line[:, 0], -90, 90)
    return [line]


def _checked(path: Path, line: Array) -> Array:
    """Return a line (M, 2) whose latitudes and longitudes are degrees."""
    wrong = ~((abs(line[:, 0]) <= 90 + _ROUNDING) & (abs(line[:, 1]) <= 360))  # NaN, too
    if wrong.any():
        lat, lon = line[wrong.argmax()]
        raise InputFileError(
            f"{path}: latitude {lat:g}, longitude {lon:g} is beyond the globe: give degrees (WGS 84), "
            "in GeoJSON the longitude first"
        )
    return line


def without_cuts(ring: Array) -> list[Array]:
    """Return a polygon's ring in pieces, without the edges along which a flat map was cut."""
    lat, lon = abs(ring).T
    at_pole, at_cut = abs(lat - 90) < _EDGE, abs(lon - 180) < _EDGE
    edges = (at_pole[1:] & at_pole[:-1]) | (at_cut[1:] & at_cut[:-1])
    borders = [0, *(np.flatnonzero(edges) + 1).tolist(), len(ring)]
    return [ring[first:last] for first, last in pairwise(borders)]


def simplified(lines: list[Array], most: int) -> list[Array]:
    """Return lines of about `most` points in all at most, coarser if they must be."""
    from shapely import LineString

    tolerance = 0.01
    while sum(map(len, lines)) > most and tolerance < math.inf:
        lines = [np.array(LineString(line).simplify(tolerance).coords) for line in lines]
        tolerance *= 2
        if tolerance > 0.1:  # islands that nobody would see
            lines = [line for line in lines if np.ptp(line, axis=0).max() > tolerance]
    return lines
