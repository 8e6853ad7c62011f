"""Polygon files: goal polygons, two columns of points, JSON, GeoJSON and WKT.

- A goal polygon of Nagata and Imahori (`.dat`): a line `n`, then n lines `x y`, with y down. Source of
  the format: https://github.com/nagata-yuichi/EscherTiling.
- Points in two columns, or in those that a header names x and y, or lon and lat, with y up. In a `.dat`
  file a title may stand above them, as in aerofoils of Selig's format.
- JSON: a list of [x, y], or one under "polygon", with y up unless the file says `"y_down": true`.
- GeoJSON and WKT, as GEOS reads them: the largest polygon, with y up.
"""

import json
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.runtime import is_list, is_object
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import MAX_VERTICES, clean_ring, outer_outline, outer_ring
from orbiflow.tiles.silhouette.readers.reading import FileContent, Reading, quoted

MAX_BYTES = 16 * 2**20
MAX_PARTS = 10_000
MAX_WIDENING = 1.1  # more than so much wider than on the ground, a shape gets a note
POLYGON_KEYS = ("polygon", "outline", "tile")
"""What a list of vertices stands under; of several, the first is taken."""

HEADERS = ("x", "y"), ("lon", "lat"), ("longitude", "latitude")
"""The columns of points; the last two are in degrees."""

UP = 'took y to point up; if it points down, write {"outline": [...], "y_down": true}'
_KEYS = ", ".join(f'"{key}"' for key in POLYGON_KEYS)
_SEPARATOR = re.compile(r"\s*[;,\t]\s*|\s+")


class TextLine(NamedTuple):
    """A line that is neither blank nor a comment.

    - `number`: Its number in the file, from 1.
    - `run`: How many times blank lines came before it.
    """

    number: int
    text: str
    run: int

    @property
    def cells(self) -> list[str]:
        """The cells, between semicolons, tabs, commas or blanks."""
        return [cell.strip('"') for cell in _SEPARATOR.split(self.text.strip().rstrip(";,"))]

    def values(self, columns: Sequence[int] = ()) -> list[float]:
        """The numbers in some of the cells, by default in all; none if one of them is no number."""
        cells = self.cells
        try:
            return [float(cells[k]) for k in columns or range(len(cells))]
        except (ValueError, IndexError):
            return []

    def refused(self, path: FileContent, reason: str) -> InputFileError:
        """Return the error for a line that does not fit."""
        return InputFileError(f"{path}: line {self.number}: {quoted(self.text)} {reason}")


def read_points(path: FileContent) -> Reading:
    """Read a polygon from lines of text: see above.

    Raises `InputFileError` for anything else, with the line that does not fit.
    """
    lines = _lines(path)
    first, rest = lines[0], lines[1:]
    if re.fullmatch(r"\s*[1-9]\d*\s*", first.text):
        return _counted(path, int(first.text.strip()[:9]), first, rest)
    if len(first.values()) == 2:
        return _columns(path, lines, (0, 1), degrees=False, notes=["took y to point up"])
    header = [cell.lower() for cell in first.cells]
    for x, y in HEADERS:
        if x in header and y in header and rest:
            notes = [f"took {x} for x and {y} for y, which points up"]
            places, degrees = (header.index(x), header.index(y)), x != "x"
            return _columns(path, rest, places, degrees=degrees, notes=notes)
    if path.suffix.lower() == ".dat" and rest and len(rest[0].values()) == 2:
        notes = [
            f"took line {first.number} for a title: {quoted(first.text)}",
            "took y to point up",
        ]
        return _columns(path, rest, (0, 1), degrees=False, notes=notes)
    raise first.refused(
        path,
        "is not a vertex (two numbers, `x y`), a number of vertices, nor a header that names columns x "
        "and y, or lon and lat; give a polygon, or a picture (PNG, JPEG, WebP or SVG)",
    )


def _lines(path: FileContent) -> list[TextLine]:
    """Return lines that are neither blank nor comments."""
    try:
        text = path.within(MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        raise InputFileError(
            f"{path}: not a text file (byte {exc.start} is not UTF-8); a list of points is one"
        ) from exc
    lines: list[TextLine] = []
    run = after_blank = 0
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            after_blank = 1
        elif not line.lstrip().startswith("#"):
            run += after_blank if lines else 0
            after_blank = 0
            lines.append(TextLine(number, line, run))
    if not lines:
        raise InputFileError(f"{path}: the file holds only blank lines; export it again")
    return lines


def _counted(path: FileContent, count: int, first: TextLine, rest: list[TextLine]) -> Reading:
    """Read a goal polygon; lines of other things may follow its vertices."""
    if not 3 <= count <= MAX_VERTICES:
        raise first.refused(path, f"vertices cannot be read, but 3 to {MAX_VERTICES}")
    extra = rest[count:]
    also = len([line for line in extra if len(line.values()) == 2])
    if also or len(rest) < count:
        raise first.refused(
            path,
            f"promises {count} vertices and {min(len(rest), count) + also} follow; correct it, or "
            "remove it if it is a title",
        )
    left = f"left {len(extra)} line{'s' * (len(extra) > 1)} after the vertices unread"
    notes = [f"{left} (line {extra[0].number} on)"] if extra else []
    points = [_vertex(path, line, (0, 1)) for line in rest[:count]]
    return read_rings(path, [points], "dat", y_down=True, notes=notes)


def _columns(
    path: FileContent,
    lines: list[TextLine],
    places: tuple[int, int],
    degrees: bool,
    notes: list[str],
) -> Reading:
    points = [_vertex(path, line, places) for line in lines]
    later = next((line for line in lines if line.run != lines[0].run), None)
    if later is not None:
        raise later.refused(
            path, "begins another run of points, after a blank line; save one outline alone"
        )
    return read_rings(path, [points], "dat", degrees=degrees, notes=notes)


def _vertex(path: FileContent, line: TextLine, places: tuple[int, int]) -> list[float]:
    values = line.values(places)
    if not values or (places == (0, 1) and len(line.cells) > 2):
        raise line.refused(
            path,
            "is not a vertex; write two numbers, `x y`; of more columns, name two in a header, x and y",
        )
    if not np.isfinite(values).all():
        raise line.refused(path, "is not a vertex: every coordinate must be a finite number")
    return values


def read_json(path: FileContent) -> Reading:
    """Read a polygon from JSON or GeoJSON, with y up unless the file says otherwise."""
    data = path.within(MAX_BYTES)
    try:
        content: object = json.loads(data)
    except json.JSONDecodeError as exc:
        where = f"line {exc.lineno}, column {exc.colno}"
        raise InputFileError(f"{path}: {where}: not valid JSON ({exc.msg})") from exc
    except RecursionError as exc:
        raise InputFileError(f"{path}: nested too deeply to be a polygon") from exc
    except ValueError as exc:
        raise InputFileError(f"{path}: not valid JSON ({exc})") from exc
    y_down: object = None
    notes: list[str] = []
    if is_object(content):
        keys = [key for key in POLYGON_KEYS if key in content]
        if not keys and "type" in content:
            text = json.dumps(content)
            return _largest(path, shapely.from_geojson, text, "GeoJSON", degrees=True)
        if not keys:
            has = ", ".join(quoted(str(key)) for key in list(content)[:8]) or "nothing"
            raise InputFileError(
                f"{path}: none of {_KEYS} is in it (it has {has}); put the vertices of one polygon "
                "under one of them, or export it as GeoJSON or its shape as a mask (PNG)"
            )
        y_down = content.get("y_down")
        if not isinstance(y_down, bool | None):
            raise InputFileError(f'{path}: "y_down" must be true or false')
        notes = [f'took "{keys[0]}", left {", ".join(keys[1:])} unread'] * (len(keys) > 1)
        content = content[keys[0]]
    if not is_list(content):
        raise InputFileError(
            f"{path}: {quoted(json.dumps(content))} must be a list of [x, y] pairs"
        )
    for i, pair in enumerate(content):
        if not is_list(pair) or len(pair) != 2 or not all(type(n) in (int, float) for n in pair):
            raise InputFileError(
                f"{path}: vertex {i} (counted from 0) is {quoted(json.dumps(pair))}, not a pair of "
                "numbers [x, y]"
            )
    reading = read_rings(path, [content], "json", y_down=bool(y_down), notes=notes)
    return reading.with_notes(UP) if y_down is None else reading


def read_wkt(path: FileContent) -> Reading:
    """Read the largest polygon of a text such as POLYGON ((0 0, 1 0, 0 1)), with y up."""
    text = path.within(MAX_BYTES).decode("utf-8-sig", errors="replace").strip()
    srid = re.match(r"SRID=(\d+)\s*;", text, re.IGNORECASE)
    geometry = text[srid.end() :] if srid else text
    degrees = srid is not None and srid[1] == "4326"
    return _largest(path, shapely.from_wkt, geometry, "WKT", degrees=degrees)


def _largest(path: FileContent, read: Any, text: str, kind: str, *, degrees: bool) -> Reading:
    """Return the largest polygon of a text that GEOS reads."""
    try:
        geometry = read(text)
    except (shapely.errors.GEOSException, NotImplementedError) as exc:
        raise InputFileError(
            f"{path}: not valid {kind} of geometries with straight sides ({exc})"
        ) from exc
    parts = shapely.get_parts(shapely.get_parts([geometry]))
    polygons = [part for part in parts if isinstance(part, Polygon) and not part.is_empty]
    if not polygons:
        kinds = " and ".join(sorted({part.geom_type for part in parts})) or geometry.geom_type
        raise InputFileError(
            f"{path}: {kind} of a {kinds} and no polygon; save a POLYGON or MULTIPOLYGON"
        )
    if len(polygons) > MAX_PARTS:
        raise InputFileError(f"{path}: over {MAX_PARTS} polygons; save the one that you mean")
    others = sorted({part.geom_type for part in parts if not isinstance(part, Polygon)})
    notes = [f"left {', '.join(others)} unread"] * bool(others)
    holes = len(polygons[0].interiors) if len(polygons) == 1 else 0
    notes += [f"filled {holes} hole{'s' * (holes > 1)}"] * (holes > 0)
    rings = [outer_ring(part) for part in polygons]
    return read_rings(path, rings, "json", degrees=degrees, notes=notes)


def read_rings(
    path: FileContent,
    rings: Sequence[Any],
    kind: str,
    *,
    y_down: bool = False,
    degrees: bool = False,
    notes: Sequence[str] = (),
) -> Reading:
    """Return the largest part of what rings of pairs make together, with notes.

    `degrees` says whether the pairs are longitudes and latitudes. Raises `InputFileError` for what is
    no ring.
    """
    every_note = list(notes)
    cleaned = [clean_ring(ring, str(path), InputFileError) for ring in rings]
    outline, seen = cleaned[0][0], None
    every_note += [note for _, dropped in cleaned for note in dropped]
    if len(cleaned) > 1:
        parts = polygons_in(shapely.union_all([Polygon(ring) for ring, _ in cleaned]))
        seen = MultiPolygon(parts)
        shape, kept = outer_outline(seen)
        outline = outer_ring(shape)
        every_note += kept
    every_note += _widened(outline) if degrees else []
    return Reading(outline, y_down, kind, None, tuple(dict.fromkeys(every_note)), seen=seen)


def _widened(ring: Array) -> list[str]:
    """Return a note where degrees of longitude are much shorter than those of latitude."""
    latitude = float(ring[:, 1].min() + ring[:, 1].max()) / 2
    wide = 1 / max(np.cos(np.radians(latitude)), 1e-3)
    if wide < MAX_WIDENING or abs(latitude) > 90:
        return []
    return [
        f"took longitudes and latitudes for x and y as they are: at latitude {latitude:.0f} the shape "
        f"is {wide:.2g} times as wide as on the ground; project it first if that matters"
    ]
