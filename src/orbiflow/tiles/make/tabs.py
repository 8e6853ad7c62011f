"""Tabs: gaps in the lines to cut, where pieces stay in their sheet until they are broken out."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import SettingError
from orbiflow.tiles.page import Curve, Outline, bezier
from orbiflow.tiles.tilings import edge_classes

STEPS = 24  # of a cubic, by which its length is measured
CHOICES = 41  # places that are tried for each tab
CLEAR = 3.0  # widths of a tab on both sides of its middle within which the outline should not turn


class Ruler:
    """A curve that is measured along itself."""

    def __init__(self, curve: Curve) -> None:
        self.curve = curve
        shares = np.linspace(0.0, 1.0, STEPS + 1)
        count = len(curve.pieces)
        points = np.stack([bezier(curve.pieces, np.full(count, share)) for share in shares], axis=1)
        steps = np.diff(points, axis=1).reshape(-1, 2)
        self.lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
        before, after = np.roll(steps, 1, axis=0), steps
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        self.turns = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
        if not curve.closed:
            self.turns[0] = np.pi

    @property
    def length(self) -> float:
        return float(self.lengths[-1])

    def calm(self, places: Array, reach: float, width: float) -> Array:
        """Return places (n,) within a reach of others, around which the curve turns least."""
        near = places[:, None] + np.linspace(-reach, reach, CHOICES)
        apart = np.abs(near[..., None] - self.lengths[:-1])
        apart = np.minimum(apart, self.length - apart)
        turns = np.where(apart < CLEAR * width, self.turns, 0.0).sum(axis=-1)
        turns += 1e-3 * np.abs(np.linspace(-1, 1, CHOICES))  # of those alike the nearest
        return near[np.arange(len(places)), turns.argmin(axis=1)]

    def part(self, start: float, end: float) -> Curve:
        """Return the curve from one length along it to another; on a closed one, past its start."""
        if end > self.length:
            return Curve.joined([self.part(start, self.length), self.part(0.0, end - self.length)])
        (first, begin), (last, stop) = self._place(start), self._place(end)
        pieces = self.curve.pieces[first : last + 1].copy()
        pieces[-1] = _divided(pieces[-1], stop)[0]
        pieces[0] = _divided(pieces[0], begin / stop if first == last else begin)[1]
        return Curve(pieces, self.curve.straight[first : last + 1])

    def _place(self, along: float) -> tuple[int, float]:
        """Return the number of a piece and the parameter on it."""
        step = int(np.searchsorted(self.lengths[1:-1], along, "right"))
        low, high = self.lengths[step : step + 2]
        share = (along - low) / max(high - low, 1e-300)
        return step // STEPS, float(step % STEPS + share) / STEPS


def _divided(piece: Array, share: float) -> tuple[Array, Array]:
    """Return both parts of a cubic (4, 2), by de Casteljau's method."""
    first, second = [piece[0]], [piece[-1]]
    while len(piece) > 1:
        piece = piece[:-1] + share * np.diff(piece, axis=0)
        first.append(piece[0])
        second.append(piece[-1])
    return np.array(first), np.array(second[::-1])


def with_tabs(curve: Curve, count: int, width: float) -> tuple[Curve, ...]:
    """Return what is cut of a piece's closed outline: all but so many gaps, away from its corners.

    Raises `SettingError` if the gaps would be half of the outline or more.
    """
    ruler = Ruler(curve)
    share = _require_room(ruler.length, count, width)
    places = ruler.calm((np.arange(count) + 0.5) * share, share / 4, width)
    ends = [*places, places[0] + ruler.length]
    return tuple(ruler.part(start + width / 2, end - width / 2) for start, end in pairwise(ends))


def edges_with_tabs(outline: Outline, count: int, width: float) -> list[tuple[Curve, ...]]:
    """Return what is cut of each edge of an outline whose edges are shared, with `count` gaps or more.

    Edges that are images of each other have their gaps at the same places, so both tiles agree.
    """
    edges, curves = outline.edges, outline.curves
    assert edges is not None  # or there are no shared edges
    kinds = [(kind, Ruler(curves[kind.edge])) for kind in edge_classes(edges)]
    gaps = [0] * len(kinds)
    while sum(n * len(kind.edges) for n, (kind, _) in zip(gaps, kinds, strict=True)) < count:
        spare = [ruler.length / (n + 1) for n, (_, ruler) in zip(gaps, kinds, strict=True)]
        gaps[int(np.argmax(spare))] += 1
    parts: list[tuple[Curve, ...]] = [(curve,) for curve in curves]
    for n, (kind, ruler) in zip(gaps, kinds, strict=True):
        if not n:
            continue
        share = _require_room(ruler.length, n, width)
        places = (np.arange(n) + 0.5) * share
        if not kind.folds:  # else the gaps must lie as the edge is folded
            places = ruler.calm(places, share / 4, width)
        reversed_edges = {image.edge: image.reversed for image in kind.images}
        for edge in kind.edges:
            measured = Ruler(curves[edge])
            at = np.sort(measured.length - places if reversed_edges.get(edge) else places)
            ends = [0.0, *np.ravel([at - width / 2, at + width / 2], order="F"), measured.length]
            pairs = zip(ends[::2], ends[1::2], strict=True)
            parts[edge] = tuple(measured.part(start, end) for start, end in pairs)
    return parts


def _require_room(length: float, count: int, width: float) -> float:
    """Return the length that each gap has for itself."""
    if 2 * count * width > length:
        raise SettingError(
            f"{{tabs}}: {count} of {width:g} mm do not fit on an outline of {length:.1f} mm; choose "
            "fewer, narrower ones with {tab_width}, or a larger {tile_size}"
        )
    return length / count
