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


Source = Path | FileContent


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


def check_file(path: Source) -> int:
    """Return the size in bytes of the regular file at `path`, or raise `InputFileError`."""
    if isinstance(path, FileContent):
        if not path.data:
            raise InputFileError(f"{path}: there are no bytes in it; give the content of a file")
        return len(path.data)
    try:
        status = path.stat()
    except FileNotFoundError as exc:
        raise InputFileError(f"{path}: no such file; check the path") from exc
    except (OSError, ValueError) as exc:
        raise InputFileError(f"{path}: cannot be reached ({exc}); check the path") from exc
    if stat.S_ISDIR(status.st_mode):
        raise InputFileError(f"{path}: is a directory; give a file inside it")
    if not stat.S_ISREG(status.st_mode):
        raise InputFileError(f"{path}: is not a regular file; give an image, SVG or polygon file")
    if status.st_size == 0:
        raise InputFileError(f"{path}: the file is empty; export or download it again")
    return status.st_size


def read_bytes(path: Source, limit: int) -> bytes:
    """Return content of the file at `path`; refused when it is larger than `limit` bytes."""
    data = read_head(path, limit + 1)
    if len(data) > limit:
        what = f"larger than {limit / 2**20:.0f} MB, the limit for this kind of file"
        raise InputFileError(f"{path}: {what}; simplify or downscale it")
    return data


def read_head(path: Source, n: int) -> bytes:
    """Return first `n` bytes of the file at `path`, or all of a shorter one."""
    if isinstance(path, FileContent):
        return path.data[:n]
    try:
        with path.open("rb") as file:
            return file.read(n)
    except OSError as exc:
        reason = f"cannot be read ({exc.strerror})"
        raise InputFileError(f"{path}: {reason}; check its permissions") from exc


def unzipped(path: Source, limit: int) -> FileContent:
    """Return what a gzip-compressed file holds; refused if that is over `limit` bytes."""
    name = str(path).removesuffix("z") if path.suffix.lower() == ".svgz" else str(path)
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(read_bytes(path, limit))) as file:
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
