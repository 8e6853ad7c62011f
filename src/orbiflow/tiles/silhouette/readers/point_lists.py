"""Polygons as lines of text, two numbers for each vertex: goal polygons, aerofoils, tables of points.

- A goal polygon of Nagata and Imahori (`.dat`): a line `n`, then n lines `x y`, with y down. Source of
  the format: https://github.com/nagata-yuichi/EscherTiling.
- An aerofoil (`.dat`), with y up: a title, then the points from the trailing edge around the nose and
  back (Selig), or the numbers of points of both sides and then these, each from the nose (Lednicer).
- Points in two columns or under a header that names them, with y up.
"""

import re
from itertools import pairwise

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.outlines import MAX_VERTICES, clean_ring
from orbiflow.tiles.silhouette.readers.globe import may_be_joined
from orbiflow.tiles.silhouette.readers.point_tables import read_bare_table, read_table
from orbiflow.tiles.silhouette.readers.reading import Reading, Source, quoted
from orbiflow.tiles.silhouette.readers.text_lines import Line, cells_of, lines_of, value_of

HIGHEST = 0.6  # of an aerofoil's length: its height
NEAR = 0.05  # of an aerofoil's length: its ends, and its nose, are so near those of its box
BETWEEN = (999.0, 999.0)  # elements of an aerofoil, as XFOIL and MSES part them


def read_points(path: Source) -> Reading:
    """Read a polygon from lines of text: see above.

    Raises `InputFileError` for anything else, with the line that does not fit.
    """
    lines = lines_of(path)
    first = lines[0]
    pairs = [_pair(line.text) for line in lines]
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
        return _counted(path, lines, pairs[1:])
    if (table := read_table(path, lines)) is not None:
        return table
    if len(lines) > 3 and pairs[1] is not None:
        return _plain(path, lines[1:], first.text)
    if (table := read_bare_table(path, lines)) is not None:
        return table
    raise InputFileError(
        f"{path}: line {first.number}: {quoted(first.text)} is not a number of vertices, a vertex (two "
        "numbers, `x y`) or a title of lines that are; save the polygon as one of these"
    )


def _pair(text: str) -> tuple[float, float] | None:
    values = [value_of(cell) for cell in cells_of(text)]
    if len(values) != 2 or values[0] is None or values[1] is None:
        return None
    return values[0], values[1]


def _vertex(path: Source, line: Line) -> tuple[float, float]:
    pair = _pair(line.text)
    if pair is not None and np.isfinite(pair).all():
        return pair
    where = f"{path}: line {line.number}: {quoted(line.text)}"
    if pair is not None or re.search(r"nan|inf", line.text, re.IGNORECASE):
        raise InputFileError(f"{where}: every coordinate must be a finite number")
    more = len(cells_of(line.text)) > 2
    cure = "; of more columns, name two in a header, x and y" if more else ""
    raise InputFileError(f"{where} is not a vertex; write two numbers, `x y`{cure}")


def _counted(path: Source, lines: list[Line], pairs: list[tuple[float, float] | None]) -> Reading:
    """Read a goal polygon, or an aerofoil whose title is a number."""
    first, rest = lines[0], lines[1:]
    title = first.text.strip()
    n = int(title) if len(title) < 10 else MAX_VERTICES + 1
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
    extra = rest[n:]
    points = [_vertex(path, line) for line in rest[:n]]
    also = [line for line in extra if _pair(line.text) is not None]
    if [_pair(line.text) for line in also] == [points[0]]:  # the ring is closed
        extra, also = [line for line in extra if line not in also], []
    if also:
        raise InputFileError(
            f"{path}: line {first.number} promises {n} vertices and {n + len(also)} follow; correct "
            "it, or remove it if it is a title"
        )
    outline, notes = clean_ring(points, str(path), InputFileError)
    if extra:
        what = f"left {len(extra)} line{'s' * (len(extra) > 1)} after the vertices unread"
        notes.append(f"{what} (line {extra[0].number} on)")
    if n == len(known) and _is_aerofoil(known):
        notes.append(
            "took line 1 for the number of vertices, and y to point down, as in goal polygons"
        )
    return Reading(outline, True, "dat", None, tuple(notes))


def _plain(path: Source, lines: list[Line], title: str) -> Reading:
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
    notes += may_be_joined(points)
    outline, dropped = clean_ring(points, str(path), InputFileError)
    return Reading(outline, False, "dat", None, (*notes, *dropped, "took y to point up"))


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
    """Whether points run from the end of least or greatest x around the nose and back to it."""
    if len(points) < 5:
        return False
    low, high = points.min(axis=0), points.max(axis=0)
    length = high[0] - low[0]
    ends = (points[[0, -1], 0] > high[0] - NEAR * length).all()
    nose = int(np.argmin(points[:, 0]))
    steps = np.sign(np.diff(points[:, 0]))
    is_monotonic = (steps[:nose] <= 0).all() and (steps[nose:] >= 0).all()
    return bool(ends and is_monotonic and high[1] - low[1] < HIGHEST * length)
