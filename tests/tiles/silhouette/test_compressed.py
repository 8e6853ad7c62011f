"""Compressed drawings are read, within bounds."""

import gzip

import pytest
from shapely import box

from orbiflow.errors import InputFileError
from orbiflow.tiles import FileContent, hausdorff, read_outline
from orbiflow.tiles.silhouette.readers import MAX_BYTES

SVG = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M1 1H8V5H1Z"/></svg>'


@pytest.mark.parametrize("name", ["a.svgz", "a.svg", "a.SVGZ"])
def test_a_compressed_drawing(name: str) -> None:
    reading = read_outline(FileContent(gzip.compress(SVG), name))
    assert reading.kind == "svg"
    assert hausdorff(reading.outline, box(1, 1, 8, 5)) < 0.01


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (gzip.compress(SVG)[:-20], "damaged or cut short"),
        (gzip.compress(SVG)[:12], "damaged or cut short"),
        (gzip.compress(b""), "is empty"),
        (gzip.compress(gzip.compress(SVG)), "of a kind that is not read"),
        (gzip.compress(b" " * (MAX_BYTES + 1)), "holds over 16 MB"),
        (gzip.compress(b"\0\1\2"), "of a kind that is not read"),
    ],
    ids=["cut short", "header alone", "empty", "twice", "too large", "unknown"],
)
def test_what_is_damaged_or_too_large_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(InputFileError, match=message):
        read_outline(FileContent(data, "a.svgz"))
