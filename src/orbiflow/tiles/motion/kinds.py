"""What moves in an animation, before it is a file of any format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array, Window
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.motion.morph import Morph
from orbiflow.tiles.pictures import (
    ASPECT,
    BendingWay,
    default_window,
)
from orbiflow.tiles.search import OwnFrame
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import (
    Copies,
    Tile,
    colouring,
    copies_meeting,
)


class Places(NamedTuple):
    """Where M copies of an outline are: linear[m] p + offset[m]; (M, 2, 2) and (M, 2), in pixels."""

    linear: Array
    offset: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """An outline that changes, and M copies of it.

    All in pixels, y down, by the progress of the animation, 0 to 1.

    - `width`, `height`: of the picture.
    - `outline`: (N, 2) about a point of its own, always with as many vertices.
    - `places`: of its copies; the first is the tile itself.
    - `colours`: (M,) numbers of the palette's fills.
    - `births`: (M, 2) from which progress to which each copy grows; before 0 for those always there.
    - `steady`: whether the places stay what they are.
    - `keys`: values of the progress between which the outline moves along straight lines, near enough.
    - `what`: in words, for titles.
    """

    width: int
    height: int
    outline: Callable[[float], Array]
    places: Callable[[float], Places]
    colours: NDArray[np.int64]
    births: Array
    steady: bool
    keys: tuple[float, ...]
    what: str

    def grown(self, progress: float) -> Array:
        """(M,) size of each copy, 0 to 1."""
        start, end = self.births.T
        share = np.clip((progress - start) / (end - start), 0, 1)
        return share * share * (3 - 2 * share)

    def rings(self, progress: float) -> Iterator[tuple[Array, int, bool]]:
        """Every copy (N, 2) that is to be seen, the number of its colour, and whether it is whole."""
        outline, (linear, offset) = self.outline(progress), self.places(progress)
        size = self.grown(progress)
        for k in np.flatnonzero(size > 0):
            yield size[k] * outline @ linear[k].T + offset[k], int(self.colours[k]), size[k] == 1


ALWAYS = (-1.0, -0.5)
"""Birth of what is there from the start."""


BEND = 0.45
"""Share of the progress of a bending in which the silhouette bends; then the tiling grows."""

LOOKS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where on its way a tiling is looked at for the copies that come into the picture."""


class Page:
    """From a tile's coordinates to a picture `width` pixels wide: the tile's default window.

    - `center`: of the tile, in its coordinates; `middle`: the same in pixels.
    """

    def __init__(self, tile: Tile, width: int, y_down: bool) -> None:
        window = default_window(tile)
        self.width, self.height = width, 2 * round(width / ASPECT / 2)
        scale = width / (window[2] - window[0])
        self.linear = scale * np.diag([1.0, 1.0 if y_down else -1.0])
        self.center = tile.center
        self.middle = np.array([self.width, self.height]) / 2

    def window(self, linear: Array) -> Window:
        """What of a plane is seen if `linear` takes it to pixels about the picture's middle."""
        corners = np.array(
            [self.middle, -self.middle, self.middle * (1, -1), self.middle * (-1, 1)]
        )
        own = corners @ np.linalg.inv(linear).T
        return (*own.min(axis=0).tolist(), *own.max(axis=0).tolist())

    def sees(self, low: Array, high: Array) -> Array:
        """(M,) whether boxes with these corners (M, 2), in pixels, come into the picture."""
        inside = (low <= 2 * self.middle) & (high >= 0)
        return inside[:, 0] & inside[:, 1]


def morph(tile: Tile, width: int, *, y_down: bool = False, steady: bool = False) -> Motion:
    """A tiling by the class's template, with straight edges, becoming the tile's; a tiling throughout.

    Args:
        tile: whose class and corners are known.
        width: of the picture, in pixels.
        y_down: whether its y axis points down.
        steady: keep the tile's lattice from the start: then the template is stretched as the tile's
            lattice is, and only edges move.

    Raises:
        OrbiflowError: for a tile of no known class.
    """
    way, page = Morph(OwnFrame.of(tile)), Page(tile, width, y_down)
    end = way.end
    group, own = end.kind.group(), Tile(end.points, end.kind.group(), end.kind.name)
    center = np.linalg.solve(end.linear, page.center - end.offset)

    def linear(progress: float) -> Array:
        return page.linear @ (end.linear if steady else way.at(progress).linear)

    def places(progress: float, copies: Copies) -> Places:
        by = linear(progress)
        turned = by @ group.linear_parts @ np.linalg.inv(by)
        moved = group.linear_parts @ center
        shifts = moved[copies.cosets] + copies.translations - center
        return Places(turned[copies.cosets], shifts @ by.T + page.middle)

    def outline(progress: float) -> Array:
        return (way.at(progress).points - center) @ linear(progress).T

    copies = _seen(own, center, linear, outline, places, page)
    still = places(1.0, copies)
    return Motion(
        page.width,
        page.height,
        outline,
        (lambda _: still) if steady else (lambda progress: places(progress, copies)),
        colouring(own).colours(copies),
        np.tile(ALWAYS, (len(copies), 1)),
        steady,
        (0.0, 1.0) if way.is_straight and steady else tuple(np.linspace(0, 1, 17).tolist()),
        f"A tiling with straight edges becomes the tiling of {tile.isohedral_class}",
    )


def grow(tile: Tile, width: int, *, y_down: bool = False) -> Motion:
    """One tile, and the tiling growing around it, nearest first."""
    page = Page(tile, width, y_down)
    outline = (tile.polygon - page.center) @ page.linear.T
    places, colours = _still_places(tile, page)
    return Motion(
        page.width,
        page.height,
        lambda _: outline,
        lambda _: places,
        colours,
        _births(places, 0.0),
        True,
        (0.0, 1.0),
        f"The tiling of {tile.isohedral_class or 'a tile'} grows around one tile".replace(
            "  ", " "
        ),
    )


def bend(given: EscherTile, width: int) -> Motion:
    """The silhouette, bending into the tile, and then the tiling growing around it.

    Args:
        given: a tile of a search for likeness, with its map.
        width: of the picture, in pixels.

    Raises:
        OrbiflowError: if there is no map: the silhouette did not bend to this tile.
    """
    tile, bending, frame = given.tile, given.bending, given.frame
    if bending is None or frame is None:
        raise OrbiflowError(
            "this tile has no bent silhouette: only tiles of a search for likeness have one, in the "
            "model.safetensors of their folder; choose kind morph or grow"
        )
    page, way = Page(tile, width, given.y_down), BendingWay(bending)
    places, colours = _still_places(tile, page)

    def outline(progress: float) -> Array:
        ring = frame.to_input(way.at(min(1.0, progress / BEND)))
        return (ring - page.center) @ page.linear.T

    return Motion(
        page.width,
        page.height,
        outline,
        lambda _: places,
        colours,
        _births(places, BEND),
        True,
        (*np.linspace(0, BEND, 13).tolist(), 1.0),
        f"The silhouette bends into a tile of {tile.isohedral_class}, and its tiling grows",
    )


def _still_places(tile: Tile, page: Page) -> tuple[Places, Array]:
    """Of all copies in the picture, the tile itself first and the nearest next; and their colours."""
    low, high = page.window(page.linear)[:2], page.window(page.linear)[2:]
    window = (*(page.center + low).tolist(), *(page.center + high).tolist())
    copies = copies_meeting(tile, window)
    linear = page.linear @ tile.group.linear_parts @ np.linalg.inv(page.linear)
    moved = (tile.group.linear_parts @ page.center)[copies.cosets] + copies.translations
    offset = (moved - page.center) @ page.linear.T + page.middle
    order = np.argsort(np.linalg.norm(offset - page.middle, axis=1), kind="stable")
    places = Places(linear[copies.cosets[order]], offset[order])
    return places, _first_dark(colouring(tile).colours(copies)[order])


def _first_dark(colours: Array) -> Array:
    """With two colours exchanged, so that the tile that is alone at first has the palette's second."""
    own = colours[0]
    return np.where(colours == own, 1, np.where(colours == 1, own, colours))


def _births(places: Places, begin: float) -> Array:
    """(M, 2) of each copy, by how far it is from the first, which is always there."""
    far = np.linalg.norm(places.offset - places.offset[0], axis=1)
    start = begin + (1 - begin) * 0.7 * far / max(far.max(), 1e-300)
    births = np.stack([start, start + 0.3 * (1 - begin)], axis=1)
    births[0] = ALWAYS
    return births


def _seen(
    own: Tile,
    center: Array,
    linear: Callable[[float], Array],
    outline: Callable[[float], Array],
    places: Callable[[float, Copies], Places],
    page: Page,
) -> Copies:
    """The copies that come into the picture at any time, those nearest to its middle first."""
    boxes = np.array([page.window(linear(look)) for look in LOOKS])
    reach = own.radius
    low, high = center + boxes[:, :2].min(axis=0) - reach, center + boxes[:, 2:].max(axis=0) + reach
    copies = copies_meeting(own, (*low.tolist(), *high.tolist()))
    seen = np.zeros(len(copies), dtype=bool)
    for look in LOOKS:
        by, offset = places(look, copies)
        rings = np.einsum("mij,nj->mni", by, outline(look)) + offset[:, None]
        # what comes in between two looks comes near at one of them
        room = 0.1 * np.ptp(outline(look), axis=0).max()
        seen |= page.sees(rings.min(axis=1) - room, rings.max(axis=1) + room)
    copies = copies.select(seen)
    far = np.linalg.norm(places(1.0, copies).offset - page.middle, axis=1)
    return copies.select(np.argsort(far, kind="stable"))


REST, MOVE, SHOW = 0.07, 0.37, 0.19
"""Shares of the loop: the rest at the start, each way, and the rest at the end, where the tile is."""


class Frame(NamedTuple):
    """A picture of a loop: its `progress`, 0 to 1, and for how many `seconds` it is seen."""

    progress: float
    seconds: float


def eased(share: float) -> float:
    """0 to 1, slow at both ends.

    >>> [round(eased(share), 3) for share in (0.0, 0.25, 0.5, 1.0)]
    [0.0, 0.156, 0.5, 1.0]
    """
    return share * share * (3 - 2 * share)


def progress(time: float) -> float:
    """How far the loop is at a time, 0 to 1, of it.

    >>> [round(progress(time), 3) for time in (0.0, 0.255, 0.5, 0.815)]
    [0.0, 0.5, 1.0, 0.5]
    """
    if time < REST:
        return 0.0
    if time < REST + MOVE:
        return eased((time - REST) / MOVE)
    if time < REST + MOVE + SHOW:
        return 1.0
    return eased(max(0.0, 1 - (time - REST - MOVE - SHOW) / MOVE))


def frames(seconds: float, fps: float) -> list[Frame]:
    """The pictures of a loop; those that follow each other and are the same are one.

    The way back has the pictures of the way there.
    """
    way = max(2, round(MOVE * seconds * fps))
    there = [Frame(eased(k / way), MOVE * seconds / way) for k in range(1, way)]
    return [
        Frame(0.0, REST * seconds + MOVE * seconds / way),
        *there,
        Frame(1.0, SHOW * seconds + MOVE * seconds / way),
        *reversed(there),
    ]
