"""Reading meshes from files: STL, OBJ, PLY, 3MF, glTF and GLB, as one closed body each.

Files may come from anybody. Their size, and the numbers of points and faces that STL, OBJ and PLY
announce, are bounded before anything is decoded; 3MF and glTF are read in a process of bounded memory
and time. Nothing is run, fetched from a network, or read from another folder; materials and textures
are left aside, colours of points are kept. PLY and glTF are read by trimesh.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import STL_TRIANGLE
from orbiflow.errors import InputFileError, OrbiflowError, system_errors
from orbiflow.settings import naming_extras
from orbiflow.solids.bounded import read_bounded
from orbiflow.solids.mending import mended
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.painting import Painting
from orbiflow.solids.soup import MAX_BYTES, MAX_FACES_READ, Soup, check_counts
from orbiflow.solids.trimesh_files import by_trimesh

MAX_LINE = 2**16
"""Bytes of a line of an OBJ file at most: a polygon of some thousand corners."""

NO_COLOUR = [b"nan"] * 3
_CORNER = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


class ReadMesh(NamedTuple):
    """A mesh from a file.

    - `mesh`: One closed body in mm, faces counter-clockwise from outside.
    - `notes`: What was mended, left out or simplified, a sentence each.
    - `painting`: Where it is painted, or None if the file has no colours at its points.
    """

    mesh: Mesh
    notes: list[str]
    painting: Painting | None


def usual_up(path: Path) -> Literal["y", "z"]:
    """Return the axis that usually points up in such a file: y in an OBJ or glTF.

    >>> usual_up(Path("a.GLB")), usual_up(Path("a.stl"))
    ('y', 'z')
    """
    return "y" if path.suffix.lower() in (".obj", ".gltf", ".glb") else "z"


def read_mesh(path: str | Path) -> ReadMesh:
    """Return the one closed body that a file holds, mended where that can be done safely.

    Lengths of STL, OBJ and PLY, which have no unit, are taken as mm; those of 3MF and glTF are
    converted. Overlapping bodies are united, holes closed, cavities filled, scraps left out, and a
    mesh of more than `MAX_FACES` triangles is simplified; `notes` says so.

    Args:
        path: A file .stl, .obj, .ply, .3mf, .gltf or .glb.

    Raises:
        InputFileError: If the file cannot be read, or holds no closed body; the message says what to
            do.
        MissingExtraError: If PLY or glTF is read without trimesh.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        endings = ", ".join(READERS)
        raise InputFileError(f"{path}: a mesh is read from {endings}; export it as one of them")
    with system_errors(InputFileError, f"{path}: cannot be read"):
        size = path.stat().st_size
        if size > MAX_BYTES:
            most = f"{MAX_BYTES / 2**20:.0f} MB"
            raise InputFileError(f"{path}: a mesh's file has at most {most}; simplify the mesh")
        data = path.read_bytes()
    try:
        soup, notes = reader(data, path), list[str]()
        check_counts(len(soup.points), len(soup.faces))
        mesh = mended(soup, notes)
        painting = Painting.of(soup, mesh)
    except InputFileError:
        raise
    except OrbiflowError as error:
        raise InputFileError(f"{path}: {error}") from error
    except (MemoryError, RecursionError) as error:
        raise InputFileError(f"{path}: is too large to be read; simplify the mesh") from error
    return ReadMesh(mesh, notes, painting)


def _read_stl(data: bytes, _: Path) -> Soup:
    """Read an STL, binary or text: some binary files begin with the word that marks a text."""
    count = int.from_bytes(data[80:84], "little")
    is_text = data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:1000].lower()
    if len(data) >= 84 and (len(data) == 84 + 50 * count or not is_text):
        check_counts(3 * count, count)
        if len(data) < 84 + 50 * count:
            whole = (len(data) - 84) // 50
            raise OrbiflowError(
                f"is cut off: {count:,} triangles are announced and {whole:,} are there; copy it again"
            )
        corners = np.frombuffer(data, STL_TRIANGLE, count, 84)["corners"].astype(float)
    elif is_text:
        words = _CORNER.findall(data.lower())
        check_counts(len(words), len(words) // 3)
        if len(words) % 3 or b"endsolid" not in data[-1000:].lower():
            raise OrbiflowError("is cut off, or is not an STL file; export it again")
        corners = _numbers(words, float).reshape(-1, 3, 3)
    else:
        raise OrbiflowError("is not an STL file; export it again")
    return Soup(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def _read_obj(data: bytes, _: Path) -> Soup:
    """Read points, perhaps with colours, and polygons of an OBJ; all else is passed over."""
    check_counts(data.count(b"\nv ") + 1, data.count(b"\nf ") + 1)
    points, faces = list[list[bytes]](), list[tuple[int, int, int]]()
    colours = list[list[bytes]]()
    for line in data.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ").splitlines():
        if len(line) > MAX_LINE:
            raise OrbiflowError("has a line that is too long for an OBJ file; export it again")
        if line.startswith((b"v ", b"v\t")):
            words = line.split()[1:]
            points.append(words[:3])
            colours.append(words[3:6] if len(words) == 6 else NO_COLOUR)
        elif line.startswith((b"f ", b"f\t")):
            corners = [_index(word, len(points)) for word in line.split()[1:]]
            faces += zip(corners[:1] * (len(corners) - 2), corners[1:], corners[2:], strict=False)
            if len(faces) > MAX_FACES_READ:
                check_counts(len(points), len(faces))
    if any(len(point) != 3 for point in points):
        raise OrbiflowError("has a point without three coordinates; export it again")
    soup = Soup(_numbers(points, float).reshape(-1, 3), np.array(faces, np.int64).reshape(-1, 3))
    if all(colour is NO_COLOUR for colour in colours):
        return soup
    shades = _numbers(colours, float).reshape(-1, 3)
    # some programs write 0 to 255
    return soup._replace(colours=shades / (255 if np.nanmax(shades) > 1 else 1))


def _index(word: bytes, count: int) -> int:
    """Return a point's number from 0; an OBJ counts from 1, or backwards from the latest point."""
    try:
        number = int(word.split(b"/", 1)[0])
    except ValueError:
        raise OrbiflowError(f"has a face of {word[:20]!r}; export it again") from None
    return number - 1 if number > 0 else count + number


def _numbers(words: Any, kind: type) -> Array:
    try:
        return np.array(words, dtype="S32").astype(kind) if len(words) else np.zeros(0)
    except (ValueError, OverflowError):
        raise OrbiflowError(
            "has a coordinate or colour that is not a number; export it again"
        ) from None


def _read_ply(data: bytes, path: Path) -> Soup:
    """Read a PLY by trimesh, once its header's counts are known to be within the bounds."""
    head, marker, _ = data[: 2**16].partition(b"end_header")
    counts = dict(re.findall(rb"element\s+(\S+)\s+(\d{1,18})\b", head))
    if not data.startswith(b"ply") or not marker or b"vertex" not in counts:
        raise OrbiflowError("is not a PLY file; export it again")
    points, faces = (int(counts.get(name, b"0")) for name in (b"vertex", b"face"))
    check_counts(points, faces)
    if sum(int(n) for n in counts.values()) > len(data):
        raise OrbiflowError("is cut off: its header announces more than it holds; copy it again")
    with naming_extras(f"reading {path.name}"):
        return by_trimesh("ply", data)


def _read_3mf(_: bytes, path: Path) -> Soup:
    return read_bounded(path)


def _read_gltf(_: bytes, path: Path) -> Soup:
    with naming_extras(f"reading {path.name}"):
        importlib.import_module("trimesh")
    return read_bounded(path)


READERS: dict[str, Callable[[bytes, Path], Soup]] = {
    ".stl": _read_stl,
    ".obj": _read_obj,
    ".ply": _read_ply,
    ".3mf": _read_3mf,
    ".gltf": _read_gltf,
    ".glb": _read_gltf,
}
"""How each format is read, by the ending of its files."""
