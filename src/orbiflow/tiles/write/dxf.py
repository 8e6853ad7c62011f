"""A scene as DXF, for cutters and CAD."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any

from orbiflow.tiles.page import Curve, Layer, Scene, clipped, flattened
from orbiflow.tiles.write.formats import TOLERANCE, DxfVersion


def write_dxf(scene: Scene, *, tolerance: float = TOLERANCE, dxf: DxfVersion = "r2010") -> str:
    """Return the scene as DXF of a version, which cutters, CAD and Inkscape read.

    Curves become polylines within `tolerance` (mm), which every reader takes. Tiles that the page
    cuts are cut. DXF has y up, and the page's lower left corner is the origin.
    """
    from ezdxf import units
    from ezdxf.colors import RGB
    from ezdxf.filemanagement import new

    scene = flattened(scene, tolerance)
    is_old = dxf == "r12"
    # R12 has no units
    document: Any = new("R12") if is_old else new("R2010", units=units.MM)
    document.header["$MEASUREMENT"] = 1
    space = document.modelspace()
    extents = (0, 0, 0), (scene.width, scene.height, 0)
    space.reset_extents(*extents)
    # ezdxf takes a corner at the origin for a missing one
    document.header["$EXTMIN"], document.header["$EXTMAX"] = extents
    space.reset_limits((0, 0), (scene.width, scene.height))
    for note in filter(None, (scene.title, *scene.notes)) if not is_old else ():
        document.header.custom_vars.append("orbiflow", note[:250])
    for layer in scene.layers:
        if layer.role == "paper":
            continue
        name = re.sub(r"\W", "_", layer.name.upper())[:31] if is_old else layer.name
        entry = document.layers.add(name, linetype="CONTINUOUS")
        colour = layer.style.stroke or layer.style.fill or "#000000"
        entry.color = ACI.get(colour, 7)
        if not is_old:
            entry.rgb = RGB.from_hex(colour)
        for part in _parts(scene, layer, tolerance):
            points = [(x, scene.height - y) for x, y in part.flattened(tolerance).tolist()]
            line = space.add_polyline2d if is_old else space.add_lwpolyline
            line(points, close=part.closed, dxfattribs={"layer": name})
    text = io.StringIO()
    document.write(text)
    return text.getvalue()


ACI = {"#ff0000": 1, "#0000ff": 5}
"""AutoCAD's numbers of colours, for readers without true colours; 7 is black on a light ground."""


def _parts(scene: Scene, layer: Layer, tolerance: float) -> Iterator[Curve]:
    """Yield the curves of a layer, cut by the page where the layer is."""
    for curve in scene.curves(layer):
        if layer.clipped:
            yield from clipped(curve, scene.clip, tolerance, filled=curve.closed)
        else:
            yield curve
