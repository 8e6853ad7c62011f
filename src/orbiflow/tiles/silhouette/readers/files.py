"""The reader of all silhouette files, which finds out a file's kind from its content or name.

Polygons written out as numbers are read here: the `.dat` files of Nagata and Imahori, JSON and GeoJSON.
"""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon

from orbiflow.arguments import as_path
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import is_list, is_object
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import (
    MAX_VERTICES,
    clean_ring,
    is_thread,
    outer_outline,
    outer_ring,
    simplified,
)
from orbiflow.tiles.silhouette.readers.pictures import read_image
from orbiflow.tiles.silhouette.readers.reading import (
    FileContent,
    Reading,
    Source,
    check_file,
    read_bytes,
    read_head,
)
from orbiflow.tiles.silhouette.readers.svg import read_svg

_HEAD_BYTES = 65536
GAP = 0.03  # of the drawing's size: such gaps in an outline are closed
MOST = 0.8  # of the lines' area
_IMAGE_MAGIC = (
    *(b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM"),
    *(b"GIF87a", b"GIF89a", b"II*\0", b"MM\0*"),
)
_SAVE_SVG = "open it in the program that made it, or in Inkscape, and save it as SVG or PNG"
_CONVERTIBLE = {
    b"\x1f\x8b": "is gzip-compressed (an .svgz?); decompress it first",
    b"%PDF": f"is a PDF or Illustrator file; {_SAVE_SVG}",
    b"%!PS": f"is a PostScript or Illustrator file; {_SAVE_SVG}",
    b"\xc5\xd0\xd3\xc6": f"is an EPS file; {_SAVE_SVG}",
    b"8BPS": "is a Photoshop file; save it as PNG",
}
_BY_ENDING = {
    **dict.fromkeys(
        (".ai", ".eps", ".cdr", ".pdf"), f"is a drawing of another program; {_SAVE_SVG}"
    ),
    ".psd": "is a Photoshop file; save it as PNG",
    **dict.fromkeys(
        (".heic", ".heif", ".avif"),
        "is a photograph of a kind that is not read; save it as PNG or JPEG",
    ),
    **{
        f".{kind}": f"is no {kind.upper()} image, or a damaged one; export or download it again"
        for kind in ("png", "jpg", "jpeg", "webp", "gif", "bmp", "tif", "tiff")
    },
}
_SVG = re.compile(r"<(\w+:)?svg[\s>]")
_COUNT_LINE = re.compile(r"\s*\d+\s*[\r\n]")
_BY_NAME = {".svg": "svg", ".json": "json", ".geojson": "json", ".dat": "dat"}
_READABLE = "a PNG, JPEG or WebP image, an SVG drawing, a .json polygon or a .dat polygon"


def read_outline(
    path: str | Path | FileContent, *, threshold: float | None = None, invert: bool | None = None
) -> Reading:
    """Read the outline of the silhouette in the file at `path`, or in a `FileContent`.

    `threshold` and `invert` are for images (see `read_image`). Raises `InputFileError` for a file
    that is missing, of an unknown kind, damaged, too large, or without a usable shape, and
    `OrbiflowError` for a setting that cannot be used.
    """
    path = path if isinstance(path, FileContent) else as_path(path, "the silhouette's file")
    check_file(path)
    kind = _kind(path, read_head(path, _HEAD_BYTES))
    if kind == "image":
        return _bridged(read_image(path, threshold=threshold, invert=invert))
    for name, value in (("threshold", threshold), ("invert", invert)):
        if value is not None:
            where = f"images only and {path} is a polygon or drawing"
            raise OrbiflowError(f"{name} applies to {where}; leave it out")
    # extreme coordinates overflow in the geometry, whose result is then refused
    with np.errstate(all="ignore"):
        return _bridged({"svg": read_svg, "json": read_json, "dat": read_dat}[kind](path))


def _bridged(reading: Reading) -> Reading:
    """Return what the lines of a drawing enclose but for small gaps, where they alone are a thread."""
    seen = reading.seen
    size = 0.0 if seen is None else float(np.ptp(np.reshape(seen.bounds, (2, 2)), axis=0).max())
    if seen is None or not is_thread(Polygon(reading.outline), size):
        return reading
    grown = outer_outline(seen.buffer(GAP / 2 * size))[0]
    body = grown.buffer(-GAP / 2 * size)
    body = max(polygons_in(body), key=lambda part: part.area, default=Polygon())
    lines = seen.buffer(0).intersection(body).area  # what is traced may touch itself
    if is_thread(body, size) or not MOST * seen.area < lines < body.area / 2:
        return reading
    note = (
        f"the largest part is no more than a line: took instead what the lines enclose when gaps of "
        f"up to {GAP:.0%} of the drawing's size are closed"
    )
    kept = [other for other in reading.notes if not other.startswith("kept the largest")]
    thin = simplified(body, GAP * size / 50)
    return replace(
        reading, outline=outer_ring(thin if thin.is_valid else body), notes=(*kept, note)
    )


def _kind(path: Source, head: bytes) -> str:
    if head.startswith(_IMAGE_MAGIC) or (head[:4] == b"RIFF" and head[8:12] == b"WEBP"):
        return "image"
    text = _text(head)
    if text is not None and not head.startswith(tuple(_CONVERTIBLE)):
        if text.startswith("<") and _SVG.search(text):
            return "svg"
        if text.startswith(("[", "{")):
            return "json"
        if _COUNT_LINE.match(text):
            return "dat"
        # the reader that fits the name of a text file gives the best message
        if path.suffix.lower() in _BY_NAME:
            return _BY_NAME[path.suffix.lower()]
    raise InputFileError(f"{path}: {_what(path, head, text)}")


def _text(head: bytes) -> str | None:
    """Return `head` as text without leading blanks, or None where it is binary."""
    utf16 = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    if not utf16 and b"\0" in head:
        return None
    text = head.decode("utf-16" if utf16 else "utf-8", errors="replace")
    return text.lstrip("\ufeff").lstrip()


def _what(path: Source, head: bytes, text: str | None) -> str:
    for magic, what in _CONVERTIBLE.items():
        if head.startswith(magic):
            return what
    if path.suffix.lower() in _BY_ENDING:
        return _BY_ENDING[path.suffix.lower()]
    suffix = f" although its name ends in {path.suffix}" if path.suffix else ""
    kind = "text" if text is not None else "data"
    return f"holds {kind} of an unknown kind{suffix}; give {_READABLE}"


MAX_BYTES = 16 * 2**20
POLYGON_KEYS = ("polygon", "tile", "outline")


def read_dat(path: Source) -> Reading:
    """Read a goal polygon of Nagata and Imahori: a line `n`, then n lines `x y`, with y down.

    Blank lines are passed over; lines after those n are left unread, with a note. Source of the
    format: https://github.com/nagata-yuichi/EscherTiling.
    """
    try:
        text = read_bytes(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        raise InputFileError(
            f"{path}: not a text file (byte {exc.start} is not UTF-8); a .dat polygon is plain text"
        ) from exc
    lines = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    n = _vertex_count(path, lines)
    if len(lines) - 1 < n:
        raise InputFileError(
            f"{path}: line {lines[0][0]} promises {n} vertices and {len(lines) - 1} follow; "
            "the file is cut short or its first line is wrong"
        )
    points = [_vertex(path, *line) for line in lines[1 : n + 1]]
    outline, notes = clean_ring(points, str(path), InputFileError)
    extra = len(lines) - 1 - n
    if extra:
        what = f"left {extra} line{'s' * (extra > 1)} after the vertices unread"
        notes.append(f"{what} (line {lines[n + 1][0]} on)")
    return Reading(outline, True, "dat", None, tuple(notes))


def _vertex_count(path: Source, lines: list[tuple[int, str]]) -> int:
    if not lines:
        raise InputFileError(f"{path}: the file holds only blank lines; export it again")
    number, first = lines[0]
    try:
        n = int(first)
    except ValueError as exc:
        raise InputFileError(
            f"{path}: line {number}: {_quote(first)} is not a number of vertices; "
            "a .dat polygon begins with a line that holds just that"
        ) from exc
    if not 3 <= n <= MAX_VERTICES:
        raise InputFileError(
            f"{path}: line {number}: {n} vertices; from 3 to {MAX_VERTICES} can be read"
        )
    return n


def _vertex(path: Source, number: int, line: str) -> tuple[float, float]:
    try:
        x, y = (float(word) for word in line.split())
    except ValueError as exc:
        raise InputFileError(
            f"{path}: line {number}: {_quote(line)} is not a vertex; write two numbers, `x y`"
        ) from exc
    if not np.isfinite([x, y]).all():
        raise InputFileError(
            f"{path}: line {number}: {_quote(line)}: every coordinate must be a finite number"
        )
    return x, y


def read_json(path: Source) -> Reading:
    """Read a polygon from JSON, with y up unless the file says otherwise.

    Taken are: a list of [x, y] pairs; an object with such a list under "polygon", "tile" or
    "outline", and optionally `"y_down": true`; the outer ring of a GeoJSON Polygon or of a Feature
    that holds one.
    """
    data = read_bytes(path, MAX_BYTES)
    try:
        content = json.loads(data)
    except json.JSONDecodeError as exc:
        where = f"line {exc.lineno}, column {exc.colno}"
        raise InputFileError(f"{path}: {where}: not valid JSON ({exc.msg})") from exc
    except RecursionError as exc:
        raise InputFileError(f"{path}: nested too deeply to be a polygon") from exc
    except ValueError as exc:
        raise InputFileError(f"{path}: not valid JSON ({exc})") from exc
    points, y_down, notes = _find_polygon(path, content)
    _check_pairs(path, points)
    outline, dropped = clean_ring(points, str(path), InputFileError)
    return Reading(outline, y_down, "json", None, (*notes, *dropped))


def _find_polygon(path: Source, content: object) -> tuple[list[Any], bool, list[str]]:
    """Return the list of vertices in `content`, whether y points down, and notes."""
    if is_list(content):
        return content, False, []
    if not is_object(content):
        raise InputFileError(f"{path}: holds a single value, not a polygon; write [[x, y], ...]")
    if "type" in content and not any(key in content for key in POLYGON_KEYS):
        points, notes = _geojson_ring(path, content)
        return points, False, notes
    keys = [key for key in POLYGON_KEYS if key in content]
    if not keys:
        found = ", ".join(_quote(str(key)) for key in list(content)[:8]) or "nothing"
        raise InputFileError(
            f'{path}: none of "polygon", "tile", "outline" is in it (it has {found}); '
            "put the list of vertices under one of them"
        )
    points, y_down = content[keys[0]], content.get("y_down", False)
    if not isinstance(y_down, bool):
        raise InputFileError(f'{path}: "y_down" must be true or false')
    if not is_list(points):
        raise InputFileError(f'{path}: "{keys[0]}" must be a list of [x, y] pairs')
    notes = [f'took "{keys[0]}", left {", ".join(keys[1:])} unread'] if len(keys) > 1 else []
    return points, y_down, notes


def _geojson_ring(path: Source, content: dict[str, Any]) -> tuple[list[Any], list[str]]:
    geometry = content.get("geometry") if content["type"] == "Feature" else content
    if not is_object(geometry) or geometry.get("type") != "Polygon":
        kind = geometry.get("type") if is_object(geometry) else content["type"]
        raise InputFileError(
            f"{path}: GeoJSON of type {_quote(str(kind))}; save one Polygon, or a Feature with one"
        )
    rings = geometry.get("coordinates")
    if not is_list(rings) or not rings or not is_list(rings[0]):
        raise InputFileError(f'{path}: the GeoJSON Polygon has no ring under "coordinates"')
    notes: list[str] = []
    if len(rings) > 1:
        notes.append(f"filled {len(rings) - 1} hole{'s' * (len(rings) > 2)}")
    # A GeoJSON position may carry an altitude.
    if any(is_list(position) and len(position) == 3 for position in rings[0]):
        notes.append("left the altitudes unread")
        return [p[:2] if is_list(p) else p for p in rings[0]], notes
    return rings[0], notes


def _check_pairs(path: Source, points: list[Any]) -> None:
    for i, pair in enumerate(points):
        if not is_list(pair) or len(pair) != 2 or not all(type(n) in (int, float) for n in pair):
            raise InputFileError(
                f"{path}: vertex {i} (counted from 0) is {_quote(json.dumps(pair))}, not a pair of "
                "numbers [x, y]"
            )


def _quote(text: str) -> str:
    """Return `text` for a message: short, and on one line."""
    text = text.strip()
    return ascii(text if len(text) <= 40 else text[:37] + "...")
