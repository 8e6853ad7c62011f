"""Files of solids to print: STL and 3MF, in mm, the same bytes every time."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.drawing.web_page import rendered

STL_TRIANGLE = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]
"""A triangle in a binary STL file."""

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


def write_stl(parts: Mapping[str, Manifold], title: str = "") -> bytes:
    """Return a binary STL of all parts, with 80 characters of the title in its header."""
    meshes = [body.to_mesh() for body in parts.values()]
    corners: Array = np.concatenate([_corners(mesh) for mesh in meshes])
    # a normal of 0 leaves it to the reader, who has the order of the corners
    triangles = np.zeros(len(corners), dtype=STL_TRIANGLE)
    triangles["corners"] = corners
    header = title.encode("ascii", "replace")[:80].ljust(80)
    return header + len(corners).to_bytes(4, "little") + triangles.tobytes()


def _corners(mesh: Any) -> Array:
    return mesh.vert_properties[mesh.tri_verts]


def write_3mf(
    parts: Mapping[str, Manifold],
    title: str = "",
    *,
    colours: Mapping[str, str] | None = None,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> bytes:
    """Return a 3MF file with each part as an object of its own, in millimetres.

    Each colour is a filament of its own, in their order. PrusaSlicer reads from a file beside the model
    which triangles of an object are for which, and drops parts that are objects on the bed, each by
    itself; Bambu Studio and OrcaSlicer read one for each object, and one painted on triangles.

    Args:
        parts: Closed bodies by name.
        title: What the file says about itself.
        colours: The colour of each part that has one, as #rrggbb.
        groups: Of a part that is one object with others, such as what fills a drawing in it, the
            names of all, itself the first.
    """
    groups, colours = groups or {}, colours or {}
    order = list(dict.fromkeys(colours.values()))
    filaments = {name: order.index(colour) + 1 for name, colour in colours.items()}
    together = {part for names in groups.values() for part in names[1:]}
    objects = [
        _object(number, {part: parts[part] for part in groups.get(name, [name])})
        for number, name in enumerate((name for name in parts if name not in together), 1)
    ]
    values = {
        "objects": objects,
        "title": title,
        "colours": colours,
        "filaments": filaments,
        "paints": {name: _painted(filament) for name, filament in filaments.items()},
    }
    files = {
        "[Content_Types].xml": "solid_content_types.xml",
        "_rels/.rels": "solid_relationships.xml",
        "3D/3dmodel.model": "solid_model.xml",
    }
    if colours:
        files["Metadata/Slic3r_PE_model.config"] = "solid_filaments_prusa.xml"
        files["Metadata/model_settings.config"] = "solid_filaments_bambu.xml"
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, template in files.items():
            entry = zipfile.ZipInfo(name)  # without a date
            text = rendered("orbiflow.drawing", template, **values)
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


class _Object(NamedTuple):
    """A mesh of one part or several: of each its name and its triangles, one after the other."""

    number: int
    name: str
    points: list[list[float]]
    parts: list[tuple[str, list[list[int]]]]


def _object(number: int, bodies: Mapping[str, Manifold]) -> _Object:
    points, parts = list[list[float]](), list[tuple[str, list[list[int]]]]()
    for name, body in bodies.items():
        mesh: Any = body.to_mesh64()
        parts.append((name, (mesh.tri_verts + len(points)).tolist()))
        points += mesh.vert_properties.tolist()
    return _Object(number, parts[0][0], points, parts)


def _painted(filament: int) -> str:
    """Return how a triangle says that all of it is of a filament, as slicers' brushes write it."""
    return f"{4 * filament:X}" if filament < 3 else f"{filament - 3:X}C"


def read_triangles(path: Path) -> list[Array]:
    """Return the triangles (n, 3, 3) of each part in a file that this package has written."""
    if path.suffix == ".stl":
        return [np.frombuffer(path.read_bytes()[84:], STL_TRIANGLE)["corners"].astype(float)]
    with zipfile.ZipFile(path) as archive:
        model = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    parts = list[Array]()
    for element in model.iter(f"{CORE}object"):
        points = np.array(
            [list(row.attrib.values()) for row in element.iter(f"{CORE}vertex")], float
        )
        sorts = dict[
            str | None, list[list[str]]
        ]()  # by the material of a part that is not the first
        for row in element.iter(f"{CORE}triangle"):
            sorts.setdefault(row.get("p1"), []).append(list(row.attrib.values())[:3])
        parts += [points[np.array(corners, int)] for corners in sorts.values()]
    return parts
