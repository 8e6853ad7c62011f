"""How Pillow draws pictures several times finer and averages them, and pictures of few colours.

Polygons and lines are drawn ten times as fast as by matplotlib, and PNGs are a quarter of the size if
they have a palette: the colours that were used, and mixtures of any two of them.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from orbiflow.arrays import Array, Window

FINER = 3
"""Factor by which each side of a pixel is drawn finer."""

MAX_FINE_PIXELS = 2**20
"""Pixels of a band that is drawn at once, which bounds the memory; the fastest power of two."""

MIN_DIFFERENCE = 16
"""Least difference, out of 255, of a mixture in a palette from the colours that were used."""

SHARP_TURN = 0.3
"""Turn in radians beyond which a line's joint is rounded: flatter ones show no notch."""


def in_bands(
    mode: str,
    size: tuple[int, int],
    ground: int | tuple[int, int, int, int],
    draw: Callable[[Image.Image, int, int], None],
) -> Image.Image:
    """Return a picture that is drawn band by band, `FINER` times as fine, and averaged.

    Args:
        mode: "P", for colours of a palette, or "RGBA".
        size: Width and height in pixels.
        ground: The colour of what nothing is drawn on, as Pillow takes it.
        draw: Draws on a band that begins at a row of the picture and has so many of its rows.
    """
    width, height = size
    is_opaque = mode == "P" or (isinstance(ground, tuple) and ground[3] == 255)
    whole = Image.new("RGB" if is_opaque else mode, size)
    most = max(1, MAX_FINE_PIXELS // (width * FINER**2))
    for top in range(0, height, most):
        rows = min(most, height - top)
        band = Image.new(mode, (width * FINER, rows * FINER), ground)
        draw(band, top, rows)
        if is_opaque:
            part = band.convert("RGB").reduce(FINER)
        else:  # transparent pixels have no colour
            part = band.convert("RGBa").reduce(FINER).convert("RGBA")
        whole.paste(part, (0, top))
    return whole


def fine_places(points: Array, top: int) -> Array:
    """Return points (N, 2) in pixels as Pillow draws them on a band that begins at row `top`."""
    # whole numbers are the middles of pixels for Pillow
    return (points - (0.0, top)) * FINER - 0.5


def draw_line(
    pen: ImageDraw.ImageDraw, path: Array, width: float, colour: int | tuple[int, ...]
) -> None:
    """Draw a line with round joints and ends along points (N, 2) in pixels."""
    whole = max(1, round(width))
    pen.line(path.ravel().tolist(), fill=colour, width=whole)
    if whole < 3:
        return
    joints = path[[0, -1]]
    if len(path) > 2:
        steps = np.diff(path, axis=0)
        cross = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
        turn = np.abs(np.arctan2(cross, (steps[:-1] * steps[1:]).sum(axis=1)))
        joints = np.concatenate([joints, path[1:-1][turn > SHARP_TURN]])
    height = pen.im.size[1]
    for x, y in joints[abs(joints[:, 1] - height / 2) < height / 2 + whole].tolist():
        pen.circle((x, y), (whole - 1) / 2, fill=colour)


def palette_png(picture: Image.Image, colours: Sequence[str]) -> bytes:
    """Return an RGB picture as PNG whose palette is 1 to 256 colours, and steps between any two."""
    return png_bytes(limited(picture, colours), compress_level=6)


def png_bytes(picture: Image.Image, **options: Any) -> bytes:
    """Return a picture as PNG, with Pillow's options."""
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", **options)
    return buffer.getvalue()


def limited(picture: Image.Image, colours: Sequence[str], steps: int = 7) -> Image.Image:
    """Return an RGB picture with a palette of these colours, and steps between any two of them.

    Pictures of the same colours have the same palette.
    """
    return picture.quantize(
        palette=_chart(tuple(dict.fromkeys(colours)), steps), dither=Image.Dither.NONE
    )


@lru_cache(maxsize=16)
def _chart(colours: tuple[str, ...], most: int) -> Image.Image:
    base = np.array([rgb(colour) for colour in colours], dtype=float)
    pairs = list(combinations(range(len(base)), 2))
    steps = min(most, (256 - len(base)) // len(pairs)) if pairs else 0
    share = np.arange(1, steps + 1)[:, None] / (steps + 1)
    mixed = [base[a] + share * (base[b] - base[a]) for a, b in pairs if steps]
    between = np.concatenate([np.zeros((0, 3)), *mixed])
    # Pillow looks colours up in boxes: a mixture too near to a colour would be taken for it
    near = np.abs(between[:, None] - base).max(axis=2).min(axis=1, initial=255) < MIN_DIFFERENCE
    table: NDArray[np.int64] = np.rint(np.concatenate([base, between[~near]])).astype(np.int64)
    chart = Image.new("P", (1, 1))
    chart.putpalette(table.ravel().tolist())
    return chart


def rgb(colour: str) -> tuple[int, int, int]:
    """Return red, green and blue, 0 to 255, of #rrggbb.

    >>> rgb("#ff8000")
    (255, 128, 0)
    """
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


@lru_cache(maxsize=32)
def font(size: float) -> Any:
    """Return Pillow's own font, `size` pixels high."""
    return ImageFont.load_default(size=size)


def window_of(rings: Sequence[Array], margin: float = 0.03) -> Window:
    """Return the rectangle around `rings` (N, 2), with a margin as a share of its longer side."""
    low = np.min([ring.min(axis=0) for ring in rings], axis=0)
    high = np.max([ring.max(axis=0) for ring in rings], axis=0)
    room = margin * float((high - low).max())
    return (*(low - room).tolist(), *(high + room).tolist())
