"""SVG drawings: the outline of the largest shape that is seen in a render, in user units."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from xml.etree.ElementTree import Element

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Window
from orbiflow.drawing import level_curves
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.outlines import (
    MAX_COORDINATE,
    clean_ring,
    outer_outline,
    outer_ring,
    percent,
)
from orbiflow.tiles.silhouette.readers.reading import FileContent, Reading
from orbiflow.tiles.silhouette.readers.svg_documents import leaves
from orbiflow.tiles.silhouette.readers.svg_render import (
    Drawing,
    Rgba,
    only,
    picture_size,
    visible,
    without_colour,
)
from orbiflow.tiles.silhouette.readers.tracing import region

LONG_PIXELS = 1500
"""The longer side of the picture that is traced."""

TOLERANCE_PIXELS = 0.3
"""How far the outline is from that of the pixels, whose own opacity is of quarters of them."""

SMALL_PIXELS = 400
"""The longer side of pictures by which it is found where a drawing is."""

MARGIN = 0.02
"""Of what is drawn: what is traced lies so far from the edge of its picture."""

BEYOND = (0.5, 10.0)
"""How many pages beyond the page are looked at, on each side."""

FIRST_REACH = 1000.0
"""User units from the origin, within which a drawing without a page is sought first."""

PAVED_SHARE = 0.95
"""Of the page: what a background covers."""

MIN_EDGE_SHARE = 0.5
"""Of the page's edge: what a background covers."""

EDGE_SHARE = 0.02
"""Of the page's longer side: a background may end so far from the edge."""

MIN_VISIBLE = 0.5
"""Opacity: what is less opaque is not seen."""

MAX_CHANNEL_DISTANCE = 10
"""Of 255: colours whose channels differ by no more are one."""

MIN_SHOWN_SHARE = 0.5
"""Of the whole: what is left if shapes in the paper's colour are background, and not the drawing."""

MIN_DENSE_SHARE = 0.25
"""Of what is all faint: less that is dense is where faint shapes overlap."""

MIN_OVERLAP_SHARE = 0.1
"""Of a shape in the paper's colour: what lies over others by more is background."""

MAX_CURVE_POINTS = 300_000
"""The most points of the curves around what is seen."""

MIN_NOTED_SHARE = 0.001
WHITE = np.array([255, 255, 255], dtype=np.uint8)
_Mask = NDArray[np.bool_]
_AROUND = np.ones((3, 3), dtype=bool)
_FILLED = "path,rect,circle,ellipse,polygon,polyline{fill:#000!important;opacity:1!important}"


def read_svg(path: FileContent) -> Reading:
    """Read the outline of the silhouette in an SVG drawing, in user units of the viewBox, with y down.

    What is seen counts, as resvg renders it: fills, strokes, texts and pictures, cut by clips, masks
    and the page, one painted over the other. What has the background's colour hides what lies below.
    The largest component is kept and its holes are filled. Where nothing is painted, all paths count
    as filled.

    Raises `InputFileError` for a drawing that is damaged, too large, or shows nothing.
    """
    drawing, notes = Drawing(path), list[str]()
    box = _bounds(drawing)
    root: Element | None = None
    if box is None and drawing.window is not None and _share_beyond(drawing, None):
        page = " ".join(f"{value:g}" for value in drawing.box or ())
        raise InputFileError(
            f"{path}: nothing lies on the page {page} (the viewBox, or width and height); fit the "
            "page to the drawing"
        )
    if box is None:
        root, notes = _all_filled(drawing), ["nothing is painted: took the closed paths as filled"]
        box = _bounds(drawing, root)
    if box is None:
        left = "".join(f"; {note}" for note in drawing.notes())
        raise InputFileError(f"{path}: the drawing has no shape that encloses an area{left}")
    paper = None
    if drawing.window is not None and root is None:
        bare = _without_background(drawing, drawing.window)
        if bare is not None:
            root, paper, notes = bare
            box = _bounds(drawing, root) or box
    window = _framed(box, drawing.window)
    size = picture_size(window, LONG_PIXELS)
    pixels = drawing.pixels(window, size, root)

    def without_paper() -> Rgba:
        shown = drawing.document.root if root is None else root
        colour = WHITE if paper is None else paper
        return drawing.pixels(window, size, without_colour(shown, colour, MAX_CHANNEL_DISTANCE))

    values, said = _shares(pixels, paper, without_paper)
    low, high = np.array(window[:2]), np.array(window[2:])
    unit = (high - low) / size
    traced = _traced(values)
    if traced is None:
        raise InputFileError(f"{path}: the drawing is too intricate; simplify it")
    seen = shapely.transform(traced, lambda points: low + points * unit)
    if not seen.area > 0:
        raise InputFileError(f"{path}: the drawing encloses no area that shows at its size")
    shape, kept = outer_outline(seen)
    outline, cleaned = clean_ring(outer_ring(shape), str(path), InputFileError)
    notes += said
    if drawing.window is not None and (share := _share_beyond(drawing, root)) > MIN_NOTED_SHARE:
        notes.append(f"left out what lies beyond the page: {percent(share)} of what is painted")
    notes += [*drawing.notes(), *kept, *cleaned]
    left, top, right, bottom = drawing.box or (0.0, 0.0, 0.0, 0.0)
    page = (right - left, bottom - top) if drawing.box else None
    return Reading(outline, True, "svg", page, tuple(notes), (left, top), seen)


def _traced(values: Array) -> BaseGeometry | None:
    """Return where values (height, width) are above a half, in pixels; (0, 0) spans [0, 1] x [0, 1].

    None is of what is too intricate.
    """
    curves = level_curves(np.pad(values, 1), 0.5)
    if sum(map(len, curves)) > MAX_CURVE_POINTS:
        return None
    area = region([curve[:, ::-1] - 0.5 for curve in curves if len(curve) > 3])
    height, width = values.shape
    # what fills the edge of the picture ends there, and not in the middle of its pixels
    simple = shapely.simplify(area, TOLERANCE_PIXELS)
    return shapely.intersection(simple, shapely.box(0, 0, width, height))


def _bounds(drawing: Drawing, root: Element | None = None) -> Window | None:
    """Return bounds of all that is seen, on the page if there is one; None if nothing is."""
    if drawing.window is not None:
        return _seen_in(drawing, drawing.window, root)
    reach, bounds = FIRST_REACH, None
    while bounds is None or max(np.abs(bounds)) >= reach * (1 - 2 / SMALL_PIXELS):
        if reach > MAX_COORDINATE:
            if bounds is None:
                return None
            raise InputFileError(
                f"{drawing.path}: a path reaches beyond {MAX_COORDINATE:g} user units; rescale the "
                "drawing"
            )
        bounds = _seen_in(drawing, (-reach, -reach, reach, reach), root)
        reach *= 10 if bounds is not None or reach < 1e6 else 1000
    for _ in range(20):  # to a drawing that is small beside its distance from the origin
        before = bounds
        bounds = _seen_in(drawing, before, root) or before
        if _size_of(bounds) > _size_of(before) / 2:
            break
    return bounds


def _size_of(window: Window) -> float:
    return max(window[2] - window[0], window[3] - window[1])


def _seen_in(drawing: Drawing, window: Window, root: Element | None) -> Window | None:
    """Return bounds of what is seen in a window, a pixel wider on each side."""
    size = picture_size(window, SMALL_PIXELS)
    shown = drawing.pixels(window, size, root)[..., 3] > 0
    if not shown.any():
        return None
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    first = np.array([columns[0] - 1, rows[0] - 1]).clip(0)
    last = np.array([columns[-1] + 2, rows[-1] + 2]).clip(None, size)
    low, high = np.array(window[:2]), np.array(window[2:])
    unit = (high - low) / size
    left, top = (low + first * unit).tolist()
    right, bottom = (low + last * unit).tolist()
    return left, top, right, bottom


def _framed(box: Window, page: Window | None) -> Window:
    """Return a window around a box with a margin, on the page."""
    margin = MARGIN * _size_of(box)
    low, high = np.array(box[:2]) - margin, np.array(box[2:]) + margin
    if page is not None:
        low, high = np.maximum(low, page[:2]), np.minimum(high, page[2:])
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _all_filled(drawing: Drawing) -> Element:
    """Return the document with all its shapes filled."""
    root = deepcopy(drawing.document.root)
    for item in root.iter():
        item.attrib.pop("style", None)
        for key in [key for key in item.attrib if key.startswith(("fill", "stroke", "opacity"))]:
            del item.attrib[key]
    sheet = Element("style")
    sheet.text = _FILLED
    root.append(sheet)
    return root


def _without_background(
    drawing: Drawing, page: Window
) -> tuple[Element, NDArray[np.uint8], list[str]] | None:
    """Return the document without its lowest shape, the shape's colour, and a note.

    None is of one whose lowest shape does not cover the page, or has nothing of another colour on it.
    """
    size = picture_size(page, SMALL_PIXELS)
    whole = drawing.document.root
    above = range(1, len(list(leaves(whole))))
    lowest = drawing.pixels(page, size, only(whole, {0}))
    if not above or not _is_paved(lowest):
        return None
    shades, counts = np.unique(lowest[lowest[..., 3] > 127][:, :3], axis=0, return_counts=True)
    paper, root = shades[counts.argmax()], only(whole, above)
    others = drawing.pixels(page, size, root)
    apart = np.abs(others[..., :3].astype(np.int16) - paper).max(axis=-1) > MAX_CHANNEL_DISTANCE
    if not (apart & (others[..., 3] > 127)).any():
        return None
    return root, paper, ["left out a background that covers the whole drawing"]


def _is_paved(pixels: Rgba) -> bool:
    opaque = visible(pixels) >= MIN_VISIBLE
    height, width = opaque.shape
    rim = math.ceil(EDGE_SHARE * max(height, width))
    inner = opaque[rim : height - rim, rim : width - rim]
    shares = [
        np.concatenate([part[0], part[-1], part[:, 0], part[:, -1]]).mean()
        for part in (opaque, inner)
    ]
    solid = scipy.ndimage.binary_fill_holes(opaque)
    return bool(np.mean(solid) >= PAVED_SHARE and max(shares) >= MIN_EDGE_SHARE)


def _shares(
    pixels: Rgba, paper: NDArray[np.uint8] | None, without_paper: Callable[[], Rgba]
) -> tuple[Array, list[str]]:
    """Return how much of each pixel is seen as shape on a paper, and notes of what was decided.

    The pixels of the drawing `without_paper`, without what has the paper's colour, show what that
    hides.
    """
    opacity, notes = visible(pixels), list[str]()
    opaque = opacity >= MIN_VISIBLE
    shown = opacity > 1 / 32
    # where faint shapes overlap they are no shape of their own
    if not opaque.any() or (opacity.max() < 0.9 and opaque.sum() < MIN_DENSE_SHARE * shown.sum()):
        usual = float(np.median(opacity[opacity > opacity.max() / 2]))
        return opacity / usual, ["took faint shapes, as there are no others"]
    few = opacity[::3, ::3]  # of the edges of shapes no two neighbours are among them
    faint = scipy.ndimage.binary_erosion((few > 1 / 32) & (few < MIN_VISIBLE), _AROUND)
    if faint.sum() > MIN_NOTED_SHARE * (few >= MIN_VISIBLE).sum():
        notes.append("left out faint shapes")
    colour = WHITE if paper is None else paper
    apart = np.abs(pixels[..., :3].astype(np.int16) - colour).max(axis=-1)
    pale = opaque & (apart <= MAX_CHANNEL_DISTANCE)
    ink = opaque & ~pale
    if not pale.any():
        return opacity, notes
    name = "#" + "".join(f"{value:02x}" for value in colour.tolist())
    dark = visible(without_paper()) >= MIN_VISIBLE
    labels, count = scipy.ndimage.label(pale)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    covered = np.bincount(labels[dark], minlength=count + 1) > MIN_OVERLAP_SHARE * sizes
    covered[0] = True
    every = ink | ~covered[labels]  # what lies on the bare paper may be the shape itself
    hidden = 1 - _solid(ink) / _solid(every)
    if not ink.any() or (paper is None and hidden > MIN_SHOWN_SHARE):
        notes.append(f"took shapes in {name} too: they are most of the drawing")
        return opacity * every, notes
    bitten = 1 - _solid(ink) / max(_solid(dark), 1)
    if bitten > MIN_NOTED_SHARE:
        notes.append(
            f"took shapes in {name} for background, which hide {percent(bitten)} of the others; give "
            "them another colour if they belong to the shape"
        )
    # beside the paper a pixel is shape as much as its colour is the shape's beside it
    most = scipy.ndimage.maximum_filter(np.where(ink, apart, 0), 3)
    beside = scipy.ndimage.binary_dilation(pale, _AROUND) & opaque
    share = np.where(beside, apart / np.maximum(most, 1), 1.0)
    return np.where(pale, 0.0, opacity * share), notes


def _solid(mask: _Mask) -> int:
    """Return the pixels of the largest component of a mask with its holes filled."""
    labels = scipy.ndimage.label(scipy.ndimage.binary_fill_holes(mask))[0]
    return int(np.bincount(np.ravel(labels))[1:].max(initial=0))


def _share_beyond(drawing: Drawing, root: Element | None) -> float:
    """Return which share of what is painted lies beyond the page, near it or farther away."""
    page = drawing.window
    assert page is not None
    low, high = np.array(page[:2]), np.array(page[2:])
    largest = 0.0
    for beyond in BEYOND:
        sides = beyond * (high - low)
        (left, top), (right, bottom) = (low - sides).tolist(), (high + sides).tolist()
        wide = left, top, right, bottom
        shown = visible(drawing.pixels(wide, picture_size(wide, SMALL_PIXELS), root))
        rows, columns = (
            np.abs(np.arange(int(count)) + 0.5 - count / 2) <= count / (2 + 4 * beyond) + 1.5
            for count in shown.shape
        )
        total = float(shown.sum())
        outside = total - float(shown[rows][:, columns].sum())
        largest = max(largest, outside / total if total else 0.0)
    return largest
