"""What lies around a drawing and is no part of it: a frame of a thin line, a card of one colour."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from PIL import Image

from orbiflow.arrays import Array

MAX_LINE_SHARE = 0.03  # of the frame's shorter side: its line
MAX_MARK_SHARE = 0.06  # of the frame's shorter side: how far marks of axes reach out or in
MIN_LINE_COVERAGE = 0.85  # of the box of a frame with its marks: its lines
MIN_FRAME_SHARE = 0.5  # of the picture's: a frame's
MIN_DRAWN_SHARE = 0.25  # of a frame's sides: what is drawn inside it
MIN_CARD_COVERAGE = 0.94  # of its box: what a card fills, round corners apart
MIN_CARD_SHARE = 0.85  # of the page's: a card's, which lies on another ground
# of 255: a card's colours are nearer, its drawing's farther
MAX_CARD_DISTANCE, MIN_DRAWN_DISTANCE = 25, 75
MAX_BETWEEN_SHARE = 0.05  # of a card's pixels: those between its colour and the drawing's
SEARCH_SIDE_PIXELS = 500  # pixels a side, in which a card is looked for
CARD_NOTE = "left out the card that the drawing lies on; if it is the shape, remove what lies on it"
AXES_NOTE = "left out the frame around the drawing, with what lies outside of it"
_TOGETHER = np.ones((3, 3), dtype=int)
_Mask = NDArray[np.bool_]


def without_frame(channel: Array, above: _Mask) -> tuple[Array, list[str]]:
    """Return a picture (H, W) without a thin frame of straight lines around a drawing, and a note.

    `above` parts its light and its dark part, of which either may be the frame's.
    """
    found = [frame for part in (above, ~above) for frame in _frames(part)]
    if not found:
        return channel, []
    # the innermost: a margin around a frame is one, too
    frame = min(found, key=lambda frame: np.prod([s.stop - s.start for s in frame.box]))
    line = scipy.ndimage.binary_dilation(frame.line, _TOGETHER)  # with its own blurred edges
    if frame.has_marks:
        beyond = np.ones(line.shape, bool)
        beyond[frame.box] = False
        line = line | beyond
    drawn = above if (above & frame.line).any() else ~above
    kept = np.where(line, np.median(channel[~drawn]), channel)
    pixels = f"{frame.width} pixel{'s' * (frame.width > 1)}"
    note = f"left out the frame around the drawing, a line {pixels} wide"
    return kept, [AXES_NOTE if frame.has_marks else note]


class _Frame(NamedTuple):
    """A frame's box and the width of its line, all its pixels, and whether it has marks of axes."""

    box: tuple[slice, ...]
    width: int
    line: _Mask
    has_marks: bool


def _frames(part: _Mask) -> Iterator[_Frame]:
    """Yield the frames in one part of a picture."""
    labels = np.asarray(scipy.ndimage.label(part, _TOGETHER)[0])
    for number, outer in enumerate(scipy.ndimage.find_objects(labels), start=1):
        sides = [side.stop - side.start for side in outer]
        if any(a < MIN_FRAME_SHARE * b for a, b in zip(sides, part.shape, strict=True)):
            continue
        line = labels == number
        box = _without_marks(line[outer], outer)
        inner = _inner_marks(line[box])
        width = _line_width(line[box] & ~inner)
        if width is None or not _is_drawn_on((part[box] & ~line[box])[width:-width, width:-width]):
            continue
        yield _Frame(box, width, line, box != outer or bool(inner.any()))


def _without_marks(line: _Mask, outer: tuple[slice, ...]) -> tuple[slice, ...]:
    """Return the box of the straight lines in an outer box, without short marks outside of it."""
    most = max(1, int(MAX_MARK_SHARE * min(line.shape)))
    found: list[slice] = []
    for axis, side in enumerate(outer):
        full = np.flatnonzero(line.mean(axis=1 - axis) > MIN_LINE_COVERAGE)
        first, last = (int(full[0]), int(full[-1])) if full.size else (0, line.shape[axis] - 1)
        is_near = first <= most and line.shape[axis] - 1 - last <= most
        found.append(slice(side.start + first, side.start + last + 1) if is_near else side)
    return tuple(found)


def _inner_marks(line: _Mask) -> _Mask:
    """Return the marks of axes that point inwards: what is near the line of a frame and lies inside."""
    most = max(3, int(MAX_MARK_SHARE * min(line.shape)))
    width = max(1, int(np.argmin(line[:, line.shape[1] // 3]) or 1))
    inner = np.zeros_like(line)
    inner[width:-width, width:-width] = line[width:-width, width:-width]
    return np.zeros_like(line) if inner[most:-most, most:-most].any() else inner


def _line_width(line: _Mask) -> int | None:
    """Return the width of a line along all of its box and nowhere else, or None."""
    most = max(3, int(MAX_LINE_SHARE * min(line.shape)))
    middle = line[line.shape[0] // 2], line[:, line.shape[1] // 2]
    runs = [int(np.argmin(run)) for m in middle for run in (m, m[::-1])]
    width = max(runs)
    if not 0 < min(runs) <= width <= most or 2 * width + 2 >= min(line.shape):
        return None
    edges = np.concatenate([line[0], line[-1], line[:, 0], line[:, -1]])
    return width if edges.mean() > 0.98 and not line[width:-width, width:-width].any() else None


def _is_drawn_on(inside: _Mask) -> bool:
    """Whether what is drawn inside a frame is no speck."""
    boxes = scipy.ndimage.find_objects(inside.astype(int))
    if not boxes:
        return False
    sides = [side.stop - side.start for side in boxes[0]]
    return all(a > MIN_DRAWN_SHARE * b for a, b in zip(sides, inside.shape, strict=True))


def without_card(image: Image.Image) -> Image.Image | None:
    """Return a picture of the drawing alone that lies on a card, on a ground of its colour, or None.

    A card is a rectangle, perhaps with round corners, of one colour, with a drawing of another on it.
    It all but fills the picture, and around it the picture is transparent or of one colour.
    """
    if image.mode not in ("L", "RGB", "RGBA"):
        return None
    small = image.convert("RGBA").reduce(-(-max(image.size) // SEARCH_SIDE_PIXELS))
    rgba = np.asarray(small)
    rgb = rgba[..., :3].astype(int)
    is_cut_out = rgba[..., 3].min() < 128
    opaque = rgba[..., 3] >= 128 if is_cut_out else ~_margin(rgb)
    colour = _card_colour(rgb, opaque)
    is_margin = not is_cut_out and colour and abs(rgb[0, 0] - colour).max() <= MAX_CARD_DISTANCE
    if colour is None or is_margin:
        return None
    # without a blurred edge
    inside = Image.fromarray(scipy.ndimage.binary_erosion(opaque, iterations=2))
    ground = Image.new("RGB", image.size, colour)
    ground.paste(image.convert("RGB"), mask=inside.resize(image.size, Image.Resampling.NEAREST))
    return ground if image.mode != "L" else ground.convert("L")


def _margin(rgb: NDArray[np.int_]) -> _Mask:
    """Return what is joined to the border and has its usual colour (H, W); nothing, if it is thin."""
    border = np.concatenate([rgb[0], rgb[-1], rgb[:, 0], rgb[:, -1]])
    alike = abs(rgb - np.median(border, axis=0)).max(axis=2) <= MAX_CARD_DISTANCE
    labels = np.asarray(scipy.ndimage.label(alike)[0])
    at_border = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    margin = np.isin(labels, at_border[at_border > 0])
    width = int(MAX_LINE_SHARE * min(margin.shape)) + 1
    edges = (margin[:width], margin[-width:], margin[:, :width], margin[:, -width:])
    return margin if all(edge.all() for edge in edges) else np.zeros_like(margin)


def _card_colour(rgb: NDArray[np.int_], opaque: _Mask) -> tuple[int, ...] | None:
    """Return the colour of the card that a part of a picture is, or None if it is none."""
    if opaque.all() or not opaque.any():
        return None
    box = scipy.ndimage.find_objects(opaque.astype(int))[0]
    sides = zip(opaque[box].shape, opaque.shape, strict=True)
    if opaque[box].mean() < MIN_CARD_COVERAGE or any(a < MIN_CARD_SHARE * b for a, b in sides):
        return None
    inside = scipy.ndimage.binary_erosion(opaque[box], iterations=2)
    rim = inside & ~scipy.ndimage.binary_erosion(inside, iterations=2)
    if not rim.any():
        return None
    colour = np.median(rgb[box][rim], axis=0).astype(int)
    apart = abs(rgb - colour).max(axis=2)
    alike, other = apart[box] <= MAX_CARD_DISTANCE, apart[box] > MIN_DRAWN_DISTANCE
    is_parted = (alike | other)[inside].mean() > 1 - MAX_BETWEEN_SHARE
    is_card = is_parted and alike[rim].mean() > 0.9 and _is_drawing(other & inside)
    return tuple(colour.tolist()) if is_card else None


def _is_drawing(drawn: _Mask) -> bool:
    """Return whether the largest part of what is drawn on a card is neither a speck nor a rectangle."""
    labels = np.asarray(scipy.ndimage.label(drawn, _TOGETHER)[0])
    if not drawn.any():
        return False
    largest = int(np.bincount(labels.ravel())[1:].argmax()) + 1
    box = scipy.ndimage.find_objects(labels)[largest - 1]
    part = np.asarray(scipy.ndimage.binary_fill_holes(labels[box] == largest))
    sides = zip(part.shape, drawn.shape, strict=True)
    return bool(all(a > MIN_DRAWN_SHARE * b for a, b in sides) and part.mean() < MIN_CARD_COVERAGE)
