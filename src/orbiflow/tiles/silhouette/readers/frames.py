"""What lies around a drawing and is no part of it: a frame of a thin line, a white card."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from orbiflow.arrays import Array

WIDEST = 0.03  # of the frame's shorter side: its line
LEAST_SIDE = 0.5  # of the picture's: a frame's
LEAST_DRAWN = 0.25  # of a frame's sides: what is drawn inside it
CARD = 0.94  # of its box: what a card fills, round corners apart
WHITE, BLACK = 0.9, 0.6  # luminances: a card is lighter than one, its drawing darker than the other
MOST_BETWEEN = 0.05  # of a card's pixels: those between white and the drawing's tone
_TOGETHER = np.ones((3, 3), dtype=int)
_Mask = NDArray[np.bool_]


def without_frame(channel: Array, above: _Mask) -> tuple[Array, list[str]]:
    """Return a picture (H, W) without a thin frame of straight lines around a drawing, and a note.

    `above` parts its light and its dark part, of which either may be the frame's.
    """
    found = [(*frame, part) for part in (above, ~above) for frame in _frames(part)]
    if not found:
        return channel, []
    # the innermost: a margin around a frame is one, too
    box, width, part = min(found, key=lambda frame: np.prod([s.stop - s.start for s in frame[0]]))
    band = np.zeros(part.shape, bool)  # with the line's own blurred edges
    band[tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box)] = True
    band[tuple(slice(side.start + width + 1, side.stop - width - 1) for side in box)] = False
    kept = np.where(band, np.median(channel[~part]), channel)
    pixels = f"{width} pixel{'s' * (width > 1)}"
    return kept, [f"left out the frame around the drawing, a line {pixels} wide"]


def _frames(part: _Mask) -> Iterator[tuple[tuple[slice, ...], int]]:
    """Yield the boxes of frames in one part of a picture, and the widths of their lines."""
    labels = np.asarray(ndimage.label(part, _TOGETHER)[0])
    for number, box in enumerate(ndimage.find_objects(labels), start=1):
        sides = [side.stop - side.start for side in box]
        if any(a < LEAST_SIDE * b for a, b in zip(sides, part.shape, strict=True)):
            continue
        width = _line_width(labels[box] == number)
        if width is not None and _is_drawn_on(part[box][width:-width, width:-width]):
            yield box, width


def _line_width(line: _Mask) -> int | None:
    """Return the width of a line along all of its box and nowhere else, or None."""
    most = max(3, int(WIDEST * min(line.shape)))
    middle = line[line.shape[0] // 2], line[:, line.shape[1] // 2]
    runs = [int(np.argmin(run)) for m in middle for run in (m, m[::-1])]
    width = max(runs)
    if not 0 < min(runs) <= width <= most or 2 * width + 2 >= min(line.shape):
        return None
    edges = np.concatenate([line[0], line[-1], line[:, 0], line[:, -1]])
    return width if edges.mean() > 0.98 and not line[width:-width, width:-width].any() else None


def _is_drawn_on(inside: _Mask) -> bool:
    """Whether what is drawn inside a frame is no speck."""
    boxes = ndimage.find_objects(inside.astype(int))
    if not boxes:
        return False
    sides = [side.stop - side.start for side in boxes[0]]
    return all(a > LEAST_DRAWN * b for a, b in zip(sides, inside.shape, strict=True))


def is_card(image: Image.Image) -> bool:
    """Whether the opaque part of an RGBA picture is a white rectangle with something dark on it."""
    rgba = np.asarray(image)
    opaque = rgba[..., 3] >= 128
    if opaque.all() or not opaque.any():
        return False
    box = ndimage.find_objects(opaque.astype(int))[0]
    if opaque[box].mean() < CARD:
        return False
    grey = np.asarray(image.convert("RGB").convert("L"))[box] / 255
    inside = ndimage.binary_erosion(opaque[box], iterations=2)
    rim = inside & ~ndimage.binary_erosion(inside, iterations=2)
    light, dark = grey > WHITE, grey < BLACK
    is_parted = (light | dark)[inside].mean() > 1 - MOST_BETWEEN
    return bool(is_parted and light[rim].mean() > 0.9 and _is_drawn_on(dark & inside))
