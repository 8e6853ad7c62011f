"""The result of every reader of silhouettes, and reading a file's bytes."""

import gzip
import io
import stat
import zlib
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import Self

from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError

MAX_BYTES = 64 * 2**20
"""The most bytes of a file of any kind: of pictures."""


@dataclass(frozen=True)
class FileContent:
    """The content of a file in memory, with the name that messages and its kind are taken from."""

    data: bytes
    name: str

    @property
    def suffix(self) -> str:
        """The ending of the name, such as ".svg"."""
        return PurePath(self.name).suffix

    def __str__(self) -> str:
        return self.name

    def within(self, limit: int) -> bytes:
        """Return the data; refused when there are more than `limit` bytes."""
        if len(self.data) > limit:
            what = f"larger than {limit / 2**20:.0f} MB, the limit for this kind of file"
            raise InputFileError(f"{self}: {what}; simplify or downscale it")
        return self.data


@dataclass(frozen=True, eq=False)
class Reading:
    """A silhouette as found in a file.

    - `outline`: A simple ring (N, 2) without a repeated last vertex, in the file's own units. In an
      image the unit is the pixel and (0, 0) the top left corner, so that pixel (row 0, column 0) spans
      [0, 1] x [0, 1].
    - `y_down`: Whether the file's y axis points down (images, SVG and goal polygons).
    - `kind`: "image", "svg", "dat" (a list of points), "json" (WKT as well) or "polygon".
    - `size`, `corner`: The width and height of the picture or drawing, if there is one, and its corner
      of least coordinates.
    - `notes`: What was decided for the user, in plain words.
    - `seen`: All that was read as shape, in the outline's units, before parts were left out and
      holes filled; None if that is the outline.
    """

    outline: Array
    y_down: bool
    kind: str = "polygon"
    size: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()
    corner: tuple[float, float] = (0.0, 0.0)
    seen: BaseGeometry | None = None

    def with_notes(self, *more: str) -> Self:
        """Return the same with more notes."""
        return replace(self, notes=(*self.notes, *more))


def content_of(source: Path | FileContent) -> FileContent:
    """Return what a regular file holds, of one that is larger than any may be a part.

    Raises `InputFileError` for one that is missing, empty or cannot be read.
    """
    if isinstance(source, FileContent):
        if not source.data:
            raise InputFileError(f"{source}: there are no bytes in it; give the content of a file")
        return source
    try:
        mode = source.stat().st_mode
    except FileNotFoundError as exc:
        raise InputFileError(f"{source}: no such file; check the path") from exc
    except (OSError, ValueError) as exc:
        raise InputFileError(f"{source}: cannot be reached ({exc}); check the path") from exc
    if stat.S_ISDIR(mode):
        raise InputFileError(f"{source}: is a directory; give a file inside it")
    if not stat.S_ISREG(mode):
        raise InputFileError(f"{source}: is not a regular file; give an image, SVG or polygon file")
    try:
        with source.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as exc:
        reason = f"cannot be read ({exc.strerror})"
        raise InputFileError(f"{source}: {reason}; check its permissions") from exc
    if not data:
        raise InputFileError(f"{source}: the file is empty; export or download it again")
    return FileContent(data, str(source))


def unzipped(path: FileContent, limit: int) -> FileContent:
    """Return what a gzip-compressed file holds; refused if that is over `limit` bytes."""
    name = str(path).removesuffix("z") if path.suffix.lower() == ".svgz" else str(path)
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(path.within(limit))) as file:
            data = file.read(limit + 1)
    except (OSError, EOFError, zlib.error) as exc:
        raise InputFileError(
            f"{path}: the gzip-compressed file is damaged or cut short ({exc}); download it again"
        ) from exc
    if len(data) > limit:
        raise InputFileError(
            f"{path}: holds over {limit / 2**20:.0f} MB, the limit for this kind of file; simplify it"
        )
    if not data:
        raise InputFileError(f"{path}: the gzip-compressed file is empty; export it again")
    return FileContent(data, name)


def quoted(text: str) -> str:
    """Return `text` for a message: short, and on one line."""
    text = text.strip()
    return ascii(text if len(text) <= 40 else text[:37] + "...")
