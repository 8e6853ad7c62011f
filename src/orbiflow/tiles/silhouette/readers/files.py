"""The reader of all silhouette files, which finds out a file's kind from its content or name."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from shapely import Polygon

from orbiflow.errors import Advice, InputFileError, OrbiflowError, literal
from orbiflow.settings import as_path
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import (
    LEFT_OUT,
    filled,
    is_thread,
    outer_outline,
    outer_ring,
    thinned,
)
from orbiflow.tiles.silhouette.readers.image_files import image_kind
from orbiflow.tiles.silhouette.readers.pictures import read_image
from orbiflow.tiles.silhouette.readers.polygons import read_json, read_points, read_wkt
from orbiflow.tiles.silhouette.readers.reading import FileContent, Reading, content_of, unzipped
from orbiflow.tiles.silhouette.readers.svg_documents import MAX_BYTES

_HEAD_BYTES = 65536
MAX_GAP_SHARE = 0.03  # of the drawing's size: such gaps in an outline are closed
MIN_LINE_SHARE = 0.8  # of the lines' area
GZIP = b"\x1f\x8b"
_SVG = re.compile(r"<(\w+:)?svg[\s>]")
_WKT = re.compile(
    r"(SRID=\d+;)?\s*(MULTI)?(POLYGON|LINESTRING|POINT)|GEOMETRYCOLLECTION", re.IGNORECASE
)
_COUNT_LINE = re.compile(r"\s*\d+\s*[\r\n]")
_BY_NAME = {
    **{".svg": "svg", ".json": "json", ".geojson": "json", ".wkt": "wkt"},
    **dict.fromkeys((".dat", ".csv", ".tsv", ".txt", ".xy"), "points"),
}
_READERS = {"json": read_json, "wkt": read_wkt, "points": read_points}
_READABLE = "a PNG, JPEG or WebP image, an SVG drawing, or a polygon (.json, .geojson, .dat, .csv)"


def read_outline(
    path: str | Path | FileContent, *, threshold: float | None = None, invert: bool | None = None
) -> Reading:
    """Read the outline of the silhouette in the file at `path`, or in a `FileContent`.

    `threshold` is for images (see `read_image`); with `invert` the shape is the light part of one, or
    what a drawing leaves out, such as a hole in a card. Raises `InputFileError` for a file
    that is missing, of an unknown kind, damaged, too large, or without a usable shape, and
    `OrbiflowError` for a setting that cannot be used.
    """
    if not isinstance(path, FileContent):
        path = as_path(path, "the silhouette's file")
    path = content_of(path)
    if path.data.startswith(GZIP):
        path = unzipped(path, MAX_BYTES)
    kind = _kind(path, path.data[:_HEAD_BYTES])
    if kind == "image":
        return _bridged(read_image(path, threshold=threshold, invert=invert))
    options = {"threshold": threshold, "invert": None if kind == "svg" else invert}
    for name in (name for name, value in options.items() if value is not None):
        what = "images" if name == "threshold" else "images and drawings"
        is_one = "a drawing" if kind == "svg" else "a polygon"
        raise OrbiflowError(f"{name} applies to {what} only and {path} is {is_one}; leave it out")
    # extreme coordinates overflow in the geometry, whose result is then refused
    with np.errstate(all="ignore"):
        reading = _read_svg(path) if kind == "svg" else _READERS[kind](path)
        return _hole_of(reading, path) if invert else _bridged(reading)


def _read_svg(path: FileContent) -> Reading:
    """Read a drawing, for which more has to be imported than for anything else."""
    from orbiflow.tiles.silhouette.readers.svg import read_svg

    return read_svg(path)


def _hole_of(reading: Reading, path: FileContent) -> Reading:
    """Return the largest hole in what was seen, such as an animal that is cut out of a card."""
    parts = [] if reading.seen is None else polygons_in(reading.seen.buffer(0))
    holes = shapely.union_all([filled(part) for part in parts]).difference(shapely.union_all(parts))
    if not holes.area > 0:
        raise InputFileError(
            Advice(
                literal(f"{path}: there is no hole in the shape")
                + ", and {invert} would take one; leave it out"
            )
        )
    shape, kept = outer_outline(holes)
    about = (LEFT_OUT, "filled", "the silhouette is")
    notes = (note for note in reading.notes if not note.startswith(about))
    notes = (*notes, "shape taken: the hole in what is drawn, as set", *kept)
    return replace(reading, outline=outer_ring(shape), notes=notes, seen=holes)


def _bridged(reading: Reading) -> Reading:
    """Return what the lines of a drawing enclose but for small gaps, where they alone are a thread."""
    seen = reading.seen
    size = 0.0 if seen is None else float(np.ptp(np.reshape(seen.bounds, (2, 2)), axis=0).max())
    if seen is None or not is_thread(Polygon(reading.outline), size):
        return reading
    grown = outer_outline(seen.buffer(MAX_GAP_SHARE / 2 * size))[0]
    body = grown.buffer(-MAX_GAP_SHARE / 2 * size)
    body = max(polygons_in(body), key=lambda part: part.area, default=Polygon())
    lines = seen.buffer(0).intersection(body).area  # what is traced may touch itself
    if is_thread(body, size) or not MIN_LINE_SHARE * seen.area < lines < body.area / 2:
        return reading
    note = (
        f"the largest part is no more than a line: took instead what the lines enclose when gaps of "
        f"up to {MAX_GAP_SHARE:.0%} of the drawing's size are closed"
    )
    kept = [other for other in reading.notes if not other.startswith(LEFT_OUT)]
    thin, _ = thinned(body, MAX_GAP_SHARE * size / 50)
    return replace(reading, outline=outer_ring(thin), notes=(*kept, note))


def _kind(path: FileContent, head: bytes) -> str:
    if image_kind(head):
        return "image"
    text = _text(head)
    if text is not None:
        if text.startswith("<") and _SVG.search(text):
            return "svg"
        if text.startswith(("[", "{")):
            return "json"
        if _WKT.match(text):
            return "wkt"
        if _COUNT_LINE.match(text) and path.suffix.lower() != ".dxf":
            return "points"
        # the reader that fits the name of a text file gives the best message
        if path.suffix.lower() in _BY_NAME:
            return _BY_NAME[path.suffix.lower()]
    raise InputFileError(
        f"{path}: is damaged, or of a kind that is not read; open it in the program that made it, and "
        f"save it as SVG or PNG; give {_READABLE}"
    )


def _text(head: bytes) -> str | None:
    """Return `head` as text without leading blanks, or None where it is binary."""
    utf16 = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    if not utf16 and b"\0" in head:
        return None
    text = head.decode("utf-16" if utf16 else "utf-8", errors="replace")
    return text.lstrip("\ufeff").lstrip()
