"""Exported files read back by programs that are not orbiflow, and tiles to export."""

import io
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
import svgelements
from hypothesis import strategies as st

from bent_tiles import bent_tile
from orbiflow.arrays import Array
from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import (
    CLASSES,
    ExportSettings,
    Scene,
    Tile,
    exported,
    isohedral_class,
    write_scene,
)
from orbiflow.tiles.result_file import group_json


def scenes(
    tile: Any, settings: ExportSettings, picture: str | Path | None = None, **how: Any
) -> tuple[list[Scene], tuple[str, ...]]:
    """The sheets of an export, and what the user should know."""
    made = exported(tile, settings, (picture,), **how)
    return list(made.scenes), made.notes


def sheet_content(scene: Scene, settings: ExportSettings) -> Any:
    """The content of a sheet's file: text or bytes."""
    form = settings.file_format
    return write_scene(scene, form, tolerance=settings.fine, dpi=settings.dpi, dxf=settings.dxf)


class Line(NamedTuple):
    """A path of a file in mm, with its curves as many points."""

    points: Array
    closed: bool
    layer: str


def svg_lines(text: str, per_curve: int = 16) -> list[Line]:
    """All visible paths of an SVG, copies of symbols among them, in user units of its viewBox."""
    drawing = svgelements.SVG.parse(io.StringIO(text), reify=True, ppi=25.4)
    found: list[Line] = []

    def walk(group: Any, layer: str) -> None:
        for item in group:
            if isinstance(item, svgelements.Group | svgelements.Use):
                walk(item, (item.values or {}).get("id") or layer)
            elif isinstance(item, svgelements.Path):
                found.append(_line(item, layer, per_curve))

    walk(drawing, "")
    return found


def _line(path: Any, layer: str, per_curve: int) -> Line:
    points: list[Array] = []
    closed = False
    share = np.linspace(0, 1, per_curve + 1)
    for segment in path:
        match segment:
            case svgelements.CubicBezier():
                points.append(np.asarray(segment.npoint(share))[1:])
            case svgelements.Close():
                closed = True
            case svgelements.Move() | svgelements.Line():
                end: Any = segment.end
                points.append(np.array([[end.x, end.y]]))
    return Line(np.concatenate(points), closed, layer)


def dxf_lines(text: str) -> tuple[Any, list[Line]]:
    """The document and its polylines, with y down from the page's top as everywhere else."""
    from ezdxf.filemanagement import read

    document: Any = read(io.StringIO(text))
    high = document.header["$EXTMAX"][1]
    lines = [
        Line(
            np.array([(x, high - y) for x, y in item.get_points("xy")]),
            bool(item.closed),
            item.dxf.layer,
        )
        for item in document.modelspace()
    ]
    return document, lines


def polygons(lines: list[Line]) -> list[shapely.Polygon]:
    """The regions of closed lines; every line must be one."""
    assert all(line.closed for line in lines)
    found = [shapely.Polygon(line.points) for line in lines]
    assert all(polygon.is_valid for polygon in found)
    return found


def tile_of(name: str, turn: float = 0.3, stretch: float = 0.1, scale: float = 7.0) -> Tile:
    """A tile of a class with bent edges, somewhere in the plane."""
    tile = bent_tile(name)
    kind = isohedral_class(name)
    linear = scale * rotation_matrix(turn) @ kind.stretch(np.full(kind.stretch_dim, stretch))
    return tile.transformed(linear, np.array([3.0, -11.0]))


def entry(name: str) -> dict[str, Any]:
    """What result.json says about a tile of a class."""
    tile = tile_of(name)
    return {
        "class": name,
        "polygon": np.concatenate([tile.polygon, tile.polygon[:1]]).tolist(),
        "corners": list(tile.corners),
        "group": group_json(tile.group),
    }


def boot_run(folder: Path) -> Path:
    """Write the folder of a run with three tiles."""
    folder.mkdir()
    document = {
        "schema_version": 2,
        "input": {"source": "pictures/boot.png", "y_down": True},
        "tiles": [entry("IH6"), entry("IH4"), entry("IH6")],
    }
    (folder / "result.json").write_text(json.dumps(document))
    return folder


tiles = st.builds(
    tile_of,
    st.sampled_from(list(CLASSES)),
    st.floats(-3, 3),
    st.floats(-0.15, 0.15),
    st.sampled_from([0.02, 1.0, 300.0]),
)
