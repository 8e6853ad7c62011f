"""The three kinds of animations of a tile: a morph, growing, and bending that ends in growing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.escher.bending_way import BendingWay
from orbiflow.escher.morph import Morph
from orbiflow.escher.own_frame import OwnFrame
from orbiflow.escher.storage import SavedModel
from orbiflow.export.motion import ALWAYS, Motion, Places
from orbiflow.figures.window import ASPECT, default_window
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import Copies, Tile, colouring, copies_meeting
from orbiflow.tilings.window import Window

Kind = Literal["morph", "bend", "grow"]
KINDS: tuple[Kind, ...] = ("morph", "bend", "grow")

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


def bend(tile: Tile, saved: SavedModel | None, width: int, *, y_down: bool = False) -> Motion:
    """The silhouette, bending into the tile, and then the tiling growing around it.

    Args:
        tile: in the input's coordinates.
        saved: its map, of a search for likeness.
        width, y_down: as for `morph`.

    Raises:
        OrbiflowError: if the map is not there: the silhouette did not bend to this tile.
    """
    if saved is None or saved.bending is None or saved.frame is None:
        raise OrbiflowError(
            "this tile has no bent silhouette: only tiles of a search for likeness have one, in the "
            "model.safetensors of their folder; choose kind morph or grow"
        )
    page, way, frame = Page(tile, width, y_down), BendingWay(saved.bending), saved.frame
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
