"""A tile's outline in smooth curves: an edge of each class is fitted, its partners are images of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.page.scene import Booleans, Curve, bezier
from orbiflow.tiles.tilings import EdgeImage, Edges, Tiles, as_tiling, edge_classes, edges

# The angle in radians by which a polyline turns at a vertex that stays a corner; and where it turns on
# beside it by at least a share of that, as a coarse arc does
CORNER, SHARP_CORNER, ON_AN_ARC = np.radians(30.0), np.radians(70.0), 0.5

_SAMPLES, _ROUNDS = 48, 4


def fitted(points: Array, tolerance: float) -> Curve:
    """Fit a curve of smooth pieces within `tolerance` to a polyline (n, 2), from end to end.

    The polyline's corners are ends of its pieces. Where no smooth piece is that close, sides are
    taken.

    >>> turns = np.linspace(0, np.pi, 40)
    >>> arc = fitted(np.stack([np.cos(turns), np.sin(turns)], axis=1), 3e-2)
    >>> len(arc.pieces)
    1
    """
    return _fitted(points.shape, np.asarray(points, dtype=np.float64).tobytes(), tolerance)


@lru_cache(maxsize=512)  # a preview asks again for each setting that changes
def _fitted(shape: tuple[int, ...], content: bytes, tolerance: float) -> Curve:
    points = np.frombuffer(content).reshape(shape)
    corners = [0, *(np.flatnonzero(_is_corner(turning(points))) + 1), len(points) - 1]
    pieces: list[tuple[Array, bool]] = []
    for first, last in pairwise(corners):
        pieces += _run(points[first : last + 1], tolerance)
    return Curve(np.stack([piece for piece, _ in pieces]), np.array([flat for _, flat in pieces]))


def _is_corner(turn: Array) -> Booleans:
    """Return which turns (n,) are corners rather than parts of an arc."""
    beside, sign = np.pad(turn, 1), np.sign(turn)
    on = np.maximum(sign * beside[:-2], sign * beside[2:])
    least = np.where(on > ON_AN_ARC * np.abs(turn), SHARP_CORNER, CORNER)
    return np.abs(turn) > least


def turning(points: Array) -> Array:
    """Return the angle (n - 2,) in radians by which a polyline turns at each inner vertex."""
    steps = np.diff(points, axis=0)
    before, after = steps[:-1], steps[1:]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    return np.arctan2(cross, (before * after).sum(axis=1))


def _run(run: Array, tolerance: float) -> list[tuple[Array, bool]]:
    """Return pieces along a polyline without corners, and whether each is straight."""
    tangents = _tangents(run)
    pieces: list[tuple[Array, bool]] = []
    todo = [(0, len(run) - 1)]
    while todo:
        first, last = todo.pop()
        part = run[first : last + 1]
        piece, worst = _cubic(part, tangents[first], tangents[last], tolerance)
        if piece is not None:
            pieces.append((piece, False))
        elif last - first == 1:
            pieces.append((Curve.polyline(part).pieces[0], True))
        else:
            middle = first + worst
            todo += [(middle, last), (first, middle)]
    return pieces


def _tangents(run: Array) -> Array:
    """Return unit tangents (n, 2) at the vertices, of the parabola through each three in a row."""
    steps = np.diff(run, axis=0)
    lengths = np.maximum(np.linalg.norm(steps, axis=1), 1e-300)[:, None]
    slopes = steps / lengths
    if len(run) == 2:
        return np.repeat(slopes, 2, axis=0)
    before, after = lengths[:-1], lengths[1:]
    inner = (slopes[:-1] * after + slopes[1:] * before) / (before + after)
    first, last = 2 * slopes[:1] - inner[:1], 2 * slopes[-1:] - inner[-1:]
    tangents = np.concatenate([first, inner, last])
    return tangents / np.maximum(np.linalg.norm(tangents, axis=1), 1e-300)[:, None]


def _cubic(part: Array, start: Array, end: Array, tolerance: float) -> tuple[Array | None, int]:
    """Return the cubic along a polyline, or None and the vertex at which to divide it."""
    samples = _samples(part)
    knots = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(samples, axis=0), axis=1))])
    share = knots / max(knots[-1], 1e-300)
    piece = _least_squares(samples, share, start, end)
    for _ in range(_ROUNDS):
        share = _closer(piece, samples, share)
        piece = _least_squares(samples, share, start, end)
    error = np.linalg.norm(bezier(piece[None], share) - samples, axis=1)
    if error.max() <= tolerance:
        along = bezier(piece[None], np.linspace(0, 1, 4 * min(len(part), 24) + 9))
        if shapely.distance(shapely.points(along), shapely.LineString(part)).max() <= tolerance:
            return piece, 0
    inner = part[1:-1]
    if not len(inner):
        return None, 0
    off = shapely.distance(
        shapely.points(inner), shapely.LineString(bezier(piece[None], np.linspace(0, 1, 40)))
    )
    balance = np.minimum(np.arange(1, len(part) - 1), np.arange(len(part) - 2, 0, -1))
    # the farthest vertex, unless a sliver would be left
    return None, int(np.argmax(off * np.minimum(balance / len(part), 0.2))) + 1


def _samples(part: Array) -> Array:
    """Return the vertices, and points on long sides: a fit to vertices alone sways between them."""
    lengths = np.linalg.norm(np.diff(part, axis=0), axis=1)
    count = np.maximum(1, np.ceil(lengths / max(lengths.sum() / _SAMPLES, 1e-300))).astype(int)
    side = np.repeat(np.arange(len(count)), count)
    share = (np.arange(count.sum()) - (np.cumsum(count) - count)[side]) / count[side]
    points = part[side] + share[:, None] * (part[side + 1] - part[side])
    return np.concatenate([points, part[-1:]])


def _least_squares(samples: Array, share: Array, start: Array, end: Array) -> Array:
    """Return the cubic with tangents `start` and `end` nearest to samples at these parameters."""
    first, last = samples[0], samples[-1]
    t = share[:, None]
    u = 1 - t
    left, right = 3 * u**2 * t * start, -3 * u * t**2 * end
    rest = samples - (u**3 + 3 * u**2 * t) * first - (t**3 + 3 * u * t**2) * last
    mixed = (left * right).sum()
    matrix = np.array([[(left**2).sum(), mixed], [mixed, (right**2).sum()]])
    goal = np.array([(left * rest).sum(), (right * rest).sum()])
    chord = float(np.linalg.norm(last - first))
    determinant = matrix[0, 0] * matrix[1, 1] - mixed**2
    lengths = np.full(2, chord / 3)
    if determinant > 1e-12 * matrix[0, 0] * matrix[1, 1]:
        solved = np.linalg.solve(matrix, goal)
        if (solved > 1e-3 * chord).all() and (solved < 4 * chord).all():
            lengths = solved
    return np.stack([first, first + lengths[0] * start, last - lengths[1] * end, last])


def _closer(piece: Array, samples: Array, share: Array) -> Array:
    """Return parameters nearer to the samples, by one step of Newton's method."""
    t = share[:, None]
    u = 1 - t
    first = np.diff(piece, axis=0)
    second = np.diff(piece, n=2, axis=0)
    slope = 3 * (u**2 * first[0] + 2 * u * t * first[1] + t**2 * first[2])
    bend = 6 * (u * second[0] + t * second[1])
    off = bezier(piece[None], share) - samples
    top = (off * slope).sum(axis=1)
    bottom = (slope**2).sum(axis=1) + (off * bend).sum(axis=1)
    step = np.where(np.abs(bottom) > 1e-300, top / np.where(bottom == 0, 1, bottom), 0.0)
    moved = np.clip(share - step, 0, 1)
    moved[0], moved[-1] = 0.0, 1.0
    return moved if (np.diff(moved) >= 0).all() else share


_SHARES = (0.6, 0.15, 0.04)  # of the tolerance; finer where curves would otherwise cross


@dataclass(frozen=True, eq=False)
class Outline:
    """The outlines of a tiling's prototiles in curves."""

    edges: Edges | None  # how they fall into edges; None if not known (`note` says why)
    # one curve for each edge, end to end, prototile by prototile; or a closed curve for each prototile
    curves: tuple[Curve, ...]
    note: str = ""  # what the user should know, or ""

    @cached_property
    def closed(self) -> tuple[Curve, ...]:
        """The outline of each prototile as one closed curve."""
        if self.edges is None:
            return self.curves
        return tuple(
            Curve.joined(
                [
                    curve
                    for curve, owner in zip(self.curves, self.edges.owners, strict=True)
                    if owner == k
                ],
                closed=True,
            )
            for k in range(len(self.edges.tiling.prototiles))
        )


def outline(tile: Tiles, tolerance: float) -> Outline:
    """Fit smooth curves near a tile's polygons that tile the plane as exactly as they do.

    One edge of each class is fitted, up to its middle if it is its own image, and the others are its
    images. Where curves would touch, they are fitted more closely, at worst along the polygon.
    """
    try:
        net = edges(tile)
    except OrbiflowError as error:
        plain = (Curve.polyline(p.polygon, closed=True) for p in as_tiling(tile).prototiles)
        return Outline(None, tuple(plain), f"the outline is left as it is: {error}")
    for share in _SHARES:
        candidate = Outline(net, _curves(net, share * tolerance))
        rings = (curve.flattened(tolerance / 20) for curve in candidate.closed)
        if all(shapely.Polygon(ring).is_valid for ring in rings):
            return candidate
    return Outline(net, tuple(Curve.polyline(net.points(k)) for k in range(len(net))))


def _curves(net: Edges, tolerance: float) -> tuple[Curve, ...]:
    curves: dict[int, Curve] = {}
    for kind in edge_classes(net):
        points = net.points(kind.edge)
        if kind.straight:
            curve = Curve.polyline(points)
        elif kind.folds:
            curve = _folded(points, kind.folds[0], tolerance)
        else:
            curve = fitted(points, tolerance)
        curves[kind.edge] = curve
        for image in kind.images:
            moved = curve.moved(image.isometry.linear, image.isometry.translation)
            curves[image.edge] = moved.reversed() if image.reversed else moved
    return tuple(curves[k] for k in range(len(net)))


def _folded(points: Array, fold: EdgeImage, tolerance: float) -> Curve:
    """Fit half of an edge that is its own image, turned or mirrored, and add the half's image."""
    middle, odd = divmod(len(points) - 1, 2)
    half = points[: middle + 1]
    if odd:  # the centre lies on a side
        half = np.concatenate([half, points[middle : middle + 2].mean(axis=0)[None]])
    curve = fitted(half, tolerance)
    image = curve.moved(fold.isometry.linear, fold.isometry.translation).reversed()
    return Curve.joined([curve, image])
