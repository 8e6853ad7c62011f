"""A page with a tile's copies in another world: outlines in curves, drawings, pictures of pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import Palette
from orbiflow.runtime import NEVER, Cancel
from orbiflow.tiles.geometry import orient
from orbiflow.tiles.page import (
    INK,
    Box,
    Curve,
    Layer,
    Motif,
    PathPart,
    Raster,
    Scene,
    Style,
    Warped,
    bezier,
    boundary,
    cut_off,
    ground_of,
    outline,
    rectangle,
)
from orbiflow.tiles.silhouette import triangulate
from orbiflow.tiles.tilings import Tiling
from orbiflow.tiles.worlds.outlines import with_points
from orbiflow.tiles.worlds.unfolding import Unfolding
from orbiflow.tiles.worlds.views import WorldView

Booleans = NDArray[np.bool_]

TOLERANCE = 0.02  # mm of curves from the outlines
SHARE_OF_TILE = 1 / 4000  # the least tolerance of an outline, in sizes of the tile
LEVELS = 6  # of detail, each four times as coarse as the one before
PIECES = 14  # of a curve's length, at least, in a copy of which all is seen
CONE_NEAR = 1e-5  # of a tile's size: cones so near to its polygon are of it
SAMPLES = 33  # of a curve, to find where it is nearest to a cone
LEAST_COPY = 0.8  # mm of the smallest copies
LEAST_DRAWN = 3.0  # mm of copies that carry their drawing
DETAIL_SIZES = 10.0, 40.0  # mm of copies from which they are drawn in more detail
DETAIL_STEPS = 14.0, 30.0, 60.0  # steps along a tile, in less and in more detail
LEAST_SHOWN = 0.25  # mm of what is drawn
SEAM = 0.08  # mm of hairlines between filled copies
LINE = 1 / 150  # of a copy's size: the width of its outline
WIDEST_LINE = 0.4  # mm


def motions_of(linear: Array, shift: Array) -> Array:
    """Return maps p -> linear p + shift, (M, 2, 2) and (M, 2), as motions (M, 3, 3) of (x, y, 1)."""
    motions = np.tile(np.eye(3), (len(linear), 1, 1))
    motions[:, :2, :2], motions[:, :2, 2] = linear, shift
    return motions


@dataclass(frozen=True, eq=False)
class World:
    """Copies of a tile in a world, as a page shows them.

    - `tiling`: The plane's tiling.
    - `vectors`: What takes points (N, 2) of its first tile to vectors (N, 3).
    - `motions`: Those (M, 3, 3) to all copies.
    - `colours`: The number of the colour (M,) of each.
    - `view`: How they are seen.
    - `unfolding`: Of a sphere or the hyperbolic plane, what its copies are found by.
    - `flip`: What takes its tile's points to the tiling's (2, 2): 1, or y downwards.
    """

    tiling: Tiling
    vectors: Callable[[Array], Array]
    motions: Array
    colours: Integers
    view: WorldView
    unfolding: Unfolding | None = None
    flip: Array = field(default_factory=lambda: np.eye(2))

    @property
    def count(self) -> int:
        """The number of colours of each figure's copies."""
        return int(self.colours.max(initial=0)) + 1

    def colour(self, copy: int, kind: int) -> int:
        """Return the number in the palette of a figure's colour in a copy."""
        return kind * self.count + int(self.colours[copy])

    @cached_property
    def cones(self) -> Array:
        """Points (K, 2) of the first tile's outline about which angles are others than in the plane."""
        return np.zeros((0, 2)) if self.unfolding is None else self.unfolding.cones @ self.flip

    @cached_property
    def fade(self) -> Array:
        """How much (M,) of what lies on it a copy shows, 0 to 1."""
        return np.ones(len(self.motions))

    @cached_property
    def size(self) -> float:
        """The tile's size in the plane, the square root of its area."""
        return float(np.sqrt(self.tiling.tile_area))

    def places(self, vectors: Array, copies: Integers) -> Array:
        """Return where vectors (N, 3) of the first tile are in copies (M,): places (M, N, 2) in mm."""
        moved = np.einsum("mij,nj->mni", self.motions[copies], vectors)
        return self.view.places(moved)

    @cached_property
    def _rings(self) -> list[Array]:
        """The polygon's vectors of each prototile, few of them."""
        return [
            self.vectors(prototile.polygon[:: max(1, len(prototile.polygon) // 60)])
            for prototile in self.tiling.prototiles
        ]

    @cached_property
    def sizes(self) -> Array:
        """The longer side in mm (M,) of the box around each copy."""
        every = np.concatenate(self._rings)
        places = self.places(every, np.arange(len(self.motions)))
        return np.ptp(places, axis=1).max(axis=1)

    @cached_property
    def faces(self) -> Booleans:
        """Which copies (M,) are seen: not those that are all on the far side of a sphere."""
        every = np.concatenate(self._rings)
        behind = self.view.behind(np.einsum("mij,nj->mni", self.motions, every))
        return np.logical_not(behind.all(axis=1))

    def outlines(self, kind: int) -> Iterator[tuple[int, Curve]]:
        """Yield each copy that is seen and the outline of a prototile in it, within `TOLERANCE`."""
        levels = np.clip(
            np.floor(
                np.log(TOLERANCE / (SHARE_OF_TILE * np.maximum(self.sizes, 1e-12))) / np.log(4)
            ),
            0,
            LEVELS - 1,
        ).astype(int)
        for level in np.unique(levels):
            fine = SHARE_OF_TILE * self.size * 4.0 ** float(level)
            curve = outline(self.tiling, fine).closed[kind]
            mine = np.flatnonzero((levels == level) & self.faces)
            longest = self.size / PIECES if level < 2 else self.size
            pieces = _divided(curve, longest, self.cones, 3 * fine)
            vectors = self.vectors(_between(pieces, 0.0, 1.0).reshape(-1, 2))
            for k, places in zip(mine.tolist(), self.places(vectors, mine), strict=True):
                yield k, _through(places.reshape(-1, 4, 2))

    def drawn(self, motif: Motif, kind: int) -> Iterator[tuple[int, PathPart]]:
        """Yield the parts of a motif, which lies on a prototile, in each copy that is large enough."""
        within = cut_off(motif, shapely.Polygon(self.tiling.prototiles[kind].polygon)).parts
        seen = np.flatnonzero((self.sizes > LEAST_DRAWN) & self.faces & (self.fade > 0))
        levels = np.digitize(self.sizes[seen], DETAIL_SIZES)
        for level in np.unique(levels).tolist():
            copies = seen[levels == level]
            scale = float(self.sizes[copies].max()) / self.size
            step, least = self.size / DETAIL_STEPS[level], LEAST_SHOWN / scale
            for part in within:
                lines = [stepped(curve, step) for curve in part.curves if _reach(curve) > least]
                if not lines:
                    continue
                closed = [curve.closed for curve in part.curves if _reach(curve) > least]
                ends = np.cumsum([len(line) for line in lines])[:-1]
                every = self.places(self.vectors(np.concatenate(lines)), copies)
                for k, places in zip(copies.tolist(), every, strict=True):
                    pieces = zip(np.split(places, ends), closed, strict=True)
                    curves = tuple(Curve.polyline(points, closed=shut) for points, shut in pieces)
                    width = part.style.width * float(self.sizes[k]) / self.size
                    style = part.style._replace(width=width)
                    seen_as = part.opacity * float(self.fade[k])
                    yield k, part._replace(curves=curves, style=style, opacity=seen_as)


def _reach(curve: Curve) -> float:
    low, high = curve.bounds()
    return float(np.max(high - low))


def stepped(curve: Curve, step: float) -> Array:
    """Return points along a curve that are no farther apart than a step, few where it is straight."""
    points = curve.flattened(step / 20)
    line = shapely.LinearRing(points) if curve.closed else shapely.LineString(points)
    simple = shapely.segmentize(shapely.simplify(line, step / 20), step)
    divided = shapely.get_coordinates(simple)
    return divided[:-1] if curve.closed else divided


def _between(pieces: Array, start: float, end: float) -> Array:
    """Return four points (n, 4, 2) of each piece (n, 4, 2), evenly from a share of it to another."""
    every = np.repeat(pieces, 4, axis=0)
    return bezier(every, np.tile(np.linspace(start, end, 4), len(pieces))).reshape(-1, 4, 2)


def _divided(curve: Curve, longest: float, cones: Array, near: float) -> Array:
    """Return the pieces (n, 4, 2) of a curve, the longer ones divided, and all at cones (K, 2).

    Those are points within the length `near` of the curve, where its image has a corner.
    """
    divided, shares = list[Array](), np.linspace(0, 1, SAMPLES)
    for piece in curve.pieces:
        length = float(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum())
        cuts = set(np.linspace(0, 1, max(1, int(np.ceil(length / longest))) + 1).tolist())
        for cone in cones:
            away = np.linalg.norm(bezier(np.tile(piece, (SAMPLES, 1, 1)), shares) - cone, axis=1)
            if away.min() < near + length / SAMPLES:
                share = _nearest(piece, cone, float(shares[away.argmin()]))
                cuts = {cut for cut in cuts if abs(cut - share) > 1 / SAMPLES or cut in (0, 1)} | {
                    share
                }
        parts = (_between(piece[None], a, b) for a, b in pairwise(sorted(cuts)))
        divided += [_through(part).pieces[0] for part in parts]
    every = np.stack(divided)
    for cone in cones:
        for end in (0, 3):
            every[np.linalg.norm(every[:, end] - cone, axis=1) < near, end] = cone
    return every


def _nearest(piece: Array, point: Array, share: float) -> float:
    """Return the share of a piece (4, 2) that is nearest to a point, near a given one."""
    low, high = max(0.0, share - 1 / SAMPLES), min(1.0, share + 1 / SAMPLES)
    for _ in range(40):
        ways = np.linspace(low, high, 4)
        away = np.linalg.norm(bezier(np.tile(piece, (4, 1, 1)), ways) - point, axis=1)
        best = int(away.argmin())
        low, high = float(ways[max(0, best - 1)]), float(ways[min(3, best + 1)])
    return (low + high) / 2


def _through(points: Array) -> Curve:
    """Return the closed curve of cubics through points (n, 4, 2) at the shares 0, 1/3, 2/3 and 1."""
    a, b, c, d = (points[:, k] for k in range(4))
    second, third = (-5 * a + 18 * b - 9 * c + 2 * d) / 6, (2 * a - 9 * b + 18 * c - 5 * d) / 6
    return Curve(np.stack([a, second, third, d], axis=1), np.zeros(len(a), dtype=bool), closed=True)


class CopyMotifs(NamedTuple):
    """What lies on the prototiles of copies.

    - `world`: The copies.
    - `motifs`: What is drawn on each prototile.
    - `pictures`: A picture of pixels of each prototile in each of its colours; or none.
    """

    world: World
    motifs: Sequence[Motif]
    pictures: Sequence[Sequence[Raster]] = ()

    def warped(self, cancel: Cancel) -> Iterator[Warped]:
        """Yield the picture on each copy that is seen."""
        world = self.world
        levels = np.digitize(world.sizes, DETAIL_SIZES)
        for prototile, pictures in zip(world.tiling.prototiles, self.pictures, strict=True):
            for level in np.unique(levels[world.faces]).tolist():
                cancel.check()
                step = 3 * world.size / DETAIL_STEPS[level]
                rough = shapely.simplify(shapely.Polygon(prototile.polygon), step / 10)
                ring = orient(shapely.get_coordinates(rough)[:-1], counter_clockwise=True)
                mesh = triangulate(with_points(ring, world.cones, step / 5), step)
                first = pictures[0]
                texels = (mesh.points - first.offset) @ np.linalg.inv(first.linear).T
                copies = np.flatnonzero((levels == level) & world.faces)
                every = world.places(world.vectors(mesh.points), copies)
                for k, places in zip(copies.tolist(), every, strict=True):
                    pixels, fade = pictures[int(world.colours[k])].pixels, float(world.fade[k])
                    yield Warped(pixels, texels, places, mesh.triangles, fade)


def world_scene(
    world: World,
    chosen: Palette,
    skins: Sequence[CopyMotifs] = (),
    *,
    line: float | None = None,
    cancel: Cancel = NEVER,
    **more: Any,
) -> Scene:
    """Return a page of a world: fills, pictures of pixels, drawings, and outlines above all.

    Args:
        world: The copies.
        chosen: Their colours.
        dresses: What lies on them.
        line: The width of outlines in mm. Default: what suits each copy's size.
        cancel: What stops it.
        more: Further fields of the scene.
    """
    kinds = range(len(world.tiling.prototiles))
    outlines = [dict(world.outlines(kind)) for kind in kinds]
    page = rectangle(Box(0.0, 0.0, *world.view.size))
    layers = [Layer("paper", "paper", Style(chosen.paper), (page,))]
    fills = {world.colour(k, kind) for kind in kinds for k in outlines[kind]}
    ground = Style(chosen.mean(fills))
    rings = (curve.flattened(TOLERANCE) for by_copy in outlines for curve in by_copy.values())
    under = PathPart(boundary(ground_of(rings)), ground)
    layers.append(Layer("ground", "paper", ground, (under,), clipped=True))
    plain = not any(skin.pictures or any(motif.parts for motif in skin.motifs) for skin in skins)
    widths = {k: _width(world, k, line) for by_copy in outlines for k in by_copy}
    for kind, by_copy in enumerate(outlines):
        for colour in sorted(set(world.colours[list(by_copy)].tolist())):
            mine = [k for k in by_copy if world.colours[k] == colour]
            number = kind * world.count + colour
            fill, name = chosen.fill(number), f"colour {number + 1}"
            for width in sorted({widths[k] for k in mine}) if plain and line != 0 else [0.0]:
                style = Style(fill, chosen.outline, width) if width else Style(fill, fill, SEAM)
                curves = tuple(by_copy[k] for k in mine if not width or widths[k] == width)
                layers.append(Layer(name, "tiles", style, curves, clipped=True))
    for skin in skins:
        if skin.pictures:
            layers.append(Layer("pictures", "drawing", Style(), tuple(skin.warped(cancel))))
        for kind, motif in enumerate(skin.motifs):
            drawn = sorted(skin.world.drawn(motif, kind), key=lambda entry: entry[0])
            parts = tuple(_inked(part, chosen, skin.world.colour(k, kind)) for k, part in drawn)
            if parts:
                layers.append(Layer("drawing", "drawing", Style(), parts, clipped=True))
    for width in sorted(set(widths.values())) if line != 0 and not plain else []:
        style = Style(None, chosen.outline, width)
        curves = tuple(
            curve for by_copy in outlines for k, curve in by_copy.items() if widths[k] == width
        )
        layers.append(Layer("outlines", "tiles", style, curves, clipped=True))
    if world.view.border is not None:
        style = Style(None, chosen.outline, line or WIDEST_LINE)
        layers.append(Layer("edge", "tiles", style, (world.view.border,)))
    return Scene(*world.view.size, tuple(layers), **more)


def _width(world: World, copy: int, line: float | None) -> float:
    """Return the width in mm of a copy's outline, one of a few."""
    width = min(WIDEST_LINE, LINE * float(world.sizes[copy])) if line is None else line
    return max(0.01, float(f"{width:.1g}"))


def _inked(part: PathPart, chosen: Palette, colour: int) -> PathPart:
    fill, stroke = (chosen.ink(colour) if paint == INK else paint for paint in part.style[:2])
    return part._replace(style=part.style._replace(fill=fill, stroke=stroke))
