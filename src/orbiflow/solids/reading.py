"""Reading meshes from files: STL, OBJ, PLY, 3MF, glTF and GLB, as one closed body each.

Files may come from anybody. Their size, and the numbers of points and faces that they announce, are
bounded before anything is decoded. Nothing is run, fetched from a network, or read from another
folder; materials and textures are left aside, colours of points are kept. PLY and glTF are read by
trimesh.
"""

from __future__ import annotations

import importlib
import io
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import STL_TRIANGLE
from orbiflow.errors import InputFileError, OrbiflowError, system_errors
from orbiflow.settings import naming_extras
from orbiflow.solids.gltf_files import COLOURS, checked_gltf, from_metres, with_raw_colours
from orbiflow.solids.mending import mended
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.package_files import read_3mf
from orbiflow.solids.painting import Painting
from orbiflow.solids.soup import MAX_BYTES, MAX_FACES_READ, Soup, check_counts

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
        known = ", ".join(READERS)
        raise InputFileError(f"{path}: a mesh is read from {known}; export it as one of them")
    with system_errors(InputFileError, f"{path}: cannot be read"):
        size = path.stat().st_size
        if size > MAX_BYTES:
            most = f"{MAX_BYTES / 2**20:.0f} MB"
            raise InputFileError(f"{path}: a mesh's file has at most {most}; simplify the mesh")
        data = path.read_bytes()
    try:
        soup, notes = reader(data, path), list[str]()
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
        found = _CORNER.findall(data.lower())
        check_counts(len(found), len(found) // 3)
        if len(found) % 3 or b"endsolid" not in data[-1000:].lower():
            raise OrbiflowError("is cut off, or is not an STL file; export it again")
        corners = _numbers(found, float).reshape(-1, 3, 3)
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
    if all(own is NO_COLOUR for own in colours):
        return soup
    found = _numbers(colours, float).reshape(-1, 3)
    # some programs write 0 to 255
    return soup._replace(colours=found / (255 if np.nanmax(found) > 1 else 1))


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
    head, found, _ = data[: 2**16].partition(b"end_header")
    counts = dict(re.findall(rb"element\s+(\S+)\s+(\d{1,18})\b", head))
    if not data.startswith(b"ply") or not found or b"vertex" not in counts:
        raise OrbiflowError("is not a PLY file; export it again")
    points, faces = (int(counts.get(name, b"0")) for name in (b"vertex", b"face"))
    check_counts(points, faces)
    if sum(int(n) for n in counts.values()) > len(data):
        raise OrbiflowError("is cut off: its header announces more than it holds; copy it again")
    return _by_trimesh("ply", data, path, None)


def _read_gltf(data: bytes, path: Path) -> Soup:
    """Read a glTF or GLB by trimesh, once it is known to be within the bounds."""
    files = checked_gltf(data, path)
    data = with_raw_colours(data)
    return from_metres(_by_trimesh(path.suffix.lower()[1:], data, path, files))


def _by_trimesh(kind: str, data: bytes, path: Path, files: Mapping[str, bytes] | None) -> Soup:
    with naming_extras(f"reading {path.name}"):
        trimesh = importlib.import_module("trimesh")
    try:
        scene = trimesh.load_scene(
            io.BytesIO(data), file_type=kind, resolver=files, skip_materials=True, process=False
        )
        parts = [own for own in scene.dump(concatenate=False) if hasattr(own, "faces")]
        soups = [_coloured(own) for own in parts]
    # what a broken file does to a reader is of any kind
    except Exception as error:
        raise OrbiflowError(f"is broken, or of a kind that is not read: {error}") from error
    check_counts(sum(len(own.points) for own in soups), sum(len(own.faces) for own in soups))
    return Soup.joined(soups)


def _coloured(part: Any) -> Soup:
    """Return a mesh of trimesh, with the colours of its points or faces."""
    points = np.asarray(part.vertices, float).reshape(-1, 3)
    soup = Soup(points, np.asarray(part.faces, np.int64).reshape(-1, 3))
    found = np.asarray(part.vertex_attributes.get(COLOURS, ()))
    if found.shape in ((len(points), 3), (len(points), 4)):
        most = np.iinfo(found.dtype).max if found.dtype.kind in "iu" else 1
        return soup._replace(colours=found[:, :3] / most)
    if part.visual.kind == "vertex":
        return soup._replace(colours=part.visual.vertex_colors[:, :3] / 255)
    if part.visual.kind == "face":
        colours = part.visual.face_colors[:, None, :3].repeat(3, axis=1) / 255
        return soup.with_corner_colours(colours)
    return soup


READERS: dict[str, Callable[[bytes, Path], Soup]] = {
    ".stl": _read_stl,
    ".obj": _read_obj,
    ".ply": _read_ply,
    ".3mf": lambda data, _: read_3mf(data),
    ".gltf": _read_gltf,
    ".glb": _read_gltf,
}
"""How each format is read, by the ending of its files."""
