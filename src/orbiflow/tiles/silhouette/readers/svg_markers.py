"""Markers: what is drawn at the corners of a path."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element

import numpy as np

from orbiflow.tiles.silhouette.readers.svg_paths import corners
from orbiflow.tiles.silhouette.readers.svg_shapes import (
    MARKED,
    DrawnShape,
    Place,
    mapped,
    view_box,
    view_matrix,
)
from orbiflow.tiles.silhouette.readers.svg_transforms import shift
from orbiflow.tiles.silhouette.readers.svg_values import angle, quantity

if TYPE_CHECKING:
    from orbiflow.tiles.silhouette.readers.svg_drawing import Drawing

# shares of the marker's viewBox
_KEYWORDS = {"left": 0.0, "top": 0.0, "center": 0.5, "right": 1.0, "bottom": 1.0}


class Markers:
    """The markers of a drawing."""

    def __init__(self, drawing: Drawing) -> None:
        self.drawing = drawing

    def around(self, element: Element, shape: DrawnShape, place: Place) -> list[DrawnShape]:
        """Return a shape and its markers, in the order in which they are painted."""
        if element.tag not in MARKED or place.style.get("visibility", "visible") != "visible":
            return [shape]
        named: dict[str, Element | None] = {}
        for key in ("start", "mid", "end"):
            text = place.style.get(f"marker-{key}", "none")
            found = self.drawing.referred(text, f"marker-{key}") if text != "none" else None
            named[key] = found if found is not None and found.tag == "marker" else None
        if all(marker is None for marker in named.values()):
            return [shape]
        drawn = [
            one
            for key, (x, y), turn in corners(shape.paths, np.linalg.inv(place.matrix)[:2])
            if (marker := named[key]) is not None
            for one in self._one(marker, shape, place.moved(shift(x, y)), turn, key)
        ]
        order = place.style.get("paint-order", "").split()
        return [*drawn, shape] if order[:1] == ["markers"] else [shape, *drawn]

    def _one(
        self, marker: Element, shape: DrawnShape, place: Place, turn: float, key: str
    ) -> list[DrawnShape]:
        """Return what one marker shows with its reference point at the origin of a place."""
        orient = marker.get("orient", "0").strip()
        if not orient.startswith("auto"):
            turn = angle(orient) or 0.0
        elif orient == "auto-start-reverse" and key == "start":
            turn += np.pi
        scale = 1.0 if marker.get("markerUnits") == "userSpaceOnUse" else shape.width
        x, y = scale * np.cos(turn), scale * np.sin(turn)
        drawing, paint = self.drawing, place.style
        inner = place.moved(np.array([[x, -y, 0.0], [y, x, 0.0], [0, 0, 1.0]]))
        context = paint.get("fill", "#000000"), paint.get("stroke", "none")
        inner = replace(inner, context=context, decorates=True)
        inner = inner.styled(drawing.styles.standing(marker))
        if np.linalg.det(inner.matrix) == 0:
            return []
        return self._framed(marker, inner)

    def _framed(self, marker: Element, place: Place) -> list[DrawnShape]:
        drawing = self.drawing
        box = view_box(marker)
        size = replace(place, viewport=(box[2], box[3]) if box else place.viewport)
        width, height = (
            size.length(marker, f"marker{key}", marker.get(f"marker{key}"), 3.0)
            for key in ("Width", "Height")
        )
        matrix, _ = view_matrix(marker, (0.0, 0.0, width, height))
        whole = box or (0.0, 0.0, width, height)
        at = np.array([[self._reference(marker, key, size, whole) for key in ("X", "Y")]])
        x, y = -mapped(matrix, at)[0]
        return drawing.viewport(marker, (x, y, width, height), place)

    def _reference(
        self, marker: Element, axis: str, place: Place, whole: tuple[float, float, float, float]
    ) -> float:
        text = (marker.get(f"ref{axis}") or "0").strip()
        k = axis == "Y"
        if text in _KEYWORDS:
            return whole[k] + _KEYWORDS[text] * whole[2 + k]
        return place.length(marker, f"ref{axis}", text if quantity(text) else "0")
