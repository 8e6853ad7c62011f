"""A scene's tiling as one web page without an end: to move, colour and keep, without a network."""

from __future__ import annotations

import base64
import io
import re
from importlib import resources
from typing import Any

import numpy as np
from markupsafe import Markup
from PIL import Image

from orbiflow import __version__
from orbiflow.arrays import Array
from orbiflow.drawing import rendered
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.page import INK, Endless, Motif, Raster, Scene
from orbiflow.tiles.write.png import texture

SIDE_PIXELS = 900  # of the longer side of a picture on a tile, at most
ROOM = 6  # pixels of it that lie beyond the outline
QUALITY = 88  # of these pictures, in per cent
SHARED = [f"drawing/js/{name}.js" for name in ("turned", "tiling", "tinted", "svg", "view")]
"""Scripts that the page carries before its own, which the studio has, too."""


def write_html(scene: Scene) -> str:
    """Return a self-contained web page with the scene's whole tiling, to be moved and coloured anew.

    A sphere or the hyperbolic plane has a page of its own.

    Raises:
        OrbiflowError: If the scene is of lines to cut, which have no whole tiling.
    """
    if scene.web_page is not None:
        return scene.web_page()
    whole = scene.endless
    if whole is None:
        raise OrbiflowError("a web page shows all tiles in their colours; leave {cut} out")
    data = {
        "title": scene.title,
        "tile": whole.as_json(),
        "palettes": [
            {
                "name": name,
                "colours": palette.colours,
                "outline": palette.outline,
                "paper": palette.paper,
            }
            for name, palette in whole.palettes().items()
        ],
        "tint": whole.tint,
        "outline": whole.line > 0,
        "skins": [
            _skin(prototile.polygon, motif, whole)
            for prototile, motif in zip(whole.tiling.prototiles, whole.motifs, strict=False)
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
    inked = tuple(part for part in motif.parts if INK in part.style)
    plain = tuple(part for part in motif.parts if INK not in part.style)
    scale = (SIDE_PIXELS - ROOM) / np.ptp(ring, axis=0).max()
    shown = texture(Motif(plain, motif.rasters), ring, scale)
    ink = texture(Motif(inked), ring, scale) if inked else None
    return {
        "picture": _address(shown),
        "ink": None if ink is None else _address(ink),
        "matrix": [*shown.linear.T.ravel().tolist(), *shown.offset.tolist()],
        "tinted": bool(whole.tint),
    }


def _address(picture: Raster) -> str:
    """Return a picture as an address that holds it."""
    file = io.BytesIO()
    Image.fromarray(picture.pixels, "RGBA").save(file, "WEBP", quality=QUALITY, method=4)
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}"
