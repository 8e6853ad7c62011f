"""Files of solids to print: STL and 3MF, in mm, the same bytes every time."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from manifold3d import Manifold

from orbiflow.arrays import Array
from orbiflow.drawing.web_page import rendered
from orbiflow.errors import OrbiflowError

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
    places: Mapping[str, Sequence[Array]] | None = None,
    groups: Mapping[str, Sequence[str]] | None = None,
) -> bytes:
    """Return a 3MF file with each part as an object of its own, in millimetres.

    Args:
        parts: Closed bodies by name.
        title: What the file says about itself.
        colours: The colour of each part that has one, as #rrggbb.
        places: Of a part that is there several times, the matrices (3, 4) of its copies: linear part
            and shift, as `Manifold.transform` takes them. A part that is not named is there once.
        groups: Of a part that is one object with others, such as what fills a drawing in it, the
            names of all, itself the first.

    Raises `OrbiflowError` for a place that is a reflection, which printers' programs read differently:
    mirror the part.
    """
    meshes = {name: body.to_mesh64() for name, body in parts.items()}
    texts = {name: list(map(_transform, moves)) for name, moves in (places or {}).items()}
    together = {part for members in (groups or {}).values() for part in members[1:]}
    numbers: dict[Any, int] = {name: number for number, name in enumerate(meshes, 1)}
    numbers |= {(name, "all"): len(meshes) + 1 + k for k, name in enumerate(groups or {}, 1)}
    values = {
        "meshes": meshes,
        "title": title,
        "colours": colours or {},
        "places": texts,
        "groups": groups or {},
        "numbers": numbers,
        "built": [name for name in meshes if name not in together],
    }
    files = {
        "[Content_Types].xml": "solid_content_types.xml",
        "_rels/.rels": "solid_relationships.xml",
        "3D/3dmodel.model": "solid_model.xml",
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, template in files.items():
            entry = zipfile.ZipInfo(name)  # without a date
            text = rendered("orbiflow.drawing", template, **values)
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _transform(place: Array) -> str:
    """Return a place (3, 4) as the twelve numbers of a 3MF file, for points as rows."""
    matrix = np.asarray(place, float)
    if matrix.shape != (3, 4) or not np.linalg.det(matrix[:, :3]) > 0:
        raise OrbiflowError("a place is a matrix (3, 4) that does not reflect")
    return " ".join(f"{number:.9g}" for number in (matrix.T + 0.0).ravel())


def read_triangles(path: Path) -> list[Array]:
    """Return the triangles (n, 3, 3) of each part in a file that this package has written."""
    if path.suffix == ".stl":
        return [np.frombuffer(path.read_bytes()[84:], STL_TRIANGLE)["corners"].astype(float)]
    with zipfile.ZipFile(path) as archive:
        model = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    triangles, groups = dict[str, Array](), dict[str, list[str]]()
    for element in model.iter(f"{CORE}object"):
        parts = [part.get("objectid", "") for part in element.iter(f"{CORE}component")]
        if parts:
            groups[element.get("id", "")] = parts
            continue
        points, corners = (
            [list(row.attrib.values()) for row in element.iter(CORE + tag)]
            for tag in ("vertex", "triangle")
        )
        triangles[element.get("id", "")] = np.array(points, float)[
            np.array([c[:3] for c in corners], int)
        ]
    placed = list[Array]()
    for item in model.iter(f"{CORE}item"):
        name = item.get("objectid", "")
        for part in groups.get(name, [name]):
            corners = triangles[part]
            if text := item.get("transform"):
                rows = np.array(text.split(), float).reshape(4, 3)
                corners = corners @ rows[:3] + rows[3]
            placed.append(corners)
    return placed
