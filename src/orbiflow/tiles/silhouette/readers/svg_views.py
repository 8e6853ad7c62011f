"""The viewBox of an element, and how it lies in the frame that it fills."""

from xml.etree.ElementTree import Element

import numpy as np

from orbiflow.arrays import Array, Window
from orbiflow.tiles.silhouette.readers.svg_shapes import BadElement
from orbiflow.tiles.silhouette.readers.svg_transforms import shift


def view_box(element: Element) -> Window | None:
    """Return the viewBox (x, y, width, height) of an element."""
    text = element.get("viewBox")
    if text is None:
        return None
    try:
        x, y, width, height = map(float, text.replace(",", " ").split())
    except ValueError as exc:
        raise BadElement(element, f"viewBox {text[:60]!a} is not four numbers") from exc
    if not (np.isfinite([x, y, width, height]).all() and width > 0 and height > 0):
        raise BadElement(element, f"viewBox {text[:60]!a} has no area")
    return x, y, width, height


def view_matrix(element: Element, frame: Window) -> tuple[Array, tuple[float, float]]:
    """Return the map (3, 3) of a viewBox into a frame, and what percentages refer to."""
    box = view_box(element)
    if box is None:
        return shift(*frame[:2]), frame[2:]
    words = (element.get("preserveAspectRatio") or "xMidYMid").lower().split()
    align, slices = words[words[:1] == ["defer"]], "slice" in words
    scale = np.array(frame[2:]) / box[2:]
    if align != "none":
        scale[:] = scale.max() if slices else scale.min()
    spare = np.array(frame[2:]) - scale * box[2:]
    share = [0.5 if f"{key}mid" in align else float(f"{key}max" in align) for key in "xy"]
    x, y = np.array(frame[:2]) - scale * box[:2] + share * spare
    return np.array([[scale[0], 0, x], [0, scale[1], y], [0, 0, 1.0]]), box[2:]
