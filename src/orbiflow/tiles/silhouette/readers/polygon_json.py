"""Polygons in JSON, GeoJSON and WKT, with y up unless the file says otherwise."""

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.runtime import is_list, is_object
from orbiflow.tiles.silhouette.outlines import clean_ring
from orbiflow.tiles.silhouette.readers.globe import at_date_line, may_be_joined, on_map, stretched
from orbiflow.tiles.silhouette.readers.json_points import (
    POLYGON_KEYS,
    Annotation,
    annotations,
    check_pairs,
    is_finite,
    largest_annotation,
    rings_of,
)
from orbiflow.tiles.silhouette.readers.reading import Reading, Source, quoted, read_bytes
from orbiflow.tiles.silhouette.readers.ring_parts import largest_of

MAX_BYTES = 16 * 2**20
MAX_POLYGONS = 10_000
UP = 'took y to point up; if it points down, write {"outline": [...], "y_down": true}'
_KEYS = ", ".join(f'"{key}"' for key in POLYGON_KEYS)
_CURVES = re.compile(r"CURVE|CIRCULARSTRING|MULTISURFACE", re.IGNORECASE)
_OTHERS = {
    "Topology": "is TopoJSON, which is not read; convert it to GeoJSON (mapshaper.org does)",
    "esri": 'is JSON of Esri ("rings"), which is not read; export GeoJSON',
}


def read_json(path: Source) -> Reading:
    """Read a polygon from JSON, with y up unless the file says otherwise.

    Taken are: a list of [x, y] pairs, of objects with x and y, or of such lists; an object with lists
    "x" and "y", or with any of these under a word of `POLYGON_KEYS`, and optionally `"y_down": true`;
    GeoJSON; annotations of COCO and labelme, with y down. Of several polygons the largest is kept.
    """
    content = _content(path)
    if is_object(content) and not any(key in content for key in POLYGON_KEYS):
        if (found := annotations(path, content)) is not None:
            return _annotated(path, *found)
        if "type" in content and not content.keys() >= {"x", "y"}:
            return _geojson(path, content)
    points, y_down, notes = _find_polygon(path, content)
    way = [UP] if y_down is None else []
    rings = rings_of(path, points)
    found = _of_rings(path, rings, bool(y_down))
    return replace(found, notes=(*notes, *found.notes, *way))


def _annotated(path: Source, found: list[Annotation], notes: list[str]) -> Reading:
    for annotation in found:
        for ring in annotation.rings:
            check_pairs(path, ring)
    best, more = largest_annotation(found)
    reading = _of_rings(path, best.rings, True)
    return replace(reading, notes=(*more, *notes, *reading.notes))


def _of_rings(path: Source, rings: list[list[Any]], y_down: bool) -> Reading:
    """Return the largest of rings whose numbers nobody calls degrees."""
    cleaned: list[Array] = []
    notes: list[str] = []
    for points in rings:
        check_pairs(path, points)
        if is_finite(points):
            notes += may_be_joined(np.array(points, dtype=float).reshape(-1, 2))
        outline, dropped = clean_ring(points, str(path), InputFileError)
        cleaned.append(outline)
        notes += dropped
    if len(cleaned) == 1:
        return Reading(cleaned[0], y_down, "json", None, tuple(notes))
    outline, more, seen = largest_of(cleaned)
    notes = [f"took the largest part of {len(cleaned)} rings of points", *notes, *more]
    return Reading(outline, y_down, "json", None, tuple(dict.fromkeys(notes)), seen=seen)


def read_wkt(path: Source) -> Reading:
    """Read the largest polygon of a text such as POLYGON ((0 0, 1 0, 0 1)), with y up."""
    text = read_bytes(path, MAX_BYTES).decode("utf-8-sig", errors="replace").strip()
    if _CURVES.search(text):
        raise InputFileError(
            f"{path}: WKT of curved geometry, which is not read; convert it to a POLYGON of straight "
            "sides (ST_CurveToLine does)"
        )
    try:
        found = shapely.from_wkt(
            text.partition(";")[2] if text.upper().startswith("SRID") else text
        )
    except shapely.errors.GEOSException as exc:
        raise InputFileError(f"{path}: not valid WKT ({exc})") from exc
    parts = shapely.get_parts([found])
    if polygons := [part for part in parts if isinstance(part, Polygon) and not part.is_empty]:
        rings = [[shapely.get_coordinates(ring).tolist() for ring in _rings(p)] for p in polygons]
        return _reading(
            path, rings, [], on_globe=bool(re.match(r"SRID=4326\s*;", text, re.IGNORECASE))
        )
    raise InputFileError(f"{path}: WKT of type {found.geom_type}; save a POLYGON or MULTIPOLYGON")


def _rings(polygon: Polygon) -> list[BaseGeometry]:
    return [polygon.exterior, *polygon.interiors]


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
    if not keys and content.keys() >= {"x", "y"}:
        return content, y_down, []
    if not keys:
        if content.keys() & {"rings", "geometryType"} or is_object(content.get("geometry")):
            raise InputFileError(f"{path}: {_OTHERS['esri']}")
        found = ", ".join(quoted(str(key)) for key in list(content)[:8]) or "nothing"
        raise InputFileError(
            f"{path}: none of {_KEYS} is in it (it has {found}); put the list of vertices under one "
            "of them"
        )
    points = content[keys[0]]
    if not is_list(points) and not is_object(points):
        raise InputFileError(f'{path}: "{keys[0]}" must be a list of [x, y] pairs')
    notes = [f'took "{keys[0]}", left {", ".join(keys[1:])} unread'] if len(keys) > 1 else []
    return points, y_down, notes


def _geojson(path: Source, content: dict[str, Any]) -> Reading:
    if content["type"] in _OTHERS:
        raise InputFileError(f"{path}: {_OTHERS[content['type']]}")
    polygons, others = _polygons(path, content)
    if not polygons:
        kinds = ", ".join(quoted(kind) for kind in dict.fromkeys(others)) or "nothing"
        raise InputFileError(
            f"{path}: GeoJSON of type {quoted(str(content['type']))} with no polygon (it has {kinds}); "
            "save a Polygon or MultiPolygon, or a Feature with one"
        )
    notes = [f"left {', '.join(sorted({*others}))} unread"] if others else []
    rings: list[list[list[Any]]] = []
    for polygon in polygons:
        if not is_list(polygon) or not polygon or not all(is_list(ring) for ring in polygon):
            raise InputFileError(f'{path}: the GeoJSON Polygon has no ring under "coordinates"')
        if any(is_list(at) and len(at) > 2 for ring in polygon for at in ring):
            notes = [note for note in notes if "altitudes" not in note] + [
                "left the altitudes unread"
            ]
        rings.append([[at[:2] if is_list(at) else at for at in ring] for ring in polygon])
    return _reading(path, rings, notes, on_globe=True)


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
        below = {"FeatureCollection": "features", "GeometryCollection": "geometries"}.get(kind)
        coordinates = found.get("coordinates")
        if kind == "Feature":
            waiting.append(found.get("geometry"))
        elif below is not None:
            inner = found.get(below)
            waiting += inner if is_list(inner) else [None]
        elif kind == "Polygon":
            polygons.append(coordinates)
        elif kind == "MultiPolygon":
            polygons += coordinates if is_list(coordinates) else [None]
        elif kind == "LineString" and is_list(coordinates) and coordinates[:1] == coordinates[-1:]:
            polygons.append([coordinates])
        else:
            others.append(kind)
        if len(polygons) + len(others) > MAX_POLYGONS:
            raise InputFileError(
                f"{path}: over {MAX_POLYGONS} geometries; save the one that you mean"
            )
    return polygons, others


def _reading(
    path: Source, polygons: list[list[list[Any]]], notes: list[str], *, on_globe: bool = False
) -> Reading:
    """Return the largest of polygons, given by their rings, of which the first is the outer one."""
    rings: list[Array] = []
    for first, *others in polygons:
        outer, *holes = _outer_first(path, [first, *others])
        if outer is not first:
            notes = [*notes, "took the ring around the others for the outer one"]
        if holes and len(polygons) == 1:
            notes = [f"filled {len(holes)} hole{'s' * (len(holes) > 1)}", *notes]
        points = np.array(outer, dtype=float) if is_finite(outer) else outer
        if isinstance(points, np.ndarray):
            points, more = on_map(path, points) if on_globe else (points, may_be_joined(points))
            notes += [note for note in more if note not in notes]
        ring, dropped = clean_ring(points, str(path), InputFileError)
        rings.append(ring)
        notes += dropped
    if len(rings) == 1:
        more = stretched(rings[0]) if on_globe else ()
        return Reading(rings[0], False, "json", None, (*notes, *more))
    rings, joined = at_date_line(rings) if on_globe else (rings, [])
    ring, more, seen = largest_of(rings)
    notes = [*notes, *joined, *more, *(stretched(ring) if on_globe else ())]
    return Reading(ring, False, "json", None, tuple(notes), seen=seen)


def _outer_first(path: Source, rings: list[list[Any]]) -> list[list[Any]]:
    """Return the rings of a polygon, the outer one first: none has a larger box."""
    check_pairs(path, rings[0])
    if len(rings) == 1:
        return rings
    for ring in rings[1:]:
        check_pairs(path, ring)
    sizes = [
        float(np.ptp(np.array(r, float), axis=0).prod()) if r and is_finite(r) else 0.0
        for r in rings
    ]
    outer = int(np.argmax(sizes))
    return [rings[outer], *rings[:outer], *rings[outer + 1 :]]
