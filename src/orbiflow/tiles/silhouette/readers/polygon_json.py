"""Polygons in JSON, GeoJSON and WKT."""

import json
import re
from typing import Any

import shapely
from shapely import Polygon

from orbiflow.errors import InputFileError
from orbiflow.runtime import is_list, is_object
from orbiflow.tiles.silhouette.readers.reading import Reading, Source, quoted, read_bytes
from orbiflow.tiles.silhouette.readers.rings import read_rings

MAX_BYTES = 16 * 2**20
MAX_RINGS = 10_000
MAX_NESTED = 2  # lists of rings in one another, as of a MultiPolygon
POLYGON_KEYS = ("polygon", "tile", "outline", "points", "vertices")
"""What a list of vertices stands under; of several, the first is taken."""

UP = 'took y to point up; if it points down, write {"outline": [...], "y_down": true}'
_KEYS = ", ".join(f'"{key}"' for key in POLYGON_KEYS)
_AXES = frozenset(("x", "y"))
_CURVES = re.compile(r"CURVE|CIRCULARSTRING|MULTISURFACE", re.IGNORECASE)
_BELOW = {"FeatureCollection": "features", "GeometryCollection": "geometries"}


def read_json(path: Source) -> Reading:
    """Read a polygon from JSON, with y up unless the file says otherwise.

    Taken are: a list of [x, y] pairs, of objects with x and y, or of such lists; an object with lists
    "x" and "y", or with any of these under a word of `POLYGON_KEYS`, and optionally `"y_down": true`;
    GeoJSON. Of several polygons the largest is kept.
    """
    content = _content(path)
    has_points = is_object(content) and (
        content.keys() & {*POLYGON_KEYS} or content.keys() >= _AXES
    )
    if is_object(content) and "type" in content and not has_points:
        return _geojson(path, content)
    points, y_down, notes = _find_polygon(path, content)
    found = _read_pairs(path, _rings(path, points), bool(y_down), notes)
    return found if y_down is not None else found.with_notes(UP)


def _read_pairs(path: Source, rings: list[Any], y_down: bool, notes: list[str]) -> Reading:
    """Return the largest of rings whose numbers nobody calls degrees."""
    for ring in rings:
        _check_pairs(path, ring)
    several = [f"took the largest part of {len(rings)} rings of points"] * (len(rings) > 1)
    return read_rings(path, rings, "json", y_down=y_down, notes=[*notes, *several])


def _content(path: Source) -> object:
    data = read_bytes(path, MAX_BYTES)
    try:
        return json.loads(data)
    except json.JSONDecodeError as exc:
        where = f"line {exc.lineno}, column {exc.colno}"
        raise InputFileError(f"{path}: {where}: not valid JSON ({exc.msg})") from exc
    except RecursionError as exc:
        raise InputFileError(f"{path}: nested too deeply to be a polygon") from exc
    except ValueError as exc:
        raise InputFileError(f"{path}: not valid JSON ({exc})") from exc


def _find_polygon(path: Source, content: object) -> tuple[Any, bool | None, list[str]]:
    """Return the vertices in `content`, whether y points down if it says so, and notes."""
    if is_list(content):
        return content, None, []
    if not is_object(content):
        raise InputFileError(f"{path}: holds a single value, not a polygon; write [[x, y], ...]")
    keys = [key for key in POLYGON_KEYS if key in content]
    y_down = content.get("y_down")
    if "y_down" in content and not isinstance(y_down, bool):
        raise InputFileError(f'{path}: "y_down" must be true or false')
    if not keys and content.keys() >= _AXES:
        return content, y_down, []
    if not keys:
        found = ", ".join(quoted(str(key)) for key in list(content)[:8]) or "nothing"
        raise InputFileError(
            f"{path}: none of {_KEYS} is in it (it has {found}); put the vertices of one polygon under "
            "one of them, or export that polygon as GeoJSON or its shape as a mask (PNG)"
        )
    points = content[keys[0]]
    if not is_list(points) and not is_object(points):
        raise InputFileError(f'{path}: "{keys[0]}" must be a list of [x, y] pairs')
    notes = [f'took "{keys[0]}", left {", ".join(keys[1:])} unread'] if len(keys) > 1 else []
    return points, y_down, notes


def _rings(path: Source, value: Any, depth: int = MAX_NESTED) -> list[Any]:
    """Return the rings in a value: of pairs, of objects with x and y, of two lists, or of rings."""
    if is_object(value) and value.keys() >= _AXES:
        xs, ys = value["x"], value["y"]
        if not is_list(xs) or not is_list(ys) or len(xs) != len(ys):
            raise InputFileError(f'{path}: "x" and "y" must be lists of numbers, as many in each')
        return [[list(pair) for pair in zip(xs, ys, strict=True)]]
    if not is_list(value) or not value:
        return [value]
    first: object = value[0]
    if is_object(first) and first.keys() >= _AXES:
        return [[[p["x"], p["y"]] if is_object(p) and p.keys() >= _AXES else p for p in value]]
    nested = is_list(first) and first and (is_list(first[0]) or is_object(first[0]))
    if not depth or not nested:
        return [value]
    found = [ring for part in value for ring in _rings(path, part, depth - 1)]
    if len(found) > MAX_RINGS:
        raise InputFileError(f"{path}: over {MAX_RINGS} rings; save the one that you mean")
    return found


def _check_pairs(path: Source, points: Any) -> None:
    """Raise `InputFileError` for a list that is not one of pairs of numbers."""
    if not is_list(points):
        raise InputFileError(f"{path}: {quoted(json.dumps(points))} is no list of pairs [x, y]")
    for i, pair in enumerate(points):
        if not is_list(pair) or len(pair) != 2 or not all(type(n) in (int, float) for n in pair):
            raise InputFileError(
                f"{path}: vertex {i} (counted from 0) is {quoted(json.dumps(pair))}, not a pair of "
                "numbers [x, y]"
            )


def _area(ring: list[Any]) -> float:
    """Return the area of a ring, 0 for what has none or is too large to be computed."""
    is_finite = all(abs(n) < 1e300 for pair in ring for n in pair)
    return float(Polygon(ring).area) if len(ring) > 2 and is_finite else 0.0


def _geojson(path: Source, content: dict[str, Any]) -> Reading:
    polygons, others = _polygons(path, content)
    if not polygons:
        kinds = ", ".join(quoted(kind) for kind in dict.fromkeys(others)) or "nothing"
        raise InputFileError(
            f"{path}: GeoJSON of type {quoted(str(content['type']))} with no polygon (it has {kinds}); "
            "save a Polygon or MultiPolygon, or a Feature with one"
        )
    notes = [f"left {', '.join(sorted({*others}))} unread"] if others else []
    for polygon in polygons:
        if not is_list(polygon) or not polygon or not all(is_list(ring) for ring in polygon):
            raise InputFileError(f'{path}: the GeoJSON Polygon has no ring under "coordinates"')
    places = (at for polygon in polygons for ring in polygon for at in ring if is_list(at))
    notes += ["left the altitudes unread"] * any(len(at) > 2 for at in places)
    flat = [
        [[at[:2] if is_list(at) else at for at in ring] for ring in polygon] for polygon in polygons
    ]
    return _read_polygons(path, flat, notes, degrees=True)


def _polygons(path: Source, content: dict[str, Any]) -> tuple[list[Any], list[str]]:
    """Return the rings of all polygons in GeoJSON, and the types of what else is in it."""
    polygons: list[Any] = []
    others: list[str] = []
    waiting: list[object] = [content]
    while waiting:
        found = waiting.pop(0)
        kind = found.get("type") if is_object(found) else None
        if not is_object(found) or not isinstance(kind, str):
            others.append("nothing" if found is None else "what is no geometry")
            continue
        coordinates, inner = found.get("coordinates"), found.get(_BELOW.get(kind, ""))
        if kind == "Feature":
            waiting.append(found.get("geometry"))
        elif kind in _BELOW:
            waiting += inner if is_list(inner) else [None]
        elif kind == "Polygon":
            polygons.append(coordinates)
        elif kind == "MultiPolygon":
            polygons += coordinates if is_list(coordinates) else [None]
        elif kind == "LineString" and is_list(coordinates) and coordinates[:1] == coordinates[-1:]:
            polygons.append([coordinates])
        else:
            others.append(kind)
        if len(polygons) + len(others) > MAX_RINGS:
            raise InputFileError(f"{path}: over {MAX_RINGS} geometries; save the one that you mean")
    return polygons, others


def read_wkt(path: Source) -> Reading:
    """Read the largest polygon of a text such as POLYGON ((0 0, 1 0, 0 1)), with y up."""
    text = read_bytes(path, MAX_BYTES).decode("utf-8-sig", errors="replace").strip()
    if _CURVES.search(text):
        raise InputFileError(
            f"{path}: WKT of curved geometry, which is not read; convert it to a POLYGON of straight "
            "sides (ST_CurveToLine does)"
        )
    srid = re.match(r"SRID=(\d+)\s*;", text, re.IGNORECASE)
    try:
        found = shapely.from_wkt(text[srid.end() :] if srid else text)
    except shapely.errors.GEOSException as exc:
        raise InputFileError(f"{path}: not valid WKT ({exc})") from exc
    parts = shapely.get_parts([found])
    polygons = [
        [shapely.get_coordinates(ring).tolist() for ring in (part.exterior, *part.interiors)]
        for part in parts
        if isinstance(part, Polygon) and not part.is_empty
    ]
    if not polygons:
        raise InputFileError(
            f"{path}: WKT of type {found.geom_type}; save a POLYGON or MULTIPOLYGON"
        )
    return _read_polygons(path, polygons, [], degrees=srid is not None and srid[1] == "4326")


def _read_polygons(
    path: Source, polygons: list[list[Any]], notes: list[str], *, degrees: bool
) -> Reading:
    """Return the largest of polygons, given by their rings, of which none is larger than the outer."""
    outer: list[Any] = []
    for rings in polygons:
        for ring in rings:
            _check_pairs(path, ring)
        outer.append(max(rings, key=_area))
        if outer[-1] is not rings[0]:
            notes = [*notes, "took the ring around the others for the outer one"]
    holes = len(polygons[0]) - 1 if len(polygons) == 1 else 0
    filled = [f"filled {holes} hole{'s' * (holes > 1)}"] * (holes > 0)
    return read_rings(path, outer, "json", degrees=degrees or None, notes=[*filled, *notes])
