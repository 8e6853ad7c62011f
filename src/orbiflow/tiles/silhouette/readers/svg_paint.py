"""The colours of a drawing's fills and strokes."""

from typing import NamedTuple

import numpy as np
import svgelements

from orbiflow.drawing import rgb
from orbiflow.tiles.silhouette.readers.svg_shapes import Drawing, DrawnShape, as_number

CURRENT = "currentColor"
"""The colour of what is drawn in `currentColor` where no colour is set."""


class Brush(NamedTuple):
    """A colour, #rrggbb or `CURRENT`, and its opacity, 0 to 1."""

    colour: str
    opacity: float


def brushes(drawing: Drawing, shape: DrawnShape) -> dict[str, Brush]:
    """Return what paints the "fill" and "stroke" of a shape, without what does not show, in order."""
    if shape.paint.get("visibility") in ("hidden", "collapse"):
        return {}
    found: dict[str, Brush] = {}
    order = shape.paint.get("paint-order", "fill").split()
    for kind in ("stroke", "fill") if "stroke" in order[:1] else ("fill", "stroke"):
        text = shape.paint.get(kind, "#000000" if kind == "fill" else "none")
        brush = _brush(text, drawing, shape.paint.get("color", CURRENT))
        if brush and (kind == "fill" or shape.width > 0):
            own = min(max(as_number(shape.paint.get(f"{kind}-opacity"), 1.0), 0.0), 1.0)
            found[kind] = Brush(brush.colour, shape.opacity * brush.opacity * own)
    return {kind: brush for kind, brush in found.items() if brush.opacity > 0}


def _brush(text: str, drawing: Drawing, current: str) -> Brush | None:
    text = text.strip()
    if text.lower() in ("none", "transparent", ""):
        return None
    if text.lower() == CURRENT.lower():
        # without a colour it is the one that shows on what lies below
        return Brush(CURRENT, 1.0) if current.lower() == CURRENT.lower() else _colour(current)
    if text.startswith("url("):
        return _gradient(text, drawing) or _brush(text.partition(")")[2], drawing, current)
    return _colour(text)


def _colour(text: str) -> Brush:
    try:
        colour = svgelements.Color(text[:60])
        red, green, blue = (int(getattr(colour, name)) for name in ("red", "green", "blue"))
        return Brush(f"#{red:02x}{green:02x}{blue:02x}", float(colour.opacity or 0.0))
    except (ValueError, TypeError, AttributeError):
        return Brush("#000000", 1.0)


def _gradient(text: str, drawing: Drawing) -> Brush | None:
    """Return the mean colour of a gradient's stops; a pattern is gray."""
    element = drawing.referred(text)
    for _ in range(5):  # gradients may refer to each other for their stops
        if element is None or any(child.tag == "stop" for child in element):
            break
        if element.tag == "pattern":
            return Brush("#808080", 1.0)
        element = drawing.by_id.get(element.get("href", "").strip().removeprefix("#"))
    if element is None:
        return None
    stops = [drawing.styles.properties(child) for child in element if child.tag == "stop"]
    colours = [_colour(stop.get("stop-color", "#000000")).colour for stop in stops]
    if not colours:
        return None
    red, green, blue = np.mean([rgb(colour) for colour in colours], axis=0).round().astype(int)
    return Brush(f"#{red:02x}{green:02x}{blue:02x}", 1.0)
