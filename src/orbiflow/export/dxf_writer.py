"""A scene as DXF: closed polylines on named layers, in millimetres."""

from __future__ import annotations

import io
from typing import Any

from orbiflow.export.clipping import clipped_line, clipped_region
from orbiflow.export.scene import Layer, Scene


def write_dxf(scene: Scene, *, tolerance: float) -> str:
    """The scene as DXF (R2010), which cutters, CAD and Inkscape read.

    Curves become polygons within `tolerance` (mm): LWPOLYLINE is what every reader takes. Tiles that
    the page cuts are cut. DXF has y up: the page's lower left corner is the origin.
    """
    from ezdxf import units
    from ezdxf.colors import RGB
    from ezdxf.filemanagement import new

    document: Any = new("R2010", units=units.MM)
    document.header["$MEASUREMENT"] = 1
    space = document.modelspace()
    extents = (0, 0, 0), (scene.width, scene.height, 0)
    space.reset_extents(*extents)
    # ezdxf takes a corner at the origin for none
    document.header["$EXTMIN"], document.header["$EXTMAX"] = extents
    space.reset_limits((0, 0), (scene.width, scene.height))
    for note in filter(None, (scene.title, *scene.notes)):
        document.header.custom_vars.append("orbiflow", note[:250])
    for layer in scene.layers:
        if layer.role == "paper":
            continue
        entry = document.layers.add(layer.name, linetype="CONTINUOUS")
        entry.rgb = RGB.from_hex(layer.style.stroke or layer.style.fill or "#000000")
        for points, closed in _polylines(scene, layer, tolerance):
            space.add_lwpolyline(points, close=closed, dxfattribs={"layer": layer.name})
    text = io.StringIO()
    document.write(text)
    return text.getvalue()


def _polylines(
    scene: Scene, layer: Layer, tolerance: float
) -> list[tuple[list[tuple[float, float]], bool]]:
    found = []
    for curve in scene.curves(layer):
        kept = [curve]
        if layer.clipped:
            cut = clipped_region if curve.closed else clipped_line
            kept = cut(curve, scene.clip, tolerance)
        for part in kept:
            points = part.flattened(tolerance)
            found.append(([(x, scene.height - y) for x, y in points.tolist()], part.closed))
    return found
