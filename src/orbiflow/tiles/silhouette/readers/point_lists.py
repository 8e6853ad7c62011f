"""Polygons as lines of text, a vertex on each: goal polygons, aerofoils, lists and tables of points.

- A goal polygon of Nagata and Imahori (`.dat`): a line `n`, then n lines `x y`, with y down. Source of
  the format: https://github.com/nagata-yuichi/EscherTiling.
- An aerofoil (`.dat`), with y up: a title, then the points from the trailing edge around the nose and
  back (Selig), or the numbers of points of both sides and then these, each from the nose (Lednicer).
- Points in two columns, in two that a header names, or in two after row numbers, with y up. A column of
  parts distinguishes several rings.
"""

import re
from collections.abc import Sequence
from functools import cached_property
from itertools import groupby, pairwise

import numpy as np
from shapely import Polygon

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.outlines import MAX_VERTICES
from orbiflow.tiles.silhouette.readers.reading import Reading, Source, quoted, read_bytes
from orbiflow.tiles.silhouette.readers.rings import read_rings

MAX_BYTES = 16 * 2**20
MAX_HEIGHT = 0.6  # of an aerofoil's length
MAX_END_GAP = 0.05  # of an aerofoil's length: between its ends and the end of its box
MIN_ROWS = 3  # of a ring, and on average of each value of a column of parts
BETWEEN = (999.0, 999.0)  # elements of an aerofoil, as XFOIL and MSES part them
COLUMNS = {
    **dict.fromkeys(("x", "lon", "lng", "long", "longitude", "easting", "east"), "x"),
    **dict.fromkeys(("y", "lat", "latitude", "northing", "north"), "y"),
}
DEGREES = frozenset(("lon", "lng", "long", "longitude", "lat", "latitude"))
PIXELS = {"row": "y", "rows": "y", "col": "x", "cols": "x", "column": "x", "columns": "x"}
PARTS = {
    *("part", "parts", "piece", "ring", "polygon", "poly", "shape", "object", "feature", "fid"),
    *("id", "group", "contour", "path", "component", "l1", "l2", "l3"),
}
"""Words in the names of columns that distinguish rings, such as QGIS's and R's."""

_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?")
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")  # of "pickup_longitude" and "decimalLatitude"


class TextLine:
    """A line that is neither blank nor a comment.

    - `number`: Its number in the file, from 1.
    - `run`: How many times blank lines came before it.
    """

    def __init__(self, number: int, text: str, run: int) -> None:
        self.number, self.text, self.run = number, text, run

    @cached_property
    def cells(self) -> list[str]:
        """The cells, between semicolons, tabs, commas or blanks: the first of these that it has.

        Where blanks part them, every number may have a decimal comma.
        """
        text, words = self.text.strip(), self.text.split()
        for separator in (";", "\t"):
            if separator in text:
                return [cell.strip() for cell in text.rstrip(separator).split(separator)]
        if len(words) > 1 and all(re.fullmatch(r"[+-]?\d+,\d+", word) for word in words):
            return words
        return [cell.strip() for cell in text.rstrip(",").split(",")] if "," in text else words

    @cached_property
    def values(self) -> list[float | None]:
        """The number in each cell, perhaps in quotes or with a decimal comma; None for what is none."""
        plain = [cell.strip('"').replace("\u2212", "-") for cell in self.cells]
        return [float(c.replace(",", ".")) if _NUMBER.fullmatch(c) else None for c in plain]

    @property
    def pair(self) -> tuple[float, float] | None:
        """The two numbers that it is, or None."""
        match self.values:
            case [float(x), float(y)]:
                return x, y
            case _:
                return None

    def refused(self, path: Source, reason: str) -> InputFileError:
        """Return the error for a line that does not fit."""
        return InputFileError(f"{path}: line {self.number}: {quoted(self.text)} {reason}")


def read_points(path: Source) -> Reading:
    """Read a polygon from lines of text: see above.

    Raises `InputFileError` for anything else, with the line that does not fit.
    """
    lines = _lines(path)
    first = lines[0]
    pairs = [line.pair for line in lines]
    if BETWEEN in pairs[1:-1]:
        raise InputFileError(
            f"{path}: line {lines[pairs.index(BETWEEN)].number}: 999 parts the elements of an "
            "aerofoil; save one outline alone"
        )
    if pairs[0] is not None:
        known = np.array([pair for pair in pairs if pair is not None])
        is_title = _is_aerofoil(known[1:]) and abs(known[0]).max() > 2 * abs(known[1:]).max()
        return _plain(path, lines[int(is_title) :], first.text if is_title else "")
    if re.fullmatch(r"\s*\d+\s*", first.text):
        return _counted(path, lines)
    if (header := _header(first)) and len(header) == len(lines[min(1, len(lines) - 1)].cells):
        return _table(path, lines, header)
    if len(lines) > 3 and pairs[1] is not None:
        return _plain(path, lines[1:], first.text)
    if len(first.values) > 2 and None not in first.values:
        return _numbered(path, lines)
    raise first.refused(
        path,
        "is not a vertex (two numbers, `x y`), a number of vertices, or a title above vertices: this "
        "text is not a polygon; give one, or a picture (PNG, JPEG, WebP or SVG)",
    )


def _lines(path: Source) -> list[TextLine]:
    """Return lines that are neither blank nor comments."""
    try:
        text = read_bytes(path, MAX_BYTES).decode("utf-8-sig")
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


def _vertex(path: Source, line: TextLine) -> tuple[float, float]:
    pair = line.pair
    if pair is not None and np.isfinite(pair).all():
        return pair
    if pair is not None or re.search(r"nan|inf", line.text, re.IGNORECASE):
        where = f"{path}: line {line.number}: {quoted(line.text)}"
        raise InputFileError(f"{where}: every coordinate must be a finite number")
    cure = "; of more columns, name two in a header, x and y" * (len(line.cells) > 2)
    raise line.refused(path, f"is not a vertex; write two numbers, `x y`{cure}")


def _counted(path: Source, lines: list[TextLine]) -> Reading:
    """Read a goal polygon, or an aerofoil whose title is a number."""
    first, rest = lines[0], lines[1:]
    title = first.text.strip()
    n = int(title) if len(title) < 10 else MAX_VERTICES + 1
    pairs = [line.pair for line in rest]
    known = np.array([pair for pair in pairs if pair is not None], dtype=float).reshape(-1, 2)
    is_title = n != len(rest) or title.startswith("0")
    runs = [line.run for line in rest]
    if is_title and None not in pairs and (_is_aerofoil(known) or _sides(known, runs) is not None):
        return _plain(path, rest, title)
    if not 3 <= n <= MAX_VERTICES:
        raise InputFileError(
            f"{path}: line {first.number}: {title[:20]} vertices; from 3 to {MAX_VERTICES} can be read"
        )
    if len(rest) < n:
        raise InputFileError(
            f"{path}: line {first.number} promises {n} vertices and {len(rest)} follow; "
            "the file is cut short or its first line is wrong"
        )
    points, extra = [_vertex(path, line) for line in rest[:n]], rest[n:]
    also = [line for line in extra if line.pair is not None]
    if [line.pair for line in also] == [points[0]]:  # the ring is closed
        extra, also = [line for line in extra if line not in also], []
    if also:
        raise InputFileError(
            f"{path}: line {first.number} promises {n} vertices and {n + len(also)} follow; correct "
            "it, or remove it if it is a title"
        )
    reading = read_rings(path, [points], "dat", y_down=True, degrees=False)
    if extra:
        what = f"left {len(extra)} line{'s' * (len(extra) > 1)} after the vertices unread"
        reading = reading.with_notes(f"{what} (line {extra[0].number} on)")
    if n == len(known) and _is_aerofoil(known):
        return reading.with_notes(
            "took line 1 for the number of vertices, and y to point down, as in goal polygons"
        )
    return reading


def _plain(path: Source, lines: list[TextLine], title: str) -> Reading:
    """Read lines of two numbers, below a title or none: an aerofoil of one run or two, or a ring."""
    notes = [f"took line {lines[0].number - 1} for a title: {quoted(title)}"] if title else []
    points = np.array([_vertex(path, line) for line in lines])
    sides = _sides(points, [line.run for line in lines])
    if sides is not None:
        upper, lower = sides
        points = np.concatenate([upper[::-1], lower[1:] if (upper[0] == lower[0]).all() else lower])
        notes.append("joined the two sides of an aerofoil at its nose")
    elif lines[0].run != lines[-1].run:
        later = next(b for a, b in pairwise(lines) if a.run != b.run)
        raise InputFileError(
            f"{path}: line {later.number} begins another run of points, after a blank line; save one "
            "outline alone"
        )
    return read_rings(path, [points], "dat", notes=notes).with_notes("took y to point up")


def _sides(points: Array, runs: list[int]) -> tuple[Array, Array] | None:
    """Return the sides of an aerofoil in Lednicer's format, each from the nose; None if it is none."""
    if len(points) < 2:
        return None
    counts, rest = points[0], points[1:]
    if (counts > 1).all() and (counts % 1 == 0).all() and counts.sum() == len(rest):
        sides = rest[: int(counts[0])], rest[int(counts[0]) :]
    elif len({*runs}) == 2:
        n = runs.index(runs[-1])
        sides = points[:n], points[n:]
    else:
        return None
    is_one = len(sides[0]) > 1 < len(sides[1]) and _is_aerofoil(
        np.vstack([sides[0][::-1], sides[1]])
    )
    return sides if is_one else None


def _is_aerofoil(points: Array) -> bool:
    """Return whether points run from the end of least or greatest x around the nose and back."""
    if len(points) < 5:
        return False
    low, high = points.min(axis=0), points.max(axis=0)
    length = high[0] - low[0]
    ends = (points[[0, -1], 0] > high[0] - MAX_END_GAP * length).all()
    nose = int(np.argmin(points[:, 0]))
    steps = np.sign(np.diff(points[:, 0]))
    is_monotonic = (steps[:nose] <= 0).all() and (steps[nose:] >= 0).all()
    return bool(ends and is_monotonic and high[1] - low[1] < MAX_HEIGHT * length)


def _numbered(path: Source, lines: list[TextLine]) -> Reading:
    """Read three columns without a header, the first of which numbers the rows."""
    first, rows = lines[0], [line.values for line in lines]
    if len(rows) > 2 and all(len(row) == 3 and None not in row for row in rows):
        numbers, x, y = np.array(rows, dtype=float).T
        if (np.diff(numbers) == 1).all() and numbers[0] in (0, 1):
            took = "took the first of three columns for row numbers, the others for x and for y"
            points, notes = np.stack([x, y], axis=1), [f"{took}, which points up"]
            return read_rings(path, [points], "dat", degrees=False, notes=notes)
    raise first.refused(
        path,
        f"has {len(rows[0])} columns of numbers and nothing says which are x and y; write a header, "
        "such as x,y,z or part,x,y",
    )


def _header(line: TextLine) -> list[str]:
    """Return the axis that the name of each column says, "" for none; nothing without x and y."""
    axes = [{COLUMNS.get(word.lower(), "") for word in _WORD.findall(cell)} for cell in line.cells]
    named = [(found - {""}).pop() if len(found - {""}) == 1 else "" for found in axes]
    in_pixels = [PIXELS.get(name.strip('"').lower(), "") for name in line.cells]
    return next((names for names in (named, in_pixels) if {"x", "y"} <= {*names}), list[str]())


def _table(path: Source, lines: Sequence[TextLine], header: list[str]) -> Reading:
    """Read the columns x and y, or longitude and latitude, that a header names."""
    if header.count("x") > 1 or header.count("y") > 1:
        raise lines[0].refused(path, "names several columns of x or of y; keep one of each")
    names, at = lines[0].cells, (header.index("x"), header.index("y"))
    x, y = (names[k] for k in at)
    points = _points(path, lines, at)
    is_down = y.strip('"').lower() in PIXELS
    are_degrees = all({w.lower() for w in _WORD.findall(name)} & DEGREES for name in (x, y))
    if are_degrees and (beyond := np.flatnonzero(abs(points[:, 1]) > 90)).size:
        line = lines[1 + int(beyond[0])]
        raise InputFileError(
            f"{path}: line {line.number}: {points[beyond[0], 1]:g} under {quoted(y)} is no "
            "latitude, which lies from -90 to 90; are the names of the columns exchanged?"
        )
    way = "down" if is_down else "up"
    rings, parted = _parted(lines, header, points)
    notes = [f"took {quoted(x)} for x and {quoted(y)} for y, which points {way}", *parted]
    return read_rings(path, rings, "dat", y_down=is_down, degrees=are_degrees, notes=notes)


def _points(path: Source, lines: Sequence[TextLine], at: tuple[int, int]) -> Array:
    """Return the numbers (N, 2) in two columns below a header."""
    names = lines[0].cells
    points: list[list[float | None]] = []
    for line in lines[1:]:
        values = line.values
        pair = [values[k] if k < len(values) == len(names) else None for k in at]
        if None in pair or not np.isfinite(np.array(pair, float)).all():
            raise line.refused(
                path,
                f"has no two numbers under {quoted(names[at[0]])} and {quoted(names[at[1]])}, of "
                f"{len(names)} columns",
            )
        points.append(pair)
    if not points:
        raise InputFileError(f"{path}: there is no line below the header; export it again")
    return np.array(points, dtype=float)


def _parted(
    lines: Sequence[TextLine], header: list[str], points: Array
) -> tuple[list[Array], list[str]]:
    """Return the rings that columns of parts distinguish, and a note of it.

    A column distinguishes rings if its name says so. Another one does if its values come in runs that
    are closed rings, or that make no ring together; else a note asks.
    """
    names = lines[0].cells
    rows = [[cell.strip('"') for cell in line.cells] for line in lines[1:]]
    columns = {k: [row[k] for row in rows] for k in range(len(names)) if not header[k]}
    runs = {k: values for k, values in columns.items() if _runs(values)}
    named = [k for k in runs if {*re.split(r"[^a-z0-9]+", names[k].lower())} & PARTS]
    if named:
        return _split(points, [names[k] for k in named], [runs[k] for k in named])
    for k, values in runs.items():
        if len(_runs(values)) > len({*values}):
            continue
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
    return found if are_labels and 1 < len(found) <= len(values) / MIN_ROWS else []


def _split(
    points: Array, names: list[str], columns: list[list[str]]
) -> tuple[list[Array], list[str]]:
    """Return points by their values in columns, without groups too small to be rings, and a note."""
    keys = list(zip(*columns, strict=True))
    groups = [[k for k, own in enumerate(keys) if own == key] for key in dict.fromkeys(keys)]
    rings = [points[group] for group in groups if len(group) >= MIN_ROWS]
    named = " and ".join(map(quoted, names))
    note = f"took the largest part of {len(groups)} rings that {named} distinguishes"
    return rings or [points], [note]


def _is_closed(ring: Array) -> bool:
    return len(ring) > MIN_ROWS and bool((ring[0] == ring[-1]).all())
