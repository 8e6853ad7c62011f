"""Meshes in 3MF files: archives of XML, in which objects are built from meshes and other objects.

trimesh would need two packages more for it, and reads no colours. `bounded.py` bounds memory and time.
"""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.solids.soup import MAX_BYTES, Soup

MILLIMETRES = {
    "micron": 1e-3,
    "millimeter": 1.0,
    "centimeter": 10.0,
    "inch": 25.4,
    "foot": 304.8,
    "meter": 1000.0,
}
"""The length of each unit of a 3MF file."""

Palette = dict[str, list[float]]
"""Colours by their place in a list, as triangles name it."""


class Resources(NamedTuple):
    """What objects are placed by, and colours taken from: each by its file and number."""

    objects: dict[tuple[str, str], ElementTree.Element]
    palettes: dict[tuple[str, str], Palette]


PALETTES = {"colorgroup": "color", "basematerials": "displaycolor"}
"""Lists of colours, and which attribute of what is in them is the colour."""

_COLOUR = re.compile(r"#([0-9A-Fa-f]{6})(?:[0-9A-Fa-f]{2})?")


def read_3mf(data: bytes) -> Soup:
    """Return all triangles that a 3MF file places, in mm.

    Raises `OrbiflowError` for what is no 3MF file.
    """
    roots = {name: _parsed(text) for name, text in _models(data).items()}
    if not roots:
        raise OrbiflowError("holds no 3D model; export it again")
    resources = Resources({}, {})
    for name, root in roots.items():
        for element in root.iter():
            number = name, element.get("id", "")
            if element.tag == "object":
                resources.objects[number] = element
            elif element.tag in PALETTES:
                colours = [_colour(entry.get(PALETTES[element.tag], "")) for entry in element]
                resources.palettes[number] = {str(k): colour for k, colour in enumerate(colours)}
    placed = list[Soup]()
    main, root = next(iter(roots.items()))
    unit = MILLIMETRES.get(root.get("unit", "millimeter"))
    if unit is None:
        raise OrbiflowError(f"is in an unknown unit, {root.get('unit')!r}; export it in mm")
    for item in (item for build in root.iter("build") for item in build.iter("item")):
        _place(item, main, np.diag([unit, unit, unit, 1.0]), resources, placed)
    return Soup.joined(placed)


def _models(data: bytes) -> dict[str, bytes]:
    """Return the XML of an archive's models, the main one first."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            models = [name for name in archive.namelist() if name.lower().endswith(".model")]
            models.sort(key=lambda name: (name.lower() != "3d/3dmodel.model", name))
            return {name.lower(): _unpacked(archive, name) for name in models}
    except OrbiflowError:
        raise
    # a broken archive's numbers lead anywhere: ValueError is of places before its start
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError) as error:
        raise OrbiflowError(f"is not a 3MF file, or is cut off: {error}") from error


def _unpacked(archive: zipfile.ZipFile, name: str) -> bytes:
    with archive.open(name) as file:
        text = file.read(MAX_BYTES + 1)
    if len(text) > MAX_BYTES:
        raise OrbiflowError(f"unpacks to over {MAX_BYTES / 2**20:.0f} MB; simplify the mesh")
    return text


def _parsed(text: bytes) -> ElementTree.Element:
    """Return the root of a model whose tags have lost their name spaces."""
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise OrbiflowError(f"is not a 3MF file, or is cut off: {error}") from error
    for element in root.iter():
        element.tag = str(element.tag).rpartition("}")[2]
    return root


def _place(
    use: ElementTree.Element, file: str, outer: Array, resources: Resources, placed: list[Soup]
) -> None:
    """Add the meshes of what an item or a component uses, in their places, to a list.

    `outer` (4, 4) is where it is used from, `file` the one that it stands in; it may name another.
    """
    named = [value for name, value in use.attrib.items() if name.rpartition("}")[2] == "path"]
    file = named[0].lstrip("/").lower() if named else file
    number = use.get("objectid", "")
    if (element := resources.objects.get((file, number))) is None:
        raise OrbiflowError(f"places object {number!r}, which is not there; export it again")
    if element.get("type", "model") != "model":
        return  # a support of the print, or another thing that is no part of the body
    matrix = outer @ _matrix(use.get("transform"))
    if (mesh := element.find("mesh")) is not None:
        points = _numbers(mesh, "vertex", ("x", "y", "z"), float)
        faces = _numbers(mesh, "triangle", ("v1", "v2", "v3"), np.int64)
        if faces.size and not 0 <= faces.min() <= faces.max() < len(points):
            raise OrbiflowError("has triangles of points that are not there; export it again")
        soup = Soup(points @ matrix[:3, :3].T + matrix[:3, 3], faces)
        if (colours := _colours(element, mesh, file, resources.palettes)) is not None:
            soup = soup.with_corner_colours(colours)
        if np.linalg.det(matrix[:3, :3]) < 0:
            soup = soup._replace(faces=soup.faces[:, ::-1])
        placed.append(soup)
    for component in element.iter("component"):
        _place(component, file, matrix, resources, placed)


def _colours(
    element: ElementTree.Element,
    mesh: ElementTree.Element,
    file: str,
    palettes: dict[tuple[str, str], Palette],
) -> Array | None:
    """Return the colours (M, 3, 3) at the triangles' corners, NaN where they have none.

    A triangle names a palette and an entry for each corner, or has those of its object. None if no
    triangle has a colour.
    """
    if not palettes:
        return None
    usual, first = element.get("pid", ""), element.get("pindex", "")
    rows, none = list[list[list[float]]](), [np.nan] * 3
    for face in mesh.iter("triangle"):
        palette = palettes.get((file, face.get("pid", usual)), {})
        corner = face.get("p1", first)
        entries = corner, face.get("p2", corner), face.get("p3", corner)
        rows.append([palette.get(entry, none) for entry in entries])
    colours = np.array(rows, float).reshape(-1, 3, 3)
    return colours if np.isfinite(colours).any() else None


def _colour(text: str) -> list[float]:
    match = _COLOUR.fullmatch(text)
    return [channel / 255 for channel in bytes.fromhex(match[1])] if match else [np.nan] * 3


def _matrix(text: str | None) -> Array:
    """Return the (4, 4) matrix of a transform, whose twelve numbers are for points as rows."""
    if text is None:
        return np.eye(4)
    try:
        rows = np.array(text.split(), float).reshape(4, 3)
    except ValueError:
        raise OrbiflowError(f"has a transform of {text[:40]!r}; export it again") from None
    return np.vstack([rows.T, [0.0, 0.0, 0.0, 1.0]])


def _numbers(mesh: ElementTree.Element, tag: str, names: tuple[str, ...], kind: type) -> Array:
    try:
        rows = [[element.attrib[name] for name in names] for element in mesh.iter(tag)]
        return np.array(rows, dtype="U32").astype(kind).reshape(-1, 3)
    except (KeyError, ValueError, OverflowError):
        raise OrbiflowError(f"has a {tag} that is not complete; export it again") from None
