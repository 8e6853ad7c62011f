"""Tables of points: a header names the columns, and a column of parts tells several rings apart."""

import re
from collections.abc import Sequence
from itertools import groupby

import numpy as np
from shapely import Polygon

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.outlines import clean_ring
from orbiflow.tiles.silhouette.readers.globe import at_date_line, on_map, stretched
from orbiflow.tiles.silhouette.readers.reading import Reading, Source, quoted
from orbiflow.tiles.silhouette.readers.ring_parts import largest_of
from orbiflow.tiles.silhouette.readers.text_lines import Line, cells_of, value_of

COLUMNS = {
    "x": ("x", "lon", "lng", "long", "longitude", "easting", "east"),
    "y": ("y", "lat", "latitude", "northing", "north"),
}
DEGREES = frozenset(("lon", "lng", "long", "longitude", "lat", "latitude"))
PIXELS = {"row": "y", "rows": "y", "col": "x", "cols": "x", "column": "x", "columns": "x"}
PARTS = {
    *("part", "parts", "piece", "ring", "polygon", "poly", "shape", "object", "feature", "fid"),
    *("id", "group", "contour", "path", "component", "l1", "l2", "l3"),
}
"""Words in the names of columns that tell rings apart, such as QGIS's and R's."""

LEAST_ROWS = 3  # of a ring, and on average of each value of a column of parts
_AXES = {name: axis for axis, names in COLUMNS.items() for name in names}
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")  # of "pickup_longitude" and "decimalLatitude"
_Point = tuple[float, float]


def read_table(path: Source, lines: Sequence[Line]) -> Reading | None:
    """Read columns x and y, or longitude and latitude, that the first line names, or return None."""
    names = cells_of(lines[0].text)
    header = [_axis(name) for name in names]
    if not {"x", "y"} <= {*header}:
        in_pixels = [PIXELS.get(name.strip('"').lower(), "") for name in names]
        header = in_pixels if {"x", "y"} <= {*in_pixels} else header
    if not {"x", "y"} <= {*header}:
        return None
    if len(header) != len(cells_of(lines[min(1, len(lines) - 1)].text)):
        return None
    return _table(path, lines, header)


def read_bare_table(path: Source, lines: Sequence[Line]) -> Reading | None:
    """Read three columns without a header whose first numbers the rows; None if not all are numbers.

    Raises `InputFileError` for other columns of numbers.
    """
    rows = [[value_of(cell) for cell in cells_of(line.text)] for line in lines]
    if len(rows[0]) < 3 or None in rows[0]:
        return None
    if all(len(row) == 3 and None not in row for row in rows):
        numbers, x, y = np.array(rows, dtype=float).T
        if len(rows) > 2 and (np.diff(numbers) == 1).all() and numbers[0] in (0, 1):
            outline, notes = clean_ring(np.stack([x, y], axis=1), str(path), InputFileError)
            took = "took the first of three columns for row numbers, the others for x and for y"
            return Reading(outline, False, "dat", None, (f"{took}, which points up", *notes))
    raise InputFileError(
        f"{path}: line {lines[0].number}: {quoted(lines[0].text)} has {len(rows[0])} columns of "
        "numbers and nothing says which are x and y; write a header, such as x,y,z or part,x,y"
    )


def _axis(cell: str) -> str:
    """Return the axis that a column's name says, or ""."""
    axes = {_AXES.get(word.lower(), "") for word in _WORD.findall(cell)} - {""}
    return axes.pop() if len(axes) == 1 else ""


def _words(name: str) -> set[str]:
    return {*re.split(r"[^a-z0-9]+", name.lower())}


def _table(path: Source, lines: Sequence[Line], header: list[str]) -> Reading:
    """Read the columns x and y, or longitude and latitude, that a header names."""
    if header.count("x") > 1 or header.count("y") > 1:
        raise InputFileError(
            f"{path}: line {lines[0].number}: {quoted(lines[0].text)} names several columns of x or "
            "of y; keep one of each"
        )
    names = cells_of(lines[0].text)
    x, y = names[header.index("x")], names[header.index("y")]
    points = _points(path, lines, (header.index("x"), header.index("y")))
    is_down = y.strip('"').lower() in PIXELS
    are_degrees = all({w.lower() for w in _WORD.findall(name)} & DEGREES for name in (x, y))
    if are_degrees and (beyond := np.flatnonzero(abs(points[:, 1]) > 90)).size:
        line = lines[1 + int(beyond[0])]
        raise InputFileError(
            f"{path}: line {line.number}: {points[beyond[0], 1]:g} under {quoted(y)} is no "
            "latitude, which lies from -90 to 90; are the names of the columns exchanged?"
        )
    way = "down" if is_down else "up"
    took = f"took {quoted(x)} for x and {quoted(y)} for y, which points {way}"
    rings, parted = _parted(lines, header, points)
    found = _largest(path, rings, are_degrees)
    notes = (took, *parted, *found.notes)
    return Reading(found.outline, is_down, "dat", None, notes, seen=found.seen)


def _points(path: Source, lines: Sequence[Line], at: tuple[int, int]) -> Array:
    """Return the numbers (N, 2) in two columns below a header."""
    names = cells_of(lines[0].text)
    points: list[_Point] = []
    for line in lines[1:]:
        cells = cells_of(line.text)
        values = [value_of(cells[i]) if i < len(cells) == len(names) else None for i in at]
        if values[0] is None or values[1] is None or not np.isfinite(np.array(values, float)).all():
            raise InputFileError(
                f"{path}: line {line.number}: {quoted(line.text)} has no two numbers under "
                f"{quoted(names[at[0]])} and {quoted(names[at[1]])}, of {len(names)} columns"
            )
        points.append((values[0], values[1]))
    if not points:
        raise InputFileError(f"{path}: there is no line below the header; export it again")
    return np.array(points)


def _largest(path: Source, rings: Sequence[Array], are_degrees: bool) -> Reading:
    """Return the largest part of rings, with notes."""
    notes: list[str] = []
    cleaned: list[Array] = []
    for ring in rings:
        points, joined = on_map(path, ring) if are_degrees else (ring, [])
        outline, dropped = clean_ring(points, str(path), InputFileError)
        cleaned.append(outline)
        notes += [*dropped, *joined]
    outline, seen = cleaned[0], None
    if len(cleaned) > 1:
        cleaned, joined = at_date_line(cleaned) if are_degrees else (cleaned, [])
        outline, kept, seen = largest_of(cleaned)
        notes += [*joined, *kept]
    notes += stretched(outline) if are_degrees else ()
    return Reading(outline, False, "dat", None, tuple(dict.fromkeys(notes)), seen=seen)


def _parted(
    lines: Sequence[Line], header: list[str], points: Array
) -> tuple[list[Array], list[str]]:
    """Return the rings that columns of parts tell apart, and a note of it.

    A column tells rings apart if its name says so. Another one does if its values come in runs that
    are closed rings, or that make no ring together; else a note asks.
    """
    names = cells_of(lines[0].text)
    rows = [[cell.strip('"') for cell in cells_of(line.text)] for line in lines[1:]]
    columns = {k: [row[k] for row in rows] for k in range(len(names)) if not header[k]}
    runs = {k: values for k, values in columns.items() if _runs(values)}
    named = [k for k in runs if _words(names[k]) & PARTS]
    if named:
        return _split(points, [names[k] for k in named], [runs[k] for k in named])
    once = {k: own for k, own in runs.items() if len(_runs(own)) == len({*own})}
    for k, values in once.items():
        rings, notes = _split(points, [names[k]], [values])
        if all(map(_is_closed, rings)) or not (_is_closed(points) or Polygon(points).is_valid):
            return rings, notes
        return [points], [
            f"took all rows for one outline, though {quoted(names[k])} comes in runs: if it numbers "
            "parts, name it part"
        ]
    return [points], []


def _runs(values: list[str]) -> list[str]:
    """Return the values of the runs in a column of labels; none of a single one, or of short ones."""
    found = [value for value, _ in groupby(values)]
    are_labels = all(found) and not any(re.search(r"\d[.,]\d", value) for value in found)
    return found if are_labels and 1 < len(found) <= len(values) / LEAST_ROWS else []


def _split(
    points: Array, names: list[str], columns: list[list[str]]
) -> tuple[list[Array], list[str]]:
    """Return points by their values in columns, without groups too small to be rings, and a note."""
    keys = list(zip(*columns, strict=True))
    groups = [[k for k, own in enumerate(keys) if own == key] for key in dict.fromkeys(keys)]
    rings = [points[group] for group in groups if len(group) >= LEAST_ROWS]
    told = " and ".join(map(quoted, names))
    return rings or [points], [
        f"took the largest part of {len(groups)} rings that {told} tells apart"
    ]


def _is_closed(ring: Array) -> bool:
    return len(ring) > LEAST_ROWS and bool((ring[0] == ring[-1]).all())
