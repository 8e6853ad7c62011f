"""Solids as files: binary STL, and 3MF with an object for each part; equal solids, equal bytes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

import numpy as np
from manifold3d import Manifold

from orbiflow.drawing import rendered


def write_stl(parts: Mapping[str, Manifold], title: str = "") -> bytes:
    """Return a binary STL of all parts, with 80 characters of the title in its header."""
    meshes = [body.to_mesh() for body in parts.values()]
    corners = np.concatenate([mesh.vert_properties[mesh.tri_verts] for mesh in meshes])
    # a normal of 0 leaves it to the reader, who has the order of the corners
    fields = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")]
    triangles = np.zeros(len(corners), dtype=fields)
    triangles["corners"] = corners
    header = title.encode("ascii", "replace")[:80].ljust(80)
    return header + len(corners).to_bytes(4, "little") + triangles.tobytes()


def write_3mf(parts: Mapping[str, Manifold], title: str = "") -> bytes:
    """Return a 3MF file with each part as an object of its own, in millimetres."""
    meshes = {name: body.to_mesh64() for name, body in parts.items()}
    files = {
        "[Content_Types].xml": "content_types.xml",
        "_rels/.rels": "relationships.xml",
        "3D/3dmodel.model": "model.xml",
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, template in files.items():
            text = rendered("orbiflow.tiles.solids", template, meshes=meshes, title=title)
            entry = zipfile.ZipInfo(name)  # without a date
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
