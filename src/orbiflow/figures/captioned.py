"""A picture of outlines over a strip with a caption, and what is drawn in it: dashes and arrows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbiflow.figures.raster import Raster
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings.window import Window

STRIP = 0.075
"""Height of the strip, as a share of the width."""

TEXT = 0.018
"""Size of its text, as a share of the width."""


def captioned(rings: Sequence[Array], width_px: int, *, y_down: bool, text: str) -> Raster:
    """A raster that shows all of `rings` (N, 2) with a margin, `text` in its strip.

    Args:
        rings: in the plane's units.
        width_px: the height follows.
        y_down: whether the y axis points down, as in images.
        text: None of it, and no strip, if it is empty.
    """
    strip = round(STRIP * width_px) if text else 0
    raster = Raster(window_of(rings), width_px, y_down=y_down, strip_px=strip)
    if text:
        caption(raster, 0.03, text)
    return raster


def window_of(rings: Sequence[Array], margin: float = 0.03) -> Window:
    """The rectangle around all of `rings` (N, 2), with a margin in shares of its longer side."""
    low = np.min([ring.min(axis=0) for ring in rings], axis=0)
    high = np.max([ring.max(axis=0) for ring in rings], axis=0)
    room = margin * float((high - low).max())
    return (*(low - room).tolist(), *(high + room).tolist())


def caption(raster: Raster, x: float, text: str) -> None:
    """Words in a raster's strip, from a share x of its width on."""
    raster.text(x * raster.width, strip_middle(raster), text, TEXT * raster.width)


def strip_middle(raster: Raster) -> float:
    """Where the strip's middle is, in pixels from the top."""
    return (raster.plane_px + raster.height) / 2


def dashes(points: Array, on: float, off: float) -> list[Array]:
    """A polyline (N, 2) in pieces of length `on`, `off` apart.

    >>> [piece[:, 0].tolist() for piece in dashes(np.array([[0.0, 0.0], [5.0, 0.0]]), 2, 1)]
    [[0.0, 2.0], [3.0, 5.0]]
    """
    knots = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    pieces = []
    for start in np.arange(0.0, knots[-1], on + off):
        end = min(start + on, knots[-1])
        inner = (knots > start) & (knots < end)
        ends = np.stack([np.interp([start, end], knots, points[:, k]) for k in (0, 1)], axis=1)
        pieces.append(np.concatenate([ends[:1], points[inner], ends[1:]]))
    return pieces


def arrow(raster: Raster, start: Array, end: Array, colour: str, width_px: float) -> None:
    """An arrow from a point of the plane (2,) to another, its head at the end."""
    tail, tip = raster.to_pixels(start), raster.to_pixels(end)
    length = float(np.hypot(*(tip - tail)))
    if length < 1e-9:
        return
    along = (tip - tail) / length
    across = np.array([-along[1], along[0]])
    head = min(5.5 * width_px, 0.6 * length)
    back = tip - head * along
    raster.line(np.stack([tail, back]), colour, width_px, pixels=True)
    raster.fill_pixels(
        np.stack([tip, back + 0.4 * head * across, back - 0.4 * head * across]), colour
    )
