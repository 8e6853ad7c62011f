"""What trimesh reads: PLY, glTF and GLB."""

from __future__ import annotations

import importlib
import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from orbiflow.errors import OrbiflowError, system_errors
from orbiflow.solids.soup import Soup

COLOURS = "_OLOR_0"
MILLIMETRES = 1000.0  # of a metre, the unit of glTF

READ_EXTENSIONS = re.compile(
    rb"KHR_(materials_\w+|texture_transform|mesh_quantization|lights_punctual)"
)
"""Extensions that a file may require: those that leave its points and triangles alone."""

_REQUIRED = re.compile(rb'"extensionsRequired"\s*:\s*\[([^\]]*)\]')


def read_gltf(data: bytes, path: Path) -> Soup:
    """Return the triangles of a glTF or GLB file, in mm.

    Colours are called `COLOURS` for trimesh, which otherwise keeps the lower 8 bits of those of 16,
    such as Blender's. Names that begin with _ are an application's own, and this one is as long as the
    usual one.
    """
    end = 20 + int.from_bytes(data[12:16], "little") if data[:4] == b"glTF" else len(data)
    header = data[:end]
    for names in _REQUIRED.findall(header):
        for name in re.findall(rb'"([^"]+)"', names):
            if not READ_EXTENSIONS.fullmatch(name):
                raise OrbiflowError(
                    f"is compressed or extended by {name.decode(errors='replace')}; export it without"
                )
    data = header.replace(b'"COLOR_0"', f'"{COLOURS}"'.encode()) + data[end:]
    soup = by_trimesh(path.suffix.lower()[1:], data, FilesBeside(path.resolve().parent))
    return soup._replace(points=MILLIMETRES * soup.points)


class FilesBeside(dict[str, bytes]):
    """The content of files in a folder, or below it, by the names that another file calls them.

    Raises `OrbiflowError` for any other.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def __missing__(self, uri: str) -> bytes:
        file = (self.folder / unquote(uri)).resolve()
        if not file.is_relative_to(self.folder):
            raise OrbiflowError(
                f"takes its numbers from {uri[:80]!r}, outside its own folder; export it as GLB, in "
                "one file"
            )
        with system_errors(OrbiflowError, f"needs {uri[:80]!r}, which cannot be read"):
            return file.read_bytes()


def by_trimesh(kind: str, data: bytes, files: Mapping[str, bytes] | None = None) -> Soup:
    """Return the triangles of a file of a kind, which may take its numbers from others.

    Raises `OrbiflowError` for a file that trimesh cannot read.
    """
    trimesh = importlib.import_module("trimesh")
    try:
        scene = trimesh.load_scene(
            io.BytesIO(data), file_type=kind, resolver=files, skip_materials=True, process=False
        )
        parts = [part for part in scene.dump(concatenate=False) if hasattr(part, "faces")]
        return Soup.joined([_coloured(part) for part in parts])
    except OrbiflowError:
        raise
    # what a broken file does to a reader is of any kind
    except Exception as error:
        raise OrbiflowError(f"is broken, or of a kind that is not read: {error}") from error


def _coloured(part: Any) -> Soup:
    """Return a mesh of trimesh, with the colours of its points or faces."""
    points = np.asarray(part.vertices, float).reshape(-1, 3)
    soup = Soup(points, np.asarray(part.faces, np.int64).reshape(-1, 3))
    stored = np.asarray(part.vertex_attributes.get(COLOURS, ()))
    if stored.shape in ((len(points), 3), (len(points), 4)):
        most = np.iinfo(stored.dtype).max if stored.dtype.kind in "iu" else 1
        return soup._replace(colours=stored[:, :3] / most)
    if part.visual.kind == "vertex":
        return soup._replace(colours=part.visual.vertex_colors[:, :3] / 255)
    if part.visual.kind == "face":
        colours = part.visual.face_colors[:, None, :3].repeat(3, axis=1) / 255
        return soup.with_corner_colours(colours)
    return soup
