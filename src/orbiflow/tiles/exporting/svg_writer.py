"""A scene as SVG: real millimetres, layers that Inkscape knows, one short line a copy."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from orbiflow.tiles.exporting.curves import Curve
from orbiflow.tiles.exporting.scene import (
    Box,
    Layer,
    Motif,
    Scene,
    Style,
    Uses,
)

_HEADER = """<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" \
xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" version="1.1" \
width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}">
"""


def write_svg(scene: Scene, *, decimals: int = 3) -> str:
    """The scene as an SVG document; one user unit is one millimetre.

    Args:
        decimals: of coordinates in mm. Edges that two tiles share are the same numbers up to the last
            of them.
    """
    number = _Numbers(decimals)
    parts = [_HEADER.format(width=number(scene.width), height=number(scene.height))]
    parts.append(f"  <title>{escape(scene.title)}</title>\n")
    if scene.notes:
        parts.append(f"  <desc>{escape(' '.join(scene.notes))}</desc>\n")
    parts.append(_definitions(scene, number))
    for layer in scene.layers:
        parts.append(_layer_start(layer))
        for item in layer.items:
            if isinstance(item, Uses):
                parts.extend(_uses(item, _reach(scene, item.symbol), number))
            else:
                parts.append(f'    <path d="{path_data(item, number)}"/>\n')
        parts.append("  </g>\n")
    parts.append("</svg>\n")
    return "".join(parts)


class _Numbers:
    """Numbers with so many decimals and nothing superfluous."""

    def __init__(self, decimals: int) -> None:
        self.decimals = decimals

    def __call__(self, value: float) -> str:
        text = (
            f"{value:.{self.decimals}f}".rstrip("0").rstrip(".")
            if self.decimals
            else f"{value:.0f}"
        )
        return "0" if text in ("-0", "") else text


def path_data(curve: Curve, number: _Numbers | None = None) -> str:
    """The d attribute of a path, in absolute coordinates.

    >>> path_data(Curve.polyline([[0, 0], [2, 0], [2, 1.5]], closed=True))
    'M0,0L2,0 2,1.5Z'
    """
    number = number or _Numbers(3)
    parts = [f"M{_pair(curve.start, number)}"]
    before, last = "", len(curve.pieces) - 1
    for k, (piece, straight) in enumerate(zip(curve.pieces, curve.straight, strict=True)):
        if straight and curve.closed and k == last:
            break  # Z draws it
        command = "L" if straight else "C"
        points = piece[3:] if straight else piece[1:]
        parts.append(" " if command == before else command)
        parts.append(" ".join(_pair(point, number) for point in points))
        before = command
    return "".join(parts) + ("Z" if curve.closed else "")


def _pair(point: np.ndarray, number: _Numbers) -> str:
    return f"{number(point[0])},{number(point[1])}"


def _definitions(scene: Scene, number: _Numbers) -> str:
    parts = []
    for name, curve in scene.symbols.items():
        parts.append(f'    <path id="{name}" d="{path_data(curve, number)}"/>\n')
    for name, motif in scene.motifs.items():
        parts.append(_motif(name, motif, number))
    if any(layer.clipped for layer in scene.layers):
        parts.append(f'    <clipPath id="window">{_rectangle(scene.clip, number)}</clipPath>\n')
    return "  <defs>\n" + "".join(parts) + "  </defs>\n" if parts else ""


def _motif(name: str, motif: Motif, number: _Numbers) -> str:
    """A group that is drawn once and used by every copy."""
    parts, clip = [], ""
    if motif.within is not None:
        clip = f' clip-path="url(#within-{name})"'
        parts.append(
            f'    <clipPath id="within-{name}"><use xlink:href="#{motif.within}"/></clipPath>\n'
        )
    parts.append(f'    <g id="{name}"{clip}>\n')
    for raster in motif.rasters:
        (a, c), (b, d) = raster.linear.tolist()
        e, f = raster.offset.tolist()
        place = ",".join(f"{value:.9g}" for value in (a, b, c, d, e, f))
        data = base64.b64encode(raster.png).decode("ascii")
        width, height = raster.size
        parts.append(
            f'      <image width="{width}" height="{height}" transform="matrix({place})" '
            f'preserveAspectRatio="none" xlink:href="data:image/png;base64,{data}"/>\n'
        )
    for part in motif.parts:
        path = "".join(path_data(curve, number) for curve in part.curves)
        opacity = f' opacity="{part.opacity:.3g}"' if part.opacity < 1 else ""
        parts.append(f'      <path{style_attributes(part.style)}{opacity} d="{path}"/>\n')
    return "".join(parts) + "    </g>\n"


def _reach(scene: Scene, name: str) -> float:
    """How far from its origin a symbol or motif reaches, in mm."""
    if name in scene.symbols:
        curves = [scene.symbols[name]]
    elif (within := scene.motifs[name].within) is not None:
        curves = [scene.symbols[within]]
    else:
        curves = [curve for part in scene.motifs[name].parts for curve in part.curves]
    return max((float(np.abs(curve.bounds()).max()) for curve in curves), default=1.0)


def _rectangle(box: Box, number: _Numbers) -> str:
    x, y, width, height = map(number, (box.left, box.top, box.width, box.height))
    return f'<rect x="{x}" y="{y}" width="{width}" height="{height}"/>'


def _layer_start(layer: Layer) -> str:
    name = quoteattr(layer.name)
    key = quoteattr(layer.name.replace(" ", "-"))
    clip = ' clip-path="url(#window)"' if layer.clipped else ""
    ink = f' color="{layer.ink}"' if layer.ink else ""
    return (
        f'  <g id={key} inkscape:groupmode="layer" inkscape:label={name}'
        f"{clip}{ink}{style_attributes(layer.style)}>\n"
    )


def style_attributes(style: Style) -> str:
    """Fill and stroke as attributes, with a space before each."""
    text = f' fill="{style.fill or "none"}"'
    if style.stroke is None:
        return text + ' stroke="none"'
    width = _Numbers(4)(style.width)
    return text + f' stroke="{style.stroke}" stroke-width="{width}" stroke-linejoin="round"'


def _uses(uses: Uses, reach: float, number: _Numbers) -> Iterator[str]:
    """A line a copy; the matrix has as many decimals as keep the symbol's far end in its place."""
    fine = _Numbers(number.decimals + max(1, math.ceil(math.log10(max(reach, 1.0)))))
    # columns first, as SVG has them
    aspects = [",".join(fine(value) for value in linear.T.ravel()) for linear in uses.linear]
    still = [bool(np.abs(linear - np.eye(2)).max() < 1e-12) for linear in uses.linear]
    for which, (x, y) in zip(uses.which.tolist(), uses.offsets.tolist(), strict=True):
        place = f"{number(x)},{number(y)}"
        how = f"translate({place})" if still[which] else f"matrix({aspects[which]},{place})"
        yield f'    <use xlink:href="#{uses.symbol}" transform="{how}"/>\n'
