"""The reader of all silhouette files, which finds out a file's kind from its content or name."""

import re
from pathlib import Path

import numpy as np

from orbiflow.arguments import path as as_path
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles.silhouette.readers.pictures import read_image
from orbiflow.tiles.silhouette.readers.polygon_files import read_dat, read_json
from orbiflow.tiles.silhouette.readers.reading import (
    FileContent,
    Reading,
    Source,
    check_file,
    read_head,
)
from orbiflow.tiles.silhouette.readers.svg import read_svg

_HEAD_BYTES = 65536
_IMAGE_MAGIC = (
    b"\x89PNG\r\n\x1a\n",
    b"\xff\xd8\xff",
    b"BM",
    b"GIF87a",
    b"GIF89a",
    b"II*\0",
    b"MM\0*",
)
_CONVERTIBLE = {
    b"\x1f\x8b": "is gzip-compressed (an .svgz?); decompress it first",
    b"%PDF": "is a PDF file; convert it to SVG first",
    b"%!PS": "is a PostScript file; convert it to SVG first",
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
        return read_image(path, threshold=threshold, invert=invert)
    for name, value in (("threshold", threshold), ("invert", invert)):
        if value is not None:
            raise OrbiflowError(
                f"{name} applies to images only and {path} is a polygon or drawing; leave it out"
            )
    # extreme coordinates overflow in the geometry, whose result is then refused
    with np.errstate(all="ignore"):
        return {"svg": read_svg, "json": read_json, "dat": read_dat}[kind](path)


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
    raise InputFileError(f"{path}: {_what(path, head, text)}; give {_READABLE}")


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
    suffix = f" although its name ends in {path.suffix}" if path.suffix else ""
    return f"holds {'text' if text is not None else 'data'} of an unknown kind{suffix}"
