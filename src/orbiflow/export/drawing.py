"""A scene drawn by matplotlib: what the PDF and the PNG have in common."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from orbiflow.export.curves import Booleans, Curve
from orbiflow.export.scene import Layer, Scene, Uses
from orbiflow.symmetry.isometry import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.path import Path

INCH = 25.4
"""In mm."""


def drawn(scene: Scene, *, least_width: float = 0.0) -> Figure:
    """A figure of the page's size; one inch of it is one inch.

    Args:
        least_width: of strokes in mm, so that hairlines show on a screen.

    Raises:
        OrbiflowError: for artwork.
    """
    from matplotlib.collections import PathCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    scene.require_plain()
    figure = Figure(figsize=(scene.width / INCH, scene.height / INCH))
    figure.patch.set_facecolor("white")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0, scene.width)
    axes.set_ylim(scene.height, 0)
    for layer in scene.layers:
        width = max(layer.style.width, least_width) * 72 / INCH
        collection = PathCollection(
            _paths(scene, layer),
            facecolors=layer.style.fill or "none",
            edgecolors=layer.style.stroke or "none",
            linewidths=width,
            joinstyle="round",
            capstyle="round",
        )
        axes.add_collection(collection, autolim=False)
        if layer.clipped:
            box = scene.clip
            window = Rectangle((box.left, box.top), box.width, box.height)
            window.set_transform(axes.transData)
            collection.set_clip_path(window)
    return figure


def _paths(scene: Scene, layer: Layer) -> list[Path]:
    paths = []
    for item in layer.items:
        if isinstance(item, Uses):
            symbol = scene.symbols[item.symbol]
            points, codes = _points_and_codes(symbol)
            paths += [_path(image, codes) for image in item.images(points)]
        else:
            paths.append(_path(*_points_and_codes(item)))
    return paths


def curves_path(curves: Iterable[Curve]) -> Path:
    """Several curves as one path of matplotlib's, filled together."""
    from matplotlib.path import Path

    parts = [_points_and_codes(curve) for curve in curves]
    if not parts:
        return Path(np.zeros((0, 2)))
    return _path(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _path(points: Array, codes: Array) -> Path:
    from matplotlib.path import Path

    path = Path(points, codes)
    path.should_simplify = False
    return path


def _points_and_codes(curve: Curve) -> tuple[Array, Array]:
    from matplotlib.path import Path

    move, line, cubic = (np.uint8(code) for code in (Path.MOVETO, Path.LINETO, Path.CURVE4))
    kept = _kept(curve.straight)
    points = curve.pieces[:, 1:].reshape(-1, 2)[kept]
    codes = np.where(np.repeat(curve.straight, 3), line, cubic)[kept]
    points, codes = np.concatenate([curve.start[None], points]), np.concatenate([[move], codes])
    if curve.closed:
        points = np.concatenate([points, curve.start[None]])
        codes = np.concatenate([codes, [np.uint8(Path.CLOSEPOLY)]])
    return points, codes


def _kept(straight: Booleans) -> Booleans:
    """(3 n,) which control points after the first to keep: of straight pieces only the end."""
    keep = np.ones((len(straight), 3), dtype=bool)
    keep[straight, :2] = False
    return keep.ravel()
