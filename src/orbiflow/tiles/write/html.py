"""A scene's tiling as one web page without an end: to move, colour and keep, without a network."""

from __future__ import annotations

import base64
import io
import re
from importlib import resources
from typing import Any

import numpy as np
import shapely
from markupsafe import Markup
from PIL import Image

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.drawing import rendered
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.page import INK, Endless, Motif, Scene, cut_off
from orbiflow.tiles.write.png import PixelSheet, painted, shape_of

SIDE_PIXELS = 900  # of the longer side of a picture on a tile, at most
PAD_PIXELS = 2  # around the outline, or what is below would show between two copies
QUALITY = 88  # of these pictures, in per cent
SHARED = [f"studio/static/js/{name}.js" for name in ("tiling", "tinted", "svg", "view")]
"""The studio's own scripts that the page carries, before its own."""


def write_html(scene: Scene) -> str:
    """Return a self-contained web page with the scene's whole tiling, to be moved and coloured anew.

    Raises:
        OrbiflowError: If the scene is of lines to cut, which have no whole tiling.
    """
    whole = scene.endless
    if whole is None:
        raise OrbiflowError("a web page shows all tiles in their colours; leave {cut} out")
    data = {
        "title": scene.title,
        "tile": whole.as_json(),
        "palettes": [
            {"name": name, "colours": own.colours, "outline": own.outline, "paper": own.paper}
            for name, own in whole.palettes().items()
        ],
        "tint": whole.tint,
        "outline": whole.line > 0,
        "skins": [
            _skin(own.polygon, motif, whole)
            for own, motif in zip(whole.tiling.prototiles, whole.motifs, strict=False)
        ],
    }
    script = page_script(*SHARED, "tiles/write/endless.js")
    return canvas_page("endless.html", scene.title, script, "showEndless", data)


def canvas_page(template: str, title: str, script: str, shows: str, data: dict[str, Any]) -> str:
    """Return a page that shows data on a canvas, by a function of its script."""
    shown = {"title": title, "version": __version__, "script": Markup(script), "shows": shows}
    return rendered("orbiflow.tiles.write", template, **shown, data=data)


def page_script(*files: str) -> str:
    """Return scripts of the package, in the order of their imports, as one module."""
    package = resources.files("orbiflow")
    text = "\n".join(package.joinpath(file).read_text("utf-8") for file in files)
    text = re.sub(r"^import [^;]*;\n", "", text, flags=re.MULTILINE)
    return re.sub(r"^export (?=(async )?function|class|const)", "", text, flags=re.MULTILINE)


def _skin(ring: Array, motif: Motif, whole: Endless) -> dict[str, Any] | None:
    """Return what lies on a prototile as pictures, with the map from their pixels to the tile in mm.

    What is drawn in a layer's ink, which each copy has in the colour that shows, is one of its own.
    """
    if not (motif.parts or motif.rasters):
        return None
    low, size = ring.min(axis=0), np.ptp(ring, axis=0)
    scale = (SIDE_PIXELS - 2 * PAD_PIXELS) / size.max()
    start = low - PAD_PIXELS / scale
    pixels = np.ceil(size * scale).astype(int) + 2 * PAD_PIXELS
    area = shapely.Polygon(ring).buffer(PAD_PIXELS / scale)
    placed = cut_off(motif, area, whole_strokes=False).moved(scale * np.eye(2), -scale * start)
    inked = [part for part in placed.parts if INK in part.style]
    plain = [part for part in placed.parts if INK not in part.style]
    black = [
        part._replace(style=part.style._replace(**_black(part.style._asdict()))) for part in inked
    ]
    shown = (int(pixels[0]), int(pixels[1]))
    images = [
        painted([PixelSheet((*rasters, *map(shape_of, parts)))], shown)
        for rasters, parts in ((placed.rasters, plain), ((), black))
    ]
    return {
        "picture": _address(images[0]),
        "ink": _address(images[1]) if inked else None,
        "matrix": [1 / scale, 0, 0, 1 / scale, *start.tolist()],
        "tinted": bool(whole.tint),
    }


def _black(style: dict[str, Any]) -> dict[str, Any]:
    return {name: "#000000" if own == INK else own for name, own in style.items()}


def _address(image: Image.Image) -> str:
    """Return a picture as an address that holds it."""
    file = io.BytesIO()
    image.save(file, "WEBP", quality=QUALITY, method=4)
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}"
