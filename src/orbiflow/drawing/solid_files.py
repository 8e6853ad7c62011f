"""Files of solids to print: STL and 3MF, in mm, the same bytes every time."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple
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

    Each colour is a filament of its own, in their order, for PrusaSlicer, Bambu Studio and OrcaSlicer,
    which read no colours but files of their own beside the model.

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
    colours = colours or {}
    order = list(dict.fromkeys(colours.values()))
    values = {
        "meshes": meshes,
        "title": title,
        "colours": colours,
        "filaments": {name: order.index(colour) + 1 for name, colour in colours.items()},
        "numbers": {name: number for number, name in enumerate(meshes, 1)},
        "items": _items(list(meshes), places or {}, groups or {}),
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


class _Item(NamedTuple):
    """What is printed in one place: the number of its object, which may be of several parts."""

    number: int
    name: str
    parts: Sequence[str]
    place: str = ""


def _items(
    names: list[str], places: Mapping[str, Sequence[Array]], groups: Mapping[str, Sequence[str]]
) -> list[_Item]:
    """Return what is printed: each copy is an object, or all but the first would lose their colour."""
    together = {part for parts in groups.values() for part in parts[1:]}
    free = count(len(names) + 2)  # after the parts and the materials
    items: list[_Item] = []
    for number, name in enumerate(names, 1):
        if name in groups:
            items.append(_Item(next(free), name, groups[name]))
        elif name in places:
            copies = map(_transform, places[name])
            items += [_Item(next(free), name, [name], place) for place in copies]
        elif name not in together:
            items.append(_Item(number, name, [name]))
    return items


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
