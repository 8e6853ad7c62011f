"""What must be known of a glTF or GLB file before another library may read it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from orbiflow.errors import OrbiflowError, system_errors
from orbiflow.solids.soup import MAX_BYTES, MAX_FACES_READ, Soup, check_counts

MAX_HEADER = 64 * 2**20
"""Bytes of the JSON at most."""

MAX_NODES = 10_000
"""Nodes of the scene at most."""

GLB_JSON = 0x4E4F534A
COLOURS = "_OLOR_0"
MILLIMETRES = 1000.0  # of a metre, the unit of glTF

READ_EXTENSIONS = re.compile(
    r"KHR_(materials_\w+|texture_transform|mesh_quantization|lights_punctual)"
)
"""Extensions that a file may require: those that leave its points and triangles alone."""


def checked_gltf(data: bytes, path: Path) -> dict[str, bytes]:
    """Return the files that a glTF file takes its numbers from, by name, once it is known to be safe.

    They must lie in its own folder or below. Numbers of points, triangles and nodes are bounded, and
    nodes must be a forest. Pictures are left aside.

    Raises `OrbiflowError` for anything else.
    """
    header = _header(data)
    try:
        needed = [str(name) for name in header.get("extensionsRequired", [])]
        if unread := [name for name in needed if not READ_EXTENSIONS.fullmatch(name)]:
            raise OrbiflowError(f"is compressed or extended by {unread[0]}; export it without")
        _check_scene(header)
        uris = [own["uri"] for own in header.get("buffers", []) if "uri" in own]
        files = [uri for uri in uris if not uri.startswith("data:")]
        found = {uri: _beside(unquote(uri), path) for uri in dict.fromkeys(files)}
        if sum(map(len, found.values())) > MAX_BYTES:
            raise OrbiflowError("has buffers that are too large; simplify the mesh")
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        if isinstance(error, OrbiflowError):
            raise
        raise OrbiflowError(f"is not a glTF file: {error}; export it again") from error
    return found


def with_raw_colours(data: bytes) -> bytes:
    """Return a file whose colours are called `COLOURS`, so that a reader leaves them as they are.

    trimesh keeps the lower 8 bits of colours of 16, such as Blender's. Names that begin with _ are an
    application's own, and this one is as long as the usual one.
    """
    end = 20 + int.from_bytes(data[12:16], "little") if data[:4] == b"glTF" else len(data)
    return data[:end].replace(b'"COLOR_0"', f'"{COLOURS}"'.encode()) + data[end:]


def from_metres(soup: Soup) -> Soup:
    """Return what is in metres, as glTF has it, in mm."""
    return soup._replace(points=MILLIMETRES * soup.points)


def _header(data: bytes) -> dict[str, Any]:
    """Return the JSON of a file, of whose binary form it is the first part."""
    text = data
    if data[:4] == b"glTF":
        version, size, length, kind = np.frombuffer(data[4:20].ljust(16, b"\0"), "<u4").tolist()
        if version != 2 or kind != GLB_JSON:
            raise OrbiflowError("is not a GLB file of version 2; export it again")
        if size > len(data) or length > size:
            raise OrbiflowError(
                f"is cut off: {size:,} bytes are announced and {len(data):,} are there; copy it again"
            )
        text = data[20 : 20 + length]
    if len(text) > MAX_HEADER:
        raise OrbiflowError("has a header that is too large; export it as GLB")
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise OrbiflowError(f"is not a glTF file, or is cut off: {error}") from error
    if not isinstance(header, dict):
        raise OrbiflowError("is not a glTF file; export it again")
    return header


def _check_scene(header: Mapping[str, Any]) -> None:
    """Check that the scene's nodes are a forest, and that all that it places is within the bounds."""
    nodes, accessors = header.get("nodes", []), header.get("accessors", [])
    children = [int(child) for node in nodes for child in node.get("children", [])]
    if len(nodes) > MAX_NODES or len(set(children)) < len(children):
        raise OrbiflowError("has too many nodes, or nodes of two parents; export it as one mesh")
    below = {k: [int(c) for c in node.get("children", [])] for k, node in enumerate(nodes)}
    waiting = [k for k in below if k not in set(children)]
    for k in waiting:  # grows while it is walked
        waiting += below[k]
    if len(waiting) < len(nodes):
        raise OrbiflowError("has nodes that are their own parents; export it again")
    sizes = [
        (accessors[p["attributes"]["POSITION"]]["count"], _corners(p, accessors))
        for mesh in header.get("meshes", [])
        for p in mesh["primitives"]
        if "POSITION" in p["attributes"]
    ]
    check_counts(sum(int(n) for n, _ in sizes), sum(int(n) for _, n in sizes) // 3)
    check_counts(max((int(own["count"]) for own in accessors), default=0), 0)
    most = max((int(points) + int(corners) for points, corners in sizes), default=0)
    uses = max(1, sum("mesh" in node for node in nodes))
    if most * uses > 100 * MAX_FACES_READ:
        raise OrbiflowError("places its meshes too often; export it as one mesh")


def _corners(primitive: Mapping[str, Any], accessors: list[Any]) -> int:
    own = primitive.get("indices", primitive["attributes"]["POSITION"])
    return accessors[own]["count"]


def _beside(name: str, path: Path) -> bytes:
    """Return the content of a file that lies in the folder of another, or below it."""
    folder = path.resolve().parent
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:|[\\/]", name) or "\\" in name:
        raise OrbiflowError(f"takes its numbers from {name[:80]!r}; export it as GLB, in one file")
    file = (folder / name).resolve()
    if not file.is_relative_to(folder):
        raise OrbiflowError(f"takes its numbers from {name[:80]!r}, outside its own folder")
    with system_errors(OrbiflowError, f"needs {name[:80]!r}, which cannot be read"):
        if file.stat().st_size > MAX_BYTES:
            raise OrbiflowError(f"needs {name[:80]!r}, which is too large; simplify the mesh")
        return file.read_bytes()
