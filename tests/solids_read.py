"""Solids read back from their files by other programs' readers, and cut through."""

import io
import zipfile
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import shapely
import trimesh

from orbiflow.arrays import Array

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


class Object(NamedTuple):
    """An object of a 3MF file."""

    name: str
    mesh: Any


def read_stl(content: bytes) -> Any:
    """All bodies of an STL as one mesh, corners at the same place made one."""
    return trimesh.load_mesh(io.BytesIO(content), file_type="stl")


def read_3mf(content: bytes) -> list[Object]:
    """The objects of a 3MF that are to be built, as they are: nothing is merged or mended."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        root = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    assert root.get("unit") == "millimeter"
    objects = {own.get("id"): own for own in root.iter(f"{CORE}object")}
    built = [objects[item.get("objectid")] for item in root.iter(f"{CORE}item")]
    own = [[p.get("objectid") for p in o.iter(f"{CORE}component")] or [o.get("id")] for o in built]
    return [_object(objects[part]) for parts in own for part in parts]


def _object(own: ElementTree.Element) -> Object:
    points = _numbers(own, "vertex", "xyz")
    triangles = _numbers(own, "triangle", ("v1", "v2", "v3")).astype(int)
    return Object(own.get("name", ""), trimesh.Trimesh(points, triangles, process=False))


def _numbers(own: ElementTree.Element, tag: str, names: Any) -> Array:
    rows = own.iter(f"{CORE}{tag}")
    return np.array([[float(row.get(name, "")) for name in names] for row in rows])


def section(body: Any, z: float) -> Any:
    """The cross-section of a body at a height, seen from above."""
    found: Any = shapely.Polygon()
    for ring in body.slice(z).to_polygons():  # holes run clockwise
        found = found.symmetric_difference(shapely.Polygon(ring))
    return found
