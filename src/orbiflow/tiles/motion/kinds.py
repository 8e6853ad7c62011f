"""The kinds of animation: what moves, and when, before it is a file of any format."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from orbiflow.arrays import Array, Integers, Window
from orbiflow.drawing import Palette, palette
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import Place, border, triangle_sides
from orbiflow.tiles.motifs import Over
from orbiflow.tiles.motion.morph import Morph
from orbiflow.tiles.motion.own_frame import OwnFrame
from orbiflow.tiles.motion.settings import AnimationSettings
from orbiflow.tiles.motion.skins import BendingFigure, Dress
from orbiflow.tiles.page import Page, Style, edge_margin, tiling_size
from orbiflow.tiles.silhouette import Bending
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import ASPECT, Copies, Tiling, copies_meeting, default_window


class Places(NamedTuple):
    """The places of M copies of an outline, in pixels: a point p lies at linear[m] p + offset[m]."""

    linear: Array
    offset: Array


class SeenCopy(NamedTuple):
    """A copy that is seen in a frame: its points p lie at `linear` p + `offset`, in pixels."""

    ring: Array  # (N, 2)
    kind: int  # its prototile
    colour: int  # the number of its colour
    whole: bool  # whether it has grown
    linear: Array
    offset: Array


NO_LINE = Style()


@dataclass(frozen=True, eq=False)
class Motion:
    """Outlines that change, and M copies of them, in pixels, y down; the progress runs from 0 to 1."""

    page: Page
    # of each prototile (N, 2) at a progress, about a point of its own; N is the same
    outlines: Callable[[float], list[Array]]
    places: Callable[[float], Places]  # of the copies at a progress; the first are the prototiles
    kinds: Integers  # the prototile (M,) of each copy
    colours: Integers  # the numbers (M,) of the palette's fills
    births: Array  # the progress (M, 2) in which each copy grows; below 0 if it is always there
    keys: tuple[float, ...]  # progress between which the outline moves in nearly straight lines
    what: str  # the motion in words, for titles
    line: Style = NO_LINE  # of outlines
    # of each prototile: the points of what bends of it, at a progress, as outlines are
    bodies: Callable[[float], list[Array]] = lambda _: []
    dress: Dress | None = None  # what lies on the tiles

    def palette(self, settings: AnimationSettings) -> Palette:
        """Return the colours of the copies."""
        return self.page.palette(palette(settings.palette))

    def grown(self, progress: float) -> Array:
        """Return the size (M,) of each copy, 0 to 1."""
        start, end = self.births.T
        return eased(np.clip((progress - start) / (end - start), 0, 1))

    def seen(self, progress: float) -> Iterator[SeenCopy]:
        """Yield every visible copy: those that grow, and above them the whole ones."""
        outlines, (linear, offset) = self.outlines(progress), self.places(progress)
        size = self.grown(progress)
        for k in (*np.flatnonzero((size > 0) & (size < 1)), *np.flatnonzero(size == 1)):
            kind, by = int(self.kinds[k]), size[k] * linear[k]
            ring, whole = outlines[kind] @ by.T + offset[k], bool(size[k] == 1)
            yield SeenCopy(ring, kind, int(self.colours[k]), whole, by, offset[k])


OUTLINE = 0.0016  # width of outlines, as a share of the page's, where none is given
ALWAYS = (-1.0, -0.5)  # the birth of copies that are there from the start


# Share of the progress of a bending in which the silhouette bends; then the tiling grows
BEND = 0.45
# Values of the progress at which the copies that come into the picture are collected
LOOKS = (0.0, 0.25, 0.5, 0.75, 1.0)


def motion(tile: EscherTile, settings: AnimationSettings, *overs: Over) -> Motion:
    """Return what moves, in pixels, before it is a file.

    `overs` are what lies over the silhouette of each of the tile's figures.
    """
    settings = settings.in_pixels()
    page, chosen = _page(tile, settings), palette(settings.palette)
    dress = None
    if any(over.picture or over.drawing for over in overs) or settings.draws:
        count = max(page.count, 2)  # the tile that is alone at first has the second
        dress = Dress.of(tile, settings, overs, page.place.scale, page.palette(chosen), count)
    bodies = () if dress is None else dress.bodies
    kinds: dict[str, Callable[[], Motion]] = {
        "morph": lambda: morph(tile, page, bodies, steady=settings.format == "svg"),
        "grow": lambda: grow(tile, page, bodies),
        "bend": lambda: bend(tile, page),
    }
    width = max(1.0, OUTLINE * page.size[0]) if settings.outline is None else settings.outline
    line = Style(None, chosen.outline, width) if width else NO_LINE
    return replace(kinds[settings.kind](), line=line, dress=dress)


def _page(tile: EscherTile, settings: AnimationSettings) -> Page:
    """Return the page, by default with the tile's default window or one that is as large."""
    (width, height), window = settings.page, default_window(tile.tiling)
    scale = math.sqrt(width * height * ASPECT) / (window[2] - window[0])
    if settings.tile_size is not None:
        scale = settings.tile_size / tiling_size(tile.tiling)
    whole = None if settings.clip else edge_margin(scale * tiling_size(tile.tiling))
    return Page.placed(tile.tiling, settings, scale, y_down=tile.y_down, whole=whole)


def _window(page: Page, linear: Array) -> Window:
    """Return the part of a plane that is seen if `linear` maps it to the page about its middle."""
    corners = np.array(page.size) / 2 * np.array([[1, 1], [-1, -1], [1, -1], [-1, 1]])
    mapped = corners @ np.linalg.inv(linear).T
    return (*mapped.min(axis=0).tolist(), *mapped.max(axis=0).tolist())


def morph(
    whole: EscherTile, page: Page, bodies: Sequence[BendingFigure] = (), *, steady: bool = False
) -> Motion:
    """Return the tiling by the class's template, with straight edges, becoming the tile's.

    It is a tiling throughout; if `steady`, the tile's lattice is there from the start.
    """
    tile, middle = whole.tile, np.array(page.size) / 2
    parts = [part.prototile.polygon for part in whole.division]
    inner = [
        part.place(body.points) for part, body in zip(whole.figures, bodies, strict=bool(bodies))
    ]
    way = Morph(OwnFrame.of(tile), [*parts, *inner])
    every = lru_cache(maxsize=2)(way.rings)  # of a frame, for its outlines and its bodies

    def rings(progress: float) -> list[Array]:
        return every(progress)[: len(parts)] if parts else [way.at(progress).points]

    end = way.end
    group, tiling = end.kind.group(), Tiling(end.kind.group(), rings(1.0))
    center = np.linalg.solve(end.linear, whole.tiling.center - end.offset)

    def linear(progress: float) -> Array:
        return page.place.linear @ (end.linear if steady else way.at(progress).linear)

    def places(progress: float, copies: Copies) -> Places:
        by = linear(progress)
        turned = by @ group.linear_parts @ np.linalg.inv(by)
        moved = group.linear_parts @ center
        shifts = moved[copies.cosets] + copies.translations - center
        return Places(turned[copies.cosets], shifts @ by.T + middle)

    def outlines(progress: float) -> list[Array]:
        return [(ring - center) @ linear(progress).T for ring in rings(progress)]

    def moved_bodies(progress: float) -> list[Array]:
        return [(points - center) @ linear(progress).T for points in every(progress)[len(parts) :]]

    copies = _seen(tiling, center, linear, outlines, places, page)
    still = places(1.0, copies)
    return Motion(
        page,
        outlines,
        (lambda _: still) if steady else (lambda progress: places(progress, copies)),
        copies.prototiles,
        page.colours_of(copies, tiling),
        np.tile(ALWAYS, (len(copies), 1)),
        (0.0, 1.0) if way.weights is None and steady else tuple(np.linspace(0, 1, 17).tolist()),
        f"A tiling with straight edges becomes the tiling of {tile.isohedral_class}",
        bodies=moved_bodies,
    )


def grow(tile: EscherTile, page: Page, bodies: Sequence[BendingFigure] = ()) -> Motion:
    """Return one tile, with all of its figures, and the tiling growing around it, nearest first."""
    outlines = [shape.polygon - shape.center for shape in page.tiling.prototiles]
    still = [
        page.place.after(part.place)(body.points) - shape.center
        for shape, part, body in zip(page.tiling.prototiles, tile.figures, bodies, strict=False)
    ]
    places, kinds, colours = _still_places(page)
    return Motion(
        page,
        lambda _: outlines,
        lambda _: places,
        kinds,
        colours,
        _births(places, 0.0, len(outlines)),
        (0.0, 1.0),
        f"The tiling of {tile.isohedral_class or 'a tile'} grows around one tile",
        bodies=lambda _: still,
    )


def bend(tile: EscherTile, page: Page) -> Motion:
    """Return each silhouette bending into its figure, and then the tiling growing around them."""
    ways, borders = list[Callable[[float], Array]](), list[Integers]()
    for part, prototile in zip(tile.figures, page.tiling.prototiles, strict=True):
        bending, frame = part.figure.bending, part.figure.frame
        if bending is None or frame is None:
            raise OrbiflowError(
                "this tile has no bent silhouette: only tiles of a search for likeness have one, in "
                "the model.safetensors of their folder; choose kind morph or grow"
            )
        place = page.place.after(part.place).after(Place(frame.linear, frame.offset))
        ways.append(partial(_bent, BendingWay(bending), place, prototile.center))
        borders.append(border(bending.triangles))
    places, kinds, colours = _still_places(page)
    silhouettes = "silhouettes bend" if len(tile.figures) > 1 else "silhouette bends"

    @lru_cache(maxsize=2)  # of a frame, for its outlines and its bodies
    def bodies(progress: float) -> list[Array]:
        return [way(min(1.0, progress / BEND)) for way in ways]

    return Motion(
        page,
        lambda progress: [body[ring] for body, ring in zip(bodies(progress), borders, strict=True)],
        lambda _: places,
        kinds,
        colours,
        _births(places, BEND, len(ways)),
        (*np.linspace(0, BEND, 13).tolist(), 1.0),
        f"The {silhouettes} into a tile of {tile.isohedral_class}, and its tiling grows",
        bodies=bodies,
    )


def _bent(way: BendingWay, place: Place, center: Array, share: float) -> Array:
    return place(way.at(share)) - center


def _still_places(page: Page) -> tuple[Places, Integers, Integers]:
    """Return the places of all copies in the picture, their prototiles and their colours.

    The prototiles come first, then the nearest.
    """
    count = len(page.tiling.prototiles)
    uses, kinds = [page.uses(k) for k in range(count)], np.arange(count)
    mine = [np.flatnonzero(page.copies.prototiles == k) for k in range(count)]
    linear = np.concatenate([used.linear[used.which] for used in uses])
    offsets = np.concatenate([used.offsets for used in uses])
    numbers = np.repeat(kinds, [len(used) for used in uses])
    colours = page.colours[np.concatenate(mine)]
    far = np.linalg.norm(offsets - np.array(page.size) / 2, axis=1)
    itself = [np.linalg.norm(offsets - tile.center, axis=1) for tile in page.tiling.prototiles]
    first = [int(np.argmin(np.where(numbers == k, away, np.inf))) for k, away in enumerate(itself)]
    far[first] = -1.0
    order = np.argsort(far, kind="stable")
    places, numbers, colours = Places(linear[order], offsets[order]), numbers[order], colours[order]
    if count == 1:  # the tile that is alone at first has the palette's second colour
        alone = colours[0]
        colours = np.where(colours == alone, 1, np.where(colours == 1, alone, colours))
    return places, numbers, colours


def _births(places: Places, begin: float, alone: int) -> Array:
    """Return each copy's birth (M, 2), by its distance from the first ones, which are always there."""
    far = np.linalg.norm(places.offset - places.offset[:alone].mean(axis=0), axis=1)
    start = begin + (1 - begin) * 0.7 * far / max(far.max(), 1e-300)
    births = np.stack([start, start + 0.3 * (1 - begin)], axis=1)
    births[:alone] = ALWAYS
    return births


def _seen(
    tiling: Tiling,
    center: Array,
    linear: Callable[[float], Array],
    outlines: Callable[[float], list[Array]],
    places: Callable[[float, Copies], Places],
    page: Page,
) -> Copies:
    """Return the copies that come into the picture at any time, those nearest to its middle first."""
    boxes = np.array([_window(page, linear(look)) for look in LOOKS])
    reach = tiling.radius
    low, high = center + boxes[:, :2].min(axis=0) - reach, center + boxes[:, 2:].max(axis=0) + reach
    copies = copies_meeting(tiling, (*low.tolist(), *high.tolist()))
    seen = np.zeros(len(copies), dtype=bool)
    for look in LOOKS:
        by, offset = places(look, copies)
        points = np.concatenate(outlines(look))
        rings = np.einsum("mij,nj->mni", by, points) + offset[:, None]
        # copies that come in between two looks are near at one of them
        room = 0.1 * np.ptp(points, axis=0).max()
        low, high = rings.min(axis=1) - room, rings.max(axis=1) + room
        seen |= ((low <= page.size) & (high >= 0)).all(axis=1)
    copies = copies.select(seen)
    far = np.linalg.norm(places(1.0, copies).offset - np.array(page.size) / 2, axis=1)
    return copies.select(np.argsort(far, kind="stable"))


class BendingWay:
    """The silhouettes on the way from the one at rest to the tile."""

    def __init__(self, bending: Bending) -> None:
        self.rest, self.images = bending.rest, bending.images
        triangles = bending.triangles
        sides, moved = (triangle_sides(points, triangles) for points in (self.rest, self.images))
        inverse = np.linalg.inv(sides)
        linear = moved @ inverse
        # polar decomposition of 2 x 2 matrices that turn nothing over
        (a, b), (c, d) = linear.transpose(1, 2, 0)
        angle = np.arctan2(c - b, a + d)
        # within half a turn of their mean: beyond it a limb has turned the other way
        mean = float(np.angle(np.exp(1j * angle).sum()))
        self._angle = mean + np.angle(np.exp(1j * (angle - mean)))
        self._stretch = _rotations(-self._angle) @ linear
        # rows of a triangle's gradient: J = P @ gradient, P the three corners as columns
        gradient = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        area = np.abs(np.linalg.det(sides))[:, None, None]
        self._gradient, self._triangles = area * gradient, triangles
        blocks = area * gradient @ np.swapaxes(gradient, 1, 2)
        rows = np.repeat(triangles[:, :, None], 3, axis=2)
        columns = np.swapaxes(rows, 1, 2)
        count = len(self.rest)
        matrix = coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
        # the solution is free up to a shift: hold one point, and shift all afterwards
        anchor = coo_array(([area.mean()], ([0], [0])), shape=(count, count))
        self._solver = splu(csc_array(matrix + anchor))

    def at(self, share: float) -> Array:
        """Return the points (n, 2) at 0 (as they are) to 1 (the tile), in the target's normal form."""
        turned = _rotations(share * self._angle)
        linear = turned @ ((1 - share) * np.eye(2) + share * self._stretch)
        pull = self._gradient @ np.swapaxes(linear, 1, 2)
        right = np.zeros_like(self.rest)
        np.add.at(right, self._triangles, pull)
        points = self._solver.solve(right)
        middle = (1 - share) * self.rest.mean(axis=0) + share * self.images.mean(axis=0)
        return points - points.mean(axis=0) + middle


def _rotations(angles: Array) -> Array:
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


Share = TypeVar("Share", float, Array)

# Shares of the loop: the rest at the start, each way, and the rest at the end, at the tile
REST, MOVE, SHOW = 0.07, 0.37, 0.19


def eased(share: Share) -> Share:
    """Return a share of a way, 0 to 1, slow at both ends.

    >>> [round(eased(share), 3) for share in (0.0, 0.25, 0.5, 1.0)]
    [0.0, 0.156, 0.5, 1.0]
    """
    return share * share * (3 - 2 * share)


def frames(seconds: float, fps: float) -> list[tuple[float, float]]:
    """Return the progress of each picture of a loop, and the seconds for which it is seen.

    The loop goes there and back by the same pictures; equal ones in a row are one.
    """
    way = max(2, round(MOVE * seconds * fps))
    step = MOVE * seconds / way
    there = [(eased(k / way), step) for k in range(1, way)]
    return [(0.0, REST * seconds + step), *there, (1.0, SHOW * seconds + step), *reversed(there)]
