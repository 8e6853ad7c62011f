"""A scene as DXF, JSON, PDF or PNG; SVG has a file of its own."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from orbiflow.drawing import plane_axes
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.scene.flattening import flattened
from orbiflow.tiles.scene.scene import (
    Curve,
    Layer,
    Part,
    PlacedTile,
    Raster,
    Scene,
    Style,
    Uses,
    clipped,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path as PlotPath


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


INCH = 25.4
"""An inch in mm."""

PLOT_TOLERANCE = 0.01  # distance in mm at which curves are cut for a picture


def drawn(scene: Scene, *, least_width: float = 0.0) -> Figure:
    """Return a figure of the page in real size; strokes are at least `least_width` mm wide."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    scene = flattened(scene, PLOT_TOLERANCE)
    figure = Figure(figsize=(scene.width / INCH, scene.height / INCH))
    figure.patch.set_facecolor("white")
    axes = plane_axes(figure, (0.0, 0.0, scene.width, scene.height), y_down=True)
    axes.set_aspect("auto")  # which rounding would otherwise decide

    def points(style: Style) -> Style:
        return style._replace(width=max(style.width, least_width) * 72 / INCH)

    for layer in scene.layers:
        # as it is in files of vectors
        how = "bilinear" if least_width else "none"
        artists = [_image(axes, item, how) for item in layer.items if isinstance(item, Raster)]
        artists += [
            draw_paths(axes, [curves_path(item.curves)], points(item.style), item.opacity)
            for item in layer.items
            if isinstance(item, Part)
        ]
        paths = []
        for item in layer.items:
            if isinstance(item, Uses):
                paths += [curves_path([c]) for c in item.curves(scene.symbols[item.symbol])]
            elif isinstance(item, Curve):
                paths.append(curves_path([item]))
        artists.append(draw_paths(axes, paths, points(layer.style)))
        for artist in artists if layer.clipped else ():
            box = scene.clip
            window = Rectangle((box.left, box.top), box.width, box.height)
            window.set_transform(axes.transData)
            artist.set_clip_path(window)
    return figure


def _image(axes: Axes, raster: Raster, interpolation: str) -> Artist:
    """Draw a picture of pixels on axes of mm, in its place."""
    from matplotlib.image import AxesImage
    from matplotlib.transforms import Affine2D

    width, height = raster.size
    image = AxesImage(axes, interpolation=interpolation, extent=(0, width, height, 0))
    image.set_data(np.asarray(Image.open(io.BytesIO(raster.png))))
    place = np.vstack([np.column_stack([raster.linear, raster.offset]), [0, 0, 1]])
    image.set_transform(Affine2D(place) + axes.transData)
    image.set_zorder(1)  # as curves, so that what comes later lies above
    axes.add_artist(image)
    return image


def draw_paths(axes: Axes, paths: list[PlotPath], style: Style, opacity: float = 1.0) -> Artist:
    """Draw paths on axes, with the stroke's width in points."""
    from matplotlib.collections import PathCollection

    collection = PathCollection(
        paths, facecolors=style.fill or "none", edgecolors=style.stroke or "none",
        linewidths=style.width, alpha=opacity if opacity < 1 else None,
        joinstyle="round", capstyle="round",
    )  # fmt: skip
    axes.add_collection(collection, autolim=False)
    return collection


def curves_path(curves: Iterable[Curve]) -> PlotPath:
    """Return several curves as one path of matplotlib's, filled together."""
    from matplotlib.path import Path as PlotPath

    points, codes = [np.zeros((0, 2))], [np.zeros(0, dtype=np.uint8)]
    for curve in curves:
        # of straight pieces only the end is kept
        straight = np.repeat(curve.straight, 3)
        kept = ~straight
        kept[2::3] = True
        points += [curve.start[None], curve.pieces[:, 1:].reshape(-1, 2)[kept]]
        along = np.where(straight, PlotPath.LINETO, PlotPath.CURVE4)[kept]
        codes += [np.array([PlotPath.MOVETO]), along]
        if curve.closed:
            points.append(curve.start[None])
            codes.append(np.array([PlotPath.CLOSEPOLY]))
    path = PlotPath(np.concatenate(points), np.concatenate(codes))
    path.should_simplify = False
    return path


def write_pdf(scene: Scene) -> bytes:
    """Return the scene as a PDF of one page; the same scene gives the same bytes."""
    buffer = io.BytesIO()
    metadata = {
        "Title": scene.title,
        "Subject": " ".join(scene.notes),
        "Creator": "orbiflow",
        "CreationDate": None,
    }
    drawn(scene).savefig(buffer, format="pdf", metadata=metadata, facecolor="none")
    return buffer.getvalue()


MOST_PIXELS = 100_000_000


def write_png(scene: Scene, *, dpi: float = 300.0) -> bytes:
    """Return the scene as a PNG that gives its resolution, so that it prints in real size."""
    width, height = (side * dpi / INCH for side in (scene.width, scene.height))
    if width * height > MOST_PIXELS or max(width, height) >= 2**16:
        raise OrbiflowError(
            f"at {dpi:g} dots per inch the page has {width:.0f} x {height:.0f} pixels; "
            f"choose fewer dots or another format"
        )
    if min(width, height) < 1:
        raise OrbiflowError(f"at {dpi:g} dots per inch the page has no pixel; choose more dots")
    figure = drawn(scene, least_width=INCH / dpi)
    buffer = io.BytesIO()
    metadata = {"Title": scene.title, "Description": " ".join(scene.notes), "Software": "orbiflow"}
    figure.savefig(buffer, format="png", dpi=dpi, metadata=metadata)
    return buffer.getvalue()
