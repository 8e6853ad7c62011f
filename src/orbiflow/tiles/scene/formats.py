"""A scene as DXF or JSON, for cutters, CAD and programs."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np

from orbiflow.tiles.scene.flattening import flattened
from orbiflow.tiles.scene.scene import Layer, PlacedTile, Scene, clipped


def write_dxf(scene: Scene, *, tolerance: float) -> str:
    """Return the scene as DXF (R2010), which cutters, CAD and Inkscape read.

    Curves become polylines within `tolerance` (mm), which every reader takes. Tiles that the page
    cuts are cut. DXF has y up, and the page's lower left corner is the origin.
    """
    from ezdxf import units
    from ezdxf.colors import RGB
    from ezdxf.filemanagement import new

    scene = flattened(scene, tolerance)
    document: Any = new("R2010", units=units.MM)
    document.header["$MEASUREMENT"] = 1
    space = document.modelspace()
    extents = (0, 0, 0), (scene.width, scene.height, 0)
    space.reset_extents(*extents)
    # ezdxf takes a corner at the origin for a missing one
    document.header["$EXTMIN"], document.header["$EXTMAX"] = extents
    space.reset_limits((0, 0), (scene.width, scene.height))
    for note in filter(None, (scene.title, *scene.notes)):
        document.header.custom_vars.append("orbiflow", note[:250])
    for layer in scene.layers:
        if layer.role == "paper":
            continue
        entry = document.layers.add(layer.name, linetype="CONTINUOUS")
        colour = layer.style.stroke or layer.style.fill or "#000000"
        entry.color, entry.rgb = ACI.get(colour, 7), RGB.from_hex(colour)
        for points, closed in _polylines(scene, layer, tolerance):
            space.add_lwpolyline(points, close=closed, dxfattribs={"layer": layer.name})
    text = io.StringIO()
    document.write(text)
    return text.getvalue()


ACI = {"#ff0000": 1, "#0000ff": 5}
"""AutoCAD's numbers of colours, for readers without true colours; 7 is black on a light ground."""


def _polylines(
    scene: Scene, layer: Layer, tolerance: float
) -> list[tuple[list[tuple[float, float]], bool]]:
    found = []
    for curve in scene.curves(layer):
        kept = [curve]
        if layer.clipped:
            kept = clipped(curve, scene.clip, tolerance, filled=curve.closed)
        for part in kept:
            points = part.flattened(tolerance)
            found.append(([(x, scene.height - y) for x, y in points.tolist()], part.closed))
    return found


SCHEMA_VERSION = 1


def write_json(scene: Scene, *, tolerance: float) -> str:
    """Return the scene as JSON; all lengths in mm, y down from the page's upper left corner."""
    scene, prototile = flattened(scene, tolerance), scene.prototile
    document: dict[str, Any] = {
        "schema_version": SCHEMA_VERSION,
        "kind": "orbiflow-export",
        "title": scene.title,
        "notes": list(scene.notes),
        "units": "mm",
        "y": "down",
        "page": {"width": scene.width, "height": scene.height, "window": list(scene.clip)},
        **scene.facts,
        "prototile": None if prototile is None else _rounded(prototile),
        "tiles": [_tile(tile, number, prototile) for number, tile in enumerate(scene.tiles)],
        "layers": [_layer(scene, layer, tolerance) for layer in scene.layers],
    }
    return json.dumps(document, allow_nan=False, separators=(",", ":"))


def _tile(tile: PlacedTile, number: int, prototile: np.ndarray | None) -> dict[str, Any]:
    placed = {}
    if prototile is not None:
        placed["polygon"] = _rounded(prototile @ tile.linear.T + tile.offset)
    return {
        "number": number,
        "aspect": tile.aspect,
        # as in SVG: a, b, c, d, e, f of x' = a x + c y + e, y' = b x + d y + f
        "transform": [*np.round(tile.linear.T.ravel(), 9).tolist(), *_rounded(tile.offset, 6)],
        "neighbours": list(tile.neighbours),
        "whole": tile.whole,
        **placed,
    }


def _layer(scene: Scene, layer: Layer, tolerance: float) -> dict[str, Any]:
    paths: list[dict[str, Any]] = []
    if layer.role not in ("paper", "tiles"):  # tiles are listed as such
        paths = [
            {"closed": curve.closed, "points": _rounded(curve.flattened(tolerance))}
            for curve in scene.curves(layer)
        ]
    style = layer.style
    return {
        "name": layer.name,
        "role": layer.role,
        "fill": style.fill,
        "stroke": style.stroke,
        "stroke_width": style.width,
        "paths": paths,
    }


def _rounded(values: np.ndarray, decimals: int = 4) -> list[Any]:
    return (np.round(values, decimals) + 0.0).tolist()
