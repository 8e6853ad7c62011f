"""Files of lines on the globe: GeoJSON, or tables of latitude and longitude."""

from __future__ import annotations

import math
import re
from codecs import BOM_UTF8
from functools import cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import Space
from orbiflow.density.tables import read_table
from orbiflow.errors import InputFileError, SettingError, system_errors

MAX_BYTES = 32_000_000
MAX_POINTS = 1_000_000
"""Limits of a file: Natural Earth's finest coastline has 18 MB and 400,000 points."""

_EDGE = 1e-4
"""Degrees from a pole or longitude 180 within which a polygon's edge is where the globe was cut."""

_ROUNDING = 1e-3
"""Degrees beyond a pole that are taken for rounding."""


def coastlines_for(space: Space, settings: PlotSettings) -> list[Array]:
    """Return the lines that settings ask for, which only the sphere can have."""
    if settings.coastlines is None:
        name = (settings.names or space.columns)[0].casefold()  # of latitudes, or without one
        on_earth = space.name == "sphere" and space.columns[0] == "lat"
        named = re.match(r"lat|column\d", name)
        return earth() if settings.earth and on_earth and named else []
    if space.name != "sphere":
        raise SettingError(f"{{coastlines}} apply to the sphere, not to the {space.name}")
    return read_coastlines(settings.coastlines)


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
    others = {b"\x00\x00\x27\x0a": "a shapefile", b"PK\x03\x04": "a zip archive"}
    for magic, what in others.items():
        if start.startswith(magic):
            raise InputFileError(
                f"{path} is {what}: make GeoJSON of it, with ogr2ogr -f GeoJSON lines.geojson FILE.shp"
            )
    text = start.removeprefix(BOM_UTF8).lstrip()
    lines = _geojson(path) if text.startswith((b"{", b"[")) else _table(path)
    if not lines:
        raise InputFileError(f"{path} holds no lines: coastlines need two points or more each")
    if sum(map(len, lines)) > MAX_POINTS:
        raise InputFileError(f"{path} has more than {MAX_POINTS} points: take coarser lines")
    return lines


def _table(path: Path) -> list[Array]:
    table = read_table(path)
    if len(table.names) != 2:
        raise InputFileError(
            f"{path} has {len(table.names)} columns: coastlines need a latitude and a longitude"
        )
    values = np.stack([table.numbers(0), table.numbers(1)], axis=1)
    return [_checked(path, line) for line in _parted(values)]


def _parted(values: Array) -> list[Array]:
    """Return the lines in values (N, 2), of which a latitude beyond 90 ends one."""
    parts = np.split(values, np.flatnonzero(abs(values[:, 0]) > 90))
    lines = [part[abs(part[:, 0]) <= 90] for part in parts]
    return [line for line in lines if len(line) > 1]


def _geojson(path: Path) -> list[Array]:
    """Return the lines of GeoJSON, as GEOS reads it: without heights."""
    import shapely

    try:
        shapes = [shapely.from_geojson(path.read_bytes().removeprefix(BOM_UTF8))]
    except shapely.errors.GEOSException as error:
        raise InputFileError(
            f"{path} is no GeoJSON ({str(error)[:200]}): make it with ogr2ogr -f GeoJSON"
        ) from error
    lines: list[Array] = []
    while shapes:
        shape = shapes.pop(0)
        if isinstance(shape, shapely.Polygon):
            for ring in (shape.exterior, *shape.interiors):
                lines += without_cuts(shapely.get_coordinates(ring)[:, ::-1])
        elif isinstance(shape, shapely.LineString):
            lines.append(shapely.get_coordinates(shape)[:, ::-1])
        else:
            shapes = [*getattr(shape, "geoms", ()), *shapes]
    return [_checked(path, line) for line in lines if len(line) > 1]


def _checked(path: Path, line: Array) -> Array:
    """Return a line (M, 2) whose latitudes and longitudes are degrees, if but for rounding."""
    wrong = ~((abs(line[:, 0]) <= 90 + _ROUNDING) & (abs(line[:, 1]) <= 360))  # NaN, too
    if wrong.any():
        lat, lon = line[wrong.argmax()]
        raise InputFileError(
            f"{path}: latitude {lat:g}, longitude {lon:g} is beyond the globe: give degrees (WGS 84), "
            "in GeoJSON the longitude first"
        )
    return np.stack([np.clip(line[:, 0], -90, 90), line[:, 1]], axis=-1)


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
