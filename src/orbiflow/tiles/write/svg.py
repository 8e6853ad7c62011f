"""A scene as SVG, for Inkscape, Illustrator, browsers and cutters.

One user unit is one millimetre, and layers are those of Inkscape. A scene's copies are one short
line each.
"""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterator
from itertools import islice
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.drawing import png_bytes
from orbiflow.tiles.page import (
    Curve,
    Layer,
    Motif,
    PathPart,
    Raster,
    Scene,
    Style,
    Uses,
    Warped,
    Words,
)
from orbiflow.tiles.write.formats import TOLERANCE
from orbiflow.tiles.write.painting import INCH, with_page_pictures

_HEADER = """<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" \
xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" version="1.1" \
width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}">
"""


def write_svg(scene: Scene, *, tolerance: float = TOLERANCE, dpi: float = 300.0) -> str:
    """Return the scene as an SVG document, in which rounding moves points by far less than `tolerance`.

    Edges that two tiles share have the same numbers up to the last decimal. Pictures on meshes have
    `dpi` pixels an inch.
    """
    scene = with_page_pictures(scene, dpi / INCH)
    number = Numbers(max(3, math.ceil(-math.log10(tolerance / 5))))
    parts = [_HEADER.format(width=number(scene.width), height=number(scene.height))]
    parts.append(f"  <title>{escape(scene.title)}</title>\n")
    if scene.notes:
        parts.append(f"  <desc>{escape(' '.join(scene.notes))}</desc>\n")
    parts.append(_definitions(scene, number))
    for layer in scene.layers:
        parts.append(_layer_start(layer))
        for item in layer.items:
            if isinstance(item, Uses):
                reach = float(np.abs(scene.points(item.symbol)).max())
                parts.extend(_uses(item, reach, number))
            elif isinstance(item, Curve):
                parts.append(f'    <path d="{path_data(item, number)}"/>\n')
            elif isinstance(item, Words):
                parts.append("    " + _words(item, number))
            else:
                element = _part(item, number) if isinstance(item, PathPart) else _image(item)
                parts.append("    " + element)
        parts.append("  </g>\n")
    parts.append("</svg>\n")
    return "".join(parts)


class Numbers:
    """A format for numbers: a fixed number of decimals, without zeros at the end."""

    def __init__(self, decimals: int) -> None:
        self.decimals = decimals

    def __call__(self, value: float) -> str:
        text = f"{value:.{self.decimals}f}"
        text = text.rstrip("0").rstrip(".") if self.decimals else text
        return "0" if text in ("-0", "") else text

    def points(self, points: Array) -> list[str]:
        """Return points (N, 2), each as two numbers with a comma between."""
        texts = " ".join([f"%.{self.decimals}f"] * points.size) % tuple(points.ravel().tolist())
        if self.decimals:
            texts = _LAST_ZEROS.sub("", texts)
        numbers = texts.split(" ")
        numbers = ["0" if text == "-0" else text for text in numbers]
        return [f"{x},{y}" for x, y in zip(numbers[::2], numbers[1::2], strict=True)]


_LAST_ZEROS = re.compile(r"\.?0+(?= |$)")
"""Zeros at the ends of numbers with decimals, that spaces divide."""


def path_data(curve: Curve, number: Numbers | None = None) -> str:
    """Return the d attribute of a path, in absolute coordinates.

    >>> path_data(Curve.polyline([[0, 0], [2, 0], [2, 1.5]], closed=True))
    'M0,0L2,0 2,1.5Z'
    """
    number = number or Numbers(3)
    straight, pieces = curve.straight, curve.pieces
    if len(straight) and straight[-1] and curve.closed:  # Z draws it
        straight, pieces = straight[:-1], pieces[:-1]
    drawn = np.ones(pieces.shape[:2], dtype=bool)  # what the command takes of start, tangents, end
    drawn[:, 0], drawn[straight, 1:3] = False, False
    points = iter(number.points(np.concatenate([curve.start[None], pieces[drawn]])))
    parts, before = [f"M{next(points)}"], ""
    for is_straight in straight.tolist():
        command = "L" if is_straight else "C"
        parts.append(" " if command == before else command)
        parts.append(" ".join(islice(points, 1 if is_straight else 3)))
        before = command
    return "".join(parts) + ("Z" if curve.closed else "")


def _definitions(scene: Scene, number: Numbers) -> str:
    parts = []
    for name, curve in scene.symbols.items():
        parts.append(f'    <path id="{name}" d="{path_data(curve, number)}"/>\n')
    for name, motif in scene.motifs.items():
        parts.append(_motif(name, motif, number))
    if any(layer.clipped for layer in scene.layers):
        box = scene.clip
        x, y, width, height = map(number, (box.left, box.top, box.width, box.height))
        window = f'<rect x="{x}" y="{y}" width="{width}" height="{height}"/>'
        parts.append(f'    <clipPath id="window">{window}</clipPath>\n')
    return "  <defs>\n" + "".join(parts) + "  </defs>\n" if parts else ""


def _motif(name: str, motif: Motif, number: Numbers) -> str:
    """Return a group that is drawn once and used by every copy."""
    parts, clip = [], ""
    if motif.within is not None:
        clip = f' clip-path="url(#within-{name})"'
        parts.append(
            f'    <clipPath id="within-{name}"><use xlink:href="#{motif.within}"/></clipPath>\n'
        )
    parts.append(f'    <g id="{name}"{clip}>\n')
    parts += ["      " + _image(raster) for raster in motif.rasters]
    parts += ["      " + _part(part, number) for part in motif.parts]
    return "".join(parts) + "    </g>\n"


def _image(picture: Raster | Warped) -> str:
    raster = picture.raster() if isinstance(picture, Warped) else picture
    values = [*raster.linear.T.ravel().tolist(), *raster.offset.tolist()]
    place = ",".join(f"{value:.9g}" for value in values)
    png = png_bytes(Image.fromarray(raster.pixels, "RGBA"))
    data = base64.b64encode(png).decode("ascii")
    width, height = raster.size
    return (
        f'<image width="{width}" height="{height}" transform="matrix({place})" '
        f'preserveAspectRatio="none" xlink:href="data:image/png;base64,{data}"/>\n'
    )


def _words(words: Words, number: Numbers) -> str:
    x, y = map(number, words.place)
    anchor = "middle" if words.centred else "start"
    return (
        f'<text x="{x}" y="{y}" fill="{words.colour}" stroke="none" font-family="sans-serif" '
        f'font-size="{number(words.size)}" text-anchor="{anchor}" dominant-baseline="central">'
        f"{escape(words.text)}</text>\n"
    )


def _part(part: PathPart, number: Numbers) -> str:
    path = "".join(path_data(curve, number) for curve in part.curves)
    opacity = f' opacity="{part.opacity:.3g}"' if part.opacity < 1 else ""
    return f'<path{_style_attributes(part.style)}{opacity} d="{path}"/>\n'


def _layer_start(layer: Layer) -> str:
    name = quoteattr(layer.name)
    key = quoteattr(layer.name.replace(" ", "-"))
    clip = ' clip-path="url(#window)"' if layer.clipped else ""
    ink = f' color="{layer.ink}"' if layer.ink else ""
    return (
        f'  <g id={key} inkscape:groupmode="layer" inkscape:label={name}'
        f"{clip}{ink}{_style_attributes(layer.style)}>\n"
    )


def _style_attributes(style: Style) -> str:
    """Return fill and stroke as attributes, with a space before each."""
    text = f' fill="{style.fill or "none"}"'
    if style.stroke is None:
        return text + ' stroke="none"'
    width = Numbers(4)(style.width)
    return text + f' stroke="{style.stroke}" stroke-width="{width}" stroke-linejoin="round"'


def _uses(uses: Uses, reach: float, number: Numbers) -> Iterator[str]:
    """Yield a line for each copy, its matrix as exact as keeps the symbol's far end in its place."""
    fine = Numbers(number.decimals + max(1, math.ceil(math.log10(max(reach, 1.0)))))
    # columns first, as SVG has them
    matrices = [",".join(fine(value) for value in linear.T.ravel()) for linear in uses.linear]
    still = [bool(np.abs(linear - np.eye(2)).max() < 1e-12) for linear in uses.linear]
    for which, (x, y) in zip(uses.which.tolist(), uses.offsets.tolist(), strict=True):
        place = f"{number(x)},{number(y)}"
        how = f"translate({place})" if still[which] else f"matrix({matrices[which]},{place})"
        yield f'    <use xlink:href="#{uses.symbol}" transform="{how}"/>\n'
